"""The gate on regression: what fails, what does not, and what it says."""

from __future__ import annotations

import json

import numpy as np
import pytest
from batch_for_tests import MAX, RMS, broken, many, ok, suite

from vehnav.batch.baseline import baseline_of
from vehnav.batch.model import BarResult, Results
from vehnav.batch.regression import Comparison, Paired, compare_with
from vehnav.batch.wording import gate_text, regressions
from vehnav.batch.worsening import floor_of, worsening


def against(before: Results, now: Results, limit: float | None = 0.05, **kwargs) -> Comparison:
    return compare_with(baseline_of(before), now, max_regression=limit, **kwargs)


def scaled(results: Results, factor) -> Results:
    """Every log's errors times ``factor(k)``."""
    rows = [
        ok(r.log, r.metrics[MAX] * factor(k), group=r.group, config=r.config)
        for k, r in enumerate(results.results)
    ]
    return suite(rows)


def row(item: Comparison, metric: str = MAX, group: str | None = "city") -> Paired:
    return next(p for p in item.paired if p.metric == metric and p.group == group)


@pytest.mark.parametrize("count", [1, 3, 5, 6, 30])
@pytest.mark.parametrize(("factor", "passed"), [(1.06, False), (1.04, True), (0.5, True)])
def test_everything_worse_by_a_share(count: int, factor: float, passed: bool) -> None:
    before = suite(ok(f"{k}", 10.0 + k) for k in range(count))
    found = against(before, scaled(before, lambda _: factor))
    assert found.passed is passed
    assert row(found).worsening == pytest.approx(factor - 1.0, abs=2e-6)  # six digits are kept
    assert (row(found).interval is None) == (count < 6)


def test_noise_never_fails_even_with_no_allowance() -> None:
    before = many(60)
    rng = np.random.default_rng(3)
    noisy = scaled(before, lambda _: 1.0 + 1e-9 * rng.standard_normal())
    found = against(before, noisy, 0.0)
    assert found.passed
    assert not any(change.worsening for change in found.changes)
    assert {p.verdict for p in found.paired} == {"same"}


def test_what_is_as_good_as_zero_never_fails() -> None:
    before = suite(ok(f"{k}", 0.001) for k in range(10))
    assert against(before, scaled(before, lambda _: 9.0)).passed  # 1 mm to 9 mm
    assert not against(before, scaled(before, lambda _: 100.0)).passed  # 1 mm to 10 cm


def test_from_nothing_the_floor_is_the_measure() -> None:
    assert worsening(0.0, 0.05, direction="less", floor=0.01) == pytest.approx(5.0)
    assert worsening(0.002, 0.052, direction="less", floor=0.01) == pytest.approx(5.0)


def test_a_suite_of_one_group_is_told_once() -> None:
    before = suite(ok(f"{k}", 10.0) for k in range(8))
    assert {p.group for p in against(before, before).paired} == {"city"}
    assert {p.group for p in against(many(9), many(9)).paired} == {
        None, "city", "highway", "mountain road",
    }  # fmt: skip


def test_one_log_ten_times_worse_fails_and_is_named() -> None:
    before = many(90)
    found = against(before, scaled(before, lambda k: 10.0 if k == 17 else 1.0))
    assert not found.passed
    failed = [change for change in found.changes if change.failed]
    assert [(c.log, c.metric) for c in failed] == [(before.results[17].log, MAX)]
    assert failed[0] is found.changes[0]
    assert failed[0].worsening == pytest.approx(9.0, abs=1e-4)
    assert not any(p.failed for p in found.paired)


def test_a_log_may_worsen_ten_times_the_limit_unless_said() -> None:
    before = many(90)
    now = scaled(before, lambda k: 1.45 if k == 17 else 1.0)
    assert against(before, now).passed
    assert not against(before, now, 0.04).passed
    assert not against(before, now, max_log_regression=0.4).passed
    assert against(before, now, 0.04, max_log_regression=0.5).passed


def test_scatter_is_told_from_regression() -> None:
    """A change that moves every log at random by 30 %: of 40 suites of 21 logs the plain median
    fails several, the gate hardly any; and a true 20 % is found in nearly all."""
    rng = np.random.default_rng(5)
    wide = {"max_log_regression": 10.0}
    before = suite(ok(f"{k}", 20.0) for k in range(21))
    plain = gate = caught = 0
    for _ in range(40):
        factors = np.exp(0.3 * rng.standard_normal(21))
        chance = against(before, scaled(before, lambda k, f=factors: f[k]), **wide)
        plain += row(chance).worsening > 0.05
        gate += not chance.passed
        assert row(chance).verdict in {"undecided", "unclear", "regressed", "better"}
        worse = against(before, scaled(before, lambda k, f=factors: 1.0 + 0.2 * f[k]), **wide)
        caught += not worse.passed
    # a median of 21 scatters by 1.25 * 0.3 / sqrt(21) = 8 %: over 5 % in a quarter of the cases
    assert 4 <= plain <= 18
    assert gate <= 4  # 2.5 % expected: the lower end of a 95 % interval
    assert caught >= 38


