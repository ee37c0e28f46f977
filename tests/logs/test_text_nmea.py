"""NMEA against pynmeagps, and the clock: midnight, dates, files without a date."""

from __future__ import annotations

import csv
from functools import reduce

import numpy as np
import pytest

from vehnav.errors import LogError
from vehnav.logs.log import ReadOptions
from vehnav.logs.nmea import read_nmea
from vehnav.logs.read import identify, read_gnss, read_log

pynmeagps = pytest.importorskip("pynmeagps")

NOON = 43200


def sentence(body, *, wrong=False):
    checksum = reduce(lambda a, c: a ^ ord(c), body, 0) ^ (1 if wrong else 0)
    return f"${body}*{checksum:02X}"


def clock(seconds):
    whole = int(seconds)
    return (
        f"{whole // 3600:02d}{whole // 60 % 60:02d}{whole % 60:02d}.{(seconds - whole) * 100:02.0f}"
    )


def gga(tod, minutes=20.2160, quality=1, height="14.1", separation="-33.8"):
    return sentence(
        f"GPGGA,{clock(tod)},42{minutes:07.4f},N,07105.3773,W,{quality},07,1.5,{height},M,"
        f"{separation},M,,"
    )


def rmc(tod, date="080725", minutes=20.2160, state="A", knots="10.0", course="90.0"):
    return sentence(
        f"GNRMC,{clock(tod)},{state},42{minutes:07.4f},N,07105.3773,W,{knots},{course},{date},,,A"
    )


def gst(tod):
    return sentence(f"GPGST,{clock(tod)},1.0,2.0,1.0,45.0,1.1,2.2,3.3")


def put(path, lines):
    path.write_bytes("\r\n".join([*lines, ""]).encode())
    return str(path)


def unix(text):
    return int(np.datetime64(text, "ns").astype(np.int64))


