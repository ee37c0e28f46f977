"""The careful path: a file read from front to back, whatever is wrong with it.

Nothing that the file says is trusted beyond its end. Where the framing breaks, the search goes on
for the next chunk or message; what was lost is noted, never passed over.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.logs.mcap import chunks
from vehnav.logs.mcap import records as rec
from vehnav.logs.mcap.delivery import Delivery, declare, deliver_chunk
from vehnav.logs.mcap.records import Source
from vehnav.logs.mcap.report import Report, signed
from vehnav.logs.messages.topics import State

WINDOW = 4 << 20
MAX_RECORD = 256 << 20
"""A loose record larger than this is stepped over, not read."""
_CHUNK_HEAD = 9 + 40 + 24
_COMPRESSIONS = {0: b"", 3: b"lz4", 4: b"zstd"}


class Scan:
    """One pass over a file.

    Attributes
    ----------
    closed : bool
        Whether the end of a complete file was met.
    lost_way : bool
        Whether the framing broke since the last sound chunk or run of messages.
    """

    def __init__(self, source: Source, delivery: Delivery, report: Report) -> None:
        self.source = source
        self.delivery = delivery
        self.report = report
        self.closed = False
        self.lost_way = False

    def run(self) -> None:
        """Read everything; damage goes to the report."""
        at = len(rec.MAGIC)
        while at < self.source.size and not self.closed:
            at = self.record(at)
        if not self.closed:
            self.report.note(
                "not-closed", "the file was not closed: its end is missing; what it holds was read"
            )

    def record(self, at: int) -> int:
        """Deal with the record at ``at``; where to go on."""
        frame = self.source.read(at, 9)
        if len(frame) < 9:
            return self.source.size
        opcode, length = rec.frame(frame)
        end = at + 9 + length
        if opcode == rec.CHUNK:
            return self.chunk(at, length)
        if opcode == rec.MESSAGE and length >= rec.FIXED_MESSAGE:
            return self.loose(at, end)
        if not self.plausible(at) or not (end == self.source.size - 8 or self.plausible(end)):
            return self.search(at)
        if opcode in (rec.SCHEMA, rec.CHANNEL) and length <= MAX_RECORD:
            data = np.frombuffer(self.source.read(at + 9, length), np.uint8)
            declare(self.delivery, data, [(opcode, 0, length)])
        elif opcode == rec.FOOTER:
            self.closed = self.source.read(end, 8) == rec.MAGIC
        return end

    def plausible(self, at: int) -> bool:
        """Whether a record can begin here."""
        frame = self.source.read(at, 9)
        if len(frame) < 9:
            return False
        opcode, length = rec.frame(frame)
        return (0 < opcode <= rec.DATA_END or opcode >= 0x80) and (
            at + 9 + length <= self.source.size or opcode == rec.CHUNK
        )

    def chunk(self, at: int, length: int) -> int:
        """A chunk and the message indexes behind it."""
        try:
            head = rec.parse_chunk_head(self.source.read(at + 9, _CHUNK_HEAD - 9))
        except FormatError:
            return self.search(at)
        if head.data_at + head.data_size != length:
            return self.search(at)
        end, inside = at + 9 + length, at + 9 + head.data_at
        problem = chunks.refusal(head, min(head.data_size, self.source.size - inside))
        if problem and head.compression == "" and head.data_size == head.uncompressed_size:
            return inside  # plain records, merely many: read as if they stood outside of a chunk
        if problem:
            self.report.note(
                "chunk-refused",
                f"chunk at byte {at}: {problem}",
                span=(signed(head.first_ns), signed(head.last_ns)),
            )
            return end if self.plausible(end) else self.search(at)
        self.lost_way = False
        packed = self.source.read(inside, head.data_size)
        indexes, after = self.indexes_behind(end)
        content = chunks.unpack(head, packed)
        deliver_chunk(self.delivery, self.report, head, content, indexes, at=at, count=True)
        if not indexes and end < self.source.size and not self.plausible(end):
            return self.search(at)
        return after

    def indexes_behind(self, at: int) -> tuple[chunks.Indexes, int]:
        """Message indexes from ``at`` on, as many as are sound, and where they end."""
        indexes: chunks.Indexes = []
        while True:
            frame = self.source.read(at, 9)
            opcode, length = rec.frame(frame) if len(frame) == 9 else (0, 0)
            if opcode != rec.MESSAGE_INDEX or at + 9 + length > self.source.size:
                return indexes, at
            try:
                indexes += rec.parse_message_indexes(self.source.read(at, 9 + length))
            except (FormatError, MemoryError):
                return indexes, at
            at += 9 + length

    def loose(self, at: int, end: int) -> int:
        """Messages outside of chunks: a window of records at once."""
        size = max(WINDOW, min(end - at, MAX_RECORD) + 9)
        data = np.frombuffer(self.source.read(at, size), np.uint8)
        starts, stop = chunks.walk(data)
        kinds = data[np.array(starts, np.int64)]
        other = np.flatnonzero(~np.isin(kinds, (rec.MESSAGE, rec.SCHEMA, rec.CHANNEL)))
        if other.size:
            stop = starts[other[0]]
            starts = starts[: other[0]]
        if not starts:
            return end if end <= self.source.size and end - at > MAX_RECORD else self.search(at)
        broken = not other.size and at + stop < self.source.size and not self.sound(at + stop)
        self.deliver_loose(data, chunks.of_walk(data, starts, stop))
        if broken:  # the length of the last one may be what is wrong
            return self.search(at + starts[-1] + rec.MESSAGE_HEAD.itemsize - 1)
        return at + stop

    def sound(self, at: int) -> bool:
        """Whether a record begins here that ends inside the file."""
        return self.plausible(at) or self.source.read(at, 8) == rec.MAGIC

    def deliver_loose(self, data: npt.NDArray[np.uint8], found: chunks.Found) -> None:
        """Hand out the messages of a window."""
        declare(self.delivery, data, found.others)
        state: State = "recovered" if self.lost_way else "sound"
        self.delivery.take(data, found.at, found.heads, state, count=True)
        self.lost_way = False

    def search(self, at: int) -> int:
        """The next chunk or message behind ``at``; the lost part is noted."""
        begin, width = at + 1, 1 << 16
        while begin < self.source.size:
            data = np.frombuffer(self.source.read(begin, width), np.uint8)
            places = (
                next_chunk(data),
                chunks.next_message(data, 0, self.delivery.known),
            )
            found = [begin + place for place in places if place is not None]
            if found:
                self.lost(at, min(found))
                return min(found)
            begin, width = begin + max(1, width // 2), min(2 * width, 2 * WINDOW)
        self.lost(at, self.source.size)
        return self.source.size

    def lost(self, at: int, end: int) -> None:
        """Note bytes that could not be understood."""
        self.lost_way = True
        self.report.note(
            "bytes-lost", f"{end - at} bytes from byte {at} on are not MCAP records; skipped"
        )


_CHUNK_FRAME = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("times", "V16"),
        ("size", "<u8"),
        ("crc", "<u4"),
        ("name_size", "<u4"),
        ("rest", "V12"),
    ]
)


def next_chunk(data: npt.NDArray[np.uint8]) -> int | None:
    """The first offset where a chunk record begins whose sizes agree."""
    width = _CHUNK_FRAME.itemsize
    if data.size < width:
        return None
    at = np.flatnonzero(data[: data.size - width + 1] == rec.CHUNK)
    window: npt.NDArray[np.void] = np.ndarray(
        (data.size - width + 1,), dtype=f"V{width}", buffer=data, strides=(1,)
    )
    heads = window[at].view(_CHUNK_FRAME)
    likely = np.flatnonzero(np.isin(heads["name_size"], tuple(_COMPRESSIONS)))
    for k in likely.tolist():
        rest, name_size = heads["rest"][k].tobytes(), int(heads["name_size"][k])
        data_size = int.from_bytes(rest[name_size : name_size + 8], "little")
        name = rest[:name_size]
        if (
            name == _COMPRESSIONS[name_size]
            and int(heads["length"][k]) == 40 + name_size + data_size
        ):
            return int(at[k])
    return None
