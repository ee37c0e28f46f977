"""Tables of numbers: the same samples written in many ways come back as the same arrays."""

from __future__ import annotations

import numpy as np
import pytest

from vehnav.errors import ConfigError, FormatError, LogError
from vehnav.logs.columns import QUANTITIES, UNIT_SPELLINGS, name_and_unit
from vehnav.logs.csv import read_csv, read_csv_gnss, read_csv_speed
from vehnav.logs.log import ReadOptions
from vehnav.logs.table import Table, sniff

T0 = 1_700_000_000_123_456_789
N = 40


def samples(n=N, seed=3):
    """Stamps, rad/s and m/s2 that six decimals hold exactly."""
    rng = np.random.default_rng(seed)
    t = T0 + 10_000_000 * np.arange(n)
    gyro = np.rint(rng.normal(size=(n, 3)) * 1e5) / 1e6
    accel = np.rint((rng.normal(size=(n, 3)) + [0.0, 0.0, 9.8]) * 1e6) / 1e6
    return t, gyro, accel


def write(path, header, columns, *, delimiter=",", decimal=".", encoding="utf-8", newline="\n"):
    """A table; columns are lists of ready texts."""
    rows = [delimiter.join(fields).replace(".", decimal) for fields in zip(*columns, strict=True)]
    text = newline.join([*([header] if header else []), *rows, ""])
    path.write_bytes(text.encode(encoding))
    return str(path)


def texts(values, form="%.6f"):
    return [[form % v for v in column] for column in np.atleast_2d(np.asarray(values).T)]


def own_table(path, header="t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", **more):
    t, gyro, accel = samples()
    return write(path, header, [[str(v) for v in t], *texts(gyro), *texts(accel)], **more)


def assert_samples(log, *, rtol=0.0, time_atol=0):
    t, gyro, accel = samples()
    assert np.max(np.abs(log.imu.t_ns - t)) <= time_atol
    np.testing.assert_allclose(log.imu.gyro, gyro, rtol=rtol)
    np.testing.assert_allclose(log.imu.accel, accel, rtol=rtol)


OPTIONS = ReadOptions()


def test_own_format_is_exact(tmp_path):
    log = read_csv(own_table(tmp_path / "own.csv"), OPTIONS)
    assert_samples(log)
    assert log.findings == ()
    assert log.unix_clock
    assert not log.damaged
    assert log.integrity["rows"] == N
    assert log.contents[0]["count"] == N
    assert log.contents[0]["rate_hz"] == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("delimiter", "decimal"),
    [
        (",", "."),
        (";", "."),
        ("\t", "."),
        (" ", "."),
        (";", ","),
        ("\t", ","),
        (" ", ","),
        ("|", "."),
    ],
)
def test_delimiters_and_decimal_signs(tmp_path, delimiter, decimal):
    header = "t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z".replace(",", delimiter)
    path = own_table(tmp_path / "x.txt", header, delimiter=delimiter, decimal=decimal)
    assert_samples(read_csv(path, OPTIONS))


@pytest.mark.parametrize(
    "more",
    [{"newline": "\r\n"}, {"encoding": "utf-8-sig"}, {"encoding": "utf-16"}],
    ids=str,
)
def test_line_ends_and_encodings(tmp_path, more):
    assert_samples(read_csv(own_table(tmp_path / "x.csv", **more), OPTIONS))


@pytest.mark.parametrize(
    "header",
    [
        "t_ns,acc",
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]",
        "# recorded by hand\n# twice\nTime_ns, GX, GY, GZ, AX, AY, AZ",
        '"t_ns","Gyro_X (rad/s)","Gyro_Y (rad/s)","Gyro_Z (rad/s)","Acc_X (m/s²)",'
        '"Acc_Y (m/s²)","Acc_Z (m/s²)"',
        "%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
        "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
    ],
)
def test_names_that_people_use(tmp_path, header):
    if header == "t_ns,acc":
        header = "t_ns,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z"
    assert_samples(read_csv(own_table(tmp_path / "x.csv", header), OPTIONS))


def test_every_unit_spelling_is_a_unit_of_some_group():
    for unit, spellings in UNIT_SPELLINGS.items():
        for spelling in spellings.split(","):
            assert name_and_unit(f"speed [{spelling}]")[1] == unit