def test_over_the_limit_by_chance_is_said_and_does_not_fail() -> None:
    before = suite(ok(f"{k}", 20.0) for k in range(7))
    factors = [1.4, 1.3, 1.2, 1.1, 0.9, 0.8, 0.7]
    found = against(before, scaled(before, lambda k: factors[k]))
    assert found.passed
    assert row(found).worsening == pytest.approx(0.1)
    assert row(found).verdict == "undecided"
    assert row(found).interval[0] < 0.0 < row(found).interval[1]
    assert (row(found).worse, row(found).better, row(found).logs) == (4, 3, 7)


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.03, "worse"), (0.97, "better"), (1.0, "same"), (1.2, "regressed")]
)
def test_verdicts_of_a_sure_change(factor: float, verdict: str) -> None:
    before = many(30)
    assert row(against(before, scaled(before, lambda _: factor))).verdict == verdict


def test_few_logs_are_not_called_better() -> None:
    before = suite(ok(f"{k}", 20.0) for k in range(3))
    assert row(against(before, scaled(before, lambda _: 0.97))).verdict == "unclear"


def test_groups_are_judged_by_themselves() -> None:
    """A third of the logs worse by 20 %: the median of the suite does not see it."""
    before = many(90)
    groups = [r.group for r in before.results]
    found = against(before, scaled(before, lambda k: 1.2 if groups[k] == "highway" else 1.0))
    assert not found.passed
    assert [(p.group, p.metric) for p in found.paired if p.failed] == [("highway", MAX)]
    assert row(found, group=None).worsening == 0.0
    assert not row(found, group=None).gated


def test_configurations_are_judged_by_themselves() -> None:
    before = many(30, configs=("default", "filter"))
    now = suite(
        ok(r.log, r.metrics[MAX] * (1.2 if r.config == "filter" else 1.0), group=r.group,
           config=r.config)
        for r in before.results
    )  # fmt: skip
    failed = {(p.config, p.group) for p in against(before, now).paired if p.failed}
    assert failed == {("filter", g) for g in ("city", "highway", "mountain road")}


def test_what_is_gated_is_what_has_bars() -> None:
    """Bars on the largest error: only it; without bars also the rms, which doubles here."""
    before = suite(ok(f"{k}", 10.0) for k in range(8))
    double = {RMS: 10.0}
    barred = suite(ok(f"{k}", 10.0, more=double) for k in range(8))
    free = suite(ok(f"{k}", 10.0, more=double, limit=None) for k in range(8))
    assert against(before, barred).passed
    assert row(against(before, barred), RMS).verdict == "regressed"  # said all the same
    assert not against(before, free).passed


def test_more_is_better_where_the_bar_is_from_below() -> None:
    def scores(value: float, bounds: tuple[str, ...]) -> Results:
        rows = []
        for k in range(8):
            r = ok(f"{k}", 10.0, more={"stops.f1": value}, limit=None)
            bars = tuple(BarResult.of("stops.f1", bound, 0.5, value) for bound in bounds)
            rows.append(type(r)(**{**vars(r), "bars": bars}))
        return suite(rows)

    assert not against(scores(0.9, ("min",)), scores(0.8, ("min",))).passed
    assert against(scores(0.8, ("min",)), scores(0.9, ("min",))).passed
    # held from both sides there is no better
    assert against(scores(0.9, ("min", "max")), scores(0.6, ("min", "max"))).passed


def test_a_signed_figure_is_judged_by_its_size() -> None:
    assert worsening(-10.0, 11.0, direction="less", floor=0.01) == pytest.approx(0.1)
    assert worsening(-10.0, -9.0, direction="less", floor=0.01) == pytest.approx(-0.1)


def test_a_log_that_fails_now_is_a_regression() -> None:
    before = suite([ok("a", 10.0), ok("b", 10.0), broken("c"), broken("d", "timeout")])
    now = suite([ok("a", 10.0), broken("b", "timeout"), ok("c", 5.0), broken("d", "crash")])
    found = against(before, now)
    assert not found.passed
    turned = {t.log: (t.before, t.now, t.failed) for t in found.turned}
    assert turned == {
        "b": ("ok", "timeout", True),
        "c": ("crash", "ok", False),
        "d": ("timeout", "crash", False),
    }
    assert against(before, suite([*now.results[:1], *before.results[1:]])).passed


