"""Files that lie about sizes, and random damage: no crash, no hang, no invented number."""

from __future__ import annotations

import struct
import subprocess
import sys
import time
from functools import cache

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap_build import Channel, drive, imu_rows, mcap, ros_channel, store

from vehnav.errors import VehnavError
from vehnav.logs.log import ReadOptions
from vehnav.logs.mcap import read_mcap

HUGE = 1 << 40
MB = 1 << 20
LIMIT_MB = 450
"""The greatest chunk that is unpacked (256 MiB), twice copied in parts, and the libraries."""
SECONDS = 10.0
"""For a file of 100 kB on a busy machine; reading it takes 0.05 s."""


@cache
def imu_channel(n: int = 300) -> Channel:
    return ros_channel("/imu", store(), "sensor_msgs/msg/Imu", imu_rows(drive(n)))


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


MAGIC = b"\x89MCAP0\r\n"
HEADER = record(1, text(b"ros2") + text(b"x"))


def definitions() -> bytes:
    name, language, schema = imu_channel().schema
    one = record(3, struct.pack("<H", 1) + text(name.encode()) + text(language.encode())
                 + text(schema))  # fmt: skip
    return one + record(4, struct.pack("<HH", 1, 1) + text(b"/imu") + text(b"cdr") + text(b""))


def message(log: int, payload: bytes, length: int | None = None) -> bytes:
    size = 22 + len(payload) if length is None else length
    return struct.pack("<BQHIQQ", 5, size, 1, 0, log, log) + payload


def messages() -> bytes:
    return b"".join(message(log, payload) for log, _, payload in imu_channel().messages)


def chunk(compression: bytes, packed: bytes, size: int, data_size: int | None = None) -> bytes:
    declared = len(packed) if data_size is None else data_size
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression) + struct.pack("<Q", declared)
    return record(6, head + packed)


END = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


def hostile_files() -> dict[str, bytes]:
    """Files each with 300 sound messages beside something that declares a huge size."""
    good = definitions() + messages()
    zeros = zstandard.ZstdCompressor().compress(bytes(2000 * MB // 10))
    lz4_zeros = lz4.frame.compress(bytes(100 * MB))
    frame = bytearray(zstandard.ZstdCompressor().compress(bytes(1000)))
    big_frame = b"\x28\xb5\x2f\xfd" + bytes([0xE0]) + struct.pack("<Q", HUGE) + bytes(frame[6:])
    payload = imu_channel().messages[0][2]
    long_string = payload[:12] + struct.pack("<I", 0xFFFFFFF0) + payload[16:]
    files = {
        "chunk of 1 TB": chunk(b"zstd", zeros[:1000], HUGE),
        "chunk of 250 MB out of 1 kB": chunk(b"lz4", lz4_zeros[:1000], 250 * MB),
        "chunk of 16 EB": chunk(b"zstd", zeros[:1000], 2**64 - 1),
        "zeros of 200 MB": chunk(b"zstd", zeros, 200 * MB),
        "frame of 1 TB": chunk(b"zstd", big_frame, 1000),
        "more than declared": chunk(b"lz4", lz4_zeros, 1000),
        "more than declared zstd": chunk(b"zstd", zeros, 1000),
        "uncompressed of 1 TB": chunk(b"", b"abc", HUGE, HUGE),
        "record of 16 EB": struct.pack("<BQ", 5, 2**64 - 1),
        "attachment of 1 TB": struct.pack("<BQ", 9, HUGE),
        "index of 4 GB": record(7, struct.pack("<HI", 1, 0xFFFFFFF0)),
        "schema name of 4 GB": record(3, struct.pack("<HI", 2, 0xFFFFFFF0)),
        "frame id of 4 GB": message(1, long_string),
        "message of 4 GB": message(1, payload, 1 << 32),
    }
    return {name: MAGIC + HEADER + good + bad + END for name, bad in files.items()}


SCRIPT = """
import pathlib, re, resource, sys, time
from vehnav.errors import VehnavError
from vehnav.logs.log import ReadOptions
from vehnav.logs.mcap import read_mcap
for path in sorted(pathlib.Path(sys.argv[1]).glob("*.mcap")):
    start = time.monotonic()
    try:
        log = read_mcap(path, ReadOptions())
        result = str(log.imu.t_ns.size if log.imu else 0) + (" damaged" if log.damaged else " ok")
    except VehnavError as error:
        result = "refused"
    status = pathlib.Path("/proc/self/status")  # getrusage there inherits the parent's peak
    if status.exists():
        peak = int(re.search(r"VmHWM:\\s+(\\d+)", status.read_text())[1]) // 1024
    else:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(path.stem, result, peak, round(time.monotonic() - start, 1), sep="|")
"""


def test_huge_sizes_are_refused_without_being_allocated(tmp_path):
    pytest.importorskip("resource")
    files = hostile_files()
    for name, data in files.items():
        (tmp_path / f"{name}.mcap").write_bytes(data)
    out = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(tmp_path)], capture_output=True, text=True, check=True
    )
    rows = [line.split("|") for line in out.stdout.splitlines()]
    assert len(rows) == len(files)
    for name, result, peak, seconds in rows:
        assert result.startswith("300 "), f"{name}: {result}"
        assert int(peak) < LIMIT_MB, f"{name}: {peak} MB"
        assert float(seconds) < SECONDS, f"{name}: {seconds} s"