UNIT_CASES = {
    "deg/s and g in the names": (
        "time_ns,gyro_x_dps,gyro_y_dps,gyro_z_dps,accel_x_g,accel_y_g,accel_z_g",
        OPTIONS,
    ),
    "deg/s and g in brackets": (
        "time (ns),gx (deg/s),gy (°/s),gz (dps),ax (g),ay (G),az [g]",
        OPTIONS,
    ),
    "deg/s and g declared": (
        "t_ns,gx,gy,gz,ax,ay,az",
        ReadOptions(gyro_unit="deg/s", accel_unit="g"),
    ),
}


@pytest.mark.parametrize("case", UNIT_CASES)
def test_units(tmp_path, case):
    header, options = UNIT_CASES[case]
    t, gyro, accel = samples()
    columns = [
        [str(v) for v in t],
        *texts(np.degrees(gyro), "%.17g"),
        *texts(accel / 9.80665, "%.17g"),
    ]
    log = read_csv(write(tmp_path / "x.csv", header, columns), options)
    assert_samples(log, rtol=4e-16 * 4)  # two roundings each way


def test_a_unit_that_contradicts_the_header_is_said(tmp_path):
    header = "t_ns,gyro_x_dps,gyro_y_dps,gyro_z_dps,accel_x,accel_y,accel_z"
    log = read_csv(own_table(tmp_path / "x.csv", header), ReadOptions(gyro_unit="rad/s"))
    assert_samples(log)
    assert [f.code for f in log.findings] == ["unit-contradiction"] * 3


def test_an_undeclared_unit_is_said(tmp_path):
    log = read_csv(own_table(tmp_path / "x.csv", "t_ns,gx,gy,gz,ax,ay,az"), OPTIONS)
    assert [(f.code, f.level) for f in log.findings] == [("unit-assumed", "info")] * 2
    with pytest.raises(ConfigError, match=r"'furlong' is not a unit of gyro_x"):
        read_csv(own_table(tmp_path / "y.csv"), ReadOptions(gyro_unit="furlong"))


