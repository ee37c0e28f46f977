"""Wanted leaves of a type tree -> plan; plan + payload bytes -> arrays, no Python per message.

A message is a row of parts of fixed size with strings and sequences between them. A part of fixed
size ends, and its leaves lie, at distances that depend on the alignment of its start only: tables
of 8 numbers. A string adds its length, which is read for all messages at once. As long as it is
the same in all of them (one frame id), positions stay plain integers; otherwise they become
arrays, with the same code.

Wire formats: OMG CDR (``cdr``, XCDR1; XCDR2 plain differs in aligning to 4 at most) behind 4 bytes
of encapsulation (DDS-RTPS 9.4.2.12); ROS 1 serialisation, which is CDR without any alignment.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.logs.messages.types import Array, Path, Scalar, Struct, Text, Type

Ints = npt.NDArray[np.int64]
Position = int | Ints

MAX_FIXED_BYTES = 1 << 30
"""A fixed part larger than this is no message."""
MAX_PARTS = 50_000
"""Fields of one type, counted wherever they occur: definitions may double at every level."""
MAX_ELEMENTS = 4096
"""Structures of varying size in one message that are stepped over; more: a bad message."""
_EIGHT = np.arange(8, dtype=np.int64)


@dataclass(frozen=True)
class Leaf:
    """``count`` wanted numbers in a row, ``offsets[start % 8]`` bytes behind the part's start."""

    quantity: str
    column: int
    code: str
    count: int
    offsets: Ints


@dataclass(frozen=True)
class Fixed:
    """A part of fixed size: ``advance[start % 8]`` bytes."""

    advance: Ints
    leaves: tuple[Leaf, ...] = ()


@dataclass(frozen=True)
class String:
    """A string behind its u32 length; the first message's is kept where ``quantity`` is set."""

    quantity: str = ""


@dataclass(frozen=True)
class Sequence:
    """Elements behind their u32 count."""

    element: tuple[Step, ...]


@dataclass(frozen=True)
class Unknown:
    """A part whose wire format is not agreed on: the plan ends before it."""

    what: str


Step = Fixed | String | Sequence | Unknown


class Compiler:
    """Turns a tree and the wanted leaves into steps, for one greatest alignment.

    Attributes
    ----------
    reached : set of Path
        Wanted numbers that the steps come to.
    """

    def __init__(self, wanted: dict[Path, tuple[str, int]], max_align: int) -> None:
        self.wanted = wanted
        self.max_align = max_align
        self.left = MAX_PARTS
        self.reached: set[Path] = set()
        self._open = True

    def compile(self, root: Struct) -> tuple[Step, ...]:
        """Steps for a whole message."""
        return tuple(self._join(self._steps(root, ())))

    def _steps(self, kind: Type, path: Path) -> list[Step]:
        self.left -= 1
        if self.left < 0:
            raise FormatError(f"a message type of more than {MAX_PARTS} fields is no message")
        if isinstance(kind, Scalar):
            return [self._numbers(kind, 1, path)]
        if isinstance(kind, Text):
            quantity = self.wanted.get(path, ("", 0))[0]
            return self._stop("wstring") if kind.wide else [String(quantity)]
        if isinstance(kind, Struct):
            return [step for name, inner in kind for step in self._steps(inner, (*path, name))]
        return self._array(kind, path)

    def _array(self, kind: Array, path: Path) -> list[Step]:
        inner = kind.element
        if kind.length is not None and isinstance(inner, Scalar):
            return [self._numbers(inner, kind.length, path)]
        element = tuple(self._join(self._steps(inner, (*path, "[]"))))
        if kind.length is None:
            return [Sequence(element)]
        if len(element) == 1 and isinstance(element[0], Fixed):
            return [Fixed(_repeat(element[0].advance, kind.length))]
        if kind.length * len(element) > 4096:
            return self._stop(f"array of {kind.length} elements of varying size")
        return list(element) * kind.length

    def _stop(self, what: str) -> list[Step]:
        """A part that cannot be stepped over: nothing behind it is reached."""
        self._open = False
        return [Unknown(what)]

    def _numbers(self, kind: Scalar, count: int, path: Path) -> Fixed:
        if count * kind.size > MAX_FIXED_BYTES:
            raise FormatError(f"field {'.'.join(path)}: {count} numbers are no message")
        align = min(kind.size, self.max_align)
        pad = -_EIGHT % align if count else np.zeros(8, np.int64)
        leaves: tuple[Leaf, ...] = ()
        if path in self.wanted and self._open:
            self.reached.add(path)
            quantity, column = self.wanted[path]
            leaves = (Leaf(quantity, column, kind.code, count, pad),)
        return Fixed(pad + count * kind.size, leaves)

    @staticmethod
    def _join(steps: list[Step]) -> list[Step]:
        """One fixed part out of neighbours."""
        joined: list[Step] = []
        for step in steps:
            last = joined[-1] if joined else None
            if isinstance(step, Fixed) and isinstance(last, Fixed):
                joined[-1] = _concatenate(last, step)
            else:
                joined.append(step)
        return joined


