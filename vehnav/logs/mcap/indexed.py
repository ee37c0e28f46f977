"""The fast path: messages found through the indexes of a file that proves to be whole.

Used only where structure and counts agree (:func:`read_index` says why not otherwise); each chunk
is checked again when it is read.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.logs.mcap import chunks
from vehnav.logs.mcap import records as rec
from vehnav.logs.mcap.delivery import Delivery, batch_of, deliver_chunk
from vehnav.logs.mcap.records import ChunkIndex, Footer, Source
from vehnav.logs.mcap.report import Report

MAX_SUMMARY_BYTES = 512 << 20
"""Of the summary section; a day of driving has some MB."""


@dataclass
class Summary:
    """The summary section.

    Attributes
    ----------
    counts : dict or None
        Messages per channel id; None without a statistics record.
    data_end : int
        Where the data section ends (behind its DataEnd record).
    """

    schemas: list[rec.Schema]
    channels: list[rec.Channel]
    chunks: list[ChunkIndex]
    counts: dict[int, int] | None
    data_end: int


@dataclass
class IndexedChunk:
    """A chunk and its message indexes, by channel id."""

    place: ChunkIndex
    entries: dict[int, npt.NDArray[Any]]


def read_summary(source: Source) -> Summary:
    """The summary section, its checksum verified where there is one.

    Raises
    ------
    FormatError
        Why there is none to rely on.
    """
    foot_size = 9 + 20 + len(rec.MAGIC)
    if source.size < 2 * len(rec.MAGIC) + foot_size:
        raise FormatError("the file is too short to have been closed")
    tail = source.read(source.size - foot_size, foot_size)
    if len(tail) < foot_size:
        raise FormatError("the file shrank while it was read")
    opcode, length = rec.frame(tail)
    if tail[-8:] != rec.MAGIC or (opcode, length) != (rec.FOOTER, 20):
        raise FormatError("the file was not closed: its end is missing")
    footer = rec.parse_footer(tail[9:29])
    end = source.size - foot_size
    if footer.summary_start == 0:
        return Summary([], [], [], None, end)
    if not len(rec.MAGIC) <= footer.summary_start <= end:
        raise FormatError("the footer points outside of the file")
    return _parse_summary(source, footer, end, tail)


def _parse_summary(source: Source, footer: Footer, end: int, tail: bytes) -> Summary:
    size = end - footer.summary_start
    if size > MAX_SUMMARY_BYTES:
        raise FormatError(f"a summary of {size} bytes")
    data = source.read(footer.summary_start, size)
    # the checksum covers the summary and the footer up to its own crc field
    if footer.crc and zlib.crc32(tail[:25], zlib.crc32(data)) != footer.crc:
        raise FormatError("the checksum of the summary does not match")
    summary = Summary([], [], [], None, footer.summary_start)
    for opcode, begin, stop in rec.frames(data):
        content = memoryview(data)[begin:stop]
        if opcode == rec.SCHEMA:
            summary.schemas.append(rec.parse_schema(content))
        elif opcode == rec.CHANNEL:
            summary.channels.append(rec.parse_channel(content))
        elif opcode == rec.CHUNK_INDEX:
            summary.chunks.append(rec.parse_chunk_index(content))
        elif opcode == rec.STATISTICS:
            summary.counts = rec.parse_statistics(content)
    return summary


def read_index(
    source: Source, summary: Summary, see: Callable[[int, npt.NDArray[np.int64]], bool]
) -> list[IndexedChunk]:
    """Message indexes of all chunks, proven to name every message of the file.

    Parameters
    ----------
    see : callable
        Told each channel id with the log times of its messages in a chunk; says whether the
        entries are worth keeping.

    Raises
    ------
    FormatError
        Why they cannot be relied on.
    """
    if summary.counts is None:
        raise FormatError("the file has no message counts")
    declared = {channel.id for channel in summary.channels}
    if any(count and channel not in declared for channel, count in summary.counts.items()):
        raise FormatError("the summary does not repeat the channels")
    places = sorted(summary.chunks, key=lambda place: place.start)
    _check_gaps(source, places, summary.data_end)
    found: dict[int, int] = {}
    result = []
    for place in places:
        entries: dict[int, npt.NDArray[Any]] = {}
        block = source.read(place.start + place.length, place.index_length)
        for channel, rows in rec.parse_message_indexes(block):
            if not rows.size:  # old recorders wrote such for channels absent from the chunk
                continue
            found[channel] = found.get(channel, 0) + rows.size
            if channel not in declared:
                raise FormatError("a message index of an undeclared channel")
            if see(channel, rows["log"].astype(np.int64)):
                before = entries.get(channel)
                entries[channel] = rows if before is None else np.concatenate([before, rows])
        result.append(IndexedChunk(place, entries))
    counted = {channel: count for channel, count in summary.counts.items() if count}
    if found != counted:
        raise FormatError(
            f"{sum(counted.values())} messages are counted, {sum(found.values())} are indexed"
        )
    return result


_BETWEEN = {rec.HEADER, rec.SCHEMA, rec.CHANNEL, rec.ATTACHMENT, rec.METADATA, rec.DATA_END}


def _check_gaps(source: Source, places: list[ChunkIndex], data_end: int) -> None:
    """Between the indexed chunks lies nothing that could hold messages."""
    at = len(rec.MAGIC)
    for place in [*places, None]:
        end = data_end if place is None else place.start
        while at < end:
            frame = source.read(at, 9)
            if len(frame) < 9:
                raise FormatError("the data section is cut short")
            opcode, length = rec.frame(frame)
            if opcode not in _BETWEEN and opcode < 0x80:
                raise FormatError("messages or chunks outside of the index")
            at += 9 + length
        if at != end:
            raise FormatError("the chunk index does not agree with the file")
        if place is not None:
            at = place.end
            if place.length < 49 or at > data_end or at <= place.start:
                raise FormatError("the chunk index points outside of the file")


def read_indexed(
    source: Source, index: list[IndexedChunk], delivery: Delivery, report: Report
) -> None:
    """Hand out the messages of all topics that are collected, chunk by chunk."""
    for chunk in index:
        wanted = {}
        for channel, entries in chunk.entries.items():
            topic = delivery.topic(channel)
            if topic is not None and topic.collectors:
                wanted[channel] = entries
        if wanted:
            _read_chunk(source, chunk.place, wanted, delivery, report)
        chunk.entries.clear()


def learn_topics(source: Source, index: list[IndexedChunk], delivery: Delivery) -> None:
    """Let topics without schema learn from their first messages."""
    for chunk in index:
        for channel, entries in chunk.entries.items():
            topic = delivery.topic(channel)
            if topic is None or not topic.unlearnt:
                continue
            try:
                content = chunks.unpack(*_chunk_record(source, chunk.place))
            except FormatError:
                continue  # said when its messages are read
            heads = chunks.indexed(content.data, channel, entries[:1])
            if heads is not None:
                delivery.learn(topic, content.data, int(entries["offset"][0]), heads[0])


def _read_chunk(
    source: Source,
    place: ChunkIndex,
    wanted: dict[int, npt.NDArray[Any]],
    delivery: Delivery,
    report: Report,
) -> None:
    try:
        head, packed = _chunk_record(source, place)
    except FormatError as error:
        _without_head(source, place, delivery, report, str(error))
        return
    content = chunks.unpack(head, packed)
    heads = {ch: chunks.indexed(content.data, ch, entries) for ch, entries in wanted.items()}
    if content.problem or content.checksum == "wrong" or any(h is None for h in heads.values()):
        indexes = _all_indexes(source, place)
        deliver_chunk(delivery, report, head, content, indexes, at=place.start, count=False)
        return
    report.count(content.checksum)
    for channel, entries in wanted.items():
        found, topic = heads[channel], delivery.topic(channel)
        if found is not None and topic is not None:
            at = entries["offset"].astype(np.int64)
            topic.add(batch_of(content.data, at, found), "sound")


def _chunk_record(source: Source, place: ChunkIndex) -> tuple[rec.ChunkHead, bytes]:
    """Head and packed bytes of a chunk record.

    Raises
    ------
    FormatError
        No chunk, or one that must not be unpacked.
    """
    beginning = source.read(place.start, 9 + 64)
    opcode, size = rec.frame(beginning) if len(beginning) > 9 else (0, 0)
    if opcode != rec.CHUNK or size + 9 != place.length:
        raise FormatError("no chunk where the index names one")
    head = rec.parse_chunk_head(beginning[9:])
    if head.data_at + head.data_size != size:
        raise FormatError("its sizes do not agree")
    problem = chunks.refusal(head, head.data_size)
    if problem:
        raise FormatError(problem)
    return head, source.read(place.start + 9 + head.data_at, head.data_size)


def _all_indexes(source: Source, place: ChunkIndex) -> chunks.Indexes:
    return rec.parse_message_indexes(source.read(place.start + place.length, place.index_length))


def _without_head(
    source: Source, place: ChunkIndex, delivery: Delivery, report: Report, problem: str
) -> None:
    """A chunk whose head is broken: its messages still lie there unless it is packed."""
    if place.compression or place.length > chunks.MAX_CHUNK_BYTES:
        report.note("chunk-lost", f"chunk at byte {place.start}: {problem}; it is packed and lost")
        return
    skip = 9 + 40  # frame and head of a chunk without compression
    raw = source.read(place.start + skip, place.length - skip)
    found = chunks.find_messages(
        np.frombuffer(raw, np.uint8),
        known=delivery.known,
        indexes=_all_indexes(source, place),
        whole=True,
    )
    text = f"chunk at byte {place.start}: {problem}; {found.at.size} messages recovered"
    report.note("chunk-damaged", text)
    delivery.take(np.frombuffer(raw, np.uint8), found.at, found.heads, "recovered", count=False)