@pytest.mark.parametrize(
    ("name", "form", "time_atol"),
    [
        ("time_s", lambda t: f"{t // 10**9}.{t % 10**9:09d}", 0),  # float64 has 119 ns here
        ("time_s", lambda t: f"{t // 10**9}.{t % 10**9 // 1000:06d}", 999),
        ("time_ms", lambda t: f"{t // 10**6}.{t % 10**6 // 1000:03d}", 999),
        ("time_us", lambda t: str(t // 1000), 999),
        ("timestamp", lambda t: str(t // 1000), 999),
        ("timestamp", lambda t: str(t), 0),
        ("time", lambda t: f"{np.datetime64(t, 'ns')}Z", 0),
        ("time", lambda t: str(np.datetime64(t // 1000, "us")), 999),
    ],
)
def test_time_columns_keep_every_digit(tmp_path, name, form, time_atol):
    t, gyro, accel = samples()
    header = f"{name},gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    stamps = [form(int(v)) for v in t]
    log = read_csv(
        write(tmp_path / "x.csv", header, [stamps, *texts(gyro), *texts(accel)]), OPTIONS
    )
    assert_samples(log, time_atol=time_atol)
    if time_atol:  # the digits that were written, exactly
        assert np.all(log.imu.t_ns % 1000 == 0)


@pytest.mark.parametrize(("scale", "unit"), [(1e-9, "s"), (1e-6, "ms"), (1e-3, "us"), (1.0, "ns")])
def test_unit_of_a_time_column_from_its_step(tmp_path, scale, unit):
    t, gyro, accel = samples()
    stamps = [f"{(v - T0) * scale:.3f}" for v in t]
    header = "t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    log = read_csv(
        write(tmp_path / "x.csv", header, [stamps, *texts(gyro), *texts(accel)]), OPTIONS
    )
    np.testing.assert_array_equal(log.imu.t_ns, t - T0)
    assert not log.unix_clock
    (finding,) = log.findings
    assert finding.code == "unit-inferred"
    assert f"taken as time in {unit}:" in finding.text


def test_declared_columns(tmp_path):
    """Other names, another order, a turned sign, a column by its number, units by option."""
    t, gyro, accel = samples()
    columns = [
        *texts(-accel / 9.80665, "%.17g"),
        [f"{v // 1000}" for v in t],
        *texts(np.degrees(gyro), "%.17g"),
    ]
    path = write(tmp_path / "x.csv", "forward,left,up,clock,p,q,r", columns)
    names = {"accel_x": "-forward", "accel_y": "-left", "accel_z": "-3", "time_us": "clock"}
    options = ReadOptions(
        columns={**names, "gyro_x": "p", "gyro_y": "Q", "gyro_z": "r"},
        gyro_unit="deg/s",
        accel_unit="g",
    )
    assert_samples(read_csv(path, options), rtol=2e-15, time_atol=999)


def test_headerless_columns_go_by_number(tmp_path):
    t, gyro, accel = samples()
    path = write(tmp_path / "x.csv", "", [[str(v) for v in t], *texts(gyro), *texts(accel)])
    with pytest.raises(LogError, match=r"no column for gyro_x.*the file has 1, 2, 3, 4, 5, 6, 7"):
        read_csv(path, OPTIONS)
    names = ("t_ns", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    options = ReadOptions(columns={name: str(k + 1) for k, name in enumerate(names)})
    assert_samples(read_csv(path, options))


def test_increments(tmp_path):
    header = "t_ns,dtheta_x,dtheta_y,dtheta_z,dvel_x,dvel_y,dvel_z"
    log = read_csv(own_table(tmp_path / "x.csv", header), OPTIONS)
    assert log.imu.sampling == "increments"
    assert_samples(log)


# ---- trouble ---------------------------------------------------------------------------------


def spoil(tmp_path, change):
    """The own table with its lines changed by ``change(lines)``."""
    path = tmp_path / "bad.csv"
    own_table(path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join(change(lines)) + "\n")
    return str(path)


def test_without_gyro_columns_the_error_says_what_there_is(tmp_path):
    path = own_table(tmp_path / "x.csv", "t_ns,a,b,c,accel_x,accel_y,accel_z")
    with pytest.raises(LogError) as error:
        read_csv(path, OPTIONS)
    text = str(error.value)
    assert "no column for gyro_x, gyro_y, gyro_z" in text
    assert "--columns gyro_x=NAME" in text
    assert "t_ns, a, b, c, accel_x, accel_y, accel_z" in text


def test_without_time_the_error_says_what_to_set(tmp_path):
    path = own_table(tmp_path / "x.csv", "zeit,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z")
    with pytest.raises(LogError, match=r"no time column.*--columns time_s=NAME"):
        read_csv(path, OPTIONS)


@pytest.mark.parametrize(
    ("columns", "error", "words"),
    [
        ({"gyro_x": "wx"}, LogError, r"no column 'wx' \(--columns gyro_x=wx\); the file has t_ns"),
        ({"gyr_x": "gyro_x"}, ConfigError, r"'gyr_x' is not a quantity; did you mean 'gyro_x'"),
        ({"lat_m": "gyro_x"}, ConfigError, r"'lat_m' is not a quantity"),
    ],
)
def test_wrong_declarations(tmp_path, columns, error, words):
    with pytest.raises(error, match=words):
        read_csv(own_table(tmp_path / "x.csv"), ReadOptions(columns=columns))


def test_unknown_preset(tmp_path):
    with pytest.raises(ConfigError, match=r"no preset 'dreden'; did you mean dresden"):
        read_csv(own_table(tmp_path / "x.csv"), ReadOptions(preset="dreden"))


def test_rows_that_are_not_numbers(tmp_path):
    def change(lines):
        lines[5] = lines[5].rsplit(",", 1)[0] + ",broken"
        lines[9] = lines[9].rsplit(",", 1)[0] + ",nan"
        lines[12] = lines[12].rsplit(",", 2)[0]  # a row cut short
        lines[20] += ",1,2"  # a row too long
        lines[-1] = lines[-1][:25]  # the recording broke off
        return lines

    log = read_csv(spoil(tmp_path, change), OPTIONS)
    kept = np.setdiff1d(np.arange(N), [4, 8, 11, 19, N - 1])
    t, _, accel = samples()
    np.testing.assert_array_equal(log.imu.t_ns, t[kept])
    np.testing.assert_array_equal(log.imu.accel, accel[kept])
    text = "\n".join(f.text for f in log.findings)
    assert sorted(f.code for f in log.findings) == ["bad-rows", "bad-rows", "non-finite"]
    assert "1 lines with more than 7 fields dropped (the first is line 21)" in text
    assert "(row 5: 'broken')" in text
    assert "4 of 39 rows dropped" in text
    assert log.damaged


@pytest.mark.parametrize("at", [0, 3, N - 1])
def test_a_long_row_anywhere(tmp_path, at):
    """Two rows run together: pandas alone cuts them silently where the first row is one."""

    def change(lines):
        lines[1 + at] += "," + lines[1 + at]
        return lines

    log = read_csv(spoil(tmp_path, change), OPTIONS)
    t, *_ = samples()
    np.testing.assert_array_equal(log.imu.t_ns, np.delete(t, at))
    (finding,) = log.findings
    assert f"the first is line {at + 2})" in finding.text


def test_an_empty_stamp_costs_one_row_and_no_digits(tmp_path):
    def change(lines):
        lines[7] = lines[7][lines[7].index(",") :]
        return lines

    log = read_csv(spoil(tmp_path, change), OPTIONS)
    t, *_ = samples()
    np.testing.assert_array_equal(log.imu.t_ns, np.delete(t, 6))
    assert [f.code for f in log.findings] == ["non-finite"]


def test_trailing_delimiters_and_blank_lines(tmp_path):
    def change(lines):
        return ["", lines[0], *(line + "," for line in lines[1:]), "", ""]

    assert_samples(read_csv(spoil(tmp_path, change), OPTIONS))


def test_zero_filled_tail(tmp_path):
    path = tmp_path / "x.csv"
    own_table(path)
    path.write_bytes(path.read_bytes() + b"\0" * 5000)
    log = read_csv(str(path), OPTIONS)
    assert_samples(log)
    assert "bad-rows" in {f.code for f in log.findings}


def test_a_column_of_text_is_refused(tmp_path):
    t, gyro, accel = samples()
    header = "t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    columns = [[str(v) for v in t], ["left"] * N, *texts(gyro)[1:], *texts(accel)]
    with pytest.raises(FormatError, match=r"column 'gyro_x' does not hold numbers \(row 1: 'left'"):
        read_csv(write(tmp_path / "x.csv", header, columns), OPTIONS)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello\nworld\n", "no line of numbers"),
        ("t_ns,gyro_x,gyro_y\n", "no line of numbers"),
    ],
)
def test_not_a_table(tmp_path, text, words):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=words):
        read_csv(str(path), OPTIONS)


def test_sniff_names_and_preamble(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("device: A 7\n# two\na;b;c\n1,5;2;3\n4,5;;6\n")
    sheet = sniff(str(path))
    assert (sheet.names, sheet.delimiter, sheet.decimal) == (("a", "b", "c"), ";", ",")
    assert (sheet.skip, sheet.preamble) == (3, ("device: A 7", "# two"))
    np.testing.assert_array_equal(Table(sheet).numbers(0), [1.5, 4.5])


# ---- clocks, GPS and speed -------------------------------------------------------------------


def two_clocks(tmp_path, header_s, log_s):
    _, gyro, accel = samples()
    columns = [texts(log_s)[0], texts(header_s)[0], *texts(gyro), *texts(accel)]
    return write(
        tmp_path / "x.csv", "t_log,t_header,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", columns
    )


def test_the_samples_own_stamps_count_where_they_are_sound(tmp_path):
    header = 1.7e9 + 0.01 * np.arange(N)
    late = header + 0.004
    log = read_csv(two_clocks(tmp_path, header, late), OPTIONS)
    assert log.imu.t_ns[0] == 1_700_000_000_000_000_000
    assert [f.code for f in log.findings] == ["clock-choice"]
    by_hand = read_csv(two_clocks(tmp_path, header, late), ReadOptions(time="log"))
    assert by_hand.imu.t_ns[0] == 1_700_000_000_004_000_000
    seconds_of_day = read_csv(two_clocks(tmp_path, header % 86400, late), OPTIONS)
    assert seconds_of_day.imu.t_ns[0] == 1_700_000_000_004_000_000
    slow = read_csv(two_clocks(tmp_path, 1.7e9 + 0.1 * np.arange(N), late), OPTIONS)
    assert slow.imu.t_ns[0] == 1_700_000_000_004_000_000
    back = header.copy()
    back[7] -= 0.5
    backward = read_csv(two_clocks(tmp_path, back, late), OPTIONS)
    assert backward.imu.t_ns[0] == 1_700_000_000_004_000_000
    assert "runs backward 1 times" in backward.findings[0].text


def test_gps_in_the_rows_of_the_imu(tmp_path):
    """A fix repeated on every row counts once, also while the vehicle stands."""
    t, gyro, accel = samples()
    k = np.arange(N) // 8
    lat = 50.0 + 1e-5 * np.minimum(k, 2)  # stands from the third fix on
    columns = [
        [str(v) for v in t],
        *texts(gyro),
        *texts(accel),
        *texts(lat),
        *texts(np.full(N, 14.5)),
        *texts(100.0 + k, "%.1f"),
        *texts(36.0 + 0 * k, "%.1f"),
        *texts(90.0 + 0 * k, "%.1f"),
        *texts(k, "%d"),
    ]
    header = (
        "t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,latitude,longitude,altitude,"
        "gps_speed_kmh,course,epoch_of_fix"
    )
    path = write(tmp_path / "x.csv", header, columns)
    log = read_csv(path, ReadOptions(columns={"fix_time": "epoch_of_fix"}))
    np.testing.assert_array_equal(log.gnss.t_ns, t[::8])
    np.testing.assert_allclose(np.degrees(log.gnss.lat), lat[::8], rtol=1e-15)
    np.testing.assert_allclose(log.gnss.v_n, np.tile([10.0, 0.0, 0.0], (5, 1)), atol=1e-14)
    assert_samples(log)
    by_change = read_csv(path, OPTIONS)  # height changes with each fix
    np.testing.assert_array_equal(by_change.gnss.t_ns, t[::8])


def test_gps_written_only_where_there_is_a_fix(tmp_path):
    t, gyro, accel = samples()
    lat = [f"{50.0:.6f}" if k % 10 == 0 else "" for k in range(N)]
    columns = [[str(v) for v in t], *texts(gyro), *texts(accel), lat, lat, lat]
    header = "t_ns,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z,lat_deg,lon_deg,height_m"
    log = read_csv(write(tmp_path / "x.csv", header, columns), OPTIONS)
    np.testing.assert_array_equal(log.gnss.t_ns, t[::10])


TRACK = "time_s,lat_deg,lon_deg,height_m,v_east_m_s,v_north_m_s,v_up_m_s"


def track(tmp_path, header, columns):
    n = 30
    t = 1_700_000_000 + np.arange(n)
    lat, lon = 50.0 + 1e-5 * np.arange(n), 14.5 + 0 * t
    known = {"t": t, "lat": lat, "lon": lon, "h": 100.0 + 0 * t, "n": 1.1 + 0 * t, "z": 0.0 * t}
    values = [texts(known[c], "%.9f")[0] for c in columns]
    return write(tmp_path / "gps.csv", header, values), known


def test_gps_tables(tmp_path):
    path, known = track(tmp_path, TRACK, ["t", "lat", "lon", "h", "z", "n", "z"])
    gnss, findings = read_csv_gnss(path, OPTIONS)
    assert findings == []
    np.testing.assert_array_equal(gnss.t_ns, known["t"] * 10**9)
    np.testing.assert_allclose(np.degrees(gnss.lat), known["lat"], rtol=1e-15)
    np.testing.assert_allclose(gnss.height, 100.0)
    np.testing.assert_allclose(gnss.v_n, np.tile([0.0, 1.1, 0.0], (30, 1)))
    assert gnss.sigma_pos is None
    header = "t_log,t_header,lat,lon,alt,hdop"
    path, known = track(tmp_path, header, ["t", "t", "lat", "lon", "h", "n"])
    gnss, _ = read_csv_gnss(path, OPTIONS)
    np.testing.assert_allclose(np.degrees(gnss.lon), known["lon"], rtol=1e-15)
    assert gnss.v_n is None


def test_gps_of_unknown_names_is_declared(tmp_path):
    path, known = track(tmp_path, "zeit,breite,laenge,hoehe,s", ["t", "lat", "lon", "h", "n"])
    with pytest.raises(LogError, match=r"no column for lat_deg; name it with --columns lat_deg="):
        read_csv_gnss(path, OPTIONS)
    options = ReadOptions(
        columns={
            "gps_time_s": "zeit",
            "lat_deg": "breite",
            "lon_deg": "laenge",
            "height_m": "hoehe",
            "sigma_horizontal": "s",
            "gyro_x": "of the recording, not of this file",
        }
    )
    gnss, _ = read_csv_gnss(path, options)
    np.testing.assert_allclose(np.degrees(gnss.lat), known["lat"], rtol=1e-15)
    np.testing.assert_allclose(gnss.sigma_pos[:, :2], 1.1)


def test_speed_table(tmp_path):
    path, known = track(tmp_path, "t_s,speed_kmh", ["t", "n"])
    speed, findings = read_csv_speed(path, OPTIONS)
    assert findings == []
    np.testing.assert_allclose(speed.speed, 1.1 / 3.6, rtol=1e-15)
    np.testing.assert_array_equal(speed.t_ns, known["t"] * 10**9)
    with pytest.raises(LogError, match="no columns for time and speed"):
        read_csv_speed(own_table(tmp_path / "x.csv"), OPTIONS)


def test_every_quantity_has_a_group_with_its_default_unit():
    from vehnav.logs.columns import ALIASES, GROUPS, TIMES

    for quantity in (*ALIASES,):
        assert quantity in QUANTITIES or quantity in TIMES
    for group in GROUPS.values():
        assert group.units[group.default] > 0.0


# ---- real logs -------------------------------------------------------------------------------


def test_dresden(shared_data):
    path = shared_data / "dresden_balzer" / "2014-03-26-000-Data.full.csv"
    log = read_csv(str(path), OPTIONS)
    assert log.imu.t_ns.size == 12187
    assert log.imu.t_ns[0] == pytest.approx(1395837483110.91e6, abs=1000)
    # its README: gyro bias at rest [-1.69 -2.59 -0.02] deg/s, |a| 9.83, over some part of 0-11 s
    rest = log.imu.t_ns < log.imu.t_ns[0] + 10e9
    np.testing.assert_allclose(
        np.degrees(log.imu.gyro[rest].mean(axis=0)), [-1.69, -2.59, -0.02], atol=0.06
    )
    assert np.linalg.norm(log.imu.accel[rest].mean(axis=0)) == pytest.approx(9.83, abs=0.01)
    # 10 Hz for 243.7 s; the greatest speed in the file is 57.83 km/h
    assert log.gnss.t_ns.size == pytest.approx(2437, abs=10)
    assert np.max(np.linalg.norm(log.gnss.v_n, axis=1)) == pytest.approx(57.83 / 3.6)
    # the receiver's velocity is the rate of its own positions
    east = np.gradient(log.gnss.lon * np.cos(log.gnss.lat) * 6.37e6, log.gnss.t_ns * 1e-9)
    moving = np.hypot(log.gnss.v_n[:, 0], log.gnss.v_n[:, 1]) > 5.0
    assert np.corrcoef(east[moving], log.gnss.v_n[moving, 0])[0, 1] > 0.9


def test_drive_0708_units_by_its_names(shared_data):
    log = read_csv(str(shared_data / "drive_0708" / "imu.csv"), OPTIONS)
    assert log.imu.t_ns.size == 54858
    assert log.imu.rate_hz == pytest.approx(100.0, rel=0.01)
    assert log.imu.accel[:3000, 2].mean() == pytest.approx(9.85, abs=0.05)
    assert log.findings == ()


def test_boston_and_ramirez(shared_data):
    folder = shared_data / "boston_apan"
    log = read_csv(str(folder / "driving_imu.csv"), OPTIONS)
    assert log.imu.t_ns.size == 30191
    assert log.imu.rate_hz == pytest.approx(40.2, abs=0.1)
    gnss, _ = read_csv_gnss(str(folder / "driving_gps.csv"), OPTIONS)
    assert gnss.t_ns.size == 755
    gnss, findings = read_csv_gnss(str(shared_data / "boston_ramirez_1hz" / "gps.csv"), OPTIONS)
    assert gnss.t_ns[0] == 1_774_632_159_104_225_000  # t_log: t_header is seconds of the day
    assert "stamps from column 't_log'" in findings[-1].text


def test_kitti(shared_data):
    stem = str(shared_data / "kitti_oxts" / "2011_09_30_drive_0018")
    log = read_csv(stem + "_imu.csv", OPTIONS)
    assert log.imu.t_ns[0] == 1_317_340_799_998_449_000
    gnss, _ = read_csv_gnss(stem + "_truth.csv", OPTIONS)
    assert gnss.t_ns[0] == 1_317_340_799_998_448_849  # nine decimals, not a float64
    assert gnss.v_n[0] == pytest.approx([-0.898412526, 5.446305752, -0.053087894])


def test_a_stray_quotation_mark_costs_one_row(tmp_path):
    def change(lines):
        lines[6] = lines[6].replace(",", ',"', 1)
        return lines

    log = read_csv(spoil(tmp_path, change), OPTIONS)
    t, *_ = samples()
    np.testing.assert_array_equal(log.imu.t_ns, np.delete(t, 5))


@pytest.mark.parametrize("first", ["time_s", "gyro_z"])
@pytest.mark.parametrize("tail", ["", "\n\n"])
def test_nine_decimals_around_a_whole_second(tmp_path, first, tail):
    """A float64 of ....999999999 s is the next second; the digits are not."""
    _, gyro, accel = samples()
    t = 1_700_000_000_999_999_990 + np.arange(N)
    names = ["time_s", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    stamps = [f"{v // 10**9}.{v % 10**9:09d}" for v in t]
    columns = dict(zip(names, [stamps, *texts(gyro), *texts(accel)], strict=True))
    order = sorted(names, key=lambda name: name != first)
    path = write(tmp_path / "x.csv", ",".join(order), [columns[name] for name in order])
    with (tmp_path / "x.csv").open("a") as file:
        file.write(tail)
    np.testing.assert_array_equal(read_csv(path, OPTIONS).imu.t_ns, t)


FLOAT_NS = 240
"""Spacing of a float64 at today's Unix seconds."""


@pytest.mark.parametrize(
    ("other", "rows_lost"), [("", 1), ("nan", 1), ("x", 1), ("{}0", 0), ("{}12345678", 0)]
)
def test_a_stamp_unlike_those_at_the_beginning(tmp_path, other, rows_lost):
    """Behind the sampled lines: the row is lost or read, no other one moves."""
    rows, at = 200, 150
    t = 1_700_000_000_999_999_990 + 10_000_001 * np.arange(rows)
    stamps = [f"{v // 10**9}.{v % 10**9:09d}" for v in t]
    stamps[at] = other.format(stamps[at])
    names = "time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    numbers = [[f"{k}"] * rows for k in range(6)]
    log = read_csv(write(tmp_path / "x.csv", names, [stamps, *numbers]), OPTIONS)
    expected = np.delete(t, [at] * rows_lost)
    assert log.imu.t_ns.size == expected.size
    assert np.abs(log.imu.t_ns - expected).max() <= FLOAT_NS


@pytest.mark.parametrize("whole", ["9223372035", "604799", "1700000000"])
@pytest.mark.parametrize("decimals", [7, 8, 9])
def test_every_width_of_fine_seconds(tmp_path, whole, decimals):
    """From seconds of the GPS week to the last second that nanoseconds can count."""
    t = int(whole) * 10**9 + np.arange(20) * 10 ** (9 - decimals) * 7
    stamps = [f"{v // 10**9}.{v % 10**9:09d}"[: len(whole) + 1 + decimals] for v in t.tolist()]
    table = Table(sniff(write(tmp_path / "x.csv", "t,x", [stamps, ["1"] * 20])), clocks=[0])
    kept = table.fixed_point(0, decimals)
    assert kept.tolist() == [int(stamp.replace(".", "")) for stamp in stamps]
    assert table.numbers(0).tolist() == pytest.approx([float(s) for s in stamps], rel=2.3e-16)