def _concatenate(a: Fixed, b: Fixed) -> Fixed:
    behind = (_EIGHT + a.advance) % 8
    leaves = list(a.leaves)
    for leaf in b.leaves:
        moved = Leaf(
            leaf.quantity, leaf.column, leaf.code, leaf.count, a.advance + leaf.offsets[behind]
        )
        last = leaves[-1] if leaves else None
        if last is not None and _continues(last, moved):
            leaves[-1] = Leaf(
                last.quantity, last.column, last.code, last.count + moved.count, last.offsets
            )
        else:
            leaves.append(moved)
    return Fixed(_compose(a.advance, b.advance), tuple(leaves))


def _continues(last: Leaf, leaf: Leaf) -> bool:
    size = last.count * int(last.code[1:])
    return (
        (last.quantity, last.code, last.column + last.count)
        == (leaf.quantity, leaf.code, leaf.column)
    ) and bool(np.all(leaf.offsets - last.offsets == size))


def _compose(first: Ints, second: Ints) -> Ints:
    """Advance over two fixed parts in a row."""
    both: Ints = first + second[(_EIGHT + first) % 8]
    if both.max() > MAX_FIXED_BYTES:
        raise FormatError("a message type of more than 1 GiB is no message")
    return both


def _repeat(advance: Ints, count: int) -> Ints:
    """Advance over ``count`` equal parts, by doubling."""
    total, power = np.zeros(8, np.int64), advance
    while count:
        if count & 1:
            total = _compose(total, power)
        count >>= 1
        if count:
            power = _compose(power, power)
    return total


