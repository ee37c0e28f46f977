"""Damaged files: everything that is still in them comes back, and what is wrong is said.

One file of 10 000 IMU messages in 10 chunks, damaged in memory in every way that recordings are.
What must come back is counted here from the bytes of the file, not by the reader.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from functools import cache

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap_build import Channel, Drive, drive, imu_rows, mcap, ros_channel, stamp, store, xyz

from vehnav.errors import LogError
from vehnav.logs.log import ReadOptions
from vehnav.logs.mcap import read_mcap

N = 10_000
CHUNK = 384 * 1024
HEAD = 31  # of a message record, before its payload


def read(tmp_path, data: bytes, **options):
    path = tmp_path / "log.mcap"
    path.write_bytes(data)
    return read_mcap(path, ReadOptions(**options))


@cache
def samples() -> Drive:
    """Noise with the grain of a float32 sensor."""
    d = drive(N)
    d.gyro = (d.gyro * 1e-2).astype("f4").astype(float)
    d.accel = d.accel.astype("f4").astype(float)
    return d


@cache
def payloads() -> list[tuple[int, int, bytes]]:
    return ros_channel("/imu", store(), "sensor_msgs/msg/Imu", imu_rows(samples())).messages


@cache
def channel() -> Channel:
    """The IMU alone."""
    whole = ros_channel("/imu", store(), "sensor_msgs/msg/Imu", [])
    whole.messages = payloads()
    return whole


@cache
def file(compression: str = "zstd", **options) -> bytes:
    return mcap([channel()], compression=compression, chunk_size=CHUNK, **options)


@dataclass
class Record:
    """A top-level record: where it begins, its content, where it ends."""

    opcode: int
    start: int
    begin: int
    end: int


def records(data: bytes) -> list[Record]:
    """Top-level records by the book."""
    found, at = [], 8
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append(Record(opcode, at, at + 9, at + 9 + length))
        at += 9 + length
    return found


def chunks(data: bytes) -> list[Record]:
    return [r for r in records(data) if r.opcode == 6]


def packed(data: bytes, chunk: Record) -> tuple[int, int]:
    """Where the (compressed) records of a chunk lie in the file."""
    (name,) = struct.unpack_from("<I", data, chunk.begin + 28)
    return chunk.begin + 40 + name, chunk.end


def unpack(data: bytes, chunk: Record) -> bytes:
    begin, end = packed(data, chunk)
    (size,) = struct.unpack_from("<Q", data, chunk.begin + 16)
    raw = data[begin:end]
    if raw[:4] == b"\x28\xb5\x2f\xfd":
        return zstandard.ZstdDecompressor().decompress(raw, max_output_size=size)
    return lz4.frame.decompress(raw) if raw[:4] == b"\x04\x22\x4d\x18" else raw


def messages_in(content: bytes) -> list[int]:
    """Offsets of the complete message records of a chunk's content."""
    found, at = [], 0
    while at + 9 <= len(content):
        opcode, length = struct.unpack_from("<BQ", content, at)
        if at + 9 + length > len(content):
            break
        if opcode == 5:
            found.append(at)
        at += 9 + length
    return found


def per_chunk(data: bytes) -> list[int]:
    return [len(messages_in(unpack(data, c))) for c in chunks(data)]


