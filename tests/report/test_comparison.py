"""Several trajectories in one picture: true to the errors, safe from names, honest about fits."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from drives import Circle, gnss_of, trajectory_of
from report.headless import Browser
from test_html import NASTY, Page

from vehnav.cli.main import cli
from vehnav.errors import ConfigError
from vehnav.evaluation import compare
from vehnav.export.formats import write_trajectory
from vehnav.export.load import Track, as_trajectory
from vehnav.report.comparison import Comparison, comparison, comparison_map, comparison_panels
from vehnav.report.comparison_page import figure, headline, remark, render_comparison
from vehnav.report.plots import write_comparison_plots

Move = Callable[[np.ndarray], np.ndarray]

MADE = "vehnav compare a.csv b.csv gps.csv --html all.html"
DRAWN_M = 0.25
"""m: tracks are thinned to 0.2 m and drawn on tenths of a metre."""


def _moved(east: float, north: float) -> Move:
    return lambda enu: enu + np.array([east, north, 0.0])


def _turned(degrees: float) -> Move:
    a = np.radians(degrees)
    turn = np.array([[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    return lambda enu: enu @ turn.T


def made(moves: dict[str, Move], *, align: str = "none", end: float = 120.0) -> Comparison:
    """Trajectories on a circle, moved, against the fixes of the circle at 1 Hz for two minutes."""
    circle = Circle()
    t, at = np.arange(0.0, end + 0.005, 0.02), np.arange(0.0, 120.5)
    gnss = gnss_of(at, circle.enu(at))
    judge = Track("gps.csv", as_trajectory(gnss), gnss)
    tracks, results = [], []
    for path, move in moves.items():
        track = trajectory_of(t, move(circle.enu(t)), circle.v(t), circle.heading(t))
        tracks.append(Track(path, track))
        results.append(compare(track, gnss, align=align))
    return comparison([*tracks, judge], results)


THREE = {"a.csv": _moved(3.0, 4.0), "b.csv": _moved(-6.0, 8.0), "c.csv": _moved(3e3, -4e3)}


@pytest.fixture(scope="module")
def three() -> Comparison:
    return made(THREE)


def test_the_curves_are_the_errors_that_were_put_in(three: Comparison) -> None:
    panels = {panel.key: panel for panel in comparison_panels(three)}
    for key in ("error", "error-distance"):
        found = {c.name: c for c in panels[key].curves}
        for name, size in (("a.csv", 5.0), ("b.csv", 10.0), ("c.csv", 5000.0)):
            values = np.concatenate([y for _, y in found[name].parts])
            np.testing.assert_allclose(values, size, rtol=1e-3)  # the plane is tangent 5 km away
    x, _ = panels["error-distance"].curves[0].parts[0]
    # Chords of 10 m on a circle of 100 m: 2 R sin(0.05) each.
    assert x[-1] == pytest.approx(120 * 200.0 * np.sin(0.05), rel=1e-3)
    assert len({c.role for c in panels["error"].curves}) == 3


def test_what_runs_away_does_not_flatten_the_others(three: Comparison) -> None:
    (error, *_) = comparison_panels(three)
    assert 10.0 < error.y_range[1] < 100.0
    assert error.note == "c.csv leaves the picture at 0 s and reaches 5000 m"
    place = comparison_map(three)
    assert place.box[2] - place.box[0] < 1000.0
    assert place.note == "c.csv leaves the map: up to 5.00 km from GPS"


def test_the_tracks_on_the_map_are_where_they_were_put(three: Comparison) -> None:
    place = comparison_map(three)
    assert [track.name for track in place.tracks] == ["GPS", "c.csv", "b.csv", "a.csv"]
    circle = Circle()
    for track, move in ((place.tracks[3], THREE["a.csv"]), (place.tracks[0], _moved(0.0, 0.0))):
        for t, points in track.parts:
            np.testing.assert_allclose(points, move(circle.enu(t))[:, :2], atol=DRAWN_M)


def test_an_aligned_track_is_drawn_as_judged_and_said_in_red() -> None:
    item = made({"a.csv": _turned(20.0)}, align="yaw+translation")
    place = comparison_map(item)
    t, points = place.tracks[-1].parts[0]
    np.testing.assert_allclose(points, Circle().enu(t)[:, :2], atol=DRAWN_M)
    page = render_comparison(item, command=MADE)
    (red,) = re.findall(r'<p class="red">(.*?)</p>', page)
    assert "Aligned to GPS before judging (--align yaw+translation)" in red
    assert "turned −20.00°" in red
    assert "no longer dead reckoning" in red
    assert "Nothing was aligned" not in page


def test_nothing_aligned_is_said_and_nothing_is_red(three: Comparison) -> None:
    page = render_comparison(three, command=MADE)
    assert "Nothing was aligned" in Page(page).text
    assert 'class="red"' not in page
    assert MADE in Page(page).text


def test_the_nearest_is_named_unless_the_fixes_differ(three: Comparison) -> None:
    assert headline(three).startswith("a.csv is nearest to GPS: 5.0 m rms over 1.20 km; b.csv 10")
    page = render_comparison(three, command=MADE)
    row = page[page.index("horizontal, rms, m") :].split("</tr>")[0]
    assert re.findall(r"<b>(.*?)</b>", row) == ["5.00"]


def test_other_fixes_are_not_compared_in_silence() -> None:
    whole, half = made({"a.csv": _moved(1.0, 0.0)}), made({"b.csv": _moved(2.0, 0.0)}, end=60.0)
    entries = (*whole.entries, *half.entries)
    item = Comparison(
        entries, whole.reference, whole.path, whole.against, (), whole.start_ns, whole.unix_clock
    )
    assert "not judged by the same fixes" in remark(item)
    assert '<td class="r"><b>' not in render_comparison(item, command=MADE)


def test_names_with_markup_are_text() -> None:
    page = render_comparison(made({NASTY: _moved(1.0, 0.0)}), command=f"vehnav compare {NASTY}")
    found = Page(page)
    assert not found.named("img")
    assert page.count("<script>") == 1
    assert "\\u202e" in found.text
    assert "://" not in page


def test_more_than_the_colours_is_refused(three: Comparison) -> None:
    entry = three.entries[0]
    track = Track("a.csv", entry.trajectory)
    with pytest.raises(ConfigError, match="9 trajectories in one picture"):
        comparison([track] * 10, [entry.errors] * 9)


def test_figures_have_three_digits_up_to_the_next_power() -> None:
    assert [figure(x) for x in (9.994, 9.996, 99.96, 0.0004)] == ["9.99", "10.0", "100", "0"]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder, circle = tmp_path_factory.mktemp("files"), Circle()
    t = np.arange(0.0, 60.005, 0.02)
    for name, move in (("a", _moved(3.0, 4.0)), ("b", _moved(0.0, 9.0)), ("gps", _moved(0.0, 0.0))):
        track = trajectory_of(t, move(circle.enu(t)), circle.v(t), circle.heading(t))
        write_trajectory(track, folder / f"{name}.csv")
    return [str(folder / f"{name}.csv") for name in ("a", "b", "gps")]


def test_the_command_writes_page_and_figures(files: list[str], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    page, plots = tmp_path / "all.html", tmp_path / "plots"
    words = ["compare", *files, "--html", str(page), "--plots", str(plots), "--max", "cep95_m=7"]
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 1, result.stderr
    found = Page(page.read_text(encoding="utf-8"))
    assert found.named("figure", id="map")
    assert found.named("p", **{"class": "red"})  # the missed bar
    assert "against the reference" in found.text
    names = {"map", "overview", "error", "error-distance", "error-along", "error-cross", "error-up"}
    assert {path.name for path in plots.iterdir()} == {
        f"{n}.{s}" for n in names for s in ("png", "pdf")
    }


def test_figures_name_every_trajectory(three: Comparison, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    (path,) = write_comparison_plots(three, tmp_path, formats=("svg",), names=["error"])
    text = path.read_text(encoding="utf-8")
    assert all(f">{name}<" in text for name in THREE)


def test_in_a_browser_the_cursor_names_every_error(
    browser: Browser, three: Comparison, tmp_path: Path
) -> None:
    path = tmp_path / "all.html"
    path.write_text(render_comparison(three, command=MADE), encoding="utf-8")
    browser.complaints.clear()
    for width, dark in ((1366, False), (390, True)):
        browser.open(path, width=width, dark=dark)
        box = browser.box("#error .plot")
        browser.point(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        said = browser.run("document.querySelector('.readout').textContent")
        assert re.search(r"60\.\d s · a\.csv 5\.0+\sm · b\.csv 10\.0+\sm · c\.csv", said), said
        assert browser.run("document.documentElement.scrollWidth") <= width
        dots = "[...document.querySelectorAll('.map .dot')].map(d => d.style.display)"
        assert browser.run(dots) == ["block"] * 4
        browser.run("document.querySelector('input[data-role=free]').click()")
        hidden = "document.querySelector('.map path.c-free').classList.contains('hidden')"
        assert browser.run(hidden)
    assert browser.complaints == []


def test_long_names_stay_inside_a_phone(browser: Browser, tmp_path: Path) -> None:
    names = [f"{k * 30}.csv" for k in ("drive_", "w" * 4, "a b ")]
    item = made({name: _moved(5.0 * k, 0.0) for k, name in enumerate(names)})
    path = tmp_path / "all.html"
    path.write_text(render_comparison(item, command="vehnav compare"), encoding="utf-8")
    assert all(name in Page(path.read_text(encoding="utf-8")).text for name in names)
    browser.open(path, width=390)
    assert browser.run("document.documentElement.scrollWidth") <= 390
