"""The page in a real browser: quiet console, nothing loaded, one cursor through all pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report.headless import Browser

from vehnav.pipeline import Run
from vehnav.report.html import write_html
from vehnav.report.mapping import map_of
from vehnav.trajectory import interpolate

PIXEL = 2.0
"""px: a mouse is on whole pixels, and lines are 1.5 px wide."""


@pytest.fixture(scope="module")
def page(
    city: Run, city_document: dict[str, Any], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_html(city, city_document, path)
    return path


@pytest.mark.parametrize("width", [390, 768, 1366])
@pytest.mark.parametrize("dark", [False, True])
def test_quiet_offline_and_never_wider_than_the_window(
    browser: Browser, page: Path, width: int, dark: bool
) -> None:
    browser.complaints.clear()
    browser.loaded.clear()
    browser.open(page, width=width, height=800, dark=dark)
    assert browser.complaints == []
    assert {url for url in browser.loaded if url != "data:,"} == {page.as_uri()}
    assert browser.run("document.documentElement.scrollWidth") <= width
    paper = browser.run("getComputedStyle(document.body).backgroundColor")
    brightness = sum(float(x) for x in paper.strip("rgb()").split(",")) / 3.0
    assert brightness < 60.0 if dark else brightness > 200.0


def _time(browser: Browser) -> float:
    return float(browser.run("document.documentElement.dataset.time"))


def _share(browser: Browser, query: str) -> list[float]:
    """Left and top of a mark, as shares of its parent."""
    return [
        float(x)
        for x in browser.run(
            f"(() => {{ const s = document.querySelector('{query}').style;"
            "return [parseFloat(s.left) / 100, parseFloat(s.top) / 100]; })()"
        )
    ]


def _on_map(city: Run, t: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Where the vehicle is on the map, as shares of its width and height."""
    west, south, east, north = map_of(city).box
    stamp = np.array([city.start_ns + round(t * 1e9)], np.int64)
    e, n, _ = interpolate(city.trajectory, stamp).enu(city.alignment.position)[0]
    return np.array([(e - west) / (east - west), (north - n) / (north - south)])


def test_hover_in_a_plot_shows_in_all_others_and_on_the_map(
    browser: Browser, page: Path, city: Run
) -> None:
    assert city.errors is not None
    browser.open(page)
    box = browser.box("#east-velocity .plot")
    browser.point(box["x"] + 0.7 * box["width"], box["y"] + 0.5 * box["height"])
    t = _time(browser)
    first, last = (city.trajectory.t_ns[[0, -1]] - city.start_ns) * 1e-9
    second = (last - first) / box["width"]  # s per px
    assert t == pytest.approx(first + 0.7 * (last - first), abs=PIXEL * second)
    for key in ("error", "speed", "heading", "tilt"):
        left = float(
            browser.run(f"parseFloat(document.querySelector('#{key} .cursor').style.left)")
        )
        assert left / 100.0 == pytest.approx((t - first) / (last - first), abs=1e-3)
    dot = _share(browser, ".map .dot.c-ours")
    assert dot == pytest.approx(_on_map(city, t), abs=1e-3)
    shown = float(browser.run("document.querySelector('#error .k-ours output').textContent"))
    judged = (city.errors.t_ns - city.start_ns) * 1e-9
    expected = float(np.interp(t, judged, city.errors.horizontal))
    assert shown == pytest.approx(expected, abs=0.3)  # drawn in 1/4000 of an axis, shown to 0.1 m
    distance = float(np.interp(t, judged, city.errors.distance))
    left = float(
        browser.run("parseFloat(document.querySelector('#error-distance .cursor').style.left)")
    )
    assert left / 100.0 == pytest.approx(distance / city.errors.distance[-1], abs=2e-3)


@pytest.mark.parametrize("leg", [0, 1, 2])
def test_hover_on_the_map_shows_in_the_plots(
    browser: Browser, page: Path, city: Run, leg: int
) -> None:
    browser.open(page)
    first, last = (city.trajectory.t_ns[[0, -1]] - city.start_ns) * 1e-9
    box = browser.box(".map .plot")
    # the place of the leg that is furthest from the marks of the stops, which lead to the stop
    times = np.linspace(city.stops[leg].end, city.stops[leg + 1].start, 50)
    marks = np.array([_on_map(city, 0.5 * (stop.start + stop.end)) for stop in city.stops])
    places = np.array([_on_map(city, t) for t in times])
    free = np.linalg.norm(places[:, None] - marks, axis=2).min(axis=1)
    assert free.max() * box["width"] > 15.0
    x, y = places[np.argmax(free)]
    browser.point(box["x"] + x * box["width"], box["y"] + y * box["height"])
    west, south, east, north = map_of(city).box
    pixel = (east - west) / box["width"]  # m
    there, here = _on_map(city, _time(browser)), np.array([x, y])
    off = float(np.hypot(*((there - here) * [east - west, north - south])))
    assert off < PIXEL * pixel
    left = float(browser.run("parseFloat(document.querySelector('#speed .cursor').style.left)"))
    assert left / 100.0 == pytest.approx((_time(browser) - first) / (last - first), abs=1e-3)


