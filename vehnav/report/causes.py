"""What caused the error, on the screen, in the document and on the page."""

from __future__ import annotations

import textwrap
import weakref
from collections.abc import Mapping
from typing import Any, Final

from vehnav.choices import METHODS
from vehnav.evaluation import Errors
from vehnav.evaluation.cause_text import sentence
from vehnav.evaluation.causes import Causes, find_causes
from vehnav.pipeline import Run
from vehnav.report.figures import own_method
from vehnav.report.markup import esc, table
from vehnav.trajectory import Trajectory

EXPLAINED: Final = ("as_published", "free")
"""Explained besides the method in force: integration with and without the stops."""
TITLES: Final = {
    "free": "free",
    "levelling": "levelling only",
    "reset": "velocity reset only",
    "as_published": "as published",
    "default": "default",
}
SHOWN: Final = 0.005
"""Share below which a cause has no row in the table."""
NOTE: Final = (
    "The sources of the linear error model, fitted to the error against GPS; values are estimate "
    "minus truth, ± one sigma. Shares are of the squared error over the drive and add up to 100 %; "
    "a negative one worked against the others. A wrong mounting yaw looks like a wrong heading, "
    "and a gyro turned against the accelerometers by 1 mrad like an accelerometer bias of 1 mg."
)


class _Latest:
    """The causes of the run that was asked for last: screen, document and page share them."""

    def __init__(self) -> None:
        self._run: weakref.ref[Run] | None = None
        self._found: dict[str, Causes] = {}

    def of(self, run: Run) -> dict[str, Causes]:
        """Its causes; computed once while the run lives."""
        if self._run is None or self._run() is not run:
            self._found, self._run = _find(run), weakref.ref(run)
        return self._found


_latest = _Latest()


def causes_of(run: Run) -> Mapping[str, Causes]:
    """Method -> causes: of the method in force first, then of those of :data:`EXPLAINED`.

    Empty without GPS to judge by, and for filters, whose corrections are not those of stops.
    """
    return _latest.of(run)


def _find(run: Run) -> dict[str, Causes]:
    if run.errors is None or run.config.method not in ("stops", "free"):
        return {}
    own = own_method(run)
    judged: dict[str, Errors] = {} if own is None else {own: run.errors}
    judged |= {name: run.method_errors[name] for name in EXPLAINED if name in run.method_errors}
    track: Trajectory = run.variants.get("default", run.trajectory)
    found = {}
    for name, errors in judged.items():
        corrections = METHODS[name]
        if corrections.refine and run.config.causal:
            continue  # the bias of every stop, but nothing tied down at the ends of the legs
        causes = find_causes(
            name,
            errors,
            track,
            levelling=corrections.levelling,
            reset=corrections.reset,
            offline=corrections.refine,
            noise=run.noise,
        )
        if causes is not None:
            found[name] = causes
    return found


def causes_lines(run: Run) -> list[str]:
    """The block of the screen: the method in force, or the next one that is explained."""
    found = causes_of(run)
    if not found:
        return []
    name, causes = next(iter(found.items()))
    text = f"{TITLES[name]}: {sentence(causes)}"
    lines = textwrap.wrap(text, 88, break_on_hyphens=False)
    return [f"{'cause' if k == 0 else '':<11}{line}" for k, line in enumerate(lines)]


def causes_tree(run: Run) -> dict[str, Any]:
    """``errors.causes`` of the document: method -> its causes."""
    return {
        name: {"summary": sentence(causes), **causes.to_dict()}
        for name, causes in causes_of(run).items()
    }


def causes_block(run: Run) -> str:
    """The section of the page: a table of the method in force, a sentence for the others."""
    found = causes_of(run)
    if not found:
        return ""
    first = next(iter(found.values()))
    lines = [
        f"<p><b>{esc(TITLES[name])}</b>: {esc(sentence(causes))}.</p>"
        for name, causes in found.items()
    ]
    if first.needed:
        lines.insert(1, _table(first))
    return "".join(lines)


def _table(causes: Causes) -> str:
    rows = []
    for cause in causes.causes:
        if abs(cause.share) < SHOWN and not cause.significant:
            continue
        value = f"{cause.value:+.3g} ± {cause.sigma:.2g}" if cause.single else f"{cause.value:.3g}"
        rows.append(
            [
                esc(cause.label) + ("" if cause.single else " (rms)"),
                f"{value} {esc(cause.unit)}",
                f"{100.0 * cause.share:.0f} ± {100.0 * cause.share_sigma:.0f} %",
                f"{100.0 * cause.share_end:.0f} %",
                f"{cause.rms_m:.2g} m" if cause.rms_m < 10.0 else f"{cause.rms_m:.0f} m",
            ]
        )
    left = f"{100.0 * causes.unexplained:.0f} %"
    rows.append(["unexplained", "", left, "", f"{causes.residual_m:.1f} m"])
    head = ["source", "value", "share", "at the end", "alone, rms"]
    together = "; ".join(
        f"{esc(one)} and {esc(other)} ({rho:+.2f})" for one, other, rho in causes.alike
    )
    note = f"<p>Not told apart by this drive: {together}.</p>" if together else ""
    return table(head, rows, name="What caused the error") + note
