"""``vehnav stops``: when the vehicle stood still, and how sure that is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    axes_options,
    command,
    finish,
    input_options,
    json_option,
    print_findings,
    print_json,
    span_options,
    stops_options,
    strict_option,
)

if TYPE_CHECKING:
    from vehnav.evaluation.stop_score import StopScore
    from vehnav.logs.log import ReadOptions
    from vehnav.pipeline import StopSearch


@command(
    "stops",
    examples=[
        "vehnav stops city.mcap",
        "vehnav stops city.mcap --stop-statistic rms --json",
        "vehnav stops drive.csv --gps-file gps.csv --gps-time-offset -0.6",
    ],
)
@click.argument("log")
@input_options
@span_options
@axes_options
@stops_options
@json_option
@strict_option
def stops(log: str, read_options: ReadOptions, as_json: bool, strict: bool, **options: Any) -> None:
    """List the stops of a log with their statistics, scored against GPS speed where there is some.

    A stop is a stretch where the angular rate and the specific force stay under their thresholds
    (paper 002). The margin is the larger of the two over its threshold: the smaller, the surer.
    """
    from vehnav.cli.run import config_from
    from vehnav.evaluation.stop_score import score_stops
    from vehnav.logs.read import read_log
    from vehnav.pipeline import search_stops

    recording = read_log(log, read_options)
    found = search_stops(recording, config_from(recording, options))
    score = None
    if recording.gnss is not None and recording.gnss.t_ns.size > 2:
        score = score_stops(found.samples.t_ns, found.stopped, recording.gnss)
    findings = [*recording.findings, *found.samples.findings]
    if as_json:
        print_json(_document(log, found, score))
    else:
        click.echo(_screen(log, found, score))
    print_findings(findings, start_ns=recording.start_ns, least="warning")
    finish(damaged=recording.damaged, strict=strict, findings=findings)


def _document(log: str, found: StopSearch, score: StopScore | None) -> dict[str, Any]:
    from vehnav.units import DEG

    return {
        "file": log,
        "statistic": found.rule.statistic,
        "threshold_deg_s": found.rule.threshold / DEG,
        "force_threshold_m_s2": found.statistics.force_threshold,
        "window_s": found.rule.window,
        "dwell_s": found.rule.dwell,
        "stops": [
            {
                "start_s": stop.start,
                "end_s": stop.end,
                "rate_deg_s": stop.rate / DEG,
                "force_m_s2": stop.force,
                "margin": stop.margin,
            }
            for stop in found.stops
        ],
        "quietest": found.quietest(),
        "gps_score": None if score is None else score.to_dict(),
    }


def _screen(log: str, found: StopSearch, score: StopScore | None) -> str:
    from vehnav.units import DEG

    rule = found.rule
    lines = [
        f"{log}: {len(found.stops)} stops, {sum(s.duration for s in found.stops):.1f} s in all",
        f"statistic {rule.statistic}: angular rate under {rule.threshold / DEG:.2f} deg/s and "
        f"specific force under {found.statistics.force_threshold:.2f} m/s2 over {rule.window:g} s, "
        f"for {rule.dwell:g} s",
    ]
    if found.stops:
        lines += ["", "  #     start       end  length  rate deg/s  force m/s2  margin"]
    for k, stop in enumerate(found.stops, start=1):
        lines.append(
            f"{k:>3}{stop.start:>10.1f}{stop.end:>10.1f}{stop.duration:>8.1f}"
            f"{stop.rate / DEG:>12.3f}{stop.force:>12.3f}{stop.margin:>8.2f}"
        )
    quiet = found.quietest()
    if not found.stops:
        lines.append(
            f"the quietest moment, at {quiet['time_s']:.1f} s, has {quiet['rate_deg_s']:.3f} deg/s "
            f"and {quiet['force_m_s2']:.3f} m/s2"
        )
    return "\n".join(lines + ["", *_score_lines(score)])


def _score_lines(score: StopScore | None) -> list[str]:
    if score is None:
        return ["no GPS to score them by"]
    lines = [
        f"GPS judges {score.standing_s:.0f} s of standing and {score.moving_s:.0f} s of moving"
    ]
    if score.found is not None:
        lines.append(f"  found     {100.0 * score.found:.1f} % of the standing time")
    if score.wrong is not None:
        lines.append(f"  wrong     {100.0 * score.wrong:.2f} % of the moving time")
    if score.fastest_m_s is not None:
        lines.append(f"  fastest   {score.fastest_m_s:.2f} m/s inside a stop")
    missed = ", ".join(f"{a:.0f}-{b:.0f} s" for a, b in score.missed) or "none"
    lines.append(f"  missed    {missed} (GPS stops of 5 s or more)")
    return lines
