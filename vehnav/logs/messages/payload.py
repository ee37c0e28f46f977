"""What containers hand to decoders, and decoders to the rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vehnav.logs.messages.types import Path

Ints = npt.NDArray[np.int64]
Wanted = dict[Path, tuple[str, int]]
"""Leaf -> quantity and column."""


@dataclass(frozen=True)
class Batch:
    """Payloads of one channel lying in one buffer.

    Attributes
    ----------
    data : (b,) uint8
    start, size : (n,) int64
        Where each payload begins in ``data``, and its bytes.
    log_ns, publish_ns : (n,) int64
        The recorder's and the sender's clock.
    """

    data: npt.NDArray[np.uint8]
    start: npt.NDArray[np.int64]
    size: npt.NDArray[np.int64]
    log_ns: npt.NDArray[np.int64]
    publish_ns: npt.NDArray[np.int64]


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