@pytest.mark.parametrize(
    "definition",
    [
        b"float64[1000000000000] a\nImu imu\n",
        b"float64[18446744073709551616] a\nImu imu\n",
        b"Big[1000000000] a\nImu imu\n" + b"=" * 80 + b"\nMSG: a/Big\nfloat64[100000] b\n",
        b"string[4000000000] a\nImu imu\n",
    ],
)
def test_a_schema_of_a_huge_message_is_refused(tmp_path, definition):
    definition += b"=" * 80 + b"\nMSG: a/Imu\nfloat64[3] gyro\nfloat64[3] accel\n"
    rows = [(k, k, bytes([0, 1, 0, 0]) + bytes(400)) for k in range(500)]
    bad = Channel("/bad", "cdr", ("a/msg/B", "ros2msg", definition), rows)
    path = tmp_path / "x.mcap"
    path.write_bytes(mcap([bad, imu_channel()]))
    log = read_mcap(path, ReadOptions())
    assert log.imu.source == "/imu"


@pytest.mark.parametrize("count", [5, 1000, 0xFFFFFFFF])
@pytest.mark.parametrize("element", ["float64", "Nothing", "Label"])
def test_a_count_that_lies_makes_a_bad_message(tmp_path, count, element):
    line = b"=" * 80
    schema = f"{element}[] many\nImu imu\n".encode()
    schema += line + b"\nMSG: a/Imu\nfloat64[3] gyro\nfloat64[3] accel\n"
    schema += line + b"\nMSG: a/Label\nstring text\n" + line + b"\nMSG: a/Nothing\nuint8 x\n"
    body = np.arange(1.0, 7.0).tobytes()
    sound = b"\0\1\0\0" + bytes(8) + body
    lying = b"\0\1\0\0" + struct.pack("<I", count) + bytes(4) + body
    rows = [(k + 1, k + 1, lying if k == 7 else sound) for k in range(50)]
    path = tmp_path / "x.mcap"
    path.write_bytes(mcap([Channel("/x", "cdr", ("a/msg/B", "ros2msg", schema), rows)]))
    log = read_mcap(path, ReadOptions())
    assert log.integrity["bad"] == 1
    assert log.imu.t_ns.size == 49
    np.testing.assert_array_equal(log.imu.accel, np.tile([4.0, 5.0, 6.0], (49, 1)))


# ---- random damage -----------------------------------------------------------------------------


@cache
def originals() -> list[bytes]:
    whole = [imu_channel()]
    return [
        mcap(whole, compression=kind, chunk_size=20_000, **more)
        for kind in ("none", "zstd", "lz4")
        for more in ({}, {"use_chunking": False})
        if kind == "none" or not more
    ]


UNCHUNKED = 1  # of the originals
SIZES = [0, 1, 22, 255, 2**31, 2**32 - 1, 2**62, 2**63, 2**64 - 1]


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """One to four damages of kinds that disks, networks and programs make."""
    damaged = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(8, len(damaged)))
        size = int(rng.integers(1, 300))
        kind = rng.integers(7)
        if kind == 0:
            damaged[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            damaged[at : at + size] = rng.bytes(len(damaged[at : at + size]))
        elif kind == 2:
            damaged[at : at + size] = bytes(len(damaged[at : at + size]))
        elif kind == 3:
            del damaged[at : at + size]
        elif kind == 4:
            other = int(rng.integers(8, len(damaged)))
            damaged[at:at] = damaged[other : other + size]
        elif kind == 5:
            value = SIZES[rng.integers(len(SIZES))]
            damaged[at : at + 8] = struct.pack("<Q", value)[: len(damaged[at : at + 8])]
        else:
            del damaged[at:]
        if len(damaged) < 40:
            break
    return bytes(damaged)


def numbers(log) -> np.ndarray:
    return np.column_stack([log.imu.t_ns, log.imu.gyro.view("i8"), log.imu.accel.view("i8")])


@pytest.mark.parametrize("block", range(4))
def test_random_damage_never_crashes_hangs_or_invents(tmp_path, block):
    """Samples that were not written come only out of parts that are marked."""
    d = drive(300)
    original = {
        row.tobytes() for row in np.column_stack([d.t, d.gyro.view("i8"), d.accel.view("i8")])
    }
    path = tmp_path / "x.mcap"
    delivered = 0
    for seed in range(block * 60, block * 60 + 60):
        rng = np.random.default_rng(seed)
        data = mutate(originals()[seed % len(originals())], rng)
        path.write_bytes(data)
        start = time.monotonic()
        try:
            log = read_mcap(path, ReadOptions(time="header"))
        except VehnavError:
            continue
        finally:
            assert time.monotonic() - start < SECONDS, seed
        if log.imu is None:
            continue
        delivered += log.imu.t_ns.size
        strange = [row for row in numbers(log) if row.tobytes() not in original]
        if seed % len(originals()) == UNCHUNKED:  # no checksums: only what stands in the file
            assert all(row[1:4].tobytes() in data and row[4:].tobytes() in data for row in strange)
            continue
        counts = log.integrity
        assert len(strange) <= counts["unverified"] + counts["recovered"], seed
        assert not strange or log.damaged, seed
    assert delivered > 60 * 300 / 2  # most of most files comes back
