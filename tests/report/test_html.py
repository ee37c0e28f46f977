"""The page: self-contained, true to the run, and safe from what a log may hold."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyproj import Geod

from vehnav.config import Config
from vehnav.errors import Finding
from vehnav.pipeline import Run, run
from vehnav.report.document import document
from vehnav.report.html import render_html, write_html
from vehnav.report.markup import esc
from vehnav.report.sections import command_line
from vehnav.report.svg import HEIGHT, WIDTH, group_label

VOID = {"meta", "link", "input", "br", "img", "hr", "wbr"}
NASTY = "<img src=x onerror=alert(1)>\"'&</script><!--" + chr(0x202E)


class Page(HTMLParser):
    """Elements and text of a page; fails where tags do not close."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"closes nothing: {tag}"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data

    def named(self, tag: str, **attributes: str) -> list[dict[str, str]]:
        """Attributes of the elements with this tag and these attributes."""
        return [
            found
            for name, found in self.elements
            if name == tag and all(found.get(k) == v for k, v in attributes.items())
        ]


@pytest.fixture(scope="module")
def page(city: Run, city_document: dict[str, Any]) -> str:
    return render_html(city, city_document)


def test_nothing_is_loaded_from_anywhere(page: str) -> None:
    assert "://" not in page
    found = Page(page)
    for tag, attributes in found.elements:
        assert tag not in {"img", "iframe", "object", "embed", "base", "form"}
        assert "src" not in attributes
        for name in ("href", "xlink:href", "action"):
            assert attributes.get(name, "#")[:1] == "#" or attributes[name] == "data:,"
    assert "url(" not in page
    assert "@import" not in page


