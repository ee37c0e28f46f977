"""A log of a suite that is simulated: the options of ``vehnav simulate``, as a record.

The simulator, and numba with it, is loaded by who simulates or checks: a suite of files does
without.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal


@dataclass(frozen=True)
class Simulation:
    """What is simulated; every field has the name and the unit of the option.

    The same record gives the same bytes.
    """

    scenario: str
    sensor: str = "mems-industrial"
    seed: int = 0
    sampling: Literal["rates", "increments"] = "rates"
    rate: float = 100.0
    duration: float | None = None
    ellipsoid: Literal["wgs84", "krasovsky"] | None = None
    gps: bool = True
    gps_rate: float = 1.0
    gps_noise: float = 0.7
    gps_drift: float = 1.2
    gps_drift_time: float = 120.0
    gps_velocity_noise: float | None = None
    gps_latency: float = 0.0
    outage: tuple[str, ...] = ()
    wheel: bool = False
    wheel_rate: float = 10.0
    wheel_noise: float = 0.03
    wheel_scale: float = 0.4

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)

    def check(self) -> None:
        """ConfigError for an unknown scenario, parameter or sensor."""
        from vehnav.sensors import load_sensor

        self._scenario()
        load_sensor(self.sensor)

    def write(self, path: Path) -> None:
        """Simulate, and write the recording; ConfigError as :meth:`check`, OSError of the disk."""
        from vehnav.config import outage_spans
        from vehnav.sensors import load_sensor
        from vehnav.simulate import GnssModel, Setup, WheelModel, simulate_runs, write_log

        way = self._scenario()
        spans = [x for text in self.outage for x in outage_spans(text, way.motion.duration)]
        receiver = GnssModel(
            rate_hz=self.gps_rate,
            noise=self.gps_noise,
            drift=self.gps_drift,
            drift_time=self.gps_drift_time,
            velocity_noise=self.gps_velocity_noise,
            latency=self.gps_latency,
            outages=tuple(spans),
        )
        wheel = WheelModel(self.wheel_rate, self.wheel_noise, self.wheel_scale / 100.0)
        setup = Setup(
            sensor=load_sensor(self.sensor),
            rate_hz=self.rate,
            sampling=self.sampling,
            gnss=receiver if self.gps else None,
            wheel=wheel if self.wheel else None,
        )
        simulated = next(simulate_runs(way, setup, seed=self.seed, runs=1))
        write_log(simulated, path, truth_every=0)

    def _scenario(self) -> Any:
        from vehnav.simulate import make_scenario

        more = {"duration": self.duration, "ellipsoid": self.ellipsoid}
        return make_scenario(self.scenario, **{k: v for k, v in more.items() if v is not None})
