"""The flat table, read back by the standard library, pandas and pyarrow."""

from __future__ import annotations

import csv
import sys

import pandas as pd
import pytest
from batch_for_tests import MAX, broken, many, ok, suite

from vehnav.batch.baseline import baseline_of
from vehnav.batch.regression import compare_with
from vehnav.batch.tables import write_table
from vehnav.errors import ConfigError, FormatError

EVIL = 'a,"b"\n=cmd|;\u2028日本 \ud800'
ROWS = suite([ok("a.mcap", 0.1 + 0.2), ok("far.mcap", 80.0), ok("none.mcap", None), broken(EVIL)])


def test_csv_keeps_every_figure_and_name(tmp_path) -> None:
    write_table(ROWS, tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["log"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"a.mcap", "far.mcap", "none.mcap", EVIL.replace("\ud800", r"\ud800")}
    assert float(rows["a.mcap"][MAX]) == 0.1 + 0.2
    assert rows["none.mcap"][MAX] == ""
    assert [rows[n]["passed"] for n in ("a.mcap", "far.mcap", "none.mcap")] == [
        "true", "false", "false",
    ]  # fmt: skip
    assert rows["far.mcap"]["missed"] == MAX
    assert rows["a.mcap"]["report"] == "logs/a.mcap/default/report.html"
    dead = rows[EVIL.replace("\ud800", r"\ud800")]
    assert (dead["status"], dead["error"], dead["exit_status"]) == (
        "crash", "killed by SIGKILL", "",
    )  # fmt: skip


@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_pandas_reads_types(tmp_path, name: str) -> None:
    write_table(ROWS, tmp_path / name)
    read = pd.read_csv if name.endswith("csv") else pd.read_parquet
    frame = read(tmp_path / name).set_index("log")
    assert frame[MAX].dtype == float
    assert frame.loc["far.mcap", MAX] == 80.0
    assert pd.isna(frame.loc["none.mcap", MAX])
    assert frame["passed"].dtype == bool
    assert int(frame["passed"].sum()) == 1
    assert frame.loc["a.mcap", "group"] == "city"
    assert len(frame) == 4


def test_both_formats_hold_the_same(tmp_path) -> None:
    results = many(50, configs=("default", "filter"))
    comparison = compare_with(baseline_of(many(50, spread=0.1)), results, max_regression=0.05)
    for name in ("t.csv", "t.parquet"):
        write_table(results, tmp_path / name, comparison=comparison)
    one, two = pd.read_csv(tmp_path / "t.csv"), pd.read_parquet(tmp_path / "t.parquet")
    assert list(one.columns) == list(two.columns)
    numbers = list(one.select_dtypes(float).columns)
    assert {MAX, f"{MAX}.baseline", f"{MAX}.worsening"} <= set(numbers)
    filled = [name for name in numbers if two[name].notna().any()]
    pd.testing.assert_frame_equal(one[filled], two[filled], check_exact=True)
    # the baseline has one configuration only
    found = one.set_index("config")[f"{MAX}.baseline"]
    assert found["default"].notna().all()
    assert found["filter"].isna().all()


@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_the_same_bytes_twice(tmp_path, name: str) -> None:
    results = many(20)
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        write_table(results, tmp_path / folder / name)
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_parquet_without_pyarrow_says_what_to_install(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(FormatError, match=r"/t\.parquet: .*pip install 'vehnav\[parquet\]'"):
        write_table(ROWS, tmp_path / "t.parquet")
    assert list(tmp_path.iterdir()) == []


def test_another_suffix_is_refused(tmp_path) -> None:
    with pytest.raises(ConfigError, match=r"t\.xlsx.*\.csv or \.parquet"):
        write_table(ROWS, tmp_path / "t.xlsx")
