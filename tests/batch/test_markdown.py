"""The job summary, read back by an independent Markdown parser."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest
from batch_for_tests import MAX, broken, many, ok, suite
from markdown_it import MarkdownIt

from vehnav.batch.baseline import baseline_of
from vehnav.batch.markdown import append_step_summary, markdown, write_markdown
from vehnav.batch.model import Results
from vehnav.batch.regression import Comparison, compare_with

MIB = 1024 * 1024
EVIL = r"""a|b\|c_d_ *e* `f` [g](http://h) <i>j</i> &amp; $k$ ~~l~~ @octocat www.m.n # o \ """


class Cells(HTMLParser):
    """Tables of a page as lists of rows of texts; what else there is as tags."""

    def __init__(self) -> None:
        super().__init__()
        self.tables: list[list[list[str]]] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self._in_cell = False

    def handle_starttag(self, tag: str, attrs) -> None:
        self.tags.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
            self._in_cell = True
        elif tag == "a":
            self.links.append(dict(attrs)["href"])

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self._in_cell = False

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._in_cell:
            self.tables[-1][-1][-1] += data


def read(text: str) -> Cells:
    page = Cells()
    page.feed(MarkdownIt("commonmark").enable("table").render(text))
    return page


def compared(before: Results, now: Results, limit: float | None = 0.05) -> Comparison:
    return compare_with(baseline_of(before), now, max_regression=limit)


def test_the_worst_stands_first_and_says_why() -> None:
    rows = [ok("fine.mcap", 5.0), ok("far.mcap", 80.0), broken("dead.mcap"), ok("best.mcap", 1.0)]
    page = read(markdown(suite(rows), base=""))
    assert page.text.startswith("fleet: failed")
    assert "4 logs: 2 of 4 passed, 1 missed a bar, 1 crashed." in page.text
    (table,) = page.tables
    assert table[0] == ["log", "group", MAX, "bars", "report"]
    assert [row[0] for row in table[1:]] == ["dead.mcap", "far.mcap", "fine.mcap", "best.mcap"]
    assert table[1][3] == "crashed: killed by SIGKILL"
    assert table[2][2:4] == [
        "80 m", f"missed: {MAX} is 80 m, at most 50 m is allowed",
    ]  # fmt: skip
    assert table[3][2:4] == ["5 m", "1 passed"]
    assert page.links == [
        f"logs/{name}.mcap/default/report.html" for name in ("far", "fine", "best")
    ]


def test_the_regression_is_said_before_the_logs() -> None:
    before = many(30)
    now = suite(
        ok(r.log, r.metrics[MAX] * (1.2 if r.group == "city" else 1.0), group=r.group, limit=999.0)
        for r in before.results
    )
    page = read(markdown(now, comparison=compared(before, now)))
    assert page.text.startswith("fleet: failed")
    assert "1 regression against" in page.text
    paired, logs = page.tables
    assert [row[0] for row in paired[1:]] == ["city"]
    assert "2 of 3 compared figures did not move" in page.text
    assert paired[1][6:] == ["20.0 % worse", "20.0 % worse", "regressed"]
    assert logs[0][-1] == "against the baseline"
    assert {row[-1] for row in logs[1:] if row[1] == "city"} == {"20.0 % worse"}
    assert {row[-1] for row in logs[1:] if row[1] != "city"} == {"the same"}
    assert len(logs) == 1 + 10  # all passed their bars: the ten nearest to them
    assert "20 more are in index" in page.text
    assert page.links == []  # a job summary has nothing beside it to link to


def test_passed_is_said() -> None:
    results = suite([ok("a", 1.0), ok("b", 2.0)])
    page = read(markdown(results, comparison=compared(results, results)))
    assert page.text.startswith("fleet: passed")
    assert "all 2 passed" in page.text
    assert "no regression against" in page.text


def test_new_and_vanished_logs_are_named() -> None:
    before = suite([ok("a", 1.0), ok("gone", 1.0), ok("no-gps", None)])
    now = suite([ok("a", 1.0), ok("fresh", 1.0), ok("no-gps", None)])
    page = read(markdown(now, comparison=compared(before, now)))
    assert "1 only in the baseline: gone/default" in page.text
    assert "1 not in the baseline: fresh/default" in page.text
    assert {row[0]: row[4] for row in page.tables[-1][1:]} == {
        "a": "the same", "fresh": "new", "no-gps": "",
    }  # fmt: skip


@pytest.mark.parametrize("name", [EVIL, "a\nb\x1b[31m|", "_x_", "1. x", "- y", "| z |", "\ud800"])
def test_names_of_any_kind_are_shown_as_they_are(name: str) -> None:
    results = suite([ok(name, 80.0, group=name), broken(f"{name}2", error=name)], name)
    text = markdown(results)
    page = read(text)
    (table,) = page.tables
    shown = name.replace("\n", r"\u000a").replace("\x1b", r"\u001b").replace("\ud800", r"\ud800")
    assert table[2][:2] == [shown.strip()] * 2
    assert table[1][3].endswith(f"crashed: {shown}".strip())
    assert set(page.tags) <= {"h3", "p", "table", "thead", "tbody", "tr", "th", "td", "strong"}
    # what GitHub would link by itself
    assert not re.search(r"https?://|www\.|(?<!\w)@\w", text)


def test_the_summary_ends_where_its_room_does(tmp_path) -> None:
    rows = [ok(f"{'日' * 150}{k}", float(k)) for k in range(3000)]
    rows += [broken(f"dead{k}", error="x" * 5000) for k in range(3000)]
    results = suite(rows)
    text = markdown(results, rows=10**6, comparison=compared(results, results))
    assert 0.7 * MIB < len(text.encode()) < MIB
    left = int(re.search(r"(\d+) more are in index", text).group(1))
    shown = text[text.index("| --- |", text.index("| log |")) :].count("\n| ")
    assert left + shown == 6000
    assert len(markdown(results).encode()) < 0.1 * MIB  # a hundred rows for a person
    # another program wrote into the same step
    file = tmp_path / "summary.md"
    file.write_text("x" * (MIB - 6000))
    assert append_step_summary(results, environ={"GITHUB_STEP_SUMMARY": str(file)})
    assert MIB - 6000 < file.stat().st_size < MIB


def test_the_step_summary_is_appended_where_there_is_one(tmp_path) -> None:
    results = suite([ok("a", 1.0)])
    assert not append_step_summary(results, environ={})
    file = tmp_path / "summary.md"
    file.write_text("before\n")
    assert append_step_summary(results, environ={"GITHUB_STEP_SUMMARY": str(file)})
    assert file.read_text() == "before\n" + markdown(results)


def test_the_file_links_its_reports(tmp_path) -> None:
    results = suite([ok("a b%.mcap", 1.0)])
    write_markdown(results, tmp_path / "summary.md")
    links = read((tmp_path / "summary.md").read_text()).links
    assert links == ["logs/a%20b%25.mcap/default/report.html"]
    write_markdown(results, tmp_path / "summary.md", folder=tmp_path / "out dir")
    links = read((tmp_path / "summary.md").read_text()).links
    assert links == ["out%20dir/logs/a%20b%25.mcap/default/report.html"]


def test_a_figure_that_has_a_bar_stands_in_where_there_is_no_gps() -> None:
    from vehnav.batch.model import BarResult, Result

    row = ok("a", None, more={"stops.count": 3.0})
    bars = (BarResult.of("stops.count", "min", 2.0, 3.0),)
    page = read(markdown(suite([Result(**{**vars(row), "bars": bars})])))
    assert page.tables[0][0][2] == "stops.count"
    assert page.tables[0][1][2:] == ["3", "1 passed"]
