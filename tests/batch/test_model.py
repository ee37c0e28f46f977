from __future__ import annotations

import json
import pickle

import pytest

from vehnav.batch.baseline import read_baseline
from vehnav.batch.model import (
    BarResult,
    Result,
    Results,
    RunBlock,
    metric_value,
    read_results,
    results_from_dict,
    write_results,
)
from vehnav.errors import FormatError, VehnavError

GOOD = Result(
    "city",
    "simulated",
    "default",
    "ok",
    0,
    None,
    "ab" * 32,
    False,
    {"errors.horizontal_m.max": 12.5, "errors.heading_deg.rms": None},
    (BarResult.of("errors.horizontal_m.max", "max", 20.0, 12.5),),
    "logs/city/default/report.html",
)
BROKEN = Result("a log", "simulated", "default", "crash", None, "killed by SIGKILL")


def test_there_and_back(tmp_path) -> None:
    results = Results.of("suite", [GOOD, BROKEN], RunBlock(jobs=2, seconds={"city/default": 1.5}))
    write_results(results, tmp_path / "results.json")
    assert read_results(tmp_path / "results.json") == results
    assert results_from_dict(json.loads(json.dumps(results.to_dict()))) == results
    assert pickle.loads(pickle.dumps(results)) == results
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]


def test_order_does_not_hang_on_the_order_of_the_work() -> None:
    one = Results.of("suite", [GOOD, BROKEN], RunBlock())
    other = Results.of("suite", [BROKEN, GOOD], RunBlock())
    assert one == other
    assert [result.log for result in one.results] == ["a log", "city"]


def test_a_nan_is_refused_and_nothing_is_written(tmp_path) -> None:
    bad = Result("x", "", "default", "ok", metrics={"errors.horizontal_m.max": float("nan")})
    with pytest.raises(ValueError):
        write_results(Results.of("suite", [bad], RunBlock()), tmp_path / "results.json")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("bound", "limit", "value", "passed"),
    [
        ("max", 10.0, 10.0, True),
        ("max", 10.0, 10.1, False),
        ("min", 10.0, 10.0, True),
        ("min", 10.0, 9.9, False),
        ("max", 10.0, None, False),
        ("min", 10.0, None, False),
    ],
)
def test_bars(bound, limit, value, passed) -> None:
    assert BarResult.of("m", bound, limit, value).passed is passed


def test_a_result_passes_only_if_it_ran() -> None:
    assert GOOD.passed
    assert not BROKEN.passed


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d.pop("version"),
        lambda d: d.update(version=2),
        lambda d: d.pop("results"),
        lambda d: d["results"][0].pop("bars"),
        lambda d: d["results"][0].update(status="fine"),
        lambda d: d["results"][0]["metrics"].update(x="y"),
        lambda d: d["run"].update(strange=1),
    ],
)
def test_what_is_not_a_results_file_is_refused_by_name(tmp_path, change) -> None:
    content = Results.of("suite", [GOOD], RunBlock()).to_dict()
    change(content)
    path = tmp_path / "old.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FormatError, match=r"old\.json"):
        read_results(path)


AGAIN = "make it again with --update-baseline"


@pytest.mark.parametrize(
    ("content", "results", "baseline"),
    [
        ("{", "not a results.json of vehnav: Exp", "not a baseline of vehnav: Exp"),
        (
            "[]",
            "not a results.json of this vehnav: version None, expected 1$",
            f"not a baseline of this vehnav: version None, expected 1; {AGAIN}$",
        ),
        (
            '{"version": 2}',
            "not a results.json of this vehnav: version 2, expected 1$",
            f"not a baseline of this vehnav: version 2, expected 1; {AGAIN}$",
        ),
        (
            '{"version": 1, "suite": "s"}',
            "not a results.json of vehnav: no field 'results'$",
            f"not a baseline of vehnav: no field 'results'; {AGAIN}$",
        ),
        (None, "cannot be read: No such file or directory$", "no such baseline; the first one is"),
    ],
)
def test_what_a_file_is_taken_for_is_said(tmp_path, content, results, baseline) -> None:
    path = tmp_path / "old.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(FormatError, match=rf"old\.json: {results}"):
        read_results(path)
    with pytest.raises(VehnavError, match=rf"old\.json: {baseline}"):
        read_baseline(path)


def test_metric_paths() -> None:
    report = {
        "errors": {"horizontal_m": {"max": 3}, "segments": [{"percent": 1.5}]},
        "errors_before_first_stop": None,
        "trajectory": {"flag": True},
        "input": {"findings": [{"code": "gap"}, {"code": "gap"}, {"code": "clock-offset"}]},
    }
    assert metric_value(report, "errors.horizontal_m.max") == 3.0
    assert metric_value(report, "errors.segments.0.percent") == 1.5
    assert metric_value(report, "errors.segments.1.percent") is None
    assert metric_value(report, "errors.segments.count") == 1.0
    assert metric_value(report, "findings.gap") == 2.0
    assert metric_value(report, "findings.no-such") == 0.0
    for nothing in ("errors", "errors.horizontal_m.rms", "trajectory.flag", "no.such.path",
                    "errors_before_first_stop.horizontal_m.max"):  # fmt: skip
        assert metric_value(report, nothing) is None
