"""The page of a suite, as text and in a real browser."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from batch_for_tests import MAX, broken, many, ok, suite
from report.headless import Browser

from vehnav.batch import index_table
from vehnav.batch.baseline import baseline_of
from vehnav.batch.distribution import Axis, Series, shares_figure
from vehnav.batch.index import render_index, write_index
from vehnav.batch.model import BarResult, Result, Results
from vehnav.batch.regression import compare_with
from vehnav.batch.wording import worst_first

WIDTH, HEIGHT = 10000, 4000
EVIL = "<script>alert(1)</script>\"'&\x1b\u202e日 \ud800"


class Page(HTMLParser):
    """Rows of the table of logs as texts, links, tags, text."""

    VOID = frozenset({"meta", "link", "input", "br", "wbr", "path", "rect"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.links: list[str] = []
        self.scripts = 0
        self.text = ""
        self.open: list[str] = []
        self._table = ""
        self._cell = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs) -> None:
        named = dict(attrs)
        if tag not in self.VOID:
            self.open.append(tag)
        self.scripts += tag == "script"
        if tag == "table":
            self._table = named.get("id", "")
        if self._table == "list":
            if tag == "tr":
                self.rows.append([])
            if tag == "td":
                self.rows[-1].append("")
                self._cell = True
        if tag == "a" and named.get("href"):
            self.links.append(named["href"])

    def handle_endtag(self, tag: str) -> None:
        if tag in self.VOID:
            return
        assert self.open.pop() == tag
        if tag == "td":
            self._cell = False
        if tag == "table":
            self._table = ""

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "script"):
            self.text += data
        if self._cell:
            self.rows[-1][-1] += data


def fleet(count: int = 60, configs: tuple[str, ...] = ("default", "filter")) -> Results:
    rows = list(many(count, configs=configs, seed=2, spread=0.1).results)
    rows[5] = broken(rows[5].log, group=rows[5].group, config=rows[5].config)
    rows[9] = ok(rows[9].log, 600.0, group=rows[9].group, config=rows[9].config)
    return suite(rows)


@pytest.fixture(scope="module")
def rendered() -> str:
    before = baseline_of(many(60, configs=("default", "filter")))
    return render_index(fleet(), comparison=compare_with(before, fleet(), max_regression=0.05))


def test_all_logs_the_worst_first_with_links(rendered: str) -> None:
    page = Page(rendered)
    order = worst_first(fleet().results)
    assert page.open == []
    assert [row[1] for row in page.rows[1:]] == [r.log for r in order]
    assert page.rows[1][0] == "crash"
    assert page.rows[2][:3] == ["missed", order[1].log, "600"]
    assert page.rows[1][-1] == "crashed: killed by SIGKILL"
    reports = [link for link in page.links if "report.html" in link]
    assert reports == [r.report for r in order if r.report]


def test_headline_and_gate(rendered: str) -> None:
    text = Page(rendered).text
    count = sum(r.passed for r in fleet().results)
    assert f"60 logs with 2 configurations: {count} of 120 passed" in text
    assert re.search(r"\d+ regressions? against", text)
    assert "crashed; in the baseline it ran" in text


def test_every_log_says_how_it_moved() -> None:
    before = suite([*(ok(name, 10.0) for name in "abcd"), ok("no-gps", None)])
    now = suite(
        [ok("a", 12.0), ok("b", 10.0), broken("c"), ok("d", None), ok("e", 1.0), ok("no-gps", None)]
    )
    comparison = compare_with(baseline_of(before), now, max_regression=0.05)
    page = Page(render_index(now, comparison=comparison))
    assert {row[1]: row[3] for row in page.rows[1:]} == {
        "a": "20.0 % worse",
        "b": "the same",
        "c": "it ran",
        "d": "figure gone",
        "e": "new",
        "no-gps": "",
    }


def test_self_contained(rendered: str) -> None:
    assert not re.search(r"""(src|href)=["'](https?:)?//""", rendered)
    assert "@import" not in rendered
    script = re.search(r"<script>(.*)</script>", rendered, re.DOTALL).group(1)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in rendered
    assert Page(rendered).scripts == 1


