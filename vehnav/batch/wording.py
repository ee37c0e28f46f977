"""The words that all outputs of a suite use for bars, states and changes; and which comes first."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from vehnav.batch.model import MAIN_METRIC, BarResult, Result, Results
from vehnav.batch.regression import Change, Comparison, Paired, Turned
from vehnav.batch.worsening import floor_of

UNITS: Final = (("_m_s", "m/s"), ("_deg", "deg"), ("percent", "%"), ("_m", "m"), ("_s", "s"))
"""By the end of a part of a metric's name."""
STATES: Final = {
    "ok": "ran",
    "error": "failed",
    "timeout": "over its time limit",
    "crash": "crashed",
    "interrupted": "not finished",
}
VERDICTS: Final = {
    "regressed": "regressed",
    "undecided": "over the limit, may be chance",
    "worse": "worse, within the limit",
    "same": "the same",
    "better": "better",
    "unclear": "no clear change",
}


def unit_of(metric: str) -> str:
    """The unit of a figure by its name.

    >>> [unit_of(f"errors.{m}") for m in ("horizontal_m.max", "velocity_m_s.rms", "cep95_m")]
    ['m', 'm/s', 'm']
    >>> unit_of("errors.percent_of_distance.end"), unit_of("stops.count")
    ('%', '')
    """
    for key, unit in UNITS:
        if any(part.endswith(key) or part.startswith(key) for part in metric.split(".")):
            return unit
    return ""


def short(value: float | None) -> str:
    """Three digits, and no more than three decimals.

    >>> [short(v) for v in (0.12345, 65.37, 42773.2, -2.5, 0.0, 3.0, None)]
    ['0.123', '65.4', '42773', '-2.50', '0', '3', '-']
    """
    if value is None:
        return "-"
    if value == int(value) and abs(value) < 1e6:
        return str(int(value))
    size = float(f"{abs(value):.3g}")
    decimals = 3 if size < 1.0 else max(0, 2 - int(math.log10(size)))
    text = f"{value:.{decimals}f}"
    return text if float(text) else "0"


def with_unit(value: float | None, metric: str) -> str:
    """A figure and its unit.

    >>> with_unit(12.345, "errors.horizontal_m.max"), with_unit(None, "errors.cep50_m")
    ('12.3 m', 'undefined')
    """
    return "undefined" if value is None else f"{short(value)} {unit_of(metric)}".rstrip()


def moved(worsening: float) -> str:
    """A relative change in words.

    >>> moved(0.0612), moved(-0.03), moved(0.0), moved(24.5)
    ('6.1 % worse', '3.0 % better', 'the same', '26 times the baseline')
    """
    if worsening == 0.0:
        return "the same"
    if worsening >= 9.995:
        return f"{worsening + 1.0:.0f} times the baseline"
    share = 100.0 * abs(worsening)
    text = f"{share:.0f}" if share >= 99.95 else f"{share:.1f}" if share >= 0.05 else "under 0.1"
    return f"{text} % {'worse' if worsening > 0.0 else 'better'}"


def change_moved(change: Change) -> str:
    """The change of a log's figure in words; of a baseline as good as zero there is no multiple."""
    if change.worsening is None:
        return ""
    text = moved(change.worsening)
    small = change.before is not None and abs(change.before) < floor_of(change.metric)
    return "from as good as zero" if small and text.endswith(" times the baseline") else text


# ---- sentences ---------------------------------------------------------------------------------


def bar_text(bar: BarResult, result: Result) -> str:
    """What was found in a log and what was allowed."""
    bound = "at most" if bar.bound == "max" else "at least"
    found = undefined(bar, result) if bar.value is None else with_unit(bar.value, bar.metric)
    return f"{bar.metric} is {found}, {bound} {with_unit(bar.limit, bar.metric)} is allowed"


def undefined(bar: BarResult, result: Result) -> str:
    """That a figure is not there, and why where that is known."""
    if bar.metric.startswith("errors.") and result.metrics.get("gps.fixes_judged") == 0.0:
        return "undefined (no GPS fix is left to judge)"
    return "undefined"


def state_text(result: Result) -> str:
    """How a log ended, with the reason."""
    if result.status == "timeout" and result.error:
        return result.error
    text = STATES[result.status]
    return f"{text}: {result.error}" if result.error else text


def change_text(change: Change) -> str:
    """A figure of a log before and now."""
    before, now = (with_unit(v, change.metric) for v in (change.before, change.now))
    share = "" if change.worsening is None else f" ({change_moved(change)})"
    return f"{change.log}/{change.config}: {change.metric} {before} -> {now}{share}"


def turned_text(row: Turned) -> str:
    """A log that ends otherwise than before."""
    name = f"{row.log}/{row.config}"
    return f"{name}: {STATES[row.now]}; in the baseline it {_was(row.before)}"


