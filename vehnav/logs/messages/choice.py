"""Which of several topics is the IMU, the GPS, the speed: stated rules, the others named."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from vehnav.errors import Finding, LogError
from vehnav.logs.log import ReadOptions
from vehnav.logs.messages.roles import Role, RoleName
from vehnav.logs.messages.topics import Collector, Topic

NAMES: Final[dict[RoleName, str]] = {"imu": "IMU", "gnss": "GPS", "speed": "speed"}
OPTIONS: Final[dict[RoleName, str]] = {
    "imu": "--imu-topic",
    "gnss": "--gps-topic",
    "speed": "--speed-topic",
}
DERIVED = ("filtered", "fused", "global", "ekf", "estimate", "localization")
"""Words in names of topics that somebody computed from other topics."""
NO_WHEEL = ("cmd", "command", "setpoint", "gps", "gnss", "imu", "target", "desired", "vel_ref")
"""Words in names of velocity topics that no wheel measured."""
WHEEL = ("wheel", "odom", "vehicle", "velocity_status", "can", "encoder")


@dataclass(frozen=True)
class Candidate:
    """A topic in a role that it could take."""

    topic: Topic
    role: Role

    @property
    def label(self) -> str:
        """Topic, and the part of the message where it is not the whole of it (or its twist)."""
        path = "" if self.role.name == "speed" else ".".join(self.role.path)
        return f"{self.topic.name} ({path})" if path else self.topic.name

    def collector(self) -> Collector:
        """What was collected for it."""
        return next(c for c in self.topic.collectors if c.role is self.role)


def _words(candidate: Candidate, words: Iterable[str]) -> bool:
    name = candidate.topic.name.lower()
    return any(word in name for word in words)


def _imu_rank(c: Candidate) -> tuple[object, ...]:
    """Most messages, then the plain standard type, then the least nested, then the name."""
    standard = c.topic.declared.type_name.endswith("/Imu")
    return (-c.topic.count, not standard, len(c.role.path), c.topic.name)


def _gnss_rank(c: Candidate) -> tuple[object, ...]:
    """A receiver before a filter's output; most messages; least nested; name."""
    return (_words(c, DERIVED), -c.topic.count, len(c.role.path), c.topic.name)


def _speed_rank(c: Candidate) -> tuple[object, ...]:
    """A reported vehicle speed, wheels, the rest; a filter's output last; most messages; name."""
    plain_twist = "linear" in c.role.quantities
    return (_words(c, DERIVED), plain_twist, not _words(c, WHEEL), -c.topic.count, c.topic.name)


RANK: Final[dict[RoleName, Callable[[Candidate], tuple[object, ...]]]] = {
    "imu": _imu_rank,
    "gnss": _gnss_rank,
    "speed": _speed_rank,
}


def asked_for(options: ReadOptions) -> dict[RoleName, str | None]:
    """The topics that the user named."""
    return {"imu": options.imu_topic, "gnss": options.gps_topic, "speed": options.speed_topic}


def candidates(topics: Iterable[Topic], role: RoleName) -> list[Candidate]:
    """Everything that could take a role, best first (one part of a message each)."""
    found = []
    for topic in topics:
        roles = [r for r in topic.roles if r.name == role]
        if topic.count and roles:
            found.append(Candidate(topic, roles[0]))
    if role == "speed":
        found = [c for c in found if not _words(c, NO_WHEEL)]
    return sorted(found, key=RANK[role])


def choose(
    path: str, topics: list[Topic], options: ReadOptions, rejected: dict[tuple[str, str], str]
) -> tuple[dict[str, Candidate], list[Finding]]:
    """One topic for each role that the recording has.

    Parameters
    ----------
    rejected : dict
        (role, topic) -> why it proved unusable.

    Raises
    ------
    LogError
        A topic that was asked for is not there, cannot take the role, or proved unusable.
    """
    chosen: dict[str, Candidate] = {}
    findings: list[Finding] = []
    for role, wanted in asked_for(options).items():
        if wanted is not None:
            chosen[role] = _named(path, topics, role, wanted, rejected)
            continue
        ranked = candidates(topics, role)
        usable = [c for c in ranked if (role, c.topic.name) not in rejected]
        for c in ranked:
            if c not in usable:
                text = f"{path}: {c.label} not used as {NAMES[role]}: "
                findings.append(
                    Finding("topic-unusable", "warning", text + rejected[role, c.topic.name])
                )
        if usable:
            chosen[role] = usable[0]
            findings += _others(path, role, usable)
    return chosen, findings


def _others(path: str, role: RoleName, usable: list[Candidate]) -> list[Finding]:
    if len(usable) < 2:
        return []
    rule = (RANK[role].__doc__ or "").rstrip(".")
    others = ", ".join(f"{c.label} ({c.topic.count})" for c in usable[1:8])
    text = f"{path}: {usable[0].label} ({usable[0].topic.count} messages) used as {NAMES[role]}, "
    text += f"not {others}; rule: {rule[0].lower()}{rule[1:]}; {OPTIONS[role]} chooses another"
    return [Finding("topic-choice", "info", text)]


def _named(
    path: str,
    topics: list[Topic],
    role: RoleName,
    wanted: str,
    rejected: dict[tuple[str, str], str],
) -> Candidate:
    """The topic that the user named."""
    named = [t for t in topics if t.name == wanted]
    if not named:
        raise LogError(
            f"{path}: no topic {wanted!r} ({OPTIONS[role]}); there is {topic_list(topics)}"
        )
    if (role, wanted) in rejected:
        raise LogError(
            f"{path}: {wanted} cannot be used as {NAMES[role]}: {rejected[role, wanted]}"
        )
    for topic in named:
        for r in topic.roles:
            if r.name == role and topic.count:
                return Candidate(topic, r)
    topic = named[0]
    why = topic.problem or (
        f"its type {topic.declared.type_name} has no such fields" if topic.count else "no messages"
    )
    raise LogError(f"{path}: {wanted} cannot be used as {NAMES[role]}: {why}")


def topic_list(topics: Iterable[Topic], limit: int = 12) -> str:
    """Topics with type and count, for an error message."""
    rows = [f"{t.name} [{t.declared.type_name or t.declared.encoding}] {t.count}" for t in topics]
    if not rows:
        return "nothing: no topics"
    more = f" and {len(rows) - limit} more" if len(rows) > limit else ""
    return ", ".join(rows[:limit]) + more