def test_names_of_any_kind_stay_text() -> None:
    row = ok(EVIL, 80.0, group=EVIL, config=EVIL)
    odd = Result(**{**vars(row), "report": "logs/a b/#1?/100%/report.html"})
    text = render_index(suite([odd, broken("x", error=EVIL), ok("y", 1.0)], EVIL), command=EVIL)
    page = Page(text)
    assert page.scripts == 1
    shown = EVIL.replace("\x1b", r"\u001b").replace("\u202e", r"\u202e")
    shown = shown.replace("\ud800", r"\ud800")
    assert page.rows[2][1] == shown
    assert page.links[0] == "logs/a%20b/%231%3F/100%25/report.html"
    text.encode()  # no lone surrogate is left


def test_whatever_there_is_it_renders() -> None:
    nothing = render_index(suite([]))
    assert "No logs" in Page(nothing).text
    for rows in ([broken("a")], [ok("a", None)], [ok("a", 0.0)], [ok("a", 1e-9), ok("b", 1e9)]):
        comparison = compare_with(baseline_of(suite(rows)), suite(rows), max_regression=0.05)
        page = Page(render_index(suite(rows), comparison=comparison))
        assert page.open == []
        assert len(page.rows) == 1 + len(rows)
        assert "nan" not in page.text.lower().replace("vehnav", "")


def test_many_rows_are_cut_and_said(monkeypatch) -> None:
    monkeypatch.setattr(index_table, "ROWS", 100)
    page = Page(render_index(many(140)))
    assert len(page.rows) == 1 + 100
    assert "40 more, which are not worse, are in results.json" in page.text


def test_written_whole(tmp_path) -> None:
    write_index(fleet(), tmp_path / "index.html")
    assert [p.name for p in tmp_path.iterdir()] == ["index.html"]


# ---- the picture -------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 7, 300, 5000])
def test_the_staircase_is_the_share_of_the_logs(n: int) -> None:
    """At any value: how many of the logs are at most that, counted anew."""
    x = np.exp(np.random.default_rng(n).standard_normal(n)) * 20.0
    text = shares_figure(MAX, [Series("c", "ours", x, np.empty(0))], least=0.01, key="k")
    low, high = (float(re.search(rf'data-{k}="([^"]+)"', text).group(1)) for k in ("low", "high"))
    assert low <= x.min()
    assert x.max() <= high
    d = re.search(r'class="curve now c-ours" d="M0 4000([^"]*)H10000"', text).group(1)
    steps = np.array([part.split("V") for part in d.split("H")[1:]], float)
    values = low * (high / low) ** (steps[:, 0] / WIDTH)
    drawn = 1.0 - steps[:, 1] / HEIGHT
    for probe in np.quantile(x, [0.0, 0.1, 0.5, 0.9, 1.0]) * 1.002:
        share = float(np.mean(x <= probe))
        found = drawn[np.searchsorted(values, probe) - 1]
        assert abs(found - share) <= max(2.0 / n, 0.005) if n > 400 else 1e-3 + 0.5 / HEIGHT
    assert drawn[-1] == 1.0


@pytest.mark.parametrize("count", [2, 3, 5])
def test_lines_that_coincide_are_all_seen(count: int) -> None:
    """Along the way each is on top for the same length; a line of its own is not interrupted."""
    x = np.exp(np.random.default_rng(3).standard_normal(30)) * 20.0
    nearly = [x * (1.0 + 1e-4 * k) for k in range(count)]
    series = [Series(f"{k}", f"r{k}", row, np.empty(0)) for k, row in enumerate(nearly)]
    series.insert(1, Series("other", "other", 1.5 * x, np.empty(0)))
    text = shares_figure(MAX, series, least=0.01, key="k")
    drawn = dict(re.findall(r'class="curve now c-(\w+)"( style="[^"]*")? d', text))
    assert drawn["other"] == drawn["r0"] == ""
    on_top = []
    for at in range(60 * count):  # pixels along the path, whole periods
        for k in reversed(range(count)):
            dash, gap = map(int, re.findall(r"\d+", drawn[f"r{k}"]) or (1, 0))
            if at % (dash + gap) < dash:
                on_top.append(k)
                break
    assert [on_top.count(k) for k in range(count)] == [60] * count
    assert text.count('class="points') == 2  # dots lie on each other, too: those of the first


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [([1.0], 1.0, 10.0), ([0.3, 44.0], 0.2, 50.0), ([0.0, 5.0], 0.01, 5.0), ([], 0.01, 0.1)],
)
def test_axis_has_round_ends(values, low: float, high: float) -> None:
    axis = Axis.of(values, least=0.01)
    assert (axis.low, axis.high) == (low, high)
    assert axis.share([low, (low * high) ** 0.5, high]) == pytest.approx([0.0, 0.5, 1.0])
    assert 2 <= len(axis.ticks()) <= 15
    assert all(low * 0.999 <= t <= high * 1.001 for t in axis.ticks())