def test_the_policy_admits_the_script_of_the_page_and_no_other(page: str) -> None:
    (policy,) = Page(page).named("meta", **{"http-equiv": "Content-Security-Policy"})
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    rules = dict(rule.strip().split(" ", 1) for rule in policy["content"].split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["script-src"] == f"'sha256-{digest}'"


def _values(found: Page, page: str, panel: str, role: str) -> list[tuple[float, float]]:
    """(x, y) of a curve, read back from its drawing."""
    (figure,) = found.named("figure", id=panel)
    x0, x1, y0, y1 = (float(figure[f"data-{k}"]) for k in ("x0", "x1", "y0", "y1"))
    part = page[page.index(f'id="{panel}"') :]
    (d,) = re.findall(rf'<path class="curve c-{role}" d="([^"]*)"', part.split("</figure>")[0])
    pairs = [pair.split() for pair in re.split("[ML]", d) if pair]
    return [
        (
            x0 + float(x) / WIDTH * (x1 - x0),
            y0 + (1.0 - float(y) / HEIGHT) * (y1 - y0),
        )
        for x, y in pairs
    ]


def test_the_error_curve_is_the_error(page: str, city: Run) -> None:
    assert city.errors is not None
    drawn = np.array(_values(Page(page), page, "error", "ours"))
    t = (city.errors.t_ns - city.start_ns) * 1e-9
    assert drawn[:, 1].max() == pytest.approx(city.errors.horizontal.max(), abs=0.02)
    assert drawn[-1] == pytest.approx([t[-1], city.errors.horizontal[-1]], abs=0.03)


def test_the_free_solution_is_drawn_beyond_the_picture_at_its_value(page: str, city: Run) -> None:
    drawn = np.array(_values(Page(page), page, "east-velocity", "free"))
    free = city.variants["free"].v_n[:, 0]
    assert drawn[:, 1].max() == pytest.approx(free.max(), abs=0.02)
    assert drawn[:, 1].min() == pytest.approx(free.min(), abs=0.02)


def test_the_map_is_true_to_scale(page: str, city: Run) -> None:
    part = page[page.index('id="map"') :].split("</figure>")[0]
    (d,) = re.findall(r'<path class="curve c-ours" data-t="[^"]*" d="([^"]*)"', part)
    points = np.array([pair.split() for pair in re.split("[ML]", d) if pair], float) / 10.0
    east, north = points[-1] - points[0]
    deg = np.degrees
    track = city.trajectory
    azimuth, _, distance = Geod(ellps="WGS84").inv(
        deg(track.lon[0]), deg(track.lat[0]), deg(track.lon[-1]), deg(track.lat[-1])
    )
    # drawn in decimetres in the tangent plane 149 m above the ellipsoid: 2e-5 of the distance
    assert np.hypot(east, north) == pytest.approx(distance, abs=0.25)
    assert deg(np.arctan2(east, -north)) == pytest.approx(azimuth, abs=0.05)
    width = float(re.search(r'viewBox="0 0 (\d+) ', part)[1]) / 10.0  # type: ignore[index]
    bar = re.search(r'class="scale [\w-]+" style="width:([\d.]+)%">(\d+) m<', part)
    assert bar is not None
    assert float(bar[1]) / 100.0 * width == pytest.approx(float(bar[2]), rel=1e-3)


def test_the_answer_and_the_tables_say_what_the_document_says(
    page: str, city: Run, city_document: dict[str, Any]
) -> None:
    text = Page(page).text
    end = city_document["errors"]["horizontal_m"]["end"]
    percent = city_document["errors"]["percent_of_distance"]["end"]
    assert f"Ended {end:.1f}\u00a0m ({percent:.1f}\u00a0%) from GPS" in text
    for stop in city_document["stops"]:
        for value in (f"{stop['start_s']:.1f}", f"{stop['tilt_corrected_deg']:.3f}"):
            assert value in text
    for finding in city_document["input"]["findings"]:
        assert finding["text"] in text
    assert city_document["input"]["sha256"] in text
    assert f"up to {city_document['gps']['used_until_s']:.1f} s" in text


def test_names_from_a_log_appear_as_text(city: Run, city_document: dict[str, Any]) -> None:
    assert city.log.imu is not None
    assert city.log.gnss is not None
    log = dataclasses.replace(
        city.log,
        path=f"/nowhere/{NASTY}.mcap",
        imu=dataclasses.replace(city.log.imu, source=NASTY, frame_id=NASTY),
        gnss=dataclasses.replace(city.log.gnss, source=NASTY),
    )
    nasty = Finding("gap", "warning", f"topic {NASTY}: a gap")
    bad = dataclasses.replace(city, log=log, findings=(*city.findings, nasty))
    calm = dataclasses.replace(
        city, findings=(*city.findings, dataclasses.replace(nasty, text="calm"))
    )
    found = Page(render_html(bad, document(bad)))
    expected = Page(render_html(calm, document(calm)))
    assert [tag for tag, _ in found.elements] == [tag for tag, _ in expected.elements]
    shown = NASTY.replace(chr(0x202E), "\\u202e")
    assert found.text.count(shown) >= 5  # name, IMU, frame, GPS, finding
    assert not any(key.startswith("on") for _, names in found.elements for key in names)


def test_a_file_name_that_is_no_text_is_still_written(city: Run, tmp_path: Path) -> None:
    log = dataclasses.replace(city.log, path="/nowhere/drive-\udcff.mcap")
    strange = dataclasses.replace(city, log=log)
    write_html(strange, document(strange), tmp_path / "report.html")
    assert "drive-\\udcff.mcap" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_written_whole_under_its_name_only(
    city: Run, city_document: dict[str, Any], page: str, tmp_path: Path
) -> None:
    write_html(city, city_document, tmp_path / "report.html")
    assert [item.name for item in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page


def test_a_local_track_without_gps_has_a_page(city: Run) -> None:
    local = run(city.log, Config(gps="none"))
    found = Page(render_html(local, document(local)))
    assert local.errors is None
    assert "in a local frame: not compared with GPS" in found.text
    assert "Expected horizontal error" in found.text
    assert "Methods compared" not in found.text
    assert "north is not known" in found.text
    assert not found.named("span", title="north is up")
    assert not [e for e in found.named("path") if "c-gps" in e.get("class", "") and "data-t" in e]


def test_a_log_without_gps_or_findings_has_a_page(city: Run) -> None:
    log = dataclasses.replace(city.log, gnss=None, findings=())
    config = Config(start_position=(55.75, 37.62, 150.0), start_heading=30.0)
    alone = dataclasses.replace(run(log, config), findings=())
    found = Page(render_html(alone, document(alone)))
    assert "the log has no GPS to compare with" in found.text
    assert "Nothing was found." in found.text


@pytest.mark.parametrize("fixes", ["one", "other day"])
def test_gps_that_shows_nothing_has_a_page(city: Run, fixes: str) -> None:
    gnss = city.log.gnss
    assert gnss is not None
    if fixes == "one":
        gnss = dataclasses.replace(
            gnss, t_ns=gnss.t_ns[9:10], lat=gnss.lat[9:10], lon=gnss.lon[9:10],
            height=gnss.height[9:10], v_n=None, sigma_pos=None, sigma_vel=None,
        )  # fmt: skip
    else:
        gnss = dataclasses.replace(gnss, t_ns=gnss.t_ns + 86_400 * 10**9)
    empty = dataclasses.replace(
        city, log=dataclasses.replace(city.log, gnss=gnss), errors=None, method_errors={}
    )
    assert "no fix is left to compare with" in Page(render_html(empty, document(empty))).text


def test_a_drive_without_stops_has_a_page(city: Run) -> None:
    config = Config(start=45.0, end=70.0, start_attitude=(30.0, 0.0, 0.0))
    found = Page(render_html(moving := run(city.log, config), document(moving)))
    assert "No stop was found." in found.text


def test_a_long_drive_stays_small(city: Run) -> None:
    """An hour and a quarter at 100 Hz, never straight: a third of the 5 MB that a page may have."""
    n = 450_000
    rng = np.random.default_rng(3)
    track = city.trajectory
    v = np.zeros((n, 3))
    v[:, :2] = np.cumsum(rng.normal(size=(n, 2)), axis=0) * 0.02
    place = np.cumsum(v[:, :2], axis=0) * 0.01 / 6.37e6
    long = dataclasses.replace(
        track,
        t_ns=track.t_ns[0] + np.arange(n, dtype=np.int64) * 10_000_000,
        lat=track.lat[0] + place[:, 1],
        lon=track.lon[0] + place[:, 0],
        height=np.full(n, track.height[0]),
        v_n=v,
        c_nb=np.broadcast_to(track.c_nb[0], (n, 3, 3)),
        stopped=np.zeros(n, bool),
        sigma_pos=None,
        sigma_heading=None,
    )
    drive = dataclasses.replace(city, trajectory=long)
    assert len(render_html(drive, document(drive)).encode()) < 1.5e6


def test_the_command_repeats_the_run() -> None:
    config = Config(
        axes="FRD", mount=(0.5, -1.0, 0.0), reset=False, as_published=True, gps="none",
        start_position=(42.1, -71.2, 3.0), stop_statistic="rms", causal=True,
    )  # fmt: skip
    assert command_line("my log.mcap", config) == (
        "vehnav run 'my log.mcap' --axes FRD --mount 0.5,-1,0 --as-published --no-reset --causal "
        "--stop-statistic rms --gps none --start-position 42.1,-71.2,3"
    )


def test_stops_at_one_place_share_a_mark() -> None:
    assert group_label([9, 2, 1, 3]) == "1–3,9"


def test_escaping_is_complete() -> None:
    assert esc("a\x00b\u2028c") == "a\\u0000b\\u2028c"
    assert esc("Größe 漢字 m²") == "Größe 漢字 m²"


def test_every_flag_of_the_command_is_an_option_of_run() -> None:
    from vehnav.cli.run import run as command

    known = {flag for param in command.params for flag in (*param.opts, *param.secondary_opts)}
    other: dict[str, Any] = {
        "axes": "FRD", "accel_axes": "BRD", "mount": (1.0, 2.0, 3.0), "start": 1.0, "end": 9.0,
        "max_gap": 0.2, "split": True, "method": "free", "as_published": True,
        "levelling": False, "reset": False, "causal": True, "vertical": "free",
        "ellipsoid": "krasovsky", "levelling_rate": 0.5, "stop_threshold": 0.4,
        "stop_statistic": "rms", "stop_window": 1.0, "stop_dwell": 3.0, "gps": "none",
        "gps_start_seconds": 30.0, "start_position": (1.0, 2.0, 3.0), "start_heading": 4.0,
        "start_attitude": (1.0, 2.0, 3.0),
    }  # fmt: skip
    words = command_line("a.mcap", Config(**other)).split()
    flags = {word for word in words if word.startswith("--")}
    assert flags <= known
    assert len(flags) == len(other)