class Cursor:
    """Positions in a batch of payloads; messages that end too early are dropped on the way.

    Attributes
    ----------
    row : (m,) int64
        Which messages of the batch are still followed.
    """

    def __init__(
        self,
        data: npt.NDArray[np.uint8],
        start: Ints,
        size: Ints,
        *,
        order: str,
        max_align: int,
        at: Position = 0,
    ) -> None:
        self.data = data
        self.order = order
        self.align = max_align
        self.row: Ints = np.arange(start.size)
        self.start = start
        self.size = size
        self.smallest = int(size.min()) if size.size else 0
        self.at: Position = at
        self.found: dict[str, list[tuple[int, npt.NDArray[Any]]]] = {}
        self.texts: dict[str, str] = {}

    def keep(self, good: npt.NDArray[np.bool_]) -> None:
        """Follow only these messages from now on."""
        self.row, self.start, self.size = self.row[good], self.start[good], self.size[good]
        if not isinstance(self.at, int):
            self.at = self.at[good]
        for quantity, parts in self.found.items():
            self.found[quantity] = [(column, values[good]) for column, values in parts]

    def require(self, end: Position) -> npt.NDArray[np.bool_] | None:
        """Which messages reach ``end``; None: all of them."""
        if isinstance(end, int) and end <= self.smallest:
            return None
        good: npt.NDArray[np.bool_] = self.size >= end
        return None if good.all() else good

    def gather(self, offset: Position, code: str, count: int) -> npt.NDArray[Any]:
        """(m, count) numbers at ``offset`` of every message (which must reach that far)."""
        width = int(code[1:]) * count
        window = np.ndarray(
            (max(self.data.size - width + 1, 0),), dtype=f"V{width}", buffer=self.data, strides=(1,)
        )
        picked = window[self.start + offset]
        numbers: npt.NDArray[Any] = picked.view(self.order + code).reshape(-1, count)
        return numbers

    def run(self, steps: tuple[Step, ...]) -> bool:
        """Follow the steps; False where one of unknown format stopped it."""
        for step in steps:
            if isinstance(step, Unknown):
                return False
            if isinstance(step, Fixed):
                self._fixed(step)
            elif isinstance(step, String):
                self._string(step)
            elif not self._sequence(step):
                return False
        return True

    def _fixed(self, step: Fixed) -> None:
        end = self.at + _lookup(step.advance, self.at)
        good = self.require(end)
        if good is not None:
            self.keep(good)
            end = end if isinstance(end, int) else end[good]
        for leaf in step.leaves:
            values = self.gather(self.at + _lookup(leaf.offsets, self.at), leaf.code, leaf.count)
            self.found.setdefault(leaf.quantity, []).append((leaf.column, values))
        self.at = end

    def _length(self) -> Position:
        """Read a u32; a plain integer where it is the same in all messages."""
        align = min(4, self.align)
        self.at = (self.at + align - 1) // align * align
        good = self.require(self.at + 4)
        if good is not None:
            self.keep(good)
        lengths = self.gather(self.at, "u4", 1)[:, 0].astype(np.int64)
        self.at = self.at + 4
        if lengths.size and lengths.min() == lengths.max():
            return int(lengths[0])
        return lengths

    def _string(self, step: String) -> None:
        length = self._length()
        good = self.require(self.at + length)
        if good is not None:
            self.keep(good)
            length = length if isinstance(length, int) else length[good]
        if step.quantity and step.quantity not in self.texts and self.row.size:
            first = int(self.start[0]) + (self.at if isinstance(self.at, int) else int(self.at[0]))
            raw = self.data[first : first + (length if isinstance(length, int) else int(length[0]))]
            self.texts[step.quantity] = raw[:256].tobytes().rstrip(b"\0").decode("utf-8", "replace")
        self.at = self.at + length

    def _sequence(self, step: Sequence) -> bool:
        count = self._length()
        # every element takes a byte or none at all: a larger count is a lie
        good = self.require(self.at + count)
        if good is not None and step.element != ():
            self.keep(good)
            count = count if isinstance(count, int) else count[good]
        element = step.element
        if not element or not self.row.size:
            return True
        if len(element) == 1 and isinstance(element[0], Fixed):
            self._fixed_elements(element[0].advance, count)
            return True
        return self._elements(element, count)

    def _fixed_elements(self, advance: Ints, count: Position) -> None:
        """Elements of fixed size: by doubling, over all messages at once."""
        if isinstance(count, int):
            table = _repeat_saturated(advance, count)
            self.at = self.at + _lookup(table, self.at)
            return
        at = np.broadcast_to(np.asarray(self.at, np.int64), count.shape).copy()
        power, left = advance, count.copy()
        while left.any():
            odd = (left & 1) == 1
            at[odd] += power[at[odd] % 8]
            left >>= 1
            power = power + power[(_EIGHT + power) % 8]
        self.at = at

    def _elements(self, element: tuple[Step, ...], count: Position) -> bool:
        """Elements of varying size: the k-th ones of all messages together."""
        counts = np.broadcast_to(np.asarray(count, np.int64), self.row.shape)
        at = np.broadcast_to(np.asarray(self.at, np.int64), counts.shape).copy()
        good = counts <= MAX_ELEMENTS
        for k in range(int(counts[good].max(initial=0))):
            some = np.flatnonzero((counts > k) & good)
            part = Cursor(
                self.data,
                self.start[some],
                self.size[some],
                order=self.order,
                max_align=self.align,
                at=at[some],
            )
            if not part.run(element):
                return False
            good[np.delete(some, part.row)] = False
            at[some[part.row]] = part.at
        self.at = at
        if not good.all():
            self.keep(good)
        return True


def _lookup(table: Ints, at: Position) -> Position:
    if isinstance(at, int):
        return int(table[at % 8])
    looked: Ints = table[at % 8]
    return looked


def _repeat_saturated(advance: Ints, count: int) -> Ints:
    """As :func:`_repeat`, for counts that come from a message (already checked to fit in it)."""
    try:
        return _repeat(advance, count)
    except FormatError:
        return np.full(8, MAX_FIXED_BYTES, np.int64)
