"""ROS 1 and ROS 2 message definitions (``ros1msg``, ``ros2msg``) -> type tree.

Grammar: https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html and
http://wiki.ros.org/msg; the definitions that a type refers to follow in the same text, each behind
a line of ``=`` and ``MSG: package/Type``.
"""

from __future__ import annotations

import re

from vehnav.errors import FormatError
from vehnav.logs.messages.types import Array, Scalar, Struct, Text, Type

MAX_NESTING = 32
"""Structures inside structures; more is no message type but an attack or a fault."""

_SCALARS = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "octet": "u1",
    **{f"int{8 * n}": f"i{n}" for n in (1, 2, 4, 8)},
    **{f"uint{8 * n}": f"u{n}" for n in (1, 2, 4, 8)},
    "float32": "f4",
    "float64": "f8",
    "float": "f4",
    "double": "f8",
}
_ROS1_SCALARS = {"byte": "i1"}
_TIMES = {
    "time": ("u4", "secs", "nsecs"),
    "duration": ("i4", "secs", "nsecs"),
}
_FALLBACK = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
}
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?P<bound><=\d+)?(?P<array>\[(?:<=)?\d*\])?\s+"
    r"(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)$"
)
_SEPARATOR = re.compile(r"^=+\s*$")


def parse_rosmsg(name: str, text: str, *, ros: int) -> Struct:
    """Tree of message type ``name`` declared by ``text``.

    Parameters
    ----------
    name : str
        Type name as the schema record says, e.g. ``sensor_msgs/msg/Imu``.
    text : str
        Concatenated definitions.
    ros : {1, 2}
        The language: ROS 1 has ``time`` and ``duration`` as primitives.

    Raises
    ------
    FormatError
        A line that is no field, a type without a definition, a type inside itself.
    """
    definitions = _split(name, text)
    if ros == 2:
        for known, body in _FALLBACK.items():
            definitions.setdefault(known, body)
    return _Parser(definitions, ros).struct(_short(name), ())


def _short(name: str) -> str:
    """``pkg/msg/Type`` -> ``pkg/Type``."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 2 else name


def _split(name: str, text: str) -> dict[str, str]:
    """Definitions by short name."""
    definitions: dict[str, str] = {}
    lines: list[str] = []
    current, head = _short(name), False
    for line in text.splitlines():
        if _SEPARATOR.match(line.strip()) and line.strip():
            definitions.setdefault(current, "\n".join(lines))
            lines, head = [], True
        elif head and line.strip().startswith("MSG:"):
            current, head = _short(line.split(":", 1)[1].strip()), False
        else:
            lines.append(line)
    definitions.setdefault(current, "\n".join(lines))
    return definitions


class _Parser:
    def __init__(self, definitions: dict[str, str], ros: int) -> None:
        self.definitions = definitions
        self.ros = ros
        self.done: dict[str, Struct] = {}

    def struct(self, name: str, outer: tuple[str, ...]) -> Struct:
        if name in outer:
            raise FormatError(f"message type {name} contains itself")
        if len(outer) > MAX_NESTING:
            raise FormatError(f"message type {outer[0]}: nested deeper than {MAX_NESTING}")
        if name not in self.done:
            fields: list[tuple[str, Type]] = []
            for line in self.definitions[name].splitlines():
                found = self.field(line, name, outer)
                if found:
                    fields.append(found)
            self.done[name] = Struct(name, fields)
        return self.done[name]

    def field(self, line: str, owner: str, outer: tuple[str, ...]) -> tuple[str, Type] | None:
        line = line.split("#", 1)[0].strip()
        if not line:
            return None
        match = _FIELD.match(line)
        if not match:
            raise FormatError(f"definition of {owner}: {line[:80]!r} is no field")
        if match["rest"].startswith("="):
            return None  # a constant
        kind = self.type(match["type"], owner, (*outer, owner))
        array = match["array"]
        if array:
            digits = array.strip("[]")
            kind = Array(kind, int(digits) if digits.isdigit() else None)
        return match["name"], kind

    def type(self, word: str, owner: str, outer: tuple[str, ...]) -> Type:
        if word in ("string", "wstring"):
            return Text(wide=word == "wstring")
        if self.ros == 1 and word in _TIMES:
            code, sec, nsec = _TIMES[word]
            return Struct(word, [(sec, Scalar(code)), (nsec, Scalar(code))])
        if word in _SCALARS:
            return Scalar((_ROS1_SCALARS if self.ros == 1 else {}).get(word, _SCALARS[word]))
        for name in self.full_names(word, owner):
            if name in self.definitions:
                return self.struct(name, outer)
        raise FormatError(f"definition of {owner}: type {word[:80]!r} is not defined")

    def full_names(self, word: str, owner: str) -> list[str]:
        """What a type word may stand for, most likely first."""
        if "/" in word:
            return [_short(word)]
        package = owner.split("/", 1)[0]
        return [f"{package}/{word}", *(["std_msgs/Header"] if word == "Header" else []), word]
