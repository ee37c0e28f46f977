"""The report of a run as one self-contained page: opens offline, carries no link to anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vehnav.export.atomic import atomic_path
from vehnav.pipeline import Run
from vehnav.report import causes, filtered, quality, sections
from vehnav.report.mapping import map_of
from vehnav.report.markup import esc
from vehnav.report.page import page, section
from vehnav.report.panels import panels
from vehnav.report.svg import map_figure, panel


def write_html(
    run: Run, document: Mapping[str, Any], path: Path, *, command: str | None = None
) -> None:
    """Write :func:`render_html` whole or not at all."""
    text = render_html(run, document, command=command)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def render_html(run: Run, document: Mapping[str, Any], *, command: str | None = None) -> str:
    """The page of a run.

    Parameters
    ----------
    run : Run
        Its arrays are what is drawn.
    document : mapping
        Of :func:`vehnav.report.document.document`: what the tables say.
    command : str or None
        The command line that made it; None: put together from the configuration.
    """
    repeat = command or sections.command_line(run.log.path, run.config)
    body = [
        _header(run, document),
        f'<main><div class="linked"><div class="left">{map_figure(map_of(run))}</div>'
        f'<div class="right">{_panels(run)}</div></div>',
        _judged(run),
        section("causes", "What caused the error", causes.causes_block(run), causes.NOTE),
        section("filter", "What the filter found", filtered.filter_table(run), FILTER_NOTE),
        section(
            "innovations", "How the measurements fared", filtered.innovations_table(run), NIS_NOTE
        ),
        section("stops", "What each stop corrected", sections.stops_table(document), STOPS_NOTE),
        section(
            "sensor",
            "The sensor at rest",
            quality.sensor_table(run),
            f"{SENSOR_NOTE} {esc(quality.fit_note(document))}",
        ),
        section("findings", "Findings", sections.findings_list(document)),
        section("start", "Start and use of GPS", sections.start_details(run, document)),
        section("input", "Recording", sections.input_details(document)),
        section("repeat", "How to repeat it", _repeat(repeat, document)),
        "</main>",
    ]
    return page(sections.title(run), "".join(body))


METHODS_NOTE = (
    "The same fixes judge every method; the start is the same for all. <em>Levelling</em> turns "
    "the platform level while the vehicle stands, <em>velocity reset</em> sets its velocity to "
    "zero: the two procedures as published. The default adds the gyro bias that every stop shows "
    "and distributes over each leg what its ends found."
)
FILTER_NOTE = (
    "States of the filter besides the track. A sigma that is still that of its start (vehicle.py, "
    "Prior) says that the drive did not show the quantity."
)
NIS_NOTE = (
    "Innovations beyond 2 sigma are weighed down, beyond 30 rejected. The mean of the normalised "
    "innovation squared is 1 where a measurement errs as assumed; below where its errors last and "
    "it is given more room for that (non-holonomic constraint)."
)
STOPS_NOTE = (
    "<em>Speed before reset</em> is what the velocity had drifted to when the vehicle stood again. "
    "<em>Of threshold</em>: how near the stop came to not being one."
)


def _panels(run: Run) -> str:
    return "".join(panel(item, explained=k == 0) for k, item in enumerate(panels(run)))


SENSOR_NOTE = (
    "From the stops of this log: white noise by the differences of one-second means, and the "
    "standard deviation of the mean rate over the stops."
)


def _judged(run: Run) -> str:
    """The tables against GPS, side by side where there is room."""
    blocks = [
        ("methods", "Methods compared", quality.methods_table(run), METHODS_NOTE),
        ("outages", "Outages bridged", quality.outages_table(run), ""),
        ("since", "Growth since the last correction", quality.drift_table(run), ""),
        ("segments", "Over lengths of road", quality.segments_table(run), SEGMENTS_NOTE),
        ("honest", "Are the expected errors honest?", quality.calibration_table(run), HONEST_NOTE),
    ]
    return f'<div class="blocks">{"".join(section(*block) for block in blocks)}</div>'


SEGMENTS_NOTE = "Mean error of the displacement over every stretch of that length, as in KITTI."
HONEST_NOTE = (
    "Shares of the judged fixes inside multiples of the expected sigma, the receiver's own sigma "
    "included where it gives one. The fixes of one drive are not independent: a single drive shows "
    "rough agreement at best."
)


def _header(run: Run, document: Mapping[str, Any]) -> str:
    figures = "".join(
        f'<div class="figure"><span>{esc(name)}</span><b>{esc(value)}</b><small>{esc(remark)}'
        "</small></div>"
        for name, value, remark in sections.key_figures(run)
    )
    warnings = sum(f["level"] != "info" for f in document["input"]["findings"])
    alarm = ""
    if warnings:
        text = "1 finding" if warnings == 1 else f"{warnings} findings"
        alarm = f' <a class="alarm" href="#findings">{text} to look at</a>'
    start = document["start_unix_ns"]
    when = "" if start is None else f", recorded {sections.utc(start)}"
    return (
        f'<header><p class="name">{esc(sections.title(run))}{when}</p>'
        f"<h1>{esc(sections.unbroken(sections.headline(run)))}.</h1>"
        f"<p>{esc(sections.gps_sentence(run))}{alarm}</p>"
        f'<div class="figures">{figures}</div></header>'
    )


def _repeat(command: str, document: Mapping[str, Any]) -> str:
    return (
        f'<pre tabindex="0"><code>{esc(command)}</code></pre>'
        f"<p>with vehnav {esc(document['vehnav'])}, on a recording with the SHA-256 above.</p>"
        "<details><summary>Every option in force</summary>"
        f'<p class="note">Marked: not the default.</p>{sections.config_details(document)}</details>'
    )
