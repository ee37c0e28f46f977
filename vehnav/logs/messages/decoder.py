"""An encoding's name -> type tree and decoder: one table, one row per encoding.

A decoder takes batches of payloads and delivers wanted leaves as arrays; payloads that do not
agree with their schema are left out, and the caller counts them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from vehnav.errors import FormatError
from vehnav.logs.messages import objects, ros
from vehnav.logs.messages.payload import Declaration, Decoder, Wanted
from vehnav.logs.messages.types import Struct


@dataclass(frozen=True)
class Encoding:
    """One row of the table."""

    schema_encodings: tuple[str, ...]
    tree: Callable[[Declaration], Struct]
    decoder: Callable[[Declaration, Struct, Wanted], Decoder]


ENCODINGS: Final[dict[str, Encoding]] = {
    "cdr": Encoding(("ros2msg",), ros.ros2_tree, ros.ros2_decoder),
    "ros1": Encoding(("ros1msg",), ros.ros1_tree, ros.ros1_decoder),
    "json": Encoding((), objects.json_tree, objects.json_decoder),
    "protobuf": Encoding(("protobuf",), objects.protobuf_tree, objects.protobuf_decoder),
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
