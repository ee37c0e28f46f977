"""Mutated files: a clear error, or records whose numbers are the file's; never a crash.

Seeded and bounded. The records check themselves (finite, strictly increasing, equal lengths), so
what comes back is sound; rows that the mutation did not touch must come back unchanged.
"""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest

from vehnav.errors import VehnavError
from vehnav.logs.read import read_log

ROUNDS = 60
N = 60
T0 = 1_700_000_000_000_000_000


def own_csv():
    rows = [f"{T0 + k * 10_000_000},0.{k:03d},0.2,0.3,0.1,0.2,9.8" for k in range(N)]
    return "\n".join(["t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", *rows, ""])


def gps_csv():
    rows = [f"{1_700_000_000 + k}.000000000,50.{k:05d},14.5,200,1,2,0.1" for k in range(N)]
    names = "time_s,lat_deg,lon_deg,height_m,v_east_m_s,v_north_m_s,v_up_m_s"
    return "\n".join([names, *rows, ""])


def pos():
    rows = [
        f"2025/07/08 19:34:{k % 60:02d}.000 50.{k:05d} 14.5 200 1 9 0.01 0.01 0.02"
        for k in range(N)
    ]
    head = "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)"
    return "\n".join([head, *rows, ""])


def nmea():
    lines = []
    for k in range(N):
        body = f"GPGGA,1200{k:02d}.00,42{k:02d}.2160,N,07105.3773,W,1,07,1.5,14.1,M,-33.8,M,,"
        lines.append(f"${body}*{reduce(lambda a, c: a ^ ord(c), body, 0):02X}")
    return "\r\n".join([*lines, ""])


def gpx():
    points = "".join(
        f'<trkpt lat="50.{k:05d}" lon="14.5"><ele>1</ele>'
        f"<time>2025-07-08T12:00:{k:02d}Z</time></trkpt>"
        for k in range(N)
    )
    return f'<?xml version="1.0"?><gpx><trk><trkseg>{points}</trkseg></trk></gpx>'


FILES = {"x.csv": own_csv, "gps.csv": gps_csv, "x.pos": pos, "x.nmea": nmea, "x.gpx": gpx}
INSERTS = (
    b",",
    b"\n",
    b'"',
    b"nan",
    b"\0",
    b"-",
    b"1e999",
    b"\xff\xfe",
    b"99999999999999999999",
    b";",
)


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """One to four changes: bytes altered, cut out, put in, doubled; or the end cut off."""
    for _ in range(int(rng.integers(1, 5))):
        at, size = int(rng.integers(0, len(data))), int(rng.integers(1, 40))
        kind = int(rng.integers(0, 5))
        if kind == 0:
            data = data[:at] + rng.bytes(min(size, 4)) + data[at + min(size, 4) :]
        elif kind == 1:
            data = data[:at] + data[at + size :]
        elif kind == 2:
            data = data[:at] + INSERTS[int(rng.integers(0, len(INSERTS)))] + data[at:]
        elif kind == 3:
            data = data[: at + size] + data[at:]
        else:
            data = data[: max(at, 1)]
    return data or b"x"


@pytest.mark.parametrize("name", FILES)
def test_mutated_files(tmp_path, name):
    rng = np.random.default_rng(20)
    sound = FILES[name]().encode()
    path = tmp_path / name
    path.write_bytes(sound)
    whole = read_log(str(path))
    kind = "imu" if whole.imu is not None else "gnss"
    read, refused = 0, []
    for _ in range(ROUNDS):
        path.write_bytes(mutate(sound, rng))
        try:
            record = getattr(read_log(str(path)), kind)
        except VehnavError as error:
            refused.append(str(error))
            continue
        read += record is not None
    assert [text for text in refused if not text.startswith(str(path))] == []
    assert read > ROUNDS // 3  # most changes cost a row or two, not the recording


@pytest.mark.parametrize("at", [0.3, 0.5, 0.9])
def test_rows_before_and_after_a_broken_one_are_unchanged(tmp_path, at):
    lines = own_csv().splitlines()
    k = int(at * N)
    lines[k + 1] = lines[k + 1][:25] + "#%&" + lines[k + 1][30:]
    path = tmp_path / "x.csv"
    path.write_text("\n".join([*lines, ""]))
    imu = read_log(str(path)).imu
    np.testing.assert_array_equal(imu.t_ns, np.delete(T0 + 10_000_000 * np.arange(N), k))
    np.testing.assert_allclose(imu.gyro[:, 0], np.delete(np.arange(N) / 1000.0, k), rtol=1e-15)
