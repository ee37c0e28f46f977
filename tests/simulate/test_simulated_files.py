"""Files of a simulated log, read back by the mcap library, rosbags, pandas and our own readers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from vehnav.errors import ConfigError
from vehnav.logs.log import ReadOptions
from vehnav.logs.read import read_log
from vehnav.rotation import angles_from_c_nb
from vehnav.sensors import load_sensor
from vehnav.simulate import (
    GnssModel,
    Setup,
    WheelModel,
    simulate,
    simulate_runs,
    write_log,
    write_runs,
)

DRIVE = "straight,duration=70,first_stop=10,last_stop=10,road=1"


@pytest.fixture(scope="module")
def drive():
    return simulate(DRIVE, sensor="mems-tactical", rate_hz=25.0, wheel=WheelModel(), seed=2)


@pytest.fixture(scope="module")
def increments():
    gnss = GnssModel(velocity_noise=0.05)
    return simulate(DRIVE, sensor="hg1700", rate_hz=25.0, sampling="increments", gnss=gnss)


def decoded(path: Path):
    """topic -> list of messages, with every checksum verified by the reference reader."""
    topics: dict[str, list] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        last = 0
        for schema, channel, message, ros in reader.iter_decoded_messages():
            assert message.log_time >= last
            last = message.log_time
            stamp = ros.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == message.log_time
            topics.setdefault(channel.topic, []).append((schema.name, message.log_time, ros))
        statistics = reader.get_summary().statistics
    assert statistics.message_count == sum(map(len, topics.values()))
    return topics


def xyz(vector):
    return [vector.x, vector.y, vector.z]


def test_mcap_by_the_reference_reader(drive, tmp_path):
    path, truth = write_log(drive, tmp_path / "a.mcap")
    assert truth.name == "a.truth.csv"
    topics = decoded(path)
    assert set(topics) == {"/imu/data", "/gps/fix", "/vehicle/speed"}
    imu = topics["/imu/data"]
    assert imu[0][0] == "sensor_msgs/msg/Imu"
    np.testing.assert_array_equal([m[1] for m in imu], drive.imu.t_ns)
    gyro = np.array([xyz(m[2].angular_velocity) for m in imu])
    accel = np.array([xyz(m[2].linear_acceleration) for m in imu])
    right, forward, up = drive.imu.gyro.T
    np.testing.assert_array_equal(gyro, np.stack([forward, -right, up], axis=-1))  # REP 103
    assert np.median(accel[:200, 2]) == pytest.approx(9.8, abs=0.1)
    assert imu[0][2].orientation_covariance[0] == -1.0  # no orientation
    assert imu[0][2].header.frame_id == "imu_link"
    fix = topics["/gps/fix"][3]
    assert fix[0] == "sensor_msgs/msg/NavSatFix"
    assert fix[2].latitude == pytest.approx(np.degrees(drive.gnss.lat[3]), abs=1e-13)
    assert fix[2].altitude == drive.gnss.height[3]
    assert fix[2].position_covariance[8] == pytest.approx(drive.gnss.sigma_pos[3, 2] ** 2)
    assert (fix[2].status.status, fix[2].status.service) == (0, 1)
    speed = [m[2].twist.linear.x for m in topics["/vehicle/speed"]]
    np.testing.assert_array_equal(speed, drive.speed.speed)


def test_mcap_by_rosbags(drive, tmp_path):
    path, _ = write_log(drive, tmp_path / "a.mcap")
    with AnyReader([path]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        first = next(m for c, _, m in reader.messages() if c.topic == "/imu/data")
        message = reader.deserialize(first, "sensor_msgs/msg/Imu")
    assert counts["/imu/data"] == drive.imu.t_ns.size
    assert message.linear_acceleration.z == drive.imu.accel[0, 2]


def test_increments_and_velocities_have_messages_of_their_own(increments, tmp_path):
    path, _ = write_log(increments, tmp_path / "a.mcap")
    topics = decoded(path)
    kind, _, message = topics["/imu/data"][5]
    assert kind == "vehnav_msgs/msg/ImuIncrements"
    assert message.delta_angle.y == -increments.imu.gyro[5, 0]
    assert message.delta_velocity.z == increments.imu.accel[5, 2]
    kind, _, message = topics["/gps/fix"][7]
    assert kind == "vehnav_msgs/msg/GnssFix"
    assert xyz(message.velocity) == list(increments.gnss.v_n[7])


@pytest.mark.parametrize("which", ["drive", "increments"])
@pytest.mark.parametrize("suffix", [".mcap", ".csv"])
def test_read_back_by_vehnav(which, suffix, request, tmp_path):
    run = request.getfixturevalue(which)
    files = write_log(run, tmp_path / f"a{suffix}")
    beside = {p.suffixes[0]: str(p) for p in files}
    options = ReadOptions()
    if suffix == ".csv":
        options = ReadOptions(gps_file=beside[".gps"], speed_file=beside.get(".speed"))
    log = read_log(str(files[0]), options)
    assert log.imu.sampling == run.imu.sampling
    assert not log.damaged
    np.testing.assert_array_equal(log.imu.t_ns, run.imu.t_ns)
    turn = [1, 0, 2] if suffix == ".mcap" else [0, 1, 2]
    sign = np.array([1.0, -1.0, 1.0]) if suffix == ".mcap" else np.ones(3)
    for name in ("gyro", "accel"):
        expected = getattr(run.imu, name)[:, turn] * sign
        np.testing.assert_allclose(getattr(log.imu, name), expected, rtol=1e-11)
    np.testing.assert_array_equal(log.gnss.t_ns, run.gnss.t_ns)
    np.testing.assert_allclose(log.gnss.lat, run.gnss.lat, atol=1e-11)
    np.testing.assert_allclose(log.gnss.sigma_pos, run.gnss.sigma_pos, atol=6e-4)
    if run.gnss.v_n is not None:
        np.testing.assert_allclose(log.gnss.v_n, run.gnss.v_n, atol=6e-4)
    if run.speed is not None:
        np.testing.assert_allclose(log.speed.speed, run.speed.speed, atol=6e-5)


def test_truth_has_the_columns_of_a_trajectory(drive, tmp_path):
    _, path = write_log(drive, tmp_path / "a.mcap", truth_every=5)
    table = pd.read_csv(path, dtype={"time_s": str})
    names = "time_s lat_deg lon_deg height_m v_east_m_s v_north_m_s v_up_m_s"
    assert list(table) == [*names.split(), "heading_deg", "pitch_deg", "roll_deg", "stopped"]
    some = drive.truth.rows(slice(None, None, 5))
    stamps = [int(t.replace(".", "")) for t in table["time_s"]]
    np.testing.assert_array_equal(stamps, some.t_ns)  # nine decimals
    np.testing.assert_allclose(np.radians(table["lat_deg"]), some.lat, atol=1e-12)
    np.testing.assert_allclose(table["v_up_m_s"], some.v_n[:, 2], atol=6e-6)
    heading, pitch, _ = angles_from_c_nb(some.c_nb)
    np.testing.assert_allclose(table["heading_deg"], np.degrees(heading), atol=6e-6)
    np.testing.assert_allclose(table["pitch_deg"], np.degrees(pitch), atol=6e-6)
    np.testing.assert_array_equal(table["stopped"], some.stopped.astype(int))


def test_runs_are_numbered_and_share_the_truth(tmp_path):
    setup = Setup(sensor=load_sensor("hg1700"), rate_hz=10.0, gnss=None)
    made = simulate_runs("static,duration=5", setup, seed=1, runs=3)
    files = [f for _, fs in write_runs(made, tmp_path / "mc.csv", count=3) for f in fs]
    assert [f.name for f in files] == [
        "mc-001.csv",
        "mc.truth.csv",
        "mc-002.csv",
        "mc-003.csv",
    ]
    assert files[0].read_text() != files[2].read_text()


def test_nothing_half_written_stays(drive, tmp_path, monkeypatch):
    (tmp_path / "a.mcap").write_text("old")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("vehnav.simulate.mcap_container.Container.finish", fail)
    with pytest.raises(OSError, match="disk full"):
        write_log(drive, tmp_path / "a.mcap")
    assert [p.name for p in tmp_path.iterdir()] == ["a.mcap"]
    assert (tmp_path / "a.mcap").read_text() == "old"


@pytest.mark.parametrize(("name", "says"), [("a.bag", "mcap or .csv"), ("no/a.csv", "no folder")])
def test_refused(drive, tmp_path, name, says):
    with pytest.raises(ConfigError, match=says):
        write_log(drive, tmp_path / name)
