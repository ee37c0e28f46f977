"""The baseline's file: what is kept, that it is the same twice, and what is refused."""

from __future__ import annotations

import json

import pytest
from batch_for_tests import MAX, broken, many, ok, suite

from vehnav.batch.baseline import COMPARED, baseline_of, read_baseline, write_baseline
from vehnav.batch.model import write_results
from vehnav.errors import ConfigError, FormatError


def test_there_and_back(tmp_path) -> None:
    results = suite([ok("a", 12.3456789), broken("b"), ok("c", None)])
    path = tmp_path / "baseline.json"
    write_baseline(results, path)
    read = read_baseline(path)
    assert (read.path, read.suite) == (str(path), "fleet")
    assert read.kept == baseline_of(results).kept
    assert {k.log: k.status for k in read.kept} == {"a": "ok", "b": "crash", "c": "ok"}
    by_log = {k.log: k.metrics for k in read.kept}
    assert by_log["a"][MAX] == 12.3457  # six digits
    assert by_log["c"][MAX] is None


def test_the_file_is_small_and_the_same_twice(tmp_path) -> None:
    results = many(100, configs=("default", "filter"))
    write_baseline(results, tmp_path / "one.json")
    write_baseline(results, tmp_path / "two.json")
    text = (tmp_path / "one.json").read_text()
    assert text == (tmp_path / "two.json").read_text()
    assert len(text.splitlines()) == 200 + 2  # a line for each: its history reads log by log
    kept = set(json.loads(text)["results"][0]["metrics"])
    assert kept <= {*COMPARED, "gps.fixes_judged"}
    assert "trajectory.distance_m" not in kept
    assert "run" not in json.loads(text)
    assert [p.name for p in tmp_path.iterdir() if "part" in p.name] == []


def test_a_results_file_serves_as_a_baseline(tmp_path) -> None:
    results = suite([ok("a", 12.0), broken("b")])
    write_results(results, tmp_path / "results.json")
    read = read_baseline(tmp_path / "results.json")
    assert {k.name: k.metrics.get(MAX) for k in read.kept} == {"a/default": 12.0, "b/default": None}


def test_an_interrupted_suite_does_not_become_the_baseline(tmp_path) -> None:
    results = suite([ok("a", 12.0), broken("b", "interrupted", "")])
    with pytest.raises(ConfigError, match=r"interrupted: 1 of 2 .*b/default.*--resume"):
        write_baseline(results, tmp_path / "baseline.json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([broken("a"), broken("b", "timeout")], r"not written, all 2 runs failed: .*gates nothing"),
        ([broken("a")], "not written, the only run failed: "),
        ([], "the suite has no logs here"),
    ],
)
def test_a_baseline_without_figures_is_not_written(tmp_path, rows, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        write_baseline(suite(rows), tmp_path / "baseline.json")
    assert list(tmp_path.iterdir()) == []


ROW = {"log": "a", "group": "", "config": "c", "status": "ok", "metrics": {}}


def of_rows(*rows: object) -> str:
    return json.dumps({"version": 1, "suite": "s", "results": rows})


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not a baseline"),
        ("[]", "version None"),
        ('{"version": 99}', "version 99, expected 1"),
        ('{"version": 1, "suite": "s"}', "vehnav: no field 'results'; make it again with --upd"),
        ('{"version": 1, "suite": "s", "results": 3}', "field 'results': expected rows, not 3"),
        (of_rows(ROW, "b"), "row 2: expected an object, not 'b'"),
        (of_rows(ROW, {"log": "b", "config": "c"}), r"row 2 \(b/c\): no field 'status'"),
        (of_rows({"status": "ok", "metrics": {}}), r"row 1 \(\?/\?\): no field 'log'"),
        (of_rows({**ROW, "metrics": []}), r"row 1 \(a/c\): field 'metrics': expected an object"),
        (
            of_rows({**ROW, "metrics": {MAX: "12,5"}}),
            rf"row 1 \(a/c\): field 'metrics: {MAX}': expected a number, not '12,5'",
        ),
        (json.dumps({"version": 1, "suite": "s", "results": [ROW, ROW]}), "a/c is there twice"),
        (
            json.dumps({"version": 1, "suite": "s", "results": [{**ROW, "status": "fine"}]}),
            r"row 1 \(a/c\): field 'status': expected one of ok, .*, not 'fine'",
        ),
        (
            json.dumps(
                {"version": 1, "suite": "s", "results": [{**ROW, "metrics": {"m": float("nan")}}]}
            ),
            "not finite",
        ),
    ],
)
def test_what_is_not_a_baseline_is_refused(tmp_path, content: str, said: str) -> None:
    path = tmp_path / "baseline.json"
    path.write_text(content)
    with pytest.raises(FormatError, match=said) as error:
        read_baseline(path)
    assert "baseline.json" in str(error.value)


def test_a_missing_baseline_says_how_to_make_it(tmp_path) -> None:
    with pytest.raises(ConfigError, match="--update-baseline"):
        read_baseline(tmp_path / "none.json")