def _was(status: str) -> str:
    if status == "timeout":
        return "was over its time limit"
    return "was not finished" if status == "interrupted" else STATES[status]


def paired_text(row: Paired) -> str:
    """A figure over the logs of a group."""
    where = row.config if row.group is None else f"{row.group or 'no group'}, {row.config}"
    text = f"{where}: {row.metric} {moved(row.worsening)}"
    if row.logs == 1:
        return f"{text} in its only log: {VERDICTS[row.verdict]}"
    text += f" in the median of {row.logs} logs"
    text += f" ({interval_text(row)}; {row.worse} worse, {row.better} better)"
    return f"{text}: {VERDICTS[row.verdict]}"


def interval_text(row: Paired) -> str:
    """Between what the median change lies, or why that is not known."""
    if row.interval is None:
        return "too few logs for an interval"
    low, high = (moved(end) for end in row.interval)
    if low == high:
        return f"95 %: {low}"
    for unit in (" % worse", " % better", " times the baseline"):
        if high.endswith(unit):
            low = low.removesuffix(unit)
    return f"95 %: {low} to {high}"


def regressions(item: Comparison) -> list[str]:
    """Everything that fails the gate, the suite first."""
    nothing = f"none of the logs is in the baseline, which is of the suite {item.suite!r}"
    if item.compared:
        nothing = "the baseline has none of the gated figures; --update-baseline makes it again"
    return [
        *[nothing] * item.empty,
        *(paired_text(p) for p in item.paired if p.failed),
        *(turned_text(t) for t in item.turned if t.failed),
        *(change_text(c) for c in item.changes if c.failed),
    ]


def remarks(item: Comparison, *, most: int = 5) -> list[str]:
    """What must be known of a comparison beside what fails."""
    out = [paired_text(p) for p in item.paired if p.verdict == "undecided" and p.gated]
    out += [turned_text(t) for t in item.turned if not t.failed]
    for names, text in (
        (item.vanished, "only in the baseline"),
        (item.new, "not in the baseline"),
        (item.other_fixes, "judged by another number of fixes than the baseline"),
    ):
        if names:
            listed = ", ".join(names[:most]) + (", ..." if len(names) > most else "")
            out.append(f"{len(names)} {text}: {listed}")
    return out


def headline(results: Results) -> str:
    """How many passed, and what became of the others."""
    rows = results.results
    logs, configs = len({r.log for r in rows}), len({r.config for r in rows})
    what = _count(logs, "log") + (f" with {configs} configurations" if configs > 1 else "")
    passed = sum(r.passed for r in rows)
    far = sum(missed(r) > 0 for r in rows)
    parts = [f"{passed} of {len(rows)} passed"]
    if passed == len(rows):
        parts = ["passed" if passed == 1 else f"all {passed} passed"]
    parts += [f"{far} missed a bar"] * (far > 0)
    for status, text in STATES.items():
        count = sum(r.status == status for r in rows)
        if count and status != "ok":
            parts.append(f"{count} {text}")
    return f"{what}: {', '.join(parts)}" if rows else "no logs"


def _count(number: int, what: str) -> str:
    return f"1 {what}" if number == 1 else f"{number} {what}s"


def gate_text(item: Comparison) -> str:
    """What the comparison with the baseline came to."""
    if item.idle:
        what = "no gated figure could be" if item.compared else "nothing was"
        return f"{what} compared with {item.path}"
    failed = len(regressions(item))
    if item.max_regression is None:
        return f"compared with {item.path}, nothing is gated"
    limits = f"{100.0 * item.max_regression:g} % in the median"
    if item.max_log_regression is not None:
        limits += f", {100.0 * item.max_log_regression:g} % for a log"
    text = _count(failed, "regression") if failed else "no regression"
    return f"{text} against {item.path} ({limits})"


# ---- order -------------------------------------------------------------------------------------


def missed(result: Result) -> int:
    """How many bars it missed; a log that did not run has missed none but itself."""
    return sum(not bar.passed for bar in result.bars) if result.status == "ok" else 0


def main_metric(results: Iterable[Result]) -> str:
    """The figure that a page shows of every log: the largest error, else what has a bar."""
    rows = list(results)
    if any(r.metrics.get(MAIN_METRIC) is not None for r in rows):
        return MAIN_METRIC
    return next((bar.metric for r in rows for bar in r.bars), MAIN_METRIC)


def worst_first(results: Iterable[Result], metric: str = MAIN_METRIC) -> list[Result]:
    """Those that did not run, then those that missed bars, then by a figure from the largest."""

    def key(r: Result) -> tuple[int, int, float, str, str]:
        value = r.metrics.get(metric)
        rank = 0 if r.status != "ok" else 1 if missed(r) else 2
        return rank, -missed(r), -math.inf if value is None else -value, r.log, r.config

    return sorted(results, key=key)
