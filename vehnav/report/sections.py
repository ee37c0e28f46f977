"""The written parts of the page: answer, key figures, tables, what it was made from."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

from vehnav.config import Config
from vehnav.evaluation import Errors
from vehnav.pipeline import Run
from vehnav.report.circle import radius_95
from vehnav.report.markup import esc, table
from vehnav.report.quality import inside_share
from vehnav.report.scale import number
from vehnav.report.summary import in_outages, metres, rms_and_most

Document = Mapping[str, Any]

SWITCHES: Final = {"levelling": "--no-levelling", "reset": "--no-reset"}
"""Options that are given when their field is false."""


def headline(run: Run) -> str:
    """The answer in one sentence."""
    if run.errors is not None:
        return judged_sentence(run.errors, aided=run.gps.aids)
    if run.errors_before is not None:
        before = run.errors_before.horizontal
        driven = float(run.errors_before.distance[-1] - run.errors_before.distance[0])
        return (
            f"Integrated backward from the first stop, the start of the log is "
            f"{metres(float(before[0]))} from GPS after {metres(driven)} without it; no fix is "
            "left to judge the rest"
        )
    path = metres(run.trajectory.path_length())
    if run.gps.aids:
        return f"{path} aided by GPS all the way; no fix is left to judge it"
    if run.log.gnss is None:
        return f"{path} by inertial sensors alone; the log has no GPS to compare with"
    if run.alignment.local:
        return f"{path} by inertial sensors alone, in a local frame: not compared with GPS"
    return f"{path} by inertial sensors alone; no fix is left to compare with"


def unbroken(text: str) -> str:
    """With no line break between a number and its unit."""
    return re.sub(r"(?<=\d) (?=k?m\b|%|s\b)", "\u00a0", text)


def judged_sentence(errors: Errors, *, aided: bool = False) -> str:
    """How far off at the end and at most; of an aided run, in the outages that it had."""
    if aided:
        text = in_outages(errors)
        return text[:1].upper() + text[1:]
    percent = errors.percent_of_distance()["end"]
    share = "" if percent is None else f" ({percent:.1f} %)"
    end, most = float(errors.horizontal[-1]), float(errors.horizontal.max())
    driven = metres(float(errors.distance[-1]))
    text = f"Ended {metres(end)}{share} from GPS after {driven} without it"
    return text if most <= 1.005 * end else f"{text}; at most {metres(most)} on the way"


def _aiding_sentence(run: Run) -> str:
    text = f"GPS aids all the way: {run.gps.fixes_used} fixes, which judge nothing"
    if run.errors is not None:
        text += f"; the {run.errors.t_ns.size} inside the outages judge"
    if run.agreement is None:
        return text + "."
    return (
        f"{text}. From all fixes, used or not, the track is {rms_and_most(run.agreement)}; that is "
        "no error figure."
    )


def gps_sentence(run: Run) -> str:
    """What GPS was used for."""
    use = run.gps
    if run.log.gnss is None:
        return "The log has no GPS."
    if use.aids:
        return _aiding_sentence(run)
    if not use.used_for or use.until_ns is None:
        judges = run.errors is not None or run.errors_before is not None
        return "GPS was not used for the solution" + ("; it only judges." if judges else ".")
    until = (use.until_ns - run.start_ns) * 1e-9
    if "aiding" in use.used_for:
        return (
            f"GPS aided up to {until:.1f} s and not after: {use.fixes_used} fixes, which judge "
            "nothing."
        )
    window = ""
    if use.window_s is not None and use.window_path_m is not None:
        window = (
            f" The heading comes from the first {use.window_s:.0f} s of driving "
            f"({metres(use.window_path_m)})."
        )
    return (
        f"GPS gave the start {' and '.join(use.used_for)} and nothing else: {use.fixes_used} fixes "
        f"up to {until:.1f} s, which judge nothing.{window}"
    )


def key_figures(run: Run) -> list[tuple[str, str, str]]:
    """(title, value, remark) of the figures at the top."""
    figures = []
    if run.errors is not None:
        horizontal = run.errors.horizontal
        percent = run.errors.percent_of_distance()["end"]
        remark = "" if percent is None else f"{percent:.1f} % of the distance"
        figures.append(("Error at the end", metres(float(horizontal[-1])), remark))
        at = (run.errors.t_ns[int(np.argmax(horizontal))] - run.start_ns) * 1e-9
        figures.append(("Largest error", metres(float(horizontal.max())), f"at {at:.0f} s"))
    elif run.errors_before is not None:
        before = float(run.errors_before.horizontal[0])
        remark = "integrated backward"
        if run.trajectory.sigma_pos is not None:
            expected = float(radius_95(run.trajectory.sigma_pos[0, :2]))
            remark += f"; expected {metres(expected)}"
        figures.append(("Error at the start", metres(before), remark))
    circle = _expected_figure(run)
    figures += [circle] if circle else []
    free = run.method_errors.get("free")
    if free is not None and run.errors is not None:
        far, own = float(free.horizontal[-1]), float(run.errors.horizontal[-1])
        remark = f"{far / own:.0f} times as far" if own > 0.0 and far > 2.0 * own else ""
        figures.append(("Without corrections", metres(far), remark))
    standing = sum(stop.duration for stop in run.stops)
    figures.append(("Stops", str(len(run.stops)), f"{standing:.0f} s in all"))
    t = run.trajectory.t_ns
    duration = f"{(t[-1] - t[0]) * 1e-9:.0f} s"
    figures.append(("Driven", metres(run.trajectory.path_length()), f"in {duration}"))
    return figures


def _expected_figure(run: Run) -> tuple[str, str, str] | None:
    """The 95 % circle at the end of what is judged, and whether the error lies in it."""
    track = run.trajectory if run.errors is None else run.errors.states
    if track.sigma_pos is None:
        return None
    radius = radius_95(track.sigma_pos[:, :2])
    if run.errors is None:
        return "Expected error", metres(float(radius[-1])), "95 %, at the end"
    share = 100.0 * (inside_share(run) or 0.0)
    return "Expected error", metres(float(radius[-1])), f"95 %; holds {share:.0f} % of the fixes"


# ---- tables ------------------------------------------------------------------------------------


def stops_table(document: Document) -> str:
    """Every stop: when, how sure, what it showed."""
    head = [
        "stop", "from s", "to s", "length s", "GPS at most m/s",
        "speed before reset m/s", "tilt corrected °", "gyro bias °/h<br>right, forward, up",
        "of threshold",
    ]  # fmt: skip
    rows = []
    for k, stop in enumerate(document["stops"]):
        fastest = stop["gps_speed_max_m_s"]
        bias = ", ".join(number(x, 0.1 if abs(x) < 10 else 1.0) for x in stop["gyro_bias_dph"])
        rows.append(
            [
                str(k + 1),
                f"{stop['start_s']:.1f}",
                f"{stop['end_s']:.1f}",
                f"{stop['end_s'] - stop['start_s']:.1f}",
                "–" if fastest is None else f"{fastest:.2f}",
                f"{stop['speed_before_reset_m_s']:.2f}",
                f"{stop['tilt_corrected_deg']:.3f}",
                bias,
                f"{100.0 * stop['margin']:.0f} %",
            ]
        )
    return table(head, rows, name="Stops") if rows else "<p>No stop was found.</p>"


def findings_list(document: Document) -> str:
    """What was noticed, the worst first."""
    found = document["input"]["findings"]
    if not found:
        return "<p>Nothing was found.</p>"
    order = {"error": 0, "warning": 1, "info": 2}
    rows = []
    for item in sorted(found, key=lambda f: order.get(f["level"], 3)):
        level = esc(item["level"])
        rows.append(
            [
                f'<span class="level l-{level}">{level}</span>',
                f'<code class="word">{esc(item["code"])}</code>',
                f'<span class="word">{_when(item["start_s"], item["end_s"])}</span>',
                esc(item["text"]),
            ]
        )
    head = ["level", "code", "when s", "what"]
    return table(head, rows, name="Findings", left=(0, 1, 2, 3))


def _when(start: float | None, end: float | None) -> str:
    if start is None:
        return ""
    return f"{start:.1f}" if end is None or end == start else f"{start:.1f}–{end:.1f}"


def details(pairs: Sequence[tuple[str, str]]) -> str:
    """Names and values; the values are markup already."""
    rows = "".join(f"<dt>{esc(name)}</dt><dd>{value}</dd>" for name, value in pairs)
    return f"<dl>{rows}</dl>"


def start_details(run: Run, document: Document) -> str:
    """Where the drive starts and what each of it came from."""
    a = document["alignment"]
    rms = a["heading_rms_m"]
    fit = "" if rms is None else f", the first stretch fits GPS to {metres(rms)} rms"
    bias = ", ".join(number(x, 1.0) for x in a["gyro_bias_dph"])
    pairs = [
        (
            "Position",
            f"{a['lat_deg']:.6f}°, {a['lon_deg']:.6f}°, {a['height_m']:.1f} m "
            f"({esc(a['position_from'])})",
        ),
        ("Heading", f"{a['heading_deg']:.2f}° ({esc(a['heading_from'])}{fit})"),
        ("Pitch, roll", f"{number(a['pitch_deg'], 0.01)}°, {number(a['roll_deg'], 0.01)}°"),
        ("Gyro bias", f"{bias} °/h (right, forward, up), the Earth's rate taken out"),
    ]
    if a["rest_force_m_s2"] is not None:
        excess = a["rest_force_m_s2"] - a["gravity_m_s2"]
        share = 100.0 * excess / a["gravity_m_s2"]
        pairs.append(
            (
                "Force at rest",
                f"{a['rest_force_m_s2']:.4f} m/s² against gravity {a['gravity_m_s2']:.4f}: taken "
                f"out as a bias of {number(excess, 0.001)} m/s² along gravity; as a scale error it "
                f"would be {number(share, 0.01)} %",
            )
        )
    pairs.append(("GPS", esc(gps_sentence(run))))
    return details(pairs)


def input_details(document: Document) -> str:
    """What was read."""
    source = document["input"]
    imu, gps, speed = source["imu"], source["gps"], source["speed"]
    pairs = [
        ("File", f"<code>{esc(source['file'])}</code>"),
        ("SHA-256", f"<code>{esc(source['sha256'] or 'a folder')}</code>"),
        (
            "IMU",
            f"<code>{esc(imu['source'])}</code>, {imu['samples']} samples, "
            f"{imu['rate_hz']:.1f} Hz, "
            f"{esc(imu['sampling'])}, frame <code>{esc(imu['frame_id'] or '-')}</code>",
        ),
    ]
    if gps is not None:
        rate = "" if gps["rate_hz"] is None else f", {gps['rate_hz']:.1f} Hz"
        pairs.append(("GPS", f"<code>{esc(gps['source'])}</code>, {gps['fixes']} fixes{rate}"))
    if speed is not None:
        pairs.append(("Speed", f"<code>{esc(speed['source'])}</code>, {speed['samples']} samples"))
    pairs.append(("Axes", f"{esc(source['axes'])} (the sensor's x, y, z in the vehicle)"))
    start = document["start_unix_ns"]
    clock = "seconds from the start of the log; it has no calendar"
    if start is not None:
        clock = f"seconds since {utc(start)}"
    pairs.append(("Times", clock))
    return details(pairs)


def utc(unix_ns: int) -> str:
    """A stamp as a person reads it."""
    return datetime.fromtimestamp(unix_ns // 10**9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def config_details(document: Document) -> str:
    """The options in force, those that differ from the defaults marked."""
    default = Config().to_dict()
    rows = []
    for name, value in document["config"].items():
        text = f"<code>{esc(option_text(value))}</code>"
        changed = name in default and list_like(default[name]) != list_like(value)
        rows.append((name, f"<mark>{text}</mark>" if changed else text))
    return details(rows)


def list_like(value: Any) -> Any:
    """Tuples as the lists that JSON makes of them."""
    return list(value) if isinstance(value, tuple) else value


def option_text(value: Any) -> str:
    """A value as on the command line."""
    if value is None:
        return "auto"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ",".join(x if isinstance(x, str) else f"{x:.10g}" for x in value)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def command_line(path: str, config: Config) -> str:
    """The command that repeats the run.

    >>> command_line("a b.mcap", Config(axes="FRD", levelling=False, mount=(0.0, 1.5, 0.0)))
    "vehnav run 'a b.mcap' --axes FRD --mount 0,1.5,0 --no-levelling"
    """
    words = ["vehnav", "run", path]
    default = Config().to_dict()
    for name, value in config.to_dict().items():
        if list_like(value) == list_like(default[name]) or value is None:
            continue
        flag = SWITCHES.get(name) or f"--{name.replace('_', '-')}"
        words += [flag] if isinstance(value, bool) else [flag, option_text(value)]
    return shlex.join(words)


def title(run: Run) -> str:
    """The name of the recording, as text."""
    return Path(run.log.path).name or run.log.path
