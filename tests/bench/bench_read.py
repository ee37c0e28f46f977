"""Reading MCAP: against single-thread decompression and against mcap with mcap-ros2-support.

All by processor time (of all threads), which a busy machine does not stretch as it does wall time.
Files are generated in a temporary folder. ``VEHNAV_BENCH_MESSAGES`` sets the IMU messages (60 000;
one hour at 200 Hz has 720 000), ``VEHNAV_BENCH_CAMERA_MB`` the camera blobs that one of the files
has beside them (100).
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

MESSAGES = int(os.environ.get("VEHNAV_BENCH_MESSAGES", "60000"))
CAMERA_MB = int(os.environ.get("VEHNAV_BENCH_CAMERA_MB", "100"))
CHUNK = 768 * 1024
BLOB = 30_000
STEP_NS = 5_000_000
T0 = 1_700_000_000_000_000_000
REPEATS = 3


@dataclass(frozen=True)
class Kind:
    """One file of the table: its name and how the writer is set."""

    name: str
    compression: str = "zstd"
    ros: int = 2
    camera: bool = False
    indexed: bool = True
    chunked: bool = True


KINDS = (
    Kind("ros2 zstd"),
    Kind("ros2 lz4", "lz4"),
    Kind("ros2 none", "none"),
    Kind("ros1 zstd", ros=1),
    Kind("no index", indexed=False),
    Kind("unchunked", "none", chunked=False),
    Kind("camera zstd", camera=True),
)


def numbers(n: int) -> np.ndarray:
    """(n, 6) angular rate and specific force with the grain of a float32 sensor."""
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(n, 6)) * [0.01] * 3 + [0, 0, 0, 0, 0, 9.8]
    return noise.astype(np.float32).astype(np.float64)


def payloads(n: int, ros: int) -> list[bytes]:
    """sensor_msgs/Imu, frame ``imu_link``, as the layout of logs says (checked by the readers)."""
    head = 4 if ros == 2 else 0
    block = 24 + head
    raw = np.zeros((n, block + 296), np.uint8)
    if ros == 2:
        raw[:, 1] = 1
    t = T0 + STEP_NS * np.arange(n)
    at = head if ros == 2 else 4
    raw[:, at : at + 4] = (t // 10**9).astype("<u4").view(np.uint8).reshape(n, 4)
    raw[:, at + 4 : at + 8] = (t % 10**9).astype("<u4").view(np.uint8).reshape(n, 4)
    text = b"imu_link\0" if ros == 2 else b"imu_link"
    raw[:, at + 8 : at + 12] = np.frombuffer(struct.pack("<I", len(text)), np.uint8)
    raw[:, at + 12 : at + 12 + len(text)] = np.frombuffer(text, np.uint8)
    values = numbers(n).astype("<f8").view(np.uint8).reshape(n, 48)
    gyro = block + 104
    raw[:, gyro : gyro + 24] = values[:, :24]
    raw[:, gyro + 96 : gyro + 120] = values[:, 24:]
    data = raw.tobytes()
    size = raw.shape[1]
    return [data[k * size : (k + 1) * size] for k in range(n)]


def write(path: Path, kind: Kind) -> None:
    """One file, by the official writer."""
    from mcap.writer import CompressionType, IndexType, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind.ros == 1 else Stores.ROS2_HUMBLE)
    text = store.generate_msgdef("sensor_msgs/msg/Imu", ros_version=kind.ros)[0].encode()
    with path.open("wb") as out:
        writer = Writer(
            out,
            chunk_size=CHUNK,
            compression=getattr(CompressionType, kind.compression.upper()),
            index_types=IndexType.ALL if kind.indexed else IndexType.NONE,
            use_chunking=kind.chunked,
        )
        writer.start(f"ros{kind.ros}", "bench")
        slash = "/msg/" if kind.ros == 2 else "/"
        schema = writer.register_schema(f"sensor_msgs{slash}Imu", f"ros{kind.ros}msg", text)
        encoding = "cdr" if kind.ros == 2 else "ros1"
        imu = writer.register_channel("/imu", encoding, schema)
        camera = writer.register_channel("/camera", "raw", 0)
        pool = np.random.default_rng(2).bytes(1000 * BLOB)  # no two alike within a chunk
        blobs = CAMERA_MB * 10**6 // BLOB if kind.camera else 0
        every = max(1, MESSAGES // max(1, blobs))
        per = -(-blobs // (MESSAGES // every)) if blobs else 0
        for k, payload in enumerate(payloads(MESSAGES, kind.ros)):
            t = T0 + STEP_NS * k
            writer.add_message(imu, t, payload, t)
            if per and k % every == 0:
                for copy in range(per):
                    first = (k // every * per + copy) % 1000 * BLOB
                    writer.add_message(camera, t, pool[first : first + BLOB], t)
        writer.finish()


def decompress(path: Path) -> int:
    """Read the file and decompress its chunks, nothing else: the limit."""
    import lz4.frame
    import zstandard

    zstd = zstandard.ZstdDecompressor()
    total = 0
    with path.open("rb", buffering=0) as file:
        size = file.seek(0, 2)
        at = 8
        while at < size - 8:
            file.seek(at)
            head = file.read(9 + 60)
            opcode, length = struct.unpack_from("<BQ", head)
            if opcode == 6:
                (unpacked,) = struct.unpack_from("<Q", head, 9 + 16)
                (name,) = struct.unpack_from("<I", head, 9 + 28)
                compression = head[9 + 32 : 9 + 32 + name]
                skip = 9 + 40 + name
                file.seek(at + skip)
                data = file.read(length + 9 - skip)
                if compression == b"zstd":
                    data = zstd.decompress(data, max_output_size=unpacked)
                elif compression == b"lz4":
                    data = lz4.frame.decompress(data)
                total += len(data)
            elif opcode == 5:  # no chunks: the bytes are all there is to read
                file.seek(at)
                while data := file.read(1 << 20):
                    total += len(data)
                break
            at += 9 + length
    return total


def official(path: Path) -> np.ndarray:
    """The standard way: mcap's reader with mcap-ros2-support."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    rows = []
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, _, m in reader.iter_decoded_messages(topics=["/imu"]):
            g, a = m.angular_velocity, m.linear_acceleration
            rows.append((g.x, g.y, g.z, a.x, a.y, a.z))
    return np.array(rows)


