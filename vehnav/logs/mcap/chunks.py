"""One chunk: decompressed within bounds, as far as it goes; its messages found, come what may."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vehnav.logs.mcap import records as rec
from vehnav.logs.mcap.records import ChunkHead

try:  # the same checksum seven times faster, where there is a build for the machine
    from isal.isal_zlib import crc32
except ImportError:
    from zlib import crc32

Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int64]
Indexes = list[tuple[int, npt.NDArray[Any]]]

MAX_CHUNK_BYTES = 256 << 20
"""Of one chunk, packed or not; writers make 1 MiB, at most some tens."""
GREATEST_RATIO = {"zstd": 40_000, "lz4": 256}
"""A format cannot pack better: 128 KiB in 4 bytes (zstd, RFC 8878), 255 bytes in one (lz4)."""
RUN = 8
"""Records of one length in a row behind which more of them are looked for at once."""
SEARCH_BLOCK = 4 << 20
_PIECE = 4096


@dataclass(frozen=True)
class Chunk:
    """Content of a chunk.

    Attributes
    ----------
    data : (b,) uint8
        As much of it as could be unpacked.
    problem : str
        "" where all of it is there.
    checksum : {"sound", "absent", "wrong", "untested"}
    """

    data: Bytes
    problem: str
    checksum: str


def unpack(head: ChunkHead, packed: bytes) -> Chunk:
    """Decompress a chunk; what does not unpack is left out, never invented.

    Parameters
    ----------
    head : ChunkHead
    packed : bytes
        May be cut short.

    Notes
    -----
    A size that no compressor can have reached is refused before anything is allocated.
    """
    data, problem = _expand(head, packed)
    if not problem and len(data) != head.uncompressed_size:
        problem = f"{len(data)} of {head.uncompressed_size} declared bytes"
    checksum = "untested" if head.crc else "absent"
    if head.crc and not problem:
        checksum = "sound" if crc32(data) == head.crc else "wrong"
    return Chunk(np.frombuffer(data, np.uint8), problem, checksum)


def refusal(head: ChunkHead, packed_size: int) -> str:
    """Why a chunk must not be unpacked at all, or ""."""
    size = head.uncompressed_size
    if max(size, head.data_size) > MAX_CHUNK_BYTES:
        return f"declares {size} bytes, more than the {MAX_CHUNK_BYTES} allowed in a chunk"
    ratio = GREATEST_RATIO.get(head.compression)
    if ratio is not None and size > ratio * (packed_size + 64):
        return f"declares {size} bytes out of {packed_size}, more than {head.compression} can pack"
    if head.compression not in ("", "zstd", "lz4"):
        return f"compression {head.compression[:20]!r} is not known"
    return ""


def _expand(head: ChunkHead, packed: bytes) -> tuple[bytes, str]:
    """Unpacked bytes and what was wrong."""
    problem = refusal(head, max(len(packed), head.data_size))
    if problem:
        return b"", problem
    if head.compression == "":
        cut = len(packed) < head.data_size
        return packed[: head.uncompressed_size], "cut short" if cut else ""
    whole = _whole_zstd if head.compression == "zstd" else _whole_lz4
    pieces = _zstd_pieces if head.compression == "zstd" else _lz4_pieces
    if len(packed) == head.data_size:
        data = whole(packed, head.uncompressed_size)
        if data is not None:
            return data, ""
    return _as_far_as_it_goes(pieces(packed), head.uncompressed_size)


def _whole_zstd(packed: bytes, size: int) -> bytes | None:
    import zstandard

    try:
        if zstandard.frame_content_size(packed) > size:
            return None  # the frame's own size would be allocated
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    except (zstandard.ZstdError, MemoryError):
        return None


def _whole_lz4(packed: bytes, size: int) -> bytes | None:
    import lz4.frame

    decompressor = lz4.frame.LZ4FrameDecompressor()
    try:
        data: bytes = decompressor.decompress(packed, max_length=size + 1)
    except (RuntimeError, ValueError, EOFError, MemoryError):
        return None
    return data if decompressor.eof and len(data) == size else None


def _as_far_as_it_goes(pieces: Iterator[bytes], size: int) -> tuple[bytes, str]:
    """Pieces up to the first error, at most ``size`` bytes."""
    data, problem = bytearray(), "cut short"
    try:
        for piece in pieces:
            data += piece
            if len(data) >= size:
                problem = "" if len(data) == size else "holds more than it declares"
                break
    except Exception as error:  # each library has its own; whatever it is, keep what came before
        problem = f"does not unpack ({str(error)[:80]})"
    return bytes(data[:size]), problem


def _zstd_pieces(packed: bytes) -> Iterator[bytes]:
    import zstandard

    with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(packed) as reader:
        while piece := reader.read(_PIECE):
            yield piece


def _lz4_pieces(packed: bytes) -> Iterator[bytes]:
    import lz4.frame

    decompressor = lz4.frame.LZ4FrameDecompressor()
    for at in range(0, len(packed), _PIECE):
        piece = decompressor.decompress(packed[at : at + _PIECE], max_length=1 << 20)
        yield piece
        while not (decompressor.needs_input or decompressor.eof):
            yield decompressor.decompress(b"", max_length=1 << 20)
        if decompressor.eof:
            return


# --- messages of a chunk -------------------------------------------------------------------------


def indexed(data: Bytes, channel: int, entries: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """Heads of the messages that an index names; None unless every one is exactly there."""
    at = entries["offset"].astype(np.int64)
    if at.size and not (at.min() >= 0 and at.max() <= data.size - rec.MESSAGE_HEAD.itemsize):
        return None
    heads = rec.heads_at(data, at)
    sound = _agree(data, channel, entries, at, heads)
    if not sound.all() or not (_apart(at) or _apart(np.sort(at))):
        return None
    return heads


def _apart(at: Ints) -> bool:
    """Whether each message begins behind the head of the one before it."""
    return bool(np.all(at[1:] - at[:-1] >= rec.MESSAGE_HEAD.itemsize))


def _agree(
    data: Bytes, channel: int, entries: npt.NDArray[Any], at: Ints, heads: npt.NDArray[Any]
) -> npt.NDArray[np.bool_]:
    """Which index entries point at a message of this channel and time that ends in the data."""
    length = np.minimum(heads["length"], np.uint64(1 << 62)).astype(np.int64)
    sound: npt.NDArray[np.bool_] = (heads["opcode"] == rec.MESSAGE) & (heads["channel"] == channel)
    sound &= (heads["log"] == entries["log"]) & (length >= rec.FIXED_MESSAGE)
    sound &= at + 9 + length <= data.size
    return sound


@dataclass(frozen=True)
class Found:
    """Messages of a buffer.

    Attributes
    ----------
    at : (n,) int64
        Where their records begin.
    heads : (n,) MESSAGE_HEAD
        With lengths put right where an index shows that they are wrong.
    others : list of (opcode, begin, end)
        Content of schema and channel records.
    stop : int
        Where the last complete record ends.
    breaks : int
        Places where the framing was lost and found again (or not).
    """

    at: Ints
    heads: npt.NDArray[Any]
    others: list[tuple[int, int, int]]
    stop: int
    breaks: int


def walk(data: Bytes, begin: int = 0) -> tuple[list[int], int]:
    """Offsets of the records that follow each other from ``begin``, and where that ends."""
    view, size, unpack_from = data.data, data.size, rec.FRAME.unpack_from
    starts: list[int] = []
    at, before, run = begin, -1, 0
    while at + 9 <= size:
        opcode, length = unpack_from(view, at)
        if opcode == 0 or length > size - at - 9 or (opcode == rec.MESSAGE and length < 22):
            break
        starts.append(at)
        at += 9 + length
        run = run + 1 if length == before else 0
        before = length
        if run == RUN:
            stride = 9 + length
            more = _equal_frames(data, at, stride)
            starts.extend(range(at, at + more * stride, stride))
            at, run = at + more * stride, 0
    return starts, at


def _equal_frames(data: Bytes, at: int, stride: int) -> int:
    """How many records from ``at`` on have the frame of the one before it."""
    count = min((data.size - at) // stride, 4096)
    if not count:
        return 0
    frames = np.ndarray((count, 9), np.uint8, data, at, (stride, 1))
    equal = (frames == data[at - stride : at - stride + 9]).all(axis=1)
    return count if equal.all() else int(np.argmin(equal))


def find_messages(
    data: Bytes, *, known: npt.NDArray[np.bool_], indexes: Indexes, whole: bool
) -> Found:
    """Every message of a buffer of records that may be broken.

    The records are walked; where that breaks, the search goes on at the next offset of the message
    index or the next place that looks like a message.

    Parameters
    ----------
    data : (b,) uint8
    known : (65536,) bool
        Channel ids that are declared.
    indexes : list
        Message indexes of the chunk, or [].
    whole : bool
        Whether ``data`` is complete: then a record that runs over its end is a break.
    """
    trusted = _trusted(data, indexes)
    starts, stop = walk(data)
    anchors: list[int] = []
    breaks = 0
    while stop < data.size:
        # the length of the last record may be what is wrong: its inside is searched, too
        last = max(starts[-1] if starts else stop, anchors[-1] if anchors else 0)
        begin = last + (rec.MESSAGE_HEAD.itemsize if starts or anchors else 1)
        following = _resume(data, begin, known, trusted)
        if following is None:
            breaks += int(whole)
            break
        breaks += 1
        anchors.append(following)
        more, stop = walk(data, following)
        starts += more
    walked = np.array(starts, np.int64)
    if anchors:
        trusted = np.union1d(trusted, np.array(anchors, np.int64))
        walked = np.unique(walked)
    return _merge(data, walked, trusted, stop, breaks)


def _trusted(data: Bytes, indexes: Indexes) -> Ints:
    """Offsets where a message index and the data agree, ascending."""
    parts = [np.zeros(0, np.int64)]
    last = max(0, data.size - rec.MESSAGE_HEAD.itemsize)
    for channel, entries in indexes:
        inside = entries[entries["offset"] <= np.uint64(last)] if data.size >= 31 else entries[:0]
        at = inside["offset"].astype(np.int64)
        heads = rec.heads_at(data, at)
        same = (heads["opcode"] == rec.MESSAGE) & (heads["channel"] == channel)
        parts.append(at[same & (heads["log"] == inside["log"])])
    joined = np.concatenate(parts)
    return joined if np.all(joined[1:] > joined[:-1]) else np.unique(joined)


def _resume(data: Bytes, begin: int, known: npt.NDArray[np.bool_], trusted: Ints) -> int | None:
    """The next place from ``begin`` on where a message begins."""
    later = trusted[np.searchsorted(trusted, begin) :]
    guess = next_message(data, begin, known)
    if later.size:
        return int(later[0]) if guess is None else min(int(later[0]), guess)
    return guess


def next_message(data: Bytes, begin: int, known: npt.NDArray[np.bool_]) -> int | None:
    """The first offset from ``begin`` that looks like a message with a record behind it."""
    last = data.size - rec.MESSAGE_HEAD.itemsize
    block, width = begin, 4096
    while block <= last:
        window = data[block : min(block + width, last + 1)]
        at = np.flatnonzero(window == rec.MESSAGE) + block
        heads = rec.heads_at(data, at)
        length = heads["length"]
        likely = (length >= rec.FIXED_MESSAGE) & (length <= data.size) & known[heads["channel"]]
        at, length = at[likely], length[likely].astype(np.int64)
        end = at + 9 + length
        at, end = at[end <= data.size], end[end <= data.size]
        follows = (end == data.size) | np.isin(
            data[np.minimum(end, data.size - 1)],
            (rec.MESSAGE, rec.SCHEMA, rec.CHANNEL, rec.MESSAGE_INDEX, rec.DATA_END, rec.CHUNK),
        )
        if follows.any():
            return int(at[follows][0])
        block, width = block + width, min(2 * width, SEARCH_BLOCK)  # mostly it is near
    return None


def of_walk(data: Bytes, starts: list[int], stop: int) -> Found:
    """What a walk that went well has found."""
    return _merge(data, np.array(starts, np.int64), np.zeros(0, np.int64), stop, 0)


def _merge(data: Bytes, starts: Ints, trusted: Ints, stop: int, breaks: int) -> Found:
    """Walked and indexed offsets together; an indexed message ends one that runs into it."""
    opcode = data[starts]
    message = starts[opcode == rec.MESSAGE]
    lost = trusted[:0]
    if not np.array_equal(trusted, message):
        lost = np.setdiff1d(trusted, message, assume_unique=True)
    others = []
    for at in starts[(opcode == rec.SCHEMA) | (opcode == rec.CHANNEL)].tolist():
        kind, length = rec.FRAME.unpack_from(data.data, at)
        others.append((kind, at + 9, at + 9 + length))
    if lost.size:
        message, breaks = np.union1d(message, lost), breaks + 1
    heads = rec.heads_at(data, message).copy()
    if breaks:
        message, heads = _cut_to_neighbours(data, message, heads, trusted)
    return Found(message, heads, others, stop, breaks)


def _cut_to_neighbours(
    data: Bytes, at: Ints, heads: npt.NDArray[Any], trusted: Ints
) -> tuple[Ints, npt.NDArray[Any]]:
    """Messages end where the next indexed one begins; walked ones inside an indexed one go."""
    limit = np.append(trusted, data.size)[np.searchsorted(trusted, at, side="right")]
    length = np.minimum(heads["length"], np.uint64(data.size)).astype(np.int64)
    end = np.minimum(at + 9 + length, limit)
    is_trusted = np.isin(at, trusted)
    reach = np.maximum.accumulate(np.where(is_trusted, end, 0))
    inside = ~is_trusted & (at < np.append(0, reach[:-1]))
    good = ~inside & (end - at >= rec.MESSAGE_HEAD.itemsize)
    heads["length"] = end - at - 9
    return at[good], heads[good]
