"""Decoded topics -> Log: which topic is used, on which clock, in SI units; all of it stated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, LogError
from vehnav.logs.check import clean_gnss, clean_imu, clean_speed
from vehnav.logs.log import Gnss, Imu, Log, ReadOptions, Speed
from vehnav.logs.messages import choice, convert
from vehnav.logs.messages.choice import Candidate
from vehnav.logs.messages.roles import Role, RoleName
from vehnav.logs.messages.stamps import CLOCK_SET_S, Clock, choose_clock, header_stamps
from vehnav.logs.messages.topics import Collector, Topic
from vehnav.units import ACCEL_UNITS, GYRO_UNITS, NS

SAME_CLOCK_S = 0.05
"""IMU and GPS stamps on one clock differ from log time by the same, to this."""
OTHER_CLOCK_S = 2.0
"""No receiver is later than this: its header is on another clock."""


MAX_RATE = 35.0
"""rad/s: no gyro of a vehicle measures more (2000 deg/s)."""
MAX_FORCE = 200.0
"""m/s2: no accelerometer of a vehicle measures more (20 g)."""


class UnusableError(Exception):
    """A chosen topic holds nothing usable; another one may."""

    def __init__(self, candidate: Candidate, why: str) -> None:
        super().__init__(why)
        self.candidate = candidate
        self.why = why


class Assembler:
    """Turns what was collected into a Log; one use."""

    def __init__(self, path: str, topics: Iterable[Topic], options: ReadOptions) -> None:
        self.path = path
        self.topics = list(topics)
        self.options = options
        self.findings: list[Finding] = []
        self.counts = dict.fromkeys(("declared", "read", "recovered", "unverified", "bad"), 0)

    def log(
        self, chosen: Mapping[str, Candidate], damage: list[Finding], notes: list[Finding]
    ) -> Log:
        """The recording.

        Parameters
        ----------
        chosen : mapping
            Of "imu", "gnss", "speed"; each has been collected.
        damage : list of Finding
            From the container: data lost, recovered or unverified.
        notes : list of Finding
            From the container and the choice of topics.

        Raises
        ------
        UnusableError
            A chosen topic holds nothing.
        """
        self.findings = [*damage, *notes]
        for role, candidate in chosen.items():
            candidate.topic.used_as.append(choice.NAMES[cast(RoleName, role)])
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is left out below
            imu, clock = self._imu(chosen["imu"]) if "imu" in chosen else (None, None)
            gnss = self._gnss(chosen["gnss"], clock) if "gnss" in chosen else None
            speed = self._speed(chosen["speed"], clock) if "speed" in chosen else None
        lost = self.counts["declared"] > self.counts["read"]
        return Log(
            self.path,
            imu,
            gnss,
            speed,
            findings=tuple(self.findings),
            unix_clock=self._unix,
            integrity=dict(self.counts),
            damaged=bool(damage) or lost,
            contents=tuple(contents_row(topic) for topic in self.topics),
        )

    _unix = True

    @property
    def _used(self) -> set[str]:
        return {name for topic in self.topics for name in topic.used_as}

    # --- one role each ---------------------------------------------------------------------------

    def _imu(self, candidate: Candidate) -> tuple[Imu, Clock]:
        collector, columns = self._columns(candidate)
        clock = self._clock(candidate, columns)
        gyro = convert.vector(columns, candidate.role, "gyro")
        accel = convert.vector(columns, candidate.role, "accel")
        for name, values in (("angular rate", gyro), ("acceleration", accel)):
            if not np.any(values):
                raise UnusableError(candidate, f"its {name} is zero throughout")
        gyro = convert.scaled(gyro, GYRO_UNITS[self.options.gyro_unit or "rad/s"])
        accel = convert.scaled(accel, ACCEL_UNITS[self.options.accel_unit or "m/s2"])
        try:
            imu, findings = clean_imu(
                clock.t_ns,
                gyro,
                accel,
                source=candidate.label,
                frame_id=collector.decoder.texts.get("frame", ""),
                sampling=candidate.role.sampling,
                where=f"{self.path}: {candidate.label}",
            )
        except LogError as error:
            raise UnusableError(candidate, str(error)) from error
        self.findings += findings
        self._unix = clock.unix
        role = candidate.role
        return replace(imu, axes=role.axes, axes_declared=role.axes_fixed), clock

    def _gnss(self, candidate: Candidate, base: Clock | None) -> Gnss | None:
        _, columns = self._columns(candidate)
        clock = self._clock(candidate, columns)
        t_ns = self._on_base(candidate, clock, columns, base)
        fixes = convert.fixes(columns, candidate.role)
        gnss, findings = clean_gnss(
            t_ns,
            fixes.lat,
            fixes.lon,
            fixes.height,
            v_n=fixes.v_n,
            sigma_pos=fixes.sigma_pos,
            status=fixes.status,
            source=candidate.label,
            where=f"{self.path}: {candidate.label}",
        )
        self.findings += findings
        if base is None:
            self._unix = clock.unix
        return gnss

    def _speed(self, candidate: Candidate, base: Clock | None) -> Speed | None:
        _, columns = self._columns(candidate)
        clock = self._clock(candidate, columns)
        t_ns = self._on_base(candidate, clock, columns, base)
        where = f"{self.path}: {candidate.label}"
        values, doubt = convert.forward_speed(columns, candidate.role)
        if doubt and not self.options.speed_topic:
            text = f"{where}: not used as vehicle speed: {doubt}; see --speed-topic"
            self.findings.append(Finding("speed-rejected", "warning", text))
            candidate.topic.used_as.remove(choice.NAMES["speed"])
            return None
        speed, findings = clean_speed(t_ns, values, source=candidate.label, where=where)
        self.findings += findings
        if "IMU" not in self._used and "GPS" not in self._used:
            self._unix = clock.unix
        return speed

    # --- shared ----------------------------------------------------------------------------------

    def _columns(self, candidate: Candidate) -> tuple[Collector, dict[str, npt.NDArray[Any]]]:
        """What was collected, with its counts and its bad messages stated."""
        collector = candidate.collector()
        topic = candidate.topic
        declared = max(topic.count, topic.declared_count, collector.read + collector.bad)
        for name, value in (
            ("declared", declared),
            ("read", collector.read),
            ("recovered", collector.recovered),
            ("unverified", collector.unverified),
            ("bad", collector.bad),
        ):
            self.counts[name] += value
        self._count_findings(candidate, collector, declared)
        if not collector.read:
            why = f"none of its {declared} messages could be decoded"
            why += f": {collector.decoder.problem}" if collector.decoder.problem else ""
            raise UnusableError(candidate, why)
        columns = collector.columns()
        wrong = implausible(candidate.role, columns)
        if wrong.any():
            self.counts["read"] -= int(wrong.sum())
            self.counts["bad"] += int(wrong.sum())
            text = f"{self.path}: {candidate.label}: {int(wrong.sum())} messages from damaged "
            text += "parts left out: stamps or values that cannot be"
            span = (int(columns["log"][wrong].min()), int(columns["log"][wrong].max()))
            self.findings.append(Finding("bad-messages", "error", text, *span))
            columns = {name: values[~wrong] for name, values in columns.items()}
        return collector, columns

    def _count_findings(self, candidate: Candidate, collector: Collector, declared: int) -> None:
        where = f"{self.path}: {candidate.label}"
        if collector.bad and collector.bad_span:
            text = f"{where}: {collector.bad} of {declared} messages left out: "
            text += collector.decoder.problem
            self.findings.append(Finding("bad-messages", "error", text, *collector.bad_span))
        lost = declared - collector.read - collector.bad
        if lost > 0:
            text = f"{where}: {lost} of {declared} declared messages could not be read"
            self.findings.append(Finding("messages-lost", "error", text))
        if collector.unverified and collector.unverified_span:
            text = f"{where}: {collector.unverified} messages come from parts whose checksum "
            text += "does not match: they may be wrong"
            span = collector.unverified_span
            self.findings.append(Finding("unverified", "warning", text, *span))

    def _clock(self, candidate: Candidate, columns: dict[str, npt.NDArray[Any]]) -> Clock:
        clock = choose_clock(candidate.role, columns, self.options.time)
        stats = clock.stats
        text = f"{self.path}: {candidate.label}: stamps are {clock.name} time ({clock.reason}); "
        text += f"log time is {1e3 * stats.offset_s:.3g} ms later (spread "
        text += f"{1e3 * stats.spread_s:.3g} ms); steps {1e3 * stats.step_s[0]:.4g} / "
        text += f"{1e3 * stats.step_s[2]:.4g} / {1e3 * stats.step_s[4]:.4g} ms"
        usual = clock.name == "header" or clock.reason in ("as asked for",)
        candidate.topic.clock = clock
        self.findings.append(Finding("clock", "info" if usual else "warning", text))
        return clock

    def _on_base(
        self,
        candidate: Candidate,
        clock: Clock,
        columns: dict[str, npt.NDArray[Any]],
        base: Clock | None,
    ) -> npt.NDArray[np.int64]:
        """Stamps on the clock of the IMU, as far as log time tells; a difference is stated."""
        if base is None or base is clock:
            return clock.t_ns
        delta = clock.stats.offset_s - base.stats.offset_s
        if abs(delta) <= SAME_CLOCK_S:
            return clock.t_ns
        where = f"{self.path}: {candidate.label}"
        if (-SAME_CLOCK_S <= delta <= OTHER_CLOCK_S) or self.options.time is not None:
            text = f"{where}: reaches the recorder {delta:.3f} s later after its stamps than the "
            text += "IMU does: latency, or another clock; see --gps-time-offset"
            self.findings.append(Finding("clock-offset", "warning", text))
            return clock.t_ns
        text = f"{where}: its stamps are on another clock than the IMU's (off by {-delta:.3f} s); "
        text += "the recorder's time is used instead"
        self.findings.append(Finding("clock-offset", "warning", text))
        moved: npt.NDArray[np.int64] = columns["log"] - round(base.stats.offset_s / NS)
        return moved


def implausible(role: Role, columns: dict[str, npt.NDArray[Any]]) -> npt.NDArray[np.bool_]:
    """(n,): rows of damaged parts whose stamp or values no sound message could have."""
    doubtful = columns.get("doubtful", np.zeros(columns["log"].size, np.bool_))
    wrong = np.zeros(doubtful.size, np.bool_)
    if not doubtful.any() or doubtful.all():
        return wrong
    header = header_stamps(role, columns)
    if header is not None:
        late = (columns["log"] - header) * NS
        wrong |= np.abs(late - np.median(late[~doubtful])) > CLOCK_SET_S
    if role.name == "imu" and role.sampling == "rates":
        for name, limit in (("gyro", MAX_RATE), ("accel", MAX_FORCE)):
            size = np.abs(columns[name]).max(axis=1) * role.quantities[name].factor
            wrong |= ~(size < limit)
    wrong &= doubtful
    return wrong


def contents_row(topic: Topic) -> dict[str, Any]:
    """What ``info`` lists of a topic."""
    first, last = topic.span or (None, None)
    seconds = (last - first) * NS if first is not None and last is not None else 0.0
    return {
        "name": topic.name,
        "type": topic.declared.type_name,
        "encoding": topic.declared.encoding,
        "count": topic.count,
        "rate_hz": (topic.count - 1) / seconds if seconds > 0 else None,
        "first_ns": first,
        "last_ns": last,
        "used_as": ", ".join(topic.used_as),
        "could_be": ", ".join(dict.fromkeys(choice.NAMES[role.name] for role in topic.roles)),
        "problem": topic.problem,
        "clock": _clock_row(topic.clock),
    }


def _clock_row(clock: Clock | None) -> dict[str, Any] | None:
    """The stamps that were chosen and how they run against log time, for a topic that is used."""
    if clock is None:
        return None
    return {"stamps": clock.name, "reason": clock.reason, **asdict(clock.stats)}
