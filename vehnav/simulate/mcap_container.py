"""The container of an MCAP file (mcap.dev/spec), written chunk by chunk from arrays of records."""

from __future__ import annotations

import io
import zlib
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Schema,
    Statistics,
    SummaryOffset,
)

Bytes = npt.NDArray[np.uint8]
Times = npt.NDArray[np.int64]

MAGIC = b"\x89MCAP0\r\n"


def _bytes(*records: Any) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _interleaved(records: list[Bytes], times: list[Times]) -> tuple[bytes, list[Times]]:
    """Records of all topics in the order of time, and the offset of each topic's records."""
    sizes = np.concatenate([np.full(r.shape[0], r.shape[1], np.int64) for r in records])
    order = np.argsort(np.concatenate(times), kind="stable")
    offsets = np.empty(sizes.size, np.int64)
    offsets[order] = np.concatenate([[0], np.cumsum(sizes[order])[:-1]])
    out = np.empty(int(sizes.sum()), np.uint8)
    split = np.split(offsets, np.cumsum([r.shape[0] for r in records])[:-1])
    for rows, places in zip(records, split, strict=True):
        if rows.size:
            out[places[:, None] + np.arange(rows.shape[1])] = rows
    return out.tobytes(), split


class Container:
    """An MCAP file in the making; ``declare`` all channels, then chunks, then ``finish``."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._crc = 0
        self._compressor = zstandard.ZstdCompressor(level=9)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._indexes: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        self._write(MAGIC + _bytes(Header(profile="ros2", library="vehnav")))

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._stream.write(data)

    def declare(self, channel: int, topic: str, kind: str, definition: str) -> None:
        """A channel of its own schema; both have the same id, counted from 1."""
        self._schemas.append(
            Schema(id=channel, name=kind, encoding="ros2msg", data=definition.encode())
        )
        self._channels.append(
            Channel(id=channel, topic=topic, message_encoding="cdr", metadata={}, schema_id=channel)
        )
        self._counts[channel] = 0

    def chunk(self, records: list[Bytes], times: list[Times]) -> None:
        """One chunk: message records (n, size) and stamps of every channel, in its order."""
        stamps = np.concatenate(times)
        if stamps.size == 0:
            return
        body, offsets = _interleaved(records, times)
        declared = b"" if self._indexes else _bytes(*self._schemas, *self._channels)
        start, end = int(stamps.min()), int(stamps.max())
        data = declared + body
        packed = self._compressor.compress(data)
        chunk_start = self._stream.tell()
        self._write(_chunk_record(start, end, data, packed))
        chunk_end = self._stream.tell()
        places: dict[int, int] = {}
        for channel, (t, offset) in enumerate(zip(times, offsets, strict=True), start=1):
            if t.size:
                places[channel] = self._stream.tell()
                self._write(_message_index(channel, t, offset + len(declared)))
                self._counts[channel] += t.size
        self._indexes.append(
            ChunkIndex(
                chunk_length=chunk_end - chunk_start,
                chunk_start_offset=chunk_start,
                compression="zstd",
                compressed_size=len(packed),
                message_end_time=end,
                message_index_length=self._stream.tell() - chunk_end,
                message_index_offsets=places,
                message_start_time=start,
                uncompressed_size=len(data),
            )
        )
        old = self._span or (start, end)
        self._span = (min(old[0], start), max(old[1], end))

    def finish(self) -> None:
        """Data end, summary, footer."""
        self._stream.write(_bytes(DataEnd(data_section_crc=self._crc)))
        start, end = self._span or (0, 0)
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._indexes),
            message_count=sum(self._counts.values()),
            message_end_time=end,
            message_start_time=start,
            metadata_count=0,
            schema_count=len(self._schemas),
        )
        summary_start = self._stream.tell()
        summary, offsets = io.BytesIO(), []
        for opcode, group in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._indexes),
        ):
            begin = summary_start + summary.tell()
            summary.write(_bytes(*group))
            length = summary_start + summary.tell() - begin
            offsets.append(
                SummaryOffset(group_length=length, group_opcode=opcode, group_start=begin)
            )
        offset_start = summary_start + summary.tell()
        summary.write(_bytes(*offsets))
        self._stream.write(summary.getvalue())
        self._stream.write(_footer(summary.getvalue(), summary_start, offset_start) + MAGIC)


def _chunk_record(start: int, end: int, data: bytes, packed: bytes) -> bytes:
    """Chunk: times, size and CRC of the plain data, compression, compressed data."""
    head = np.array([start, end, len(data)], "<u8").tobytes()
    crc = zlib.crc32(data).to_bytes(4, "little")
    compression = len(b"zstd").to_bytes(4, "little") + b"zstd"
    body = head + crc + compression + len(packed).to_bytes(8, "little") + packed
    return bytes([6]) + len(body).to_bytes(8, "little") + body


def _message_index(channel: int, t_ns: Times, offsets: Times) -> bytes:
    """MessageIndex: pairs of log time and offset in the plain chunk."""
    pairs = np.stack([t_ns, offsets], axis=-1).astype("<u8").tobytes()
    body = channel.to_bytes(2, "little") + len(pairs).to_bytes(4, "little") + pairs
    return bytes([7]) + len(body).to_bytes(8, "little") + body


def _footer(summary: bytes, summary_start: int, offset_start: int) -> bytes:
    """Footer; its CRC covers the summary and the footer up to the CRC itself."""
    plain = _bytes(
        Footer(summary_start=summary_start, summary_offset_start=offset_start, summary_crc=0)
    )
    crc = zlib.crc32(plain[:-4], zlib.crc32(summary))
    return plain[:-4] + crc.to_bytes(4, "little")