def test_an_axis_of_very_different_logs_keeps_the_large_ones() -> None:
    axis = Axis.of([1e-2, 1e9], least=0.01)
    assert axis.high == 1e9
    assert axis.low == 1e3


def test_bars_are_drawn_where_they_are() -> None:
    text = render_index(suite([ok("a", 10.0), ok("b", 20.0)]))
    low, high = (float(re.search(rf'data-{k}="([^"]+)"', text).group(1)) for k in ("low", "high"))
    x = int(re.search(r'class="limit" d="M(\d+) 0', text).group(1))
    assert low * (high / low) ** (x / WIDTH) == pytest.approx(50.0, rel=2e-3)


def test_bars_have_the_colour_of_their_configuration_unless_for_all() -> None:
    def rows(limits: dict[str, float]) -> list[Result]:
        return [ok("a", 10.0, config=name, limit=limit) for name, limit in limits.items()]

    both = render_index(suite(rows({"x": 30.0, "y": 30.0})))
    assert re.findall(r'class="(limit[^"]*)" d="M\d+ 0V', both) == ["limit"]
    each = render_index(suite(rows({"x": 20.0, "y": 30.0})))
    assert re.findall(r'class="(limit[^"]*)" d="M\d+ 0V', each) == [
        "limit k-ours",
        "limit k-free",
    ]
    # a bar for every group, or far beyond all errors, would hide the curves
    many_bars = suite(ok(f"{k}", 10.0, limit=20.0 + k) for k in range(9))
    assert 'class="limit' not in render_index(many_bars)
    assert 'class="limit' not in render_index(suite([ok("a", 10.0, limit=5000.0)]))


def test_one_value_for_all_logs_is_no_picture() -> None:
    rows = []
    for k in range(3):
        row = ok(f"{k}", 10.0 + k, more={"stops.count": 3.0})
        bars = (*row.bars, BarResult.of("stops.count", "min", 2.0, 3.0))
        rows.append(Result(**{**vars(row), "bars": bars}))
    assert render_index(suite(rows)).count('<figure class="panel shares') == 1


def test_a_figure_with_a_bar_gets_a_picture_of_its_own() -> None:
    rows = []
    for k in range(5):
        row = ok(f"{k}", 10.0 + k, more={"errors.heading_deg.rms": 1.0 + k})
        bar = BarResult.of("errors.heading_deg.rms", "max", 3.0, 1.0 + k)
        rows.append(Result(**{**vars(row), "bars": (*row.bars, bar)}))
    text = render_index(suite(rows))
    assert re.findall(r'<figure class="panel shares" id="([^"]*)"', text) == [
        "shares-0",
        "shares-1",
    ]


def test_the_worst_of_a_score_is_the_smallest() -> None:
    """Nine scores of 0.9 and one of 0.1, held from below."""
    rows = []
    for k in range(10):
        value = 0.1 if k == 3 else 0.9
        row = ok(f"{k}", None, more={"stops.f1": value})
        bars = (BarResult.of("stops.f1", "min", 0.5, value),)
        rows.append(Result(**{**vars(row), "bars": bars}))
    text = Page(render_index(suite(rows))).text
    assert "90 % are over0.820" in text  # linear between the two smallest
    assert "median log0.900" in text
    assert "100.9000.8200.100" in text  # 10 logs: median, worst tenth, worst


# ---- in a browser ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def file(rendered: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("index") / "index.html"
    path.write_text(rendered, encoding="utf-8")
    return path