def patched(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


def flipped(data: bytes, at: int, bit: int = 0) -> bytes:
    return patched(data, at, bytes([data[at] ^ (1 << bit)]))


def identical(log) -> int:
    """How many delivered samples are exactly those written; none may be delivered twice."""
    d = samples()
    index = np.searchsorted(d.t, log.imu.t_ns)
    index = np.minimum(index, N - 1)
    same = d.t[index] == log.imu.t_ns
    same &= (d.gyro[index] == log.imu.gyro).all(axis=1)
    same &= (d.accel[index] == log.imu.accel).all(axis=1)
    return int(same.sum())


def codes(log) -> set[str]:
    return {f.code for f in log.findings}


# ---- the file as it should be ------------------------------------------------------------------


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_the_whole_file(tmp_path, compression):
    assert sum(per_chunk(file(compression))) == N
    log = read(tmp_path, file(compression))
    assert identical(log) == log.imu.t_ns.size == N
    assert not log.damaged


# ---- cut off -----------------------------------------------------------------------------------


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_cut_in_a_chunk(tmp_path, compression):
    data = file(compression)
    chunk = chunks(data)[6]
    begin, end = packed(data, chunk)
    cut = begin + (end - begin) // 2
    before = sum(per_chunk(data)[:6])
    if compression == "none":
        expected = before + len(messages_in(data[begin:cut]))
    else:  # blocks of 128 KiB (zstd) and 64 KiB (lz4); of half a chunk three tenths must come
        expected = before + per_chunk(data)[6] * 3 // 10
    log = read(tmp_path, data[:cut])
    assert identical(log) == log.imu.t_ns.size >= expected
    assert log.damaged
    assert log.integrity["recovered"] == log.imu.t_ns.size - before
    assert {"chunk-damaged", "not-closed"} <= codes(log)


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_cut_behind_a_chunk(tmp_path, compression):
    data = file(compression)
    for cut in (chunks(data)[5].end, chunks(data)[6].start):  # without and with its index
        log = read(tmp_path, data[:cut])
        assert identical(log) == log.imu.t_ns.size == sum(per_chunk(data)[:6])
        assert log.damaged
        assert "not-closed" in codes(log)


@pytest.mark.parametrize("keep", [-1, -8, -20, -60, -200])
def test_cut_in_the_summary(tmp_path, keep):
    log = read(tmp_path, file()[:keep])
    assert identical(log) == log.imu.t_ns.size == N
    assert log.damaged


def test_a_tail_of_zeros_after_a_power_loss(tmp_path):
    data = file()
    cut = chunks(data)[6].start
    log = read(tmp_path, data[:cut] + bytes(len(data) - cut))
    assert identical(log) == log.imu.t_ns.size == sum(per_chunk(data)[:6])
    assert log.damaged
    assert "bytes-lost" in codes(log)


# ---- bits and blocks ---------------------------------------------------------------------------


def message_at(data: bytes, chunk: int, k: int) -> int:
    """Offset in an uncompressed file of the k-th message of a chunk."""
    begin, end = packed(data, chunks(data)[chunk])
    return begin + messages_in(data[begin:end])[k]


def test_a_bit_in_a_payload(tmp_path):
    data = file("none")
    at = message_at(data, 3, 700) + HEAD + 4 + 128 + 6  # in angular_velocity.x
    log = read(tmp_path, flipped(data, at, 3))
    assert log.imu.t_ns.size == N
    assert identical(log) == N - 1
    assert log.integrity["unverified"] == per_chunk(data)[3]
    assert log.damaged
    unverified = next(f for f in log.findings if f.code == "unverified")
    stamps = samples().t + 1_000_000  # log times
    first = sum(per_chunk(data)[:3])
    assert unverified.start_ns == stamps[first]
    assert unverified.end_ns == stamps[first + per_chunk(data)[3] - 1]


@pytest.mark.parametrize("bit", [0, 3, 7, 12, 20, 33, 63])
@pytest.mark.parametrize("index", [True, False])
def test_a_bit_in_a_record_length(tmp_path, bit, index):
    data = file("none") if index else without_indexes()
    at = message_at(data, 3, 700) + 1 + bit // 8
    log = read(tmp_path, flipped(data, at, bit % 8))
    assert identical(log) >= N - 1 - (0 if index else 1)
    assert log.imu.t_ns.size - identical(log) == 0
    assert log.damaged


@cache
def without_indexes() -> bytes:
    from mcap.writer import IndexType

    return mcap([channel()], compression="none", chunk_size=CHUNK, index=IndexType.NONE)


def test_a_packed_chunk_that_unpacks_to_something_else(tmp_path):
    """zstd without its own checksum: some flipped bits are not noticed."""
    data = file("zstd")
    chunk = chunks(data)[4]
    begin, end = packed(data, chunk)
    original = unpack(data, chunk)
    rng = np.random.default_rng(0)
    for at in rng.integers(begin + 1000, end, 4000):
        bad = flipped(data, int(at), int(at) % 8)
        try:
            content = unpack(bad, chunk)
        except zstandard.ZstdError:
            continue
        if len(content) == len(original) and content != original:
            break
    else:
        pytest.fail("no such bit")
    log = read(tmp_path, bad)
    assert log.imu.t_ns.size >= N - per_chunk(data)[4]
    assert identical(log) >= N - per_chunk(data)[4]
    assert log.integrity["unverified"] > 0
    assert log.damaged


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_packed_chunk_that_does_not_unpack(tmp_path, compression):
    data = file(compression)
    counts = per_chunk(data)
    chunk = chunks(data)[3]
    begin, end = packed(data, chunk)
    at = begin + (end - begin) // 2
    log = read(tmp_path, patched(data, at, b"\xff" * 64))
    lost = counts[3] - counts[3] * 3 // 10
    assert identical(log) >= N - lost
    assert log.damaged
    unsure = log.integrity["unverified"] + log.integrity["recovered"]
    assert log.imu.t_ns.size - identical(log) <= unsure


@pytest.mark.parametrize("compression", ["zstd", "none"])
@pytest.mark.parametrize("closed", [True, False])
def test_a_block_of_zeros_over_a_chunk_head(tmp_path, compression, closed):
    data = file(compression)
    counts = per_chunk(data)
    bad = patched(data, chunks(data)[4].start - 100, bytes(4096))
    log = read(tmp_path, bad if closed else bad[:-60])
    # uncompressed, only the messages under the zeros are lost
    lost = counts[4] if compression == "zstd" else 4096 // 300 + 2
    assert identical(log) == log.imu.t_ns.size >= N - lost
    assert log.damaged
    assert codes(log) & {"chunk-lost", "chunk-damaged", "bytes-lost"}


def test_zeros_in_the_message_indexes(tmp_path):
    data = file()
    index = next(r for r in records(data) if r.opcode == 7 and r.start > chunks(data)[4].end - 1)
    for at, size in ((index.start, 9), (index.begin + 100, 64), (index.begin, 6)):
        log = read(tmp_path, patched(data, at, bytes(size)))
        assert identical(log) == log.imu.t_ns.size == N


def test_an_index_that_points_elsewhere(tmp_path):
    """Offsets of one index entry shifted to the middle of a payload: the chunk is walked."""
    data = file("none")
    index = next(r for r in records(data) if r.opcode == 7)
    at = index.begin + 6 + 16 * 5 + 8
    (offset,) = struct.unpack_from("<Q", data, at)
    log = read(tmp_path, patched(data, at, struct.pack("<Q", offset + 40)))
    assert identical(log) == log.imu.t_ns.size == N


# ---- structures that lie -----------------------------------------------------------------------


def with_loose_messages(data: bytes, count: int) -> bytes:
    """Messages behind the last chunk of an indexed file, counted nowhere."""
    end = next(r for r in records(data) if r.opcode == 15)
    loose = b"".join(
        struct.pack("<BQHIQQ", 5, 22 + len(payload), 1, 0, log, publish) + payload
        for log, publish, payload in payloads()[:count]
    )
    changed = data[: end.start] + loose + data[end.start :]
    footer = next(r for r in records(changed) if r.opcode == 2)
    (start,) = struct.unpack_from("<Q", changed, footer.begin)
    return patched(changed, footer.begin, struct.pack("<QQI", start + len(loose), 0, 0))


def test_messages_outside_of_the_chunks_of_an_indexed_file(tmp_path):
    some = Channel(channel().topic, "cdr", channel().schema, payloads()[100:])
    data = with_loose_messages(mcap([some], chunk_size=CHUNK), 100)
    log = read(tmp_path, data)
    assert identical(log) == log.imu.t_ns.size == N


def test_a_compression_that_is_not_known(tmp_path):
    data = file("zstd")
    counts = per_chunk(data)
    one = patched(data, chunks(data)[2].begin + 32, b"brot")
    log = read(tmp_path, one)
    assert identical(log) == log.imu.t_ns.size == N - counts[2]
    assert log.damaged
    assert "brot" in " ".join(f.text for f in log.findings)
    for chunk in chunks(data):
        one = patched(one, chunk.begin + 32, b"brot")
    log = read(tmp_path, one)
    assert log.imu is None
    assert log.damaged
    assert "brot" in " ".join(f.text for f in log.findings)


def test_statistics_that_promise_more(tmp_path):
    data = file()
    statistics = next(r for r in records(data) if r.opcode == 11)
    at = statistics.end - 8
    assert struct.unpack_from("<Q", data, at) == (N,)
    bad = patched(data, at, struct.pack("<Q", N + 500))
    footer = next(r for r in records(bad) if r.opcode == 2)
    bad = patched(bad, footer.begin + 16, bytes(4))
    log = read(tmp_path, bad)
    assert identical(log) == log.imu.t_ns.size == N
    assert log.integrity["declared"] == N + 500
    assert log.damaged
    assert "500 of 10500" in next(f.text for f in log.findings if f.code == "messages-lost")


@pytest.mark.parametrize("length", [0, 3, 4, 100, 320])
def test_messages_that_are_too_short_are_counted(tmp_path, length):
    rows = list(payloads()[:2000])
    for k in range(50, 2000, 100):
        rows[k] = (rows[k][0], rows[k][1], rows[k][2][:length])
    log = read(tmp_path, mcap([Channel("/imu", "cdr", channel().schema, rows)]))
    assert identical(log) == log.imu.t_ns.size == 1980
    assert log.integrity["bad"] == 20
    bad = next(f for f in log.findings if f.code == "bad-messages")
    assert "20 of 2000" in bad.text
    assert (bad.start_ns, bad.end_ns) == (rows[50][0], rows[1950][0])
    assert log.damaged


@pytest.mark.parametrize("extra", [1, 3, 4, 50])
def test_messages_that_are_too_long(tmp_path, extra):
    """Up to 3 bytes of padding are usual; more is another type."""
    rows = [(log, publish, data + bytes(extra)) for log, publish, data in payloads()[:200]]
    log = read(tmp_path, mcap([Channel("/imu", "cdr", channel().schema, rows)]))
    assert (log.imu is not None) == (extra <= 3)
    if log.imu is None:
        assert "length" in " ".join(f.text for f in log.findings)


def test_payloads_of_another_type_are_no_numbers(tmp_path):
    types = store()
    fixes = ros_channel(
        "/imu", types, "sensor_msgs/msg/NavSatFix",
        [(t, {"header": stamp(t, "gps"), "latitude": 48.0}) for t in samples().t[:300]],
    )  # fmt: skip
    fixes.schema = channel().schema
    log = read(tmp_path, mcap([fixes]))
    assert log.imu is None
    assert "none of its 300 messages" in " ".join(f.text for f in log.findings)


def test_log_times_at_the_ends_of_the_range(tmp_path):
    rows = [(log, publish, data) for log, publish, data in payloads()[:500]]
    rows[0] = (0, 0, rows[0][2])
    rows[499] = (2**64 - 1, 2**64 - 1, rows[499][2])
    log = read(tmp_path, mcap([Channel("/imu", "cdr", channel().schema, rows)]))
    assert identical(log) == log.imu.t_ns.size == 500


def test_a_definition_that_comes_after_its_messages(tmp_path):
    """The first chunk, which declares the channel, is lost; a later one declares it again."""
    first = mcap([Channel("/imu", "cdr", channel().schema, payloads()[:500])])
    second = mcap([Channel("/imu", "cdr", channel().schema, payloads()[500:900])])
    body = chunks(first)[0]
    content = unpack(first, body)
    loose = content[messages_in(content)[0] :]
    log = read(tmp_path, first[: body.start] + loose + second[chunks(second)[0].start :][:-60])
    assert identical(log) == log.imu.t_ns.size == 900


def test_messages_of_a_channel_that_is_never_declared(tmp_path):
    data = mcap([channel(), Channel("/x", "json", None, [(1, 1, b"{}")] * 7)], use_chunking=False)
    second = [r for r in records(data) if r.opcode == 4][1]
    end = next(r for r in records(data) if r.opcode == 15)  # the summary declares it again
    bad = patched(data, second.start, b"\x80")[: end.start]  # an application's own record
    log = read(tmp_path, bad)
    assert identical(log) == N
    assert "7 messages" in next(f.text for f in log.findings if f.code == "undeclared-channel")


# ---- unchunked files ---------------------------------------------------------------------------


@cache
def loose_file() -> bytes:
    return mcap([channel()], use_chunking=False)


def test_an_unchunked_file_that_is_cut(tmp_path):
    data = loose_file()
    messages = [r for r in records(data) if r.opcode == 5]
    log = read(tmp_path, data[: messages[7_345].start + 50])
    assert identical(log) == log.imu.t_ns.size == 7_345
    assert log.damaged


@pytest.mark.parametrize("bit", [0, 5, 9, 18, 40])
def test_a_bit_in_a_length_of_an_unchunked_file(tmp_path, bit):
    data = loose_file()
    message = [r for r in records(data) if r.opcode == 5][6000]
    log = read(tmp_path, flipped(data, message.start + 1 + bit // 8, bit % 8))
    assert identical(log) == log.imu.t_ns.size >= N - 2
    assert log.damaged


def test_zeros_in_an_unchunked_file(tmp_path):
    data = loose_file()
    message = [r for r in records(data) if r.opcode == 5][6000]
    log = read(tmp_path, patched(data, message.start + 17, bytes(4096)))
    assert identical(log) == log.imu.t_ns.size >= N - 4096 // 300 - 2
    assert log.damaged
    assert "bytes-lost" in codes(log)


# ---- split recordings --------------------------------------------------------------------------


def test_a_folder_of_split_files_whose_last_was_not_closed(tmp_path):
    folder = tmp_path / "drive"
    folder.mkdir()
    for k in range(12):  # 10 and 11 come after 9
        part = Channel("/imu", "cdr", channel().schema, payloads()[k * 100 : (k + 1) * 100])
        data = mcap([part])
        (folder / f"drive_{k}.mcap").write_bytes(data if k < 11 else data[:-60])
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    log = read_mcap(folder, ReadOptions())
    assert identical(log) == log.imu.t_ns.size == 1200
    assert log.damaged
    (folder / "drive_12.mcap").write_bytes(b"")
    assert read_mcap(folder, ReadOptions()).imu.t_ns.size == 1200
    with pytest.raises(LogError, match=r"no \.mcap"):
        read_mcap(tmp_path, ReadOptions())


def test_whole_split_files_are_no_damage(tmp_path):
    for k in range(3):
        part = Channel("/imu", "cdr", channel().schema, payloads()[k * 100 : (k + 1) * 100])
        (tmp_path / f"d_{k}.mcap").write_bytes(mcap([part]))
    log = read_mcap(tmp_path, ReadOptions())
    assert identical(log) == log.imu.t_ns.size == 300
    assert not log.damaged
    assert log.contents[0]["count"] == 300


def test_other_drives_in_one_folder_are_not_one_recording(tmp_path):
    """Merged, the second would be taken for repeated stamps of the first."""
    part = mcap([Channel("/imu", "cdr", channel().schema, payloads()[:100])])
    (tmp_path / "city.mcap").write_bytes(part)
    (tmp_path / "highway.mcap").write_bytes(part)
    with pytest.raises(LogError, match=r"not the parts of one recording \(city.mcap, highway.mcap"):
        read_mcap(tmp_path, ReadOptions())


def test_the_checksums_of_the_tests_are_those_of_the_format():
    data = file("none")
    chunk = chunks(data)[0]
    (crc,) = struct.unpack_from("<I", data, chunk.begin + 24)
    assert crc == zlib.crc32(unpack(data, chunk)) != 0
    assert xyz((1, 2, 3)) == {"x": 1.0, "y": 2.0, "z": 3.0}
