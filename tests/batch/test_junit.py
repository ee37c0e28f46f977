"""JUnit XML, read back by an independent parser and held to what the schemas have in common."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import junitparser
import pytest
from batch_for_tests import MAX, broken, many, ok, suite

from vehnav.batch.baseline import baseline_of
from vehnav.batch.junit import junit_xml, write_junit
from vehnav.batch.model import BarResult, Result
from vehnav.batch.regression import compare_with

EVIL = "a<b>&\"'\x00\x0b\x1b[31m\ud800\ufffe]]>\n\t日本 😀"


def cases(text: bytes) -> dict[str, junitparser.TestCase]:
    """Test cases by name, as junitparser reads them."""
    found = junitparser.JUnitXml.fromstring(text)
    return {case.name: case for part in found for case in part}


def outcome(case: junitparser.TestCase) -> str:
    assert len(case.result) <= 1
    return type(case.result[0]).__name__ if case.result else "passed"


def test_one_case_for_each_log_configuration_and_bar() -> None:
    results = suite(
        [
            ok("good.mcap", 20.0),
            ok("far.mcap", 80.0),
            broken("dead.mcap"),
            broken("late.mcap", "timeout", "60 s"),
            broken("rest.mcap", "interrupted", ""),
            ok("good.mcap", 20.0, config="filter"),
        ]
    )
    read = junitparser.JUnitXml.fromstring(junit_xml(results))
    assert [(s.name, s.tests, s.failures, s.errors, s.skipped) for s in read] == [
        ("fleet.default", 10, 1, 2, 4),
        ("fleet.filter", 2, 0, 0, 0),
    ]
    assert (read.tests, read.failures, read.errors) == (12, 1, 2)
    first = {case.name: outcome(case) for case in next(iter(read))}
    assert first == {
        "dead.mcap: ran": "Error",
        f"dead.mcap: {MAX} max": "Skipped",
        "far.mcap: ran": "passed",
        f"far.mcap: {MAX} max": "Failure",
        "good.mcap: ran": "passed",
        f"good.mcap: {MAX} max": "passed",
        "late.mcap: ran": "Error",
        f"late.mcap: {MAX} max": "Skipped",
        "rest.mcap: ran": "Skipped",
        f"rest.mcap: {MAX} max": "Skipped",
    }


def test_a_failure_says_what_where_and_how_far() -> None:
    found = cases(junit_xml(suite([ok("far.mcap", 81.25), broken("dead.mcap")])))
    failure = found[f"far.mcap: {MAX} max"].result[0]
    assert failure.type == "bar"
    assert failure.message == (f"far.mcap/default: {MAX} is 81.2 m, at most 50 m is allowed")
    assert "logs/far.mcap/default/report.html" in failure.text
    error = found["dead.mcap: ran"].result[0]
    assert (error.type, error.message) == ("crash", "crashed: killed by SIGKILL")
    assert found["far.mcap: ran"].time == pytest.approx(1.25)


def test_a_missed_bar_without_a_figure() -> None:
    found = cases(junit_xml(suite([ok("no_gps.mcap", None)])))
    assert "undefined" in found[f"no_gps.mcap: {MAX} max"].result[0].message


def test_names_are_unique_and_keep_when_a_limit_moves() -> None:
    def names(*bars: BarResult) -> set[str]:
        row = ok("a.mcap", 20.0)
        text = junit_xml(suite([Result(**{**vars(row), "bars": bars})]))
        listed = [case.name for part in junitparser.JUnitXml.fromstring(text) for case in part]
        assert len(listed) == len(set(listed)) == 1 + len(bars)
        return set(listed)

    one = names(BarResult.of(MAX, "max", 50.0, 20.0))
    assert one == names(BarResult.of(MAX, "max", 25.0, 20.0))
    assert len(names(BarResult.of(MAX, "max", 50.0, 20.0), BarResult.of(MAX, "min", 1.0, 20.0)))
    assert len(names(BarResult.of(MAX, "max", 50.0, 20.0), BarResult.of(MAX, "max", 9.0, 20.0)))


def test_points_and_slashes_in_names_do_not_make_packages() -> None:
    """Jenkins takes what is before the last point of a class for its package."""
    row = ok("logs/2024.05.01/a.mcap", 20.0, config="filter v1.2")
    found = junitparser.JUnitXml.fromstring(junit_xml(suite([row], "fleet 3.0")))
    for part in found:
        for case in part:
            assert case.classname == "fleet 3_0.filter v1_2"


def test_the_baseline_has_cases_of_its_own() -> None:
    before = many(30)
    rows = [
        ok(r.log, r.metrics[MAX] * (1.2 if r.group == "city" else 1.0), group=r.group, limit=500.0)
        for r in before.results
    ]
    rows[4] = ok(rows[4].log, 10 * rows[4].metrics[MAX], group=rows[4].group, limit=5000.0)
    rows[5] = broken(rows[5].log, group=rows[5].group)
    now = suite(rows)
    comparison = compare_with(baseline_of(before), now, max_regression=0.05)
    found = junitparser.JUnitXml.fromstring(junit_xml(now, comparison=comparison))
    last = list(found)[-1]
    assert last.name == "fleet.baseline"
    outcomes = {case.name: outcome(case) for case in last}
    assert outcomes[f"city, default: {MAX}"] == "Failure"
    assert outcomes[f"highway, default: {MAX}"] == "passed"
    worst, dead = rows[4].name, rows[5].name
    assert {n for n, o in outcomes.items() if o == "Failure" and n.startswith("drive")} == {
        worst,
        dead,
    }
    assert sum(name.startswith("drive") for name in outcomes) == 30
    texts = {case.name: case.result[0].message for case in last if case.result}
    assert "times" in texts[worst]
    assert "killed" not in texts[dead]
    assert "crashed; in the baseline it ran" in texts[dead]
    assert "20.0 % worse in the median of 9 logs" in texts[f"city, default: {MAX}"]


def test_without_a_gate_there_are_no_cases_of_regression() -> None:
    results = many(9)
    comparison = compare_with(baseline_of(results), results)
    assert len(junitparser.JUnitXml.fromstring(junit_xml(results, comparison=comparison))) == 1


def test_names_of_any_kind_survive(tmp_path) -> None:
    """Controls, markup, lone surrogates of file names that are not UTF-8."""
    row = broken(EVIL, error=EVIL, config="c", group="g")
    write_junit(suite([row], EVIL), tmp_path / "junit.xml")
    text = (tmp_path / "junit.xml").read_bytes()
    names = [c.name for part in junitparser.JUnitXml.fromstring(text) for c in part]
    shown = r"""a<b>&"'\u0000\u000b\u001b[31m\ud800\ufffe]]>\u000a\u0009日本 😀"""
    assert names == [f"{shown}: ran", f"{shown}: {MAX} max"]
    assert [p.name for p in tmp_path.iterdir()] == ["junit.xml"]