def test_a_drive_against_pynmeagps(tmp_path):
    lines = []
    for k in range(20):
        tod = NOON + 0.5 * k
        lines += [gga(tod, 20.2 + 0.001 * k), gst(tod), rmc(tod, minutes=20.2 + 0.001 * k)]
    path = put(tmp_path / "drive.nmea", lines)
    assert identify(path).name == "NMEA"
    gnss, findings = read_gnss(path)
    assert findings == []
    judged = [pynmeagps.NMEAReader.parse(line) for line in lines]
    fixes = [m for m in judged if m.msgID == "GGA"]
    moves = [m for m in judged if m.msgID == "RMC"]
    # pynmeagps rounds to 10 decimals of a degree
    np.testing.assert_allclose(np.degrees(gnss.lat), [m.lat for m in fixes], atol=6e-11, rtol=0)
    np.testing.assert_allclose(np.degrees(gnss.lon), [m.lon for m in fixes], atol=6e-11, rtol=0)
    np.testing.assert_allclose(gnss.height, [m.alt + m.sep for m in fixes])
    stamps = [unix(f"{m.date}T{m.time}") for m in moves]
    np.testing.assert_array_equal(gnss.t_ns, stamps)
    np.testing.assert_allclose(gnss.v_n[:, 0], [m.spd * 1852 / 3600 for m in moves])  # course east
    np.testing.assert_allclose(gnss.v_n[:, 1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(gnss.sigma_pos, np.tile([2.2, 1.1, 3.3], (20, 1)))


def test_rmc_alone(tmp_path):
    path = put(tmp_path / "x.txt", [rmc(NOON + k, minutes=20.2 + 0.001 * k) for k in range(5)])
    gnss, findings = read_nmea(path)
    assert gnss.t_ns[0] == unix("2025-07-08T12:00:00")
    assert np.all(np.diff(gnss.lat) > 0)
    assert [f.code for f in findings] == ["gps-height-missing"]


@pytest.mark.parametrize("first", ["gga", "rmc"])
def test_midnight(tmp_path, first):
    lines = []
    for k in range(-3, 4):
        date = "311224" if k < 0 else "010125"
        pair = [gga((86400 + k) % 86400), rmc((86400 + k) % 86400, date)]
        lines += pair if first == "gga" else pair[::-1]
    gnss, findings = read_nmea(put(tmp_path / "x.nmea", lines))
    midnight = unix("2025-01-01")
    np.testing.assert_array_equal(gnss.t_ns, midnight + 10**9 * np.arange(-3, 4))
    assert findings == []


def test_a_date_before_the_first_fix_is_not_believed(tmp_path):
    lines = [rmc(NOON + k, "060180", state="V") for k in range(3)]
    lines += [line for k in range(3, 9) for line in (gga(NOON + k), rmc(NOON + k))]
    gnss, _ = read_nmea(put(tmp_path / "x.nmea", lines))
    assert gnss.t_ns[0] == unix("2025-07-08T12:00:03")


def test_two_sessions_in_one_file(tmp_path):
    lines = []
    for date, start in (("080725", NOON), ("100725", NOON - 3600)):
        lines += [s for k in range(5) for s in (gga(start + k), rmc(start + k, date))]
    gnss, _ = read_nmea(put(tmp_path / "x.nmea", lines))
    np.testing.assert_array_equal(gnss.t_ns[:5], unix("2025-07-08T12:00") + 10**9 * np.arange(5))
    np.testing.assert_array_equal(gnss.t_ns[5:], unix("2025-07-10T11:00") + 10**9 * np.arange(5))


def test_trouble_is_counted(tmp_path):
    lines = [line for k in range(20) for line in (gga(NOON + k), rmc(NOON + k))]
    lines[4] = lines[4].replace("4220", "4221")  # bit errors: the checksum tells
    lines[6] = "$GPGGA,120003.00,42"
    lines[8] = gga(NOON + 4, quality=0)
    lines[10] = "rubbish \x00\xff"
    gnss, findings = read_nmea(put(tmp_path / "x.nmea", lines))
    np.testing.assert_array_equal(
        (gnss.t_ns - unix("2025-07-08T12:00")) // 10**9, np.setdiff1d(np.arange(20), [2, 3, 4, 5])
    )
    text = {f.code: f.text for f in findings}
    assert "2 of 39 sentences dropped" in text["bad-rows"]
    assert "1 status no fix" in text["gps-rejected"]


def test_sentences_behind_a_stamp_of_the_logger(tmp_path):
    lines = [
        f"2025-07-08 12:00:{k:02d} > {line}"
        for k in range(5)
        for line in (gga(NOON + k), rmc(NOON + k))
    ]
    path = put(tmp_path / "x.log", lines)
    assert identify(path).name == "NMEA"
    assert read_nmea(path)[0].t_ns.size == 5


def test_standing_without_course(tmp_path):
    lines = [s for k in range(5) for s in (gga(NOON + k), rmc(NOON + k, knots="0.02", course=""))]
    gnss, findings = read_nmea(put(tmp_path / "x.nmea", lines))
    assert np.all(np.abs(gnss.v_n) < 0.02)
    assert findings == []


def test_nothing_in_it(tmp_path):
    with pytest.raises(LogError, match="no GGA or RMC"):
        read_nmea(put(tmp_path / "x.nmea", [sentence("GPGSV,1,1,00")]))
    with pytest.raises(LogError, match=r"no usable fix in 3 sentences"):
        read_nmea(put(tmp_path / "x.nmea", [gga(NOON + k, quality=0) for k in range(3)]))


def test_boston_sentences_without_date(shared_data, tmp_path):
    """The GGA sentences that its CSV carries: the day comes from the IMU beside them."""
    folder = shared_data / "boston_apan"
    with (folder / "driving_gps.csv").open() as file:
        rows = list(csv.DictReader(file))
    path = put(tmp_path / "boston.nmea", [row["gga"] for row in rows])
    alone, findings = read_gnss(path)
    assert [f.code for f in findings] == ["no-date"]
    assert alone.t_ns[0] < 86400 * 10**9
    log = read_log(str(folder / "driving_imu.csv"), ReadOptions(gps_file=path))
    np.testing.assert_array_equal(log.gnss.t_ns, [int(float(r["t_header"])) * 10**9 for r in rows])
    np.testing.assert_allclose(
        np.degrees(log.gnss.lat), [float(r["lat"]) for r in rows], atol=6e-10, rtol=0
    )
