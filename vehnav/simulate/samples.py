"""The logs of ``sample_logs/``: ``python -m vehnav.simulate.samples sample_logs``."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from vehnav.sensors import Sensor, load_sensor
from vehnav.simulate.generate import SimulatedLog, simulate
from vehnav.simulate.receivers import GnssModel, WheelModel
from vehnav.simulate.write import write_log


@dataclass(frozen=True)
class Sample:
    """A recording of ``sample_logs/``.

    Attributes
    ----------
    files : tuple of str
        Names under which the one drive is written.
    scenario, sensor : str
    seed : int
    rate_hz : float
    gyro_count, accel_count : float
        The counts that are stored, rad/s and m/s2: round numbers, so that the files stay small.
    wheel : WheelModel or None
    """

    files: tuple[str, ...]
    scenario: str
    sensor: str
    seed: int
    rate_hz: float
    gyro_count: float
    accel_count: float
    wheel: WheelModel | None = None


SAMPLES: Final = (
    Sample(
        files=("city.mcap", "city.csv"),
        scenario="city,duration=300,seed=26,first_stop=30,last_stop=15,stop_every=52",
        sensor="mems-industrial",
        seed=7,
        rate_hz=100.0,
        gyro_count=2e-5,
        accel_count=2e-3,
    ),
    Sample(
        files=("highway_hg1700.mcap",),
        scenario="motorway,duration=600,seed=2,first_stop=60,stop_every=150",
        sensor="hg1700",
        seed=11,
        rate_hz=50.0,
        gyro_count=1e-5,
        accel_count=1e-3,
        wheel=WheelModel(),
    ),
)


def counted(sensor: Sensor, gyro_count: float, accel_count: float) -> Sensor:
    """The sensor with other counts."""
    return replace(
        sensor,
        gyro=replace(sensor.gyro, quantisation=gyro_count),
        accel=replace(sensor.accel, quantisation=accel_count),
    )


def make_sample(sample: Sample) -> SimulatedLog:
    """The drive of a sample."""
    return simulate(
        sample.scenario,
        sensor=counted(load_sensor(sample.sensor), sample.gyro_count, sample.accel_count),
        seed=sample.seed,
        rate_hz=sample.rate_hz,
        gnss=GnssModel(),
        wheel=sample.wheel,
    )


def write_samples(folder: Path) -> list[Path]:
    """Make all samples; truth at 10 Hz beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for sample in SAMPLES:
        simulated = make_sample(sample)
        for name in sample.files:
            written += write_log(simulated, folder / name, truth_every=round(sample.rate_hz / 10))
    return list(dict.fromkeys(written))


def main() -> None:
    """Write the samples into the folder named on the command line."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m vehnav.simulate.samples FOLDER")
    for path in write_samples(Path(sys.argv[1])):
        sys.stderr.write(f"{path}: {path.stat().st_size / 1e6:.2f} MB\n")


if __name__ == "__main__":
    main()
