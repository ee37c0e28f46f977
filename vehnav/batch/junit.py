"""JUnit XML of a suite, as Jenkins, GitLab and others read it.

A ``testsuite`` for each configuration, in it of every log a test case that it ran and one for each
of its bars; one more ``testsuite`` for the comparison with the baseline, where there is a gate.

The dialect is what they have in common (the Surefire schema and Jenkins' own): a case has at most
one ``error``, ``failure`` or ``skipped``; times have three decimals; class and name together are
unique, since GitLab drops the second of two. The class is SUITE.CONFIGURATION, points inside a name
replaced, because Jenkins cuts it at the last one. A missed bar is a ``failure``, a log that did not
run an ``error``; its bars, and what was interrupted, are ``skipped``.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from vehnav.batch import wording
from vehnav.batch.model import BarResult, Result, Results, RunBlock
from vehnav.batch.regression import Comparison
from vehnav.export.atomic import atomic_path

Outcome = Literal["passed", "failure", "error", "skipped"]
_FORBIDDEN: Final = (*range(0x20), 0x7F, *range(0x80, 0xA0), 0xFFFE, 0xFFFF)
NOT_XML: Final = {c: f"\\u{c:04x}" for c in _FORBIDDEN}
"""Characters that XML 1.0 forbids or advises against; a name that has them shows them."""


@dataclass(frozen=True)
class Case:
    """One ``testcase``; ``kind`` and ``text`` say why it did not pass."""

    name: str
    outcome: Outcome = "passed"
    kind: str = ""
    text: str = ""
    seconds: float = 0.0


def write_junit(results: Results, path: Path, *, comparison: Comparison | None = None) -> None:
    """Write :func:`junit_xml` whole or not at all."""
    text = junit_xml(results, comparison=comparison)
    with atomic_path(path) as temporary:
        temporary.write_bytes(text)


def junit_xml(results: Results, *, comparison: Comparison | None = None) -> bytes:
    """The document, UTF-8.

    Parameters
    ----------
    results : Results
    comparison : Comparison or None
        Adds a test case for every group and figure that the gate looks at, and for every log.
    """
    root = ET.Element("testsuites", {"name": _clean(results.suite)})
    suites = [
        (config, _cases([r for r in results.results if r.config == config], results.run))
        for config in dict.fromkeys(r.config for r in results.results)
    ]
    if comparison is not None and comparison.max_regression is not None:
        suites.append(("baseline", _regression_cases(comparison)))
    for name, cases in suites:
        root.append(_suite(results, name, cases))
    _count(root, [case for _, cases in suites for case in cases])
    del root.attrib["skipped"]  # the schemas have it in a testsuite only
    ET.indent(root, " ")
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _suite(results: Results, name: str, cases: Sequence[Case]) -> ET.Element:
    """A ``testsuite``; its class is the name of the suite and ``name``."""
    full = f"{_clean(results.suite).replace('.', '_')}.{_clean(name).replace('.', '_')}"
    run = results.run
    suite = ET.Element("testsuite", {"name": full})
    _count(suite, cases)
    if run.started:
        suite.set("timestamp", run.started.partition("+")[0].rstrip("Z").partition(".")[0])
    if run.host:
        suite.set("hostname", _clean(run.host))
    properties = ET.SubElement(suite, "properties")
    for key, value in (("vehnav", run.vehnav), ("python", run.python), ("platform", run.platform)):
        ET.SubElement(properties, "property", {"name": key, "value": _clean(value)})
    for case in cases:
        suite.append(_element(case, full))
    return suite


def _count(element: ET.Element, cases: Sequence[Case]) -> None:
    outcomes = Counter(case.outcome for case in cases)
    element.set("tests", str(len(cases)))
    element.set("failures", str(outcomes["failure"]))
    element.set("errors", str(outcomes["error"]))
    element.set("skipped", str(outcomes["skipped"]))
    element.set("time", f"{sum(case.seconds for case in cases):.3f}")


def _element(case: Case, full: str) -> ET.Element:
    attributes = {"classname": full, "name": _clean(case.name), "time": f"{case.seconds:.3f}"}
    element = ET.Element("testcase", attributes)
    if case.outcome != "passed":
        first = _clean(case.text.partition("\n")[0])
        inside = ET.SubElement(element, case.outcome, {"message": first})
        if case.outcome != "skipped":  # JUnit's own schema gives skipped no type and no text
            inside.set("type", case.kind)
            inside.text = "\n".join(_clean(line) for line in case.text.split("\n"))
    return element


def _clean(text: str) -> str:
    """Text that XML can hold; lone surrogates, of names that are not UTF-8, become visible too."""
    return text.translate(NOT_XML).encode("utf-8", "backslashreplace").decode("utf-8")


# ---- cases -------------------------------------------------------------------------------------


def _cases(results: Iterable[Result], run: RunBlock) -> list[Case]:
    """Of a configuration: every log that it ran, and its bars."""
    out = []
    for r in results:
        out.append(_ran(r, run.seconds.get(r.name, 0.0)))
        out += [_bar(r, bar, name) for bar, name in zip(r.bars, _bar_names(r), strict=True)]
    return out


def _ran(r: Result, seconds: float) -> Case:
    name = f"{r.log}: ran"
    if r.status == "ok":
        return Case(name, seconds=seconds)
    outcome: Outcome = "skipped" if r.status == "interrupted" else "error"
    text = wording.state_text(r)
    if r.exit_status is not None:
        text += f"\nexit status {r.exit_status}"
    return Case(name, outcome, r.status, text, seconds)


def _bar_names(r: Result) -> list[str]:
    """Unique, and the same when a limit moves, so that a case keeps its history."""
    names = [f"{r.log}: {bar.metric} {bar.bound}" for bar in r.bars]
    twice = {name for name, count in Counter(names).items() if count > 1}
    return [
        f"{name} {bar.limit:g}" if name in twice else name
        for name, bar in zip(names, r.bars, strict=True)
    ]


def _bar(r: Result, bar: BarResult, name: str) -> Case:
    if r.status != "ok":
        return Case(name, "skipped", "bar", f"no figures: {wording.STATES[r.status]}")
    if bar.passed:
        return Case(name)
    report = f"\nreport: {r.report}" if r.report else ""
    return Case(name, "failure", "bar", f"{r.name}: {wording.bar_text(bar, r)}{report}")


def _regression_cases(item: Comparison) -> list[Case]:
    """Every group and figure that is gated, then every log that the baseline has."""
    cases = []
    for p in item.paired:
        if p.gated:
            name = f"{p.group or 'no group'}, {p.config}: {p.metric}"
            text = wording.paired_text(p)
            cases.append(Case(name, "failure", "regression", text) if p.failed else Case(name))
    logs: dict[str, list[str]] = {}
    for c in item.changes:
        if c.gated:
            found = logs.setdefault(f"{c.log}/{c.config}", [])
            found += [wording.change_text(c)] * c.failed
    for t in item.turned:
        if t.failed:
            logs.setdefault(f"{t.log}/{t.config}", []).append(wording.turned_text(t))
    for name in sorted(logs):
        text = "\n".join(logs[name])
        cases.append(Case(name, "failure", "regression", text) if text else Case(name))
    return cases