def test_hover_over_the_distance_goes_to_its_time(browser: Browser, page: Path, city: Run) -> None:
    assert city.errors is not None
    browser.open(page)
    box = browser.box("#error-distance .plot")
    browser.point(box["x"] + 0.4 * box["width"], box["y"] + 10.0)
    judged = (city.errors.t_ns - city.start_ns) * 1e-9
    driven = float(np.interp(_time(browser), judged, city.errors.distance))
    metre = city.errors.distance[-1] / box["width"]
    assert driven == pytest.approx(0.4 * city.errors.distance[-1], abs=PIXEL * metre)


def test_keys_move_the_cursor(browser: Browser, page: Path, city: Run) -> None:
    browser.open(page)
    box = browser.box("#speed .plot")
    browser.point(box["x"] + 0.5 * box["width"], box["y"] + 20.0)
    before = _time(browser)
    browser.run("document.querySelector('#speed .plot').focus()")
    browser.press("ArrowRight")
    first, last = (city.trajectory.t_ns[[0, -1]] - city.start_ns) * 1e-9
    assert _time(browser) - before == pytest.approx((last - first) / 200.0, abs=2e-3)


def test_tracks_can_be_shown_and_hidden(browser: Browser, page: Path) -> None:
    browser.open(page)
    seen = "getComputedStyle(document.querySelector('.map path.c-published')).display"
    assert browser.run(seen) == "none"
    browser.run("document.querySelector('input[data-role=published]').click()")
    assert browser.run(seen) != "none"


def test_zoom_keeps_scale_marks_and_cursor_in_place(
    browser: Browser, page: Path, city: Run
) -> None:
    browser.open(page)
    first, last = (city.trajectory.t_ns[[0, -1]] - city.start_ns) * 1e-9
    stop = city.stops[1]
    middle = 0.5 * (stop.start + stop.end)
    box = browser.box("#speed .plot")
    browser.point(box["x"] + (middle - first) / (last - first) * box["width"], box["y"] + 20.0)
    for _ in range(3):  # about the vehicle, which stands at the stop
        browser.run("document.querySelector('[data-zoom=\"2\"]').click()")
    west, _, east, _ = map_of(city).box
    size = "document.querySelector('.map svg').viewBox.baseVal.width / 10"
    width = float(browser.run(size))
    assert width == pytest.approx((east - west) / 8.0, rel=1e-3)
    text = str(browser.run("document.querySelector('.scale').textContent"))
    plot, scale = browser.box(".map .plot"), browser.box(".scale")
    assert scale["y"] > plot["y"] + 0.8 * plot["height"]
    assert scale["y"] + scale["height"] < plot["y"] + plot["height"]
    bar = "parseFloat(document.querySelector('.scale').style.width) / 100"
    assert text.endswith(" m")
    assert float(browser.run(bar)) * width == pytest.approx(float(text[:-2]), rel=1e-3)
    mark = _share(browser, f'.map .mark[data-at="{middle:.2f}"]')
    assert _share(browser, ".map .dot.c-ours") == pytest.approx(mark, abs=0.005)
    assert all(0.0 < x < 1.0 for x in mark)
    for _ in range(5):
        browser.run("document.querySelector('[data-zoom=\"0.5\"]').click()")
    assert float(browser.run(size)) == pytest.approx(east - west, abs=0.1)
    assert browser.complaints == []


@pytest.mark.parametrize("width", [390, 1366])
def test_the_page_does_not_jump_when_values_appear(
    browser: Browser, page: Path, width: int
) -> None:
    browser.open(page, width=width)
    tops = "[...document.querySelectorAll('figure')].map(f => f.getBoundingClientRect().top)"
    box = browser.box("#speed .plot")
    before = browser.run(tops)
    browser.point(box["x"] + 0.6 * box["width"], box["y"] + 20.0)
    assert browser.run("document.querySelector('#speed output').textContent") != ""
    assert browser.run(tops) == before