# ---- what the schemas of Surefire and Jenkins have in common ------------------------------------

ATTRIBUTES = {
    "testsuites": {"name", "tests", "failures", "errors", "time"},
    "testsuite": {
        "name", "tests", "failures", "errors", "skipped", "time", "timestamp", "hostname",
    },
    "properties": set(),
    "property": {"name", "value"},
    "testcase": {"classname", "name", "time"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
    "skipped": {"message"},
}  # fmt: skip
REQUIRED = {
    "testsuite": {"name", "tests", "failures", "errors"},
    "property": {"name", "value"},
    "testcase": {"classname", "name", "time"},
    "failure": {"type", "message"},
    "error": {"type", "message"},
}
CHILDREN = {
    "testsuites": ["testsuite"],
    "testsuite": ["properties", "testcase"],
    "properties": ["property"],
    "testcase": ["failure", "error", "skipped"],
}
SUREFIRE_TIME = re.compile(r"(([0-9]{0,3},)*[0-9]{3}|[0-9]{0,3})*(\.[0-9]{0,3})?")
ISO8601 = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}")


def test_structure_of_the_common_schemas() -> None:
    rows = [*many(12).results, broken("x"), broken("y", "interrupted"), ok("z", 900.0)]
    results = suite(rows)
    comparison = compare_with(baseline_of(results), results, max_regression=0.05)
    root = ET.fromstring(junit_xml(results, comparison=comparison))
    assert root.tag == "testsuites"
    for element in root.iter():
        kinds = [child.tag for child in element]
        assert set(element.attrib) <= ATTRIBUTES[element.tag]
        assert set(element.attrib) >= REQUIRED.get(element.tag, set())
        allowed = CHILDREN.get(element.tag, [])
        assert set(kinds) <= set(allowed)
        assert kinds == sorted(kinds, key=allowed.index)  # a sequence, properties first
        if "time" in element.attrib:
            assert SUREFIRE_TIME.fullmatch(element.attrib["time"])
        if "timestamp" in element.attrib:
            assert ISO8601.fullmatch(element.attrib["timestamp"])
    for part in root:
        tags = [child.tag for case in part.iter("testcase") for child in case]
        assert int(part.get("tests", "")) == len(list(part.iter("testcase")))
        assert int(part.get("failures", "")) == tags.count("failure")
        assert int(part.get("errors", "")) == tags.count("error")
        assert int(part.get("skipped", "")) == tags.count("skipped")
    pairs = [(c.get("classname"), c.get("name")) for c in root.iter("testcase")]
    assert len(pairs) == len(set(pairs))
