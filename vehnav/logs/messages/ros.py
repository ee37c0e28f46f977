"""ROS payloads: CDR behind its encapsulation, and ROS 1 serialisation."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.logs.messages.cdr import Compiler, Cursor, Step
from vehnav.logs.messages.payload import Batch, Declaration, Decoded, Ints, Wanted
from vehnav.logs.messages.rosmsg import parse_rosmsg
from vehnav.logs.messages.types import Struct

PADDING = 3
"""Bytes behind a message that some middleware adds to reach a multiple of 4."""


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
        self._missing = False

    def plan(self, max_align: int) -> tuple[Step, ...]:
        """Steps for this greatest alignment."""
        if max_align not in self._plans:
            compiler = Compiler(self._wanted, max_align)
            self._plans[max_align] = compiler.compile(self._root)
            self._missing = any(
                path not in compiler.reached and name != "frame"
                for path, (name, _) in self._wanted.items()
            )
        return self._plans[max_align]

    def decode(self, batch: Batch) -> Decoded:
        """Wanted leaves of a batch; see :class:`Decoder`."""
        if not self._encapsulated:
            return self._decode_kind(batch, np.arange(batch.start.size), 0, "<", 1)
        has_head = np.flatnonzero(batch.size >= 4)
        if has_head.size < batch.size.size:
            self.problem = "shorter than the 4 bytes of CDR encapsulation"
        start = batch.start[has_head]
        kind = batch.data[start].astype(np.uint16) << 8 | batch.data[start + 1]
        if not kind.size:
            return Decoded(has_head, {})
        same = kind.min() == kind.max()
        parts = []
        for value in kind[:1] if same else np.unique(kind):
            known = _KINDS.get(int(value))
            if known is None:
                self.problem = (
                    f"CDR encapsulation 0x{int(value):04x} is not supported{_hint(value)}"
                )
                continue
            rows = has_head if same else has_head[kind == value]
            parts.append(self._decode_kind(batch, rows, 4, *known))
        return _merge(parts)

    def _decode_kind(
        self, batch: Batch, row: Ints, skip: int, order: str, max_align: int
    ) -> Decoded:
        every = row.size == batch.start.size
        cursor = Cursor(
            batch.data,
            (batch.start if every else batch.start[row]) + skip,
            (batch.size if every else batch.size[row]) - skip,
            order=order,
            max_align=max_align,
        )
        plan = self.plan(max_align)
        if self._missing:
            self.problem = "what is wanted lies behind a field of unknown wire format"
            return Decoded(row[:0], {})
        whole = cursor.run(plan)
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


def ros1_tree(declared: Declaration) -> Struct:
    """Tree of a ``ros1msg`` schema; FormatError where it is none."""
    return _checked(parse_rosmsg(declared.type_name, _text(declared), ros=1))


def ros2_tree(declared: Declaration) -> Struct:
    """Tree of a ``ros2msg`` schema; FormatError where it is none."""
    return _checked(parse_rosmsg(declared.type_name, _text(declared), ros=2))


def _checked(root: Struct) -> Struct:
    """The tree, once it proves to be of a size that messages have."""
    Compiler({}, 8).compile(root)
    return root


def _text(declared: Declaration) -> str:
    return declared.schema.decode("utf-8", "replace")


def ros1_decoder(_: Declaration, root: Struct, wanted: Wanted) -> RosDecoder:
    """Decoder of ROS 1 payloads."""
    return RosDecoder(root, wanted, encapsulated=False)


def ros2_decoder(_: Declaration, root: Struct, wanted: Wanted) -> RosDecoder:
    """Decoder of ROS 2 payloads."""
    return RosDecoder(root, wanted, encapsulated=True)
