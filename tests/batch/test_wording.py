"""The words of the outputs, and the order of what is worst."""

from __future__ import annotations

import pytest
from batch_for_tests import MAX, RMS, broken, ok, suite

from vehnav.batch.baseline import baseline_of
from vehnav.batch.model import BarResult, Result
from vehnav.batch.regression import Paired, compare_with
from vehnav.batch.wording import (
    bar_text,
    change_text,
    headline,
    interval_text,
    moved,
    regressions,
    remarks,
    short,
    worst_first,
)


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        (None, "too few logs for an interval"),
        ((0.051, 0.07), "95 %: 5.1 to 7.0 % worse"),
        ((-0.07, -0.051), "95 %: 7.0 to 5.1 % better"),
        ((-0.02, 0.14), "95 %: 2.0 % better to 14.0 % worse"),
        ((0.0, 0.14), "95 %: the same to 14.0 % worse"),
        ((0.2, 0.2000001), "95 %: 20.0 % worse"),
        ((10.0, 20.0), "95 %: 11 to 21 times the baseline"),
        ((5.0, 20.0), "95 %: 500 % worse to 21 times the baseline"),
    ],
)
def test_intervals(interval, text: str) -> None:
    row = Paired("c", "g", MAX, "less", 9, 5, 4, 1.0, 1.0, 0.0, interval, True, False, "same")
    assert interval_text(row) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0004, "0"), (999.6, "1000"), (99.96, "100"), (1.5e7, "15000000"), (-0.0004, "0")],
)
def test_figures(value: float, text: str) -> None:
    assert short(value) == text


def test_a_change_too_small_to_print_is_not_called_none() -> None:
    assert moved(1e-5) == "under 0.1 % worse"


@pytest.mark.parametrize(
    ("before", "now", "text"),
    [
        (0.0, 5.0, "0 m -> 5 m (from as good as zero)"),  # 500 times the floor, not the baseline
        (0.2, 5.0, "0.200 m -> 5 m (25 times the baseline)"),
        (0.005, 0.025, "0.005 m -> 0.025 m (200 % worse)"),  # of the floor, 0.01 m
        (None, 5.0, "undefined -> 5 m"),
    ],
)
def test_a_multiple_is_one_of_the_baseline(before, now, text: str) -> None:
    item = compare_with(baseline_of(suite([ok("a", before)])), suite([ok("a", now)]))
    (change,) = [c for c in item.changes if c.metric == MAX]
    assert change_text(change) == f"a/default: {MAX} {text}"


def test_what_did_not_run_comes_first_then_missed_bars_then_the_largest() -> None:
    rows = [ok("small", 1.0), ok("far", 80.0), ok("large", 30.0), broken("dead"), ok("none", None)]
    order = [r.log for r in worst_first(rows)]
    assert order == ["dead", "none", "far", "large", "small"]


def test_the_more_bars_are_missed_the_worse() -> None:
    one = ok("one", 99.0)
    bars = (*one.bars, BarResult.of(RMS, "max", 1.0, 30.0))
    two = Result(**{**vars(ok("two", 60.0)), "bars": bars})
    assert [r.log for r in worst_first([one, two])] == ["two", "one"]


def test_a_figure_that_is_not_there_says_why() -> None:
    gone = ok("a", None, more={"gps.fixes_judged": 0.0})
    assert bar_text(gone.bars[0], gone) == (
        f"{MAX} is undefined (no GPS fix is left to judge), at most 50 m is allowed"
    )
    other = ok("a", None)
    assert bar_text(other.bars[0], other).startswith(f"{MAX} is undefined, at most")


def test_a_group_in_one_sentence() -> None:
    before = suite(ok(f"{k}", 10.0) for k in range(7))
    now = suite(ok(f"{k}", 12.0 if k else 9.0) for k in range(7))
    item = compare_with(baseline_of(before), now, max_regression=0.05)
    assert regressions(item)[0] == (
        f"city, default: {MAX} 20.0 % worse in the median of 7 logs "
        "(95 %: 20.0 % worse; 6 worse, 1 better): regressed"
    )


@pytest.mark.parametrize(
    ("rows", "text"),
    [
        ([], "no logs"),
        ([ok("a", 1.0)], "1 log: passed"),
        ([ok("a", 1.0), ok("b", 2.0)], "2 logs: all 2 passed"),
        (
            [ok("a", 1.0), ok("a", 99.0, config="x"), broken("b", "timeout")],
            "2 logs with 2 configurations: 1 of 3 passed, 1 missed a bar, 1 over its time limit",
        ),
    ],
)
def test_headline(rows, text: str) -> None:
    assert headline(suite(rows)) == text


def test_sentences_of_a_comparison() -> None:
    before = suite([ok("a", 10.0), ok("b", 10.0), broken("c"), ok("d", 1.0)])
    now = suite([ok("a", 20.0), broken("b"), ok("c", 5.0), ok("e", 1.0)])
    item = compare_with(baseline_of(before), now, max_regression=0.05)
    assert regressions(item) == [
        f"city, default: {MAX} 100 % worse in its only log: regressed",
        "b/default: crashed; in the baseline it ran",
        f"a/default: {MAX} 10 m -> 20 m (100 % worse)",
    ]
    assert remarks(item) == [
        "c/default: ran; in the baseline it crashed",
        "1 only in the baseline: d/default",
        "1 not in the baseline: e/default",
    ]
