"""Why GPS judges nothing, and other sentences that depend on a number."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.logs_for_tests import ORIGIN, straight_log
from vehnav.aided import _doubts
from vehnav.config import Config
from vehnav.evaluation.judge import fixes
from vehnav.logs.log import Log
from vehnav.pipeline import run
from vehnav.report.summary import answer, summary
from vehnav.units import DEG

PLACE = (ORIGIN[0] / DEG, ORIGIN[1] / DEG, ORIGIN[2])


@pytest.fixture(scope="module")
def log() -> Log:
    return straight_log()


def some(log: Log, index) -> Log:
    """With these fixes only."""
    return replace(log, gnss=fixes(log.gnss, np.asarray(index)))


@pytest.mark.parametrize("method", ["default", "filter"])
def test_gps_that_is_not_used_and_a_local_frame(log: Log, method: str) -> None:
    options = {} if method == "default" else {"method": method}
    found = run(log, Config(gps="none", **options))
    assert answer(found) == (
        "GPS was not used, and the frame is only local: GPS cannot judge the track"
    )
    assert "used for the start" not in summary(found)


def test_too_few_fixes_are_counted(log: Log) -> None:
    given = Config(gps="none", start_position=PLACE, start_heading=0.0)
    for left, text in (([40, 90], "2 GPS fixes lie"), ([40], "1 GPS fix lies")):
        found = run(some(log, left), given)
        assert answer(found) == (
            f"{text} during the track: too few to judge the track, which takes 3"
        )
    assert "off at the end" in answer(run(log, given))


def test_a_start_far_from_the_fixes(log: Log) -> None:
    away = (PLACE[0] + 1.0, *PLACE[1:])
    found = run(log, Config(gps="none", start_position=away, start_heading=0.0))
    assert answer(found).startswith("none of 160 GPS fixes can judge the track: it is not where")


def test_fixes_that_all_serve_the_start(log: Log) -> None:
    found = run(some(log, range(60)), Config(gps_start_seconds=60.0))
    assert answer(found) == ("no GPS fix is left to judge the track: all were used for the start")


def test_an_aided_run(log: Log) -> None:
    aided = Config(method="filter", gps="aid")
    assert "all aid it; --outage cuts some out" in answer(run(log, aided))
    short = replace(aided, outage=("50:50.5",))
    assert answer(run(log, short)).startswith("1 GPS fix lies in the outages: too few to judge")


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({}, "the start position and heading are not known"),
        ({"start_heading": 0.0}, "the start position is not known"),
        ({"start_position": PLACE}, "the start heading is not known"),
    ],
)
def test_what_of_the_start_is_not_known(log: Log, given, text: str) -> None:
    found = run(log, Config(gps="none", **given))
    (said,) = [f.text for f in found.findings if f.code == "local-frame"]
    assert said.startswith(f"{text}: the frame is only local")


@pytest.mark.parametrize(("count", "text"), [(1, "once all fixes"), (3, "3 times all fixes")])
def test_how_often_the_filter_was_set_on_the_fixes(count: int, text: str) -> None:
    row = SimpleNamespace(used=9, rejected=1, inflated=0, set_on=count)
    result = SimpleNamespace(innovations={"gnss": row}, parameters=np.zeros(20))
    (doubt,) = _doubts(result)
    assert doubt.code == "set-on-fixes"
    assert doubt.text.startswith(text)
