"""MCAP records: framing and the few record types that a reader needs, every length checked.

Format: https://mcap.dev/spec. A record is an opcode (u8), a length (u64) and that many bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET = range(9, 15)
DATA_END = 15

FRAME = struct.Struct("<BQ")
MESSAGE_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log", "<u8"),
        ("publish", "<u8"),
    ]
)
"""A message record up to its payload, frame included: 31 bytes."""
INDEX_ENTRY = np.dtype([("log", "<u8"), ("offset", "<u8")])
FIXED_MESSAGE = 22
"""Bytes of a message's content before its payload."""


class Source:
    """A file that is read at offsets; never more than it holds."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open("rb", buffering=0)
        self.size = self._file.seek(0, 2)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def read(self, offset: int, count: int) -> bytes:
        """``count`` bytes from ``offset``, or as many as there are."""
        count = max(0, min(count, self.size - offset))
        self._file.seek(offset)
        data = self._file.read(count) or b""
        while len(data) < count:
            more = self._file.read(count - len(data))
            if not more:
                break
            data += more
        return data


class Fields:
    """Cursor over the content of one record; running over its end is a FormatError."""

    def __init__(self, data: bytes | memoryview, what: str) -> None:
        self.data = memoryview(data)
        self.at = 0
        self.what = what

    def take(self, count: int) -> memoryview:
        """The next ``count`` bytes."""
        if count > len(self.data) - self.at:
            raise FormatError(f"{self.what} record is cut short")
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, size: int) -> int:
        """The next unsigned integer of ``size`` bytes."""
        return int.from_bytes(self.take(size), "little")

    def blob(self) -> bytes:
        """Bytes behind their u32 length."""
        return bytes(self.take(self.number(4)))

    def text(self) -> str:
        """UTF-8 behind its u32 length; broken characters are marked, not fatal."""
        return self.blob().decode("utf-8", "replace")


@dataclass(frozen=True)
class Schema:
    """Schema record."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """Channel record."""

    id: int
    schema_id: int
    topic: str
    encoding: str


@dataclass(frozen=True)
class ChunkHead:
    """Chunk record without its data; ``data_at`` counts from the record's content."""

    first_ns: int
    last_ns: int
    uncompressed_size: int
    crc: int
    compression: str
    data_at: int
    data_size: int


@dataclass(frozen=True)
class ChunkIndex:
    """Chunk index record of the summary."""

    start: int
    length: int
    index_length: int
    compression: str

    @property
    def end(self) -> int:
        """Behind the chunk and its message indexes."""
        return self.start + self.length + self.index_length


@dataclass(frozen=True)
class Footer:
    """Footer record."""

    summary_start: int
    summary_offset_start: int
    crc: int


def frame(data: bytes | memoryview, at: int = 0) -> tuple[int, int]:
    """Opcode and content length of the record that begins at ``at``."""
    opcode, length = FRAME.unpack_from(data, at)
    return int(opcode), int(length)


def frames(data: bytes | memoryview, start: int = 0) -> Iterator[tuple[int, int, int]]:
    """(opcode, begin, end) of the content of each complete record in ``data``.

    Raises
    ------
    FormatError
        The last record runs over the end of ``data``.
    """
    at, size = start, len(data)
    while at < size:
        if at + 9 > size:
            raise FormatError("a record is cut short")
        opcode, length = FRAME.unpack_from(data, at)
        if length > size - at - 9:
            raise FormatError(f"a record of {length} bytes runs over the end")
        yield opcode, at + 9, at + 9 + length
        at += 9 + length


def parse_schema(data: bytes | memoryview) -> Schema:
    """Content of a schema record."""
    f = Fields(data, "schema")
    return Schema(f.number(2), f.text(), f.text(), f.blob())


def parse_channel(data: bytes | memoryview) -> Channel:
    """Content of a channel record."""
    f = Fields(data, "channel")
    identity, schema_id = f.number(2), f.number(2)
    return Channel(identity, schema_id, f.text(), f.text())


def parse_chunk_head(data: bytes | memoryview) -> ChunkHead:
    """Beginning of a chunk record's content (which need not be complete)."""
    f = Fields(data, "chunk")
    first_ns, last_ns, size, crc = f.number(8), f.number(8), f.number(8), f.number(4)
    compression = f.text()
    data_size = f.number(8)
    return ChunkHead(first_ns, last_ns, size, crc, compression, f.at, data_size)


def parse_chunk_index(data: bytes | memoryview) -> ChunkIndex:
    """Content of a chunk index record."""
    f = Fields(data, "chunk index")
    f.take(16)
    start, length = f.number(8), f.number(8)
    f.blob()  # places of the message indexes by channel
    return ChunkIndex(start, length, f.number(8), f.text())


def parse_footer(data: bytes | memoryview) -> Footer:
    """Content of a footer record."""
    f = Fields(data, "footer")
    return Footer(f.number(8), f.number(8), f.number(4))


def parse_statistics(data: bytes | memoryview) -> dict[int, int]:
    """Messages per channel id, from the content of a statistics record."""
    f = Fields(data, "statistics")
    f.take(8 + 2 + 4 * 4 + 16)
    counts = _table(f.blob(), np.dtype([("channel", "<u2"), ("count", "<u8")]), "statistics")
    return dict(zip(counts["channel"].tolist(), counts["count"].tolist(), strict=True))


def parse_message_indexes(data: bytes) -> list[tuple[int, npt.NDArray[Any]]]:
    """(channel id, entries) of the message index records that follow a chunk.

    Raises
    ------
    FormatError
        Something else stands there.
    """
    indexes = []
    for opcode, begin, end in frames(data):
        if opcode != MESSAGE_INDEX:
            raise FormatError(f"record of type {opcode} among the message indexes of a chunk")
        f = Fields(memoryview(data)[begin:end], "message index")
        indexes.append((f.number(2), _table(f.blob(), INDEX_ENTRY, "message index")))
    return indexes


def _table(raw: bytes, row: np.dtype[Any], what: str) -> npt.NDArray[Any]:
    """Rows of equal size."""
    if len(raw) % row.itemsize:
        raise FormatError(f"{what} record holds a broken row")
    return np.frombuffer(raw, row)


def heads_at(data: npt.NDArray[np.uint8], at: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    """Message heads at these offsets (each at least 31 bytes before the end of ``data``)."""
    window: npt.NDArray[Any] = np.ndarray(
        (max(data.size - MESSAGE_HEAD.itemsize + 1, 0),),
        dtype=f"V{MESSAGE_HEAD.itemsize}",
        buffer=data,
        strides=(1,),
    )
    return window[at].view(MESSAGE_HEAD)
