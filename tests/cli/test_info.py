"""``vehnav info``, ``vehnav check`` and calibration files, on logs whose trouble is made here."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from tests.logs_for_tests import straight_log
from tests.test_axes_auto import turned
from vehnav import read_log
from vehnav.cli.main import cli
from vehnav.config import Config
from vehnav.export.recording import write_recording
from vehnav.mounting import sensor_to_body
from vehnav.pipeline import search_stops
from vehnav.simulate import simulate, write_log


def vehnav(*args: object) -> Result:
    return CliRunner().invoke(cli, [str(a) for a in args])


def write(path: Path, *, letters: str = "BRU", mount=(0.0, 0.0, 0.0), seconds=160.0) -> Path:
    """The made drive, its case turned, as a CSV whose columns say neither axes nor units.

    Axes of the file are taken as FLU then; GPS lies beside it.
    """
    log = straight_log(seconds=seconds, rate=50.0)
    assert log.imu is not None
    c_bs = sensor_to_body(letters, mount=tuple(np.radians(mount)))[0]
    gyro, accel = log.imu.gyro @ c_bs, log.imu.accel @ c_bs
    data = {"t_ns": log.imu.t_ns}
    for k, axis in enumerate("xyz"):
        data[f"g{axis}"] = gyro[:, k]
        data[f"a{axis}"] = accel[:, k]
    pd.DataFrame(data).to_csv(path, index=False)
    assert log.gnss is not None
    gnss = log.gnss
    rows = {"t_ns": gnss.t_ns, "lat_deg": np.degrees(gnss.lat), "lon_deg": np.degrees(gnss.lon)}
    beside = path.with_suffix(".gps.csv")
    pd.DataFrame({**rows, "height_m": gnss.height}).to_csv(beside, index=False)
    return path


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("info") / "drive.csv", mount=(0.0, -6.0, 5.0))


def test_one_screen_with_the_evidence(drive) -> None:
    done = vehnav("info", drive)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert len(lines) <= 24  # a terminal
    text = done.stdout
    for part in (
        "8000 declared, 8000 read",
        "50.00 Hz",
        "driven",
        "axes       BRU, mount",
        "units",
    ):
        assert part in text
    assert "forward: 4 departures and arrivals" in text
    assert "usually" not in text  # its header says nothing of axes: nothing to warn of
    assert "[axes-" not in done.stderr


def test_json_has_what_a_ticket_needs(drive) -> None:
    done = vehnav("info", drive, "--json")
    found = json.loads(done.stdout)
    assert found["version"] == 1
    assert found["navigable"] is True
    assert found["axes"]["axes"] == "BRU"
    assert found["axes"]["mount_deg"] == pytest.approx([0.0, -6.0, 5.0], abs=1.0)
    assert found["axes"]["evidence"]["events"] == 4
    assert found["imu"]["count"] == 8000
    assert found["imu"]["rate_hz"] == pytest.approx(50.0)
    # 12 and 15 m/s at the top of sin^2 over 40 and 60 s: half of it on the mean
    assert found["gps"]["distance_m"] == pytest.approx(12.0 * 20.0 + 15.0 * 30.0, rel=0.01)
    ends = [(s["start_s"], s["end_s"]) for s in found["stops"]]
    # a stop begins at 0.2 m/s, which sin^2 has 2.2 s before it ends
    true = np.array([[0.0, 20.0], [60.0, 80.0], [140.0, 160.0]])
    assert np.array(ends) == pytest.approx(true, abs=2.5)
    assert found["units"]["accel"] == "m/s2"


def test_a_calibration_serves_another_log_of_the_same_car(drive, tmp_path) -> None:
    """The second log has one stop and no departure: by itself it does not show forward."""
    car = tmp_path / "car.toml"
    saving = vehnav("info", drive, "--save-calibration", car)
    assert saving.exit_code == 0
    assert f"written    {car}" in saving.stdout
    saved = tomllib.loads(car.read_text(encoding="utf-8"))["input"]
    assert saved["axes"] == "BRU"
    assert saved["mount"] == pytest.approx([0.0, -6.0, 5.0], abs=1.0)
    short = write(tmp_path / "short.csv", mount=(0.0, -6.0, 5.0), seconds=18.0)
    alone = json.loads(vehnav("info", short, "--json").stdout)
    assert alone["axes"]["evidence"]["certain"] is False
    with_it = json.loads(vehnav("info", short, "--calibration", car, "--json").stdout)
    assert with_it["axes"]["axes"] == "BRU"
    assert with_it["axes"]["mount_deg"] == pytest.approx(saved["mount"], abs=1e-12)
    # the command line counts more
    over = vehnav("info", short, "--calibration", car, "--axes", "FLU", "--json")
    assert json.loads(over.stdout)["axes"]["axes"] == "FLU"
    refused = vehnav("info", short, "--save-calibration", tmp_path / "no.toml")
    assert refused.exit_code == 2
    assert "no calibration" in refused.stderr
    assert not (tmp_path / "no.toml").exists()


def test_a_calibration_leaves_open_what_no_stop_shows(shared_data, tmp_path) -> None:
    """Turning in circles shows the axes, but neither the mounting nor the scale."""
    car = tmp_path / "car.toml"
    log = shared_data / "boston_apan" / "going_in_circles.mcap"
    assert vehnav("info", log, "--save-calibration", car).exit_code == 0
    saved = tomllib.loads(car.read_text(encoding="utf-8"))["input"]
    assert saved == {"axes": "FRD"}


def test_run_takes_the_calibration(drive, tmp_path) -> None:
    car = tmp_path / "car.toml"
    vehnav("info", drive, "--save-calibration", car)
    out = tmp_path / "out"
    done = vehnav("run", drive, "--calibration", car, "--out-dir", out, "--json")
    assert done.exit_code == 0, done.output
    given = json.loads(done.stdout)["input"]
    saved = tomllib.loads(car.read_text(encoding="utf-8"))["input"]
    assert given["axes"] == "BRU"
    assert given["mount_deg"] == pytest.approx(saved["mount"], abs=1e-12)
    assert "axes-contradiction" not in [f["code"] for f in given["findings"]]


def test_a_calibration_keeps_the_scale_of_the_accelerometer(tmp_path) -> None:
    """A car whose accelerometer reads 2 % too much; the judge is the simulated specific force.

    A second drive reads within 0.1 % of the truth, and so do its first 18 s, which have no
    departure and by themselves show neither the axes nor the scale.
    """

    def logged(name: str, seed: int) -> tuple[Path, np.ndarray]:
        log = simulate("city,duration=240,first_stop=20", seed=seed, rate_hz=50.0).log()
        case = turned(log, "BRU")
        assert log.imu is not None
        assert case.imu is not None
        imu = replace(case.imu, accel=1.02 * case.imu.accel, axes="RFU")  # as its names say
        files = write_recording(replace(case, imu=imu), tmp_path / f"{name}.csv")
        return files[0], log.imu.accel

    car = tmp_path / "car.toml"
    assert vehnav("info", logged("first", 3)[0], "--save-calibration", car).exit_code == 0
    saved = tomllib.loads(car.read_text(encoding="utf-8"))["input"]
    assert saved["accel_scale"] == pytest.approx(1.0 / 1.02, rel=1e-3)
    second, truth = logged("second", 8)
    log, given = read_log(str(second)), {**saved, "mount": tuple(saved["mount"])}
    found, auto = search_stops(log, Config(**given)).samples, search_stops(log).samples
    assert found.orientation.axes == auto.orientation.axes == "BRU"
    short = search_stops(log, Config(**given, end=18.0)).samples
    alone = search_stops(log, Config(end=18.0)).samples
    assert not alone.orientation.evidence.certain
    for samples in (found, short):
        true = truth[: samples.t.size]
        size = np.linalg.norm(samples.f, axis=1) / np.linalg.norm(true, axis=1)
        assert np.median(size) == pytest.approx(1.0, abs=1e-3)
        off = np.linalg.norm(samples.f - true, axis=1)
        assert np.median(off) < 9.81 * np.radians(1.0)  # tilt of the mount
    assert np.median(np.linalg.norm(alone.f, axis=1)) > 1.015 * 9.81


@pytest.mark.parametrize(
    "text", ["", "[stops]\nstop_dwell = 2.0\n", "[input]\ngyro_unit = 'deg/s'\n"]
)
def test_what_is_no_calibration_is_refused(drive, tmp_path, text) -> None:
    car = tmp_path / "car.toml"
    car.write_text(text, encoding="utf-8")
    done = vehnav("info", drive, "--calibration", car)
    assert done.exit_code == 2
    assert "not a calibration" in done.stderr


def test_what_cannot_be_navigated_is_told_not_refused(tmp_path) -> None:
    path = write(tmp_path / "roll.csv")
    done = vehnav("info", path, "--start", "25", "--end", "55")
    assert done.exit_code == 0
    assert "NOT NAVIGABLE" in done.stdout
    assert "no stop was found" in done.stdout
    gone = vehnav("info", tmp_path / "missing.csv")
    assert gone.exit_code == 2


# ---- check -------------------------------------------------------------------------------------


def test_check_of_a_sound_log(tmp_path) -> None:
    path = write(tmp_path / "good.csv", letters="FLU")
    done = vehnav("check", path, "--strict")
    assert done.exit_code == 0, done.output
    assert "8000 declared, 8000 read, 0 recovered, 0 unverified, 0 bad" in done.stdout
    assert "sound: 0 errors, 0 warnings" in done.stdout


def test_check_names_a_hole_and_strict_makes_it_count(tmp_path) -> None:
    path = write(tmp_path / "hole.csv", letters="FLU")
    rows = pd.read_csv(path)
    t = (rows.t_ns - rows.t_ns[0]) * 1e-9
    rows[(t < 100.0) | (t > 103.0)].to_csv(path, index=False)
    done = vehnav("check", path)
    assert done.exit_code == 0
    assert "warning: [gap] 100.0-103.0 s" in done.stdout
    assert vehnav("check", path, "--strict").exit_code == 1
    found = json.loads(vehnav("check", path, "--json").stdout)
    (gap,) = [f for f in found["findings"] if f["code"] == "gap"]
    assert gap["level"] == "warning"
    assert gap["start_s"] == pytest.approx(100.0, abs=0.03)


def test_check_of_a_damaged_recording_leaves_with_3(sample_logs, tmp_path) -> None:
    whole = (sample_logs / "city.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    done = vehnav("check", cut)
    assert done.exit_code == 3, done.output
    assert "damaged: " in done.stdout
    assert "error: " in done.stdout
    counts = json.loads(vehnav("check", cut, "--json").stdout)["integrity"]
    assert counts["damaged"] is True
    assert counts["read"] > 0
    assert vehnav("check", cut, "--strict").exit_code == 1


def _of_driving(tmp_path: Path) -> Path:
    """No stop: the rows between 25 and 55 s."""
    path = write(tmp_path / "rolling.csv", letters="FLU")
    rows = pd.read_csv(path)
    t = (rows.t_ns - rows.t_ns[0]) * 1e-9
    rows[(t > 25.0) & (t < 55.0)].to_csv(path, index=False)
    return path


def _slow(tmp_path: Path) -> Path:
    """One sample a second."""
    path = write(tmp_path / "slow.csv", letters="FLU")
    pd.read_csv(path)[::50].to_csv(path, index=False)
    return path


def _fixes(tmp_path: Path) -> Path:
    """No IMU."""
    return write(tmp_path / "drive.csv").with_suffix(".gps.csv")


def _cut_in_motion(tmp_path: Path) -> Path:
    """A drive without a stop, and the end of the file is missing."""
    made = simulate("shake,duration=60,amplitude=1", sensor="mems-tactical", rate_hz=50.0)
    whole = tmp_path / "whole.mcap"
    write_log(made, whole)
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    return path


@pytest.mark.parametrize(
    ("make", "verdict"),
    [
        (lambda tmp_path: write(tmp_path / "good.csv", letters="FLU"), "sound"),
        (_of_driving, "not navigable"),
        (_slow, "not navigable"),
        (_fixes, "not navigable"),
        (_cut_in_motion, "damaged, not navigable"),
    ],
)
def test_info_and_check_agree_on_what_can_be_navigated(make, verdict, tmp_path) -> None:
    path = make(tmp_path)
    navigable = "not navigable" not in verdict
    checked, shown = vehnav("check", path), vehnav("info", path)
    assert checked.exit_code == shown.exit_code == (3 if "damaged" in verdict else 0)
    assert checked.stdout.splitlines()[-1].startswith(f"{verdict}: ")
    assert ("NOT NAVIGABLE" in shown.stdout) is not navigable
    documents = [json.loads(vehnav(name, path, "--json").stdout) for name in ("check", "info")]
    for found in documents:
        assert (found["verdict"], found["navigable"]) == (verdict, navigable)
        assert (found["problem"] is None) is navigable
    assert documents[0].items() <= documents[1].items()


@pytest.mark.parametrize(
    "name",
    ["kitti_oxts/2011_10_03_drive_0042.mcap", "boston_apan/going_in_circles.mcap",
     "boston_ramirez_1hz/imu.csv", "mcap_by_others/hansmann_navsatfix_50min.mcap"],
)  # fmt: skip
def test_real_logs_that_cannot_be_navigated_are_not_called_usable(shared_data, name) -> None:
    checked, shown = vehnav("check", shared_data / name), vehnav("info", shared_data / name)
    assert checked.stdout.splitlines()[-1].startswith("not navigable: ")
    assert "NOT NAVIGABLE" in shown.stdout


def test_check_of_what_holds_no_recording(tmp_path) -> None:
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    done = vehnav("check", empty)
    assert done.exit_code == 2
    assert "0 bytes" in done.stderr