def ours(path: Path) -> np.ndarray:
    """vehnav."""
    from vehnav.logs.log import ReadOptions
    from vehnav.logs.mcap import read_mcap

    imu = read_mcap(path, ReadOptions()).imu
    if imu is None:
        raise SystemExit("no IMU was read")
    return np.hstack([imu.gyro, imu.accel])


def seconds(work: Callable[[], object]) -> float:
    """Processor time of a call, all threads of this process together."""
    start = time.process_time()
    work()
    return time.process_time() - start


def alternating(path: Path) -> tuple[float, float, float]:
    """Medians of the limit, of vehnav and of their ratio; in turns, behind one run to warm up."""
    decompress(path), ours(path)
    pairs = [
        (seconds(lambda: decompress(path)), seconds(lambda: ours(path))) for _ in range(REPEATS)
    ]
    limit, own = (median(pair[k] for pair in pairs) for k in (0, 1))
    return limit, own, median(pair[1] / pair[0] for pair in pairs)


def peak_mb(path: Path) -> float:
    """Greatest memory of a process that reads the file, interpreter and libraries included."""
    code = (
        "import pathlib, re, sys, resource; from vehnav.logs.mcap import read_mcap; "
        "from vehnav.logs.log import ReadOptions; read_mcap(sys.argv[1], ReadOptions()); "
        "status = pathlib.Path('/proc/self/status'); "
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss if not status.exists() else "
        "re.search(r'VmHWM:\\s+(\\d+)', status.read_text())[1])"
    )
    out = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True
    )
    return int(out.stdout) / 1024


def main() -> bool:
    """Print the table; False where numbers differ from those written."""
    print(f"{MESSAGES} IMU messages; camera {CAMERA_MB} MB; limit: decompression alone, 1 thread")
    print(
        f"{'file':<12} {'MB':>6} {'limit ms':>9} {'x limit':>8} {'x mcap-ros2':>12} {'peak MB':>8}"
    )
    expected = numbers(MESSAGES)
    good = True
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            path = Path(folder) / "bench.mcap"
            write(path, kind)
            good &= bool(np.array_equal(ours(path), expected))
            limit, own, ratio = alternating(path)
            slow = ""
            if kind.name == "ros2 zstd":
                rows: list[np.ndarray] = []
                spent = seconds(lambda p=path, out=rows: out.append(official(p)))
                good &= bool(np.array_equal(rows[0], expected))
                slow = f"{spent / own:.0f}"
            print(
                f"{kind.name:<12} {path.stat().st_size / 1e6:6.1f} {1e3 * limit:9.1f} "
                f"{ratio:8.1f} {slow:>12} {peak_mb(path):8.0f}",
                flush=True,
            )
    return good
