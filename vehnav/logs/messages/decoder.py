"""An encoding's name -> type tree and decoder: one table, one row per encoding.

A decoder takes batches of payloads and delivers wanted leaves as arrays; payloads that do not
agree with their schema are left out, and the caller counts them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.logs.messages.cdr import Compiler, Cursor, Step
from vehnav.logs.messages.rosmsg import parse_rosmsg
from vehnav.logs.messages.types import Batch, Path, Struct

Ints = npt.NDArray[np.int64]
Wanted = dict[Path, tuple[str, int]]

PADDING = 3
"""Bytes behind a message that some middleware adds to reach a multiple of 4."""


@dataclass(frozen=True)
class Declaration:
    """What a container says about the messages of a channel.

    Attributes
    ----------
    encoding : str
        Of the payloads: cdr, ros1, json, protobuf.
    type_name, schema_encoding, schema
        The schema record.
    """

    encoding: str
    type_name: str = ""
    schema_encoding: str = ""
    schema: bytes = field(default=b"", repr=False)


@dataclass(frozen=True)
class Decoded:
    """Wanted leaves of the messages that agree with their schema.

    Attributes
    ----------
    row : (m,) int64
        Which messages of the batch.
    columns : dict
        Quantity -> (m, k) numbers as stored.
    """

    row: Ints
    columns: dict[str, npt.NDArray[Any]]


class Decoder(Protocol):
    """Payloads -> arrays for one channel."""

    texts: dict[str, str]
    """Strings of the first message."""
    problem: str
    """What was wrong with the last payload left out."""

    def decode(self, batch: Batch) -> Decoded:
        """Wanted leaves of a batch."""
        ...


def join(found: dict[str, list[tuple[int, npt.NDArray[Any]]]]) -> dict[str, npt.NDArray[Any]]:
    """Columns of each quantity side by side, in order."""
    columns = {}
    for quantity, parts in found.items():
        parts.sort(key=lambda part: part[0])
        arrays = [values for _, values in parts]
        columns[quantity] = arrays[0] if len(arrays) == 1 else np.hstack(arrays)
    return columns


# CDR encapsulation kind (DDS-XTypes 1.3, table 60) -> byte order, greatest alignment
_KINDS = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}


class RosDecoder:
    """ROS 2 CDR behind its encapsulation, or ROS 1 serialisation without one."""

    def __init__(self, root: Struct, wanted: Wanted, *, encapsulated: bool) -> None:
        self.texts: dict[str, str] = {}
        self.problem = ""
        self._root = root
        self._wanted = wanted
        self._encapsulated = encapsulated
        self._plans: dict[int, tuple[Step, ...]] = {}

    def plan(self, max_align: int) -> tuple[Step, ...]:
        """Steps for this greatest alignment."""
        if max_align not in self._plans:
            self._plans[max_align] = Compiler(self._wanted, max_align).compile(self._root)
        return self._plans[max_align]

    def decode(self, batch: Batch) -> Decoded:
        """Wanted leaves of a batch; see :class:`Decoder`."""
        if not self._encapsulated:
            return self._decode_kind(batch, np.arange(batch.start.size), 0, "<", 1)
        has_head = np.flatnonzero(batch.size >= 4)
        if has_head.size < batch.size.size:
            self.problem = "shorter than the 4 bytes of CDR encapsulation"
        first = batch.data[batch.start[has_head]]
        kind = batch.data[batch.start[has_head] + 1].astype(np.int64) | first.astype(np.int64) << 8
        parts = []
        for value in np.unique(kind):
            known = _KINDS.get(int(value))
            if known is None:
                self.problem = (
                    f"CDR encapsulation 0x{int(value):04x} is not supported{_hint(value)}"
                )
                continue
            parts.append(self._decode_kind(batch, has_head[kind == value], 4, *known))
        return _merge(parts)

    def _decode_kind(
        self, batch: Batch, row: Ints, skip: int, order: str, max_align: int
    ) -> Decoded:
        cursor = Cursor(
            batch.data,
            batch.start[row] + skip,
            batch.size[row] - skip,
            order=order,
            max_align=max_align,
        )
        whole = cursor.run(self.plan(max_align))
        left = cursor.size - cursor.at
        good = (left >= 0) & (left <= PADDING) if whole else left >= 0
        if not good.all():
            self.problem = "its length does not agree with its schema"
            cursor.keep(good)
        elif cursor.row.size < row.size:
            self.problem = "it ends before its schema does"
        for name, text in cursor.texts.items():
            self.texts.setdefault(name, text)
        return Decoded(row[cursor.row], join(cursor.found))


def _hint(kind: int) -> str:
    if 0x08 <= kind <= 0x0B:
        return " (XCDR2 of an appendable or mutable type); record with XCDR1"
    return ""


def _merge(parts: list[Decoded]) -> Decoded:
    """Messages of several byte orders, back in their order."""
    parts = [part for part in parts if part.row.size]
    if not parts:
        return Decoded(np.zeros(0, np.int64), {})
    if len(parts) == 1:
        return parts[0]
    row = np.concatenate([part.row for part in parts])
    order = np.argsort(row, kind="stable")
    columns = {
        name: np.concatenate(
            [
                part.columns[name].astype(part.columns[name].dtype.newbyteorder("="))
                for part in parts
            ]
        )[order]
        for name in parts[0].columns
    }
    return Decoded(row[order], columns)


def _ros(ros: int) -> Callable[[Declaration], Struct]:
    def tree(declared: Declaration) -> Struct:
        text = declared.schema.decode("utf-8", "replace")
        return parse_rosmsg(declared.type_name, text, ros=ros)

    return tree


@dataclass(frozen=True)
class Encoding:
    """One row of the table."""

    schema_encodings: tuple[str, ...]
    tree: Callable[[Declaration], Struct]
    decoder: Callable[[Declaration, Struct, Wanted], Decoder]


ENCODINGS: dict[str, Encoding] = {
    "cdr": Encoding(
        ("ros2msg",), _ros(2), lambda _, root, wanted: RosDecoder(root, wanted, encapsulated=True)
    ),
    "ros1": Encoding(
        ("ros1msg",), _ros(1), lambda _, root, wanted: RosDecoder(root, wanted, encapsulated=False)
    ),
}


def type_tree(declared: Declaration) -> Struct:
    """Tree of a channel's messages.

    Raises
    ------
    FormatError
        An encoding that is not known, or a schema that does not follow its language.
    """
    row = ENCODINGS.get(declared.encoding)
    if row is None:
        raise FormatError(f"encoding {declared.encoding[:40]!r} is not known")
    if row.schema_encodings and declared.schema_encoding not in row.schema_encodings:
        raise FormatError(
            f"schema language {declared.schema_encoding[:40]!r} is not known "
            f"for {declared.encoding}"
        )
    return row.tree(declared)


def make_decoder(declared: Declaration, root: Struct, wanted: Wanted) -> Decoder:
    """Decoder of a channel whose tree is ``root``."""
    return ENCODINGS[declared.encoding].decoder(declared, root, wanted)
