"""What `vehnav score` prints: no wider than the terminal, and nothing is lost on the way."""

from __future__ import annotations

import re

import pytest
from batch_for_tests import broken, many, ok, suite

from vehnav.batch import wording
from vehnav.batch.baseline import baseline_of
from vehnav.batch.model import Results
from vehnav.batch.regression import Comparison, compare_with
from vehnav.cli.score_screen import MOST_LINES, screen

LONG = (
    "no IMU: "
    + " ".join(f"/topic/{k} (sensor_msgs/Image)," for k in range(12))
    + " say --imu-topic"
)
WIDTHS = (72, 80, 140)


def results(configs: tuple[str, ...]) -> Results:
    return suite(
        row
        for name in configs
        for row in (
            ok("town", 65.4, config=name),
            ok("a_drive_with_a_long_name_2026-11-22_run_7", 12.0, config=name),
            broken("b", "error", f"b.mcap: {LONG}", config=name),
            broken("c", "timeout", "over the time limit of 300 s", config=name),
            ok("bends", 20.0, group="mountain", config=name),
        )
    )


def compared(now: Results) -> Comparison:
    before = suite(ok(r.log, 10.0, group=r.group, config=r.config) for r in now.results)
    return compare_with(baseline_of(before), now, max_regression=0.05)


def words(text: str) -> list[str]:
    return text.split()


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("configs", [("default",), ("default", "a_long_name_of_a_configuration")])
def test_no_line_is_wider_than_the_terminal(width: int, configs: tuple[str, ...]) -> None:
    now = results(configs)
    text = screen(now, compared(now), width=width)
    assert max(map(len, text.splitlines())) <= width
    assert not re.search(r" $", text, re.MULTILINE)


@pytest.mark.parametrize("width", WIDTHS)
def test_wrapping_loses_no_word(width: int) -> None:
    """But of an error that is longer than its lines, whose end is in results.json."""
    now = suite(r for r in results(("default",)).results if r.log in ("town", "c", "bends"))
    whole = screen(now, compared(now))
    wrapped = screen(now, compared(now), width=width)
    assert sorted(words(wrapped)) == sorted(words(whole))


def test_a_long_error_is_cut_where_it_says_so() -> None:
    now = results(("default",))
    narrow = screen(now, width=72).splitlines()
    start = next(k for k, line in enumerate(narrow) if "failed: b.mcap" in line)
    assert narrow[start + MOST_LINES - 1].endswith(" ...")
    assert "failed: b.mcap" in screen(now)  # no terminal: a row is a line
    rows = [line for line in screen(now).splitlines() if line.startswith("b ")]
    assert len(rows) == 1
    assert rows[0].endswith("...")
    assert LONG in " ".join(words(screen(now, width=240)))


def test_configurations_are_named_where_there_are_several() -> None:
    assert "configuration" not in screen(results(("default",)))
    both = screen(results(("default", "filter")))
    assert "configuration" in both
    assert both.count("  filter ") == 5


def test_what_passes_and_is_not_among_the_worst_is_counted() -> None:
    text = screen(many(90))
    shown = re.findall(r"^drive_\S+", text, re.MULTILINE)
    left = sum(map(int, re.findall(r"^\.\.\. and (\d+) more", text, re.MULTILINE)))
    assert len(shown) + left == 90
    failed = [r.log for r in many(90).results if not r.passed]
    assert failed
    assert set(failed) <= set(shown)


def test_a_log_over_its_time_is_not_said_twice() -> None:
    (row,) = [r for r in results(("default",)).results if r.log == "c"]
    assert wording.state_text(row) == "over the time limit of 300 s"