def test_a_figure_that_is_gone_is_a_regression() -> None:
    before, now = suite([ok("a", 10.0), ok("b", 10.0)]), suite([ok("a", 10.0), ok("b", None)])
    found = against(before, now)
    assert not found.passed
    assert [(c.log, c.now, c.failed) for c in found.changes if c.failed] == [("b", None, True)]
    assert against(now, before).passed


def test_new_and_vanished_are_named_and_do_not_fail() -> None:
    before = suite([ok("a", 10.0), ok("b", 10.0), ok("b", 1.0, config="filter")])
    now = suite([ok("a", 10.0), ok("c", 90.0, limit=None)])
    found = against(before, now)
    assert found.passed
    assert found.new == ("c/default",)
    assert found.vanished == ("b/default", "b/filter")


def test_a_baseline_of_other_logs_does_not_pass_for_a_gate() -> None:
    before, now = suite([ok("a", 10.0)], "old"), suite([ok("b", 10.0)])
    found = against(before, now)
    assert not found.passed
    assert regressions(found) == [
        "none of the logs is in the baseline, which is of the suite 'old'"
    ]
    assert gate_text(found).startswith("nothing was compared with")
    assert against(before, now, None).passed
    assert against(before, suite([ok("a", 10.0), ok("b", 10.0)])).passed


def test_a_baseline_without_figures_does_not_pass_for_a_gate() -> None:
    """Also one whose figures are others than those that are gated now."""
    now = suite([ok("a", 10.0), ok("b", 10.0)])
    for before in (suite([broken("a"), broken("b", "timeout")]), suite([ok("a", None)])):
        found = against(before, now)
        assert not found.passed
        assert regressions(found) == [
            "the baseline has none of the gated figures; --update-baseline makes it again"
        ]
        assert gate_text(found).startswith("no gated figure could be compared with")
        assert against(before, now, None).passed
    assert against(suite([broken("a"), ok("b", 10.0)]), now).passed


def test_where_there_is_no_figure_to_gate_it_is_said() -> None:
    """Logs without GPS: only that they still run is held, and that is no "no regression"."""
    rows = [ok("a", None), ok("b", None)]
    found = against(suite(rows), suite(rows))
    assert found.passed
    assert gate_text(found).startswith("no gated figure could be compared with")
    assert not against(suite(rows), suite([ok("a", None), broken("b")])).passed


def test_runs_that_all_fail_now_are_not_blamed_on_the_baseline() -> None:
    found = against(suite([ok("a", 10.0)]), suite([broken("a")]))
    assert not found.passed
    assert regressions(found) == ["a/default: crashed; in the baseline it ran"]


def test_another_stretch_judged_is_named() -> None:
    before = suite([ok("a", 10.0), ok("b", 10.0)])
    fewer = {"gps.fixes_judged": 150.0}
    assert against(before, suite([ok("a", 10.0), ok("b", 10.0, more=fewer)])).other_fixes == (
        "b/default",
    )


def test_without_a_limit_nothing_fails_but_all_is_said() -> None:
    before = many(30)
    found = against(before, scaled(before, lambda _: 3.0), None)
    assert found.passed
    assert row(found).worsening == pytest.approx(2.0)
    assert row(found).verdict == "worse"
    with pytest.raises(ValueError, match="not negative"):
        against(before, before, -0.1)


def test_the_document_is_plain_and_the_same_twice() -> None:
    before, now = many(40), many(40, spread=0.2)
    texts = [
        json.dumps(against(before, now).to_dict(), allow_nan=False, sort_keys=True)
        for _ in range(2)
    ]
    assert texts[0] == texts[1]
    tree = json.loads(texts[0])
    assert set(tree) == {
        "baseline", "suite", "compared", "max_regression", "max_log_regression", "passed",
        "paired", "changes", "status", "new", "vanished", "other_fixes",
    }  # fmt: skip
    assert all(change["worsening"] for change in tree["changes"])


@pytest.mark.parametrize(
    ("metric", "floor"),
    [
        ("errors.horizontal_m.max", 0.01),
        ("errors.cep95_m", 0.01),
        ("errors.velocity_m_s.rms", 0.001),
        ("errors.heading_deg.end", 0.01),
        ("errors.percent_of_distance.max", 0.01),
        ("stops.count", 0.5),
    ],
)
def test_floors_by_unit(metric: str, floor: float) -> None:
    assert floor_of(metric) == floor


@pytest.mark.parametrize("metric", ["stops.count", "findings.gap", "gps.fixes_judged"])
def test_a_count_that_begins_is_no_thousandfold(metric: str) -> None:
    """From nothing to one: one more, against half of one, which is as good as none."""
    floor = floor_of(metric)
    assert worsening(0.0, 1.0, direction="less", floor=floor) == 2.0
    assert worsening(5.0, 6.0, direction="less", floor=floor) == 0.2
    assert worsening(5.0, 5.0, direction="less", floor=floor) == 0.0
