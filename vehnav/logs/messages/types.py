"""The tree of a message type, whatever language it was declared in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

Path = tuple[str, ...]
"""Field names from the root of a message to a leaf, spelt as in its schema."""

MAX_DEPTH = 12
"""Nesting that is followed; the deepest public vehicle message has 6."""
MAX_NODES = 20_000
"""Fields that are visited in one tree: a hostile schema may double at every level."""


@dataclass(frozen=True)
class Scalar:
    """A number; ``code`` is a numpy type without byte order, e.g. ``f8``."""

    code: str

    @property
    def size(self) -> int:
        """Bytes."""
        return int(self.code[1:])

    @property
    def is_integer(self) -> bool:
        """Whether the values are counts rather than floats."""
        return self.code[0] in "iu"


@dataclass(frozen=True)
class Text:
    """A string; ``wide`` strings have no agreed wire format."""

    wide: bool = False


@dataclass(frozen=True)
class Array:
    """``length`` elements, or as many as the message says where ``length`` is None."""

    element: Type
    length: int | None


@dataclass(frozen=True)
class Struct:
    """Named fields in order.

    ``fields`` may be filled after construction (definitions refer to each other), hence a list.
    """

    name: str
    fields: list[tuple[str, Type]] = field(default_factory=list, hash=False, compare=False)

    def __iter__(self) -> Iterator[tuple[str, Type]]:
        return iter(self.fields)


Type = Scalar | Text | Array | Struct


def plain(name: str) -> str:
    """Field name without case and underscores: ``linear_accel`` and ``LinearAccel`` are one.

    >>> plain("Linear_Accel")
    'linearaccel'
    """
    return name.replace("_", "").lower()


def structs(root: Struct) -> Iterator[tuple[Path, tuple[Struct, ...]]]:
    """Every structure in a tree, outermost first, with its path and itself behind its ancestors.

    Elements of arrays are not entered: their place differs from message to message.
    """
    queue: list[tuple[Path, tuple[Struct, ...]]] = [((), (root,))]
    visited = 0
    for path, chain in queue:
        yield path, chain
        if len(chain) > MAX_DEPTH:
            continue
        for name, kind in chain[-1]:
            visited += 1
            if visited > MAX_NODES:
                return
            if isinstance(kind, Struct):
                queue.append(((*path, name), (*chain, kind)))