def shown(browser: Browser) -> list[list[str]]:
    """Texts of the rows that are not hidden."""
    return browser.run(
        "[...document.querySelectorAll('#list tbody tr:not([hidden])')]"
        ".map((row) => [...row.cells].map((cell) => cell.textContent))"
    )


def choose(browser: Browser, key: str, value: str) -> None:
    browser.run(
        f"(() => {{ const box = document.getElementById('{key}'); box.value = {value!r};"
        "box.dispatchEvent(new Event('input', {bubbles: true})); })()"
    )


@pytest.mark.parametrize("width", [390, 1366])
@pytest.mark.parametrize("dark", [False, True])
def test_quiet_offline_and_never_wider_than_the_window(
    browser: Browser, file: Path, width: int, dark: bool
) -> None:
    browser.complaints.clear()
    browser.loaded.clear()
    browser.open(file, width=width, height=800, dark=dark)
    assert browser.complaints == []
    assert {url for url in browser.loaded if url != "data:,"} == {file.as_uri()}
    assert browser.run("document.documentElement.scrollWidth") <= width


def test_sorts_and_filters(browser: Browser, file: Path) -> None:
    browser.open(file)
    assert len(shown(browser)) == 120
    head = "document.querySelectorAll('#list th button')[2]"
    browser.run(f"{head}.click()")
    figures = [float(row[2]) for row in shown(browser) if row[2] != "–"]
    assert figures == sorted(figures, reverse=True)
    browser.run(f"{head}.click()")
    rows = shown(browser)
    figures = [float(row[2]) for row in rows if row[2] != "–"]
    assert figures == sorted(figures)
    assert rows[-1][2] == "–"  # what has no figure stays at the end
    choose(browser, "state", "failed")
    assert {row[0] for row in shown(browser)} >= {"crash", "missed"}
    failed = len(shown(browser))
    assert failed < 120
    choose(browser, "state", "broken")
    assert [row[0] for row in shown(browser)] == ["crash"]
    choose(browser, "state", "")
    choose(browser, "config", "=filter")
    assert len(shown(browser)) == 60
    choose(browser, "group", "=highway")
    assert len(shown(browser)) == 20
    choose(browser, "find", "DRIVE_000")
    names = {row[1] for row in shown(browser)}
    assert names == {f"drive_000{k}.mcap" for k in (1, 4, 7)}
    assert browser.run("document.getElementById('count').textContent") == "3 of 120 rows"


def test_the_cursor_reads_shares(browser: Browser, file: Path) -> None:
    """Pointing at a value says the share of the logs under it, counted anew."""
    browser.open(file)
    box = browser.box(".shares .plot")
    browser.point(box["x"] + 0.5 * box["width"], box["y"] + 20)
    said = browser.run("document.querySelector('.shares .readout').textContent")
    value = float(re.fullmatch(r"of the logs are under ([\d.]+) m", said).group(1))
    told = browser.run("[...document.querySelectorAll('.shares output')].map((e) => e.textContent)")
    for config, text in zip(("default", "filter"), told, strict=True):
        found = [r.metrics.get(MAX) for r in fleet().results if r.config == config]
        under = [x <= value for x in found if x is not None]
        assert float(text.rstrip(" %")) == pytest.approx(100 * np.mean(under), abs=2.0)


def test_a_point_names_its_log_and_a_click_shows_it(browser: Browser, file: Path) -> None:
    browser.open(file)
    box = browser.box(".pairs .plot")
    low, high = browser.run(
        "['low', 'high'].map((k) => Number(document.querySelector('.pairs').dataset[k]))"
    )
    log = fleet().results[9].log
    before = next(
        r.metrics[MAX]
        for r in many(60, configs=("default", "filter")).results
        if r.name == fleet().results[9].name
    )
    x, y = np.log(np.array([before, 600.0]) / low) / np.log(high / low)
    browser.point(box["x"] + x * box["width"], box["y"] + (1.0 - y) * box["height"])
    said = browser.run("document.querySelector('.pairs .readout').textContent")
    assert said.startswith(f"{log}, ")
    assert said.endswith(" before, 600 m now")
    browser.run("document.querySelector('.pairs .plot').click()")
    assert {row[1] for row in shown(browser)} == {log}
