"""From channel ids of one MCAP file to the topics of the recording."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.logs.mcap import chunks
from vehnav.logs.mcap import records as rec
from vehnav.logs.mcap.records import FIXED_MESSAGE, MESSAGE_HEAD, Channel, Schema
from vehnav.logs.mcap.report import Report, signed
from vehnav.logs.messages.payload import Batch, Declaration
from vehnav.logs.messages.topics import State, Topic, Topics


class Delivery:
    """Declared channels of one file; takes messages and hands them to their topics.

    Attributes
    ----------
    known : (65536,) bool
        Channel ids that are declared.
    unknown : dict
        Channel id -> messages of channels that were never declared.
    """

    def __init__(self, topics: Topics) -> None:
        self.topics = topics
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.of_channel: dict[int, Topic] = {}
        self.known = np.zeros(1 << 16, bool)
        self.unknown: dict[int, int] = {}

    def declare_schema(self, schema: Schema) -> None:
        """A schema record; the first of an id counts."""
        self.schemas.setdefault(schema.id, schema)

    def declare_channel(self, channel: Channel) -> None:
        """A channel record; the first of an id counts."""
        if channel.id not in self.channels:
            self.channels[channel.id] = channel
            self.known[channel.id] = True

    def topic(self, channel_id: int) -> Topic | None:
        """The topic of a channel, or None for one that is not declared."""
        if channel_id not in self.of_channel:
            channel = self.channels.get(channel_id)
            if channel is None:
                return None
            schema = self.schemas.get(channel.schema_id)
            declared = (
                Declaration(channel.encoding)
                if schema is None
                else Declaration(channel.encoding, schema.name, schema.encoding, schema.data)
            )
            self.of_channel[channel_id] = self.topics.get(channel.topic, declared)
        return self.of_channel[channel_id]

    def take(
        self,
        data: npt.NDArray[np.uint8],
        at: npt.NDArray[np.int64],
        heads: npt.NDArray[Any],
        state: State,
        *,
        count: bool,
    ) -> None:
        """Messages at offsets of a buffer, of any channels.

        Parameters
        ----------
        count : bool
            Whether they count as seen (False where the index has counted them already).
        """
        ids = heads["channel"]
        for channel_id in np.flatnonzero(np.bincount(ids)).tolist():
            rows = np.flatnonzero(ids == channel_id)
            number = rows.size
            mine = slice(None) if number == ids.size else rows  # the first: no copies
            topic = self.topic(channel_id)
            if topic is None:
                self.unknown[channel_id] = self.unknown.get(channel_id, 0) + number
                continue
            if count:
                topic.see(heads["log"][mine].astype(np.int64))
            if topic.unlearnt:
                self.learn(topic, data, int(at[mine][0]), heads[mine][0])
            if topic.collectors:
                topic.add(batch_of(data, at[mine], heads[mine]), state)

    def learn(self, topic: Topic, data: npt.NDArray[np.uint8], at: int, head: np.void) -> None:
        """Let a topic without schema learn from this message."""
        end = at + 9 + int(head["length"])
        self.topics.learn(topic, data[at + MESSAGE_HEAD.itemsize : end].tobytes())


def batch_of(
    data: npt.NDArray[np.uint8], at: npt.NDArray[np.int64], heads: npt.NDArray[Any]
) -> Batch:
    """Message records as payloads."""
    return Batch(
        data,
        at + MESSAGE_HEAD.itemsize,
        heads["length"].astype(np.int64) - FIXED_MESSAGE,
        heads["log"].astype(np.int64),
        heads["publish"].astype(np.int64),
    )


def deliver_chunk(
    delivery: Delivery,
    report: Report,
    head: rec.ChunkHead,
    content: chunks.Chunk,
    indexes: chunks.Indexes,
    *,
    at: int,
    count: bool,
) -> None:
    """Hand out every message that can be found in a chunk, broken as it may be."""
    report.count(content.checksum)
    span = (signed(head.first_ns), signed(head.last_ns))
    found = chunks.find_messages(
        content.data, known=delivery.known, indexes=indexes, whole=not content.problem
    )
    declare(delivery, content.data, found.others)
    if content.problem:
        text = f"chunk at byte {at}: {content.problem}; {found.at.size} messages recovered"
        report.note("chunk-damaged", text, span=span)
    elif found.breaks:
        text = f"chunk at byte {at}: broken records; {found.at.size} messages found around them"
        report.note("chunk-damaged", text, span=span)
    if content.checksum == "wrong":
        text = f"chunk at byte {at}: its checksum does not match; its messages are unverified"
        report.note("checksum-mismatch", text, span=span, level="warning")
    damaged = bool(content.problem or found.breaks)
    state: State = (
        "unverified" if content.checksum == "wrong" else "recovered" if damaged else "sound"
    )
    delivery.take(content.data, found.at, found.heads, state, count=count)


def declare(
    delivery: Delivery, data: npt.NDArray[np.uint8], others: list[tuple[int, int, int]]
) -> None:
    """Schema and channel records of a buffer."""
    view = data.data
    for opcode, begin, end in others:
        try:
            if opcode == rec.SCHEMA:
                delivery.declare_schema(rec.parse_schema(view[begin:end]))
            else:
                delivery.declare_channel(rec.parse_channel(view[begin:end]))
        except FormatError:
            continue  # its messages will count as of an undeclared channel
