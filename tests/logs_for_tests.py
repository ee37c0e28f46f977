"""Small logs made from closed forms, for tests of everything above the readers."""

from __future__ import annotations

import numpy as np

from vehnav.earth import WGS84, geodetic_from_local_enu, normal_gravity
from vehnav.logs.log import Gnss, Imu, Log

ORIGIN = (0.9, 0.3, 200.0)
START_NS = 1_700_000_000_000_000_000


def speed_profile(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speed and acceleration of a drive north: stand 20 s, drive, stand, drive, stand."""
    v, a = np.zeros_like(t), np.zeros_like(t)
    for begin, end, top in ((20.0, 60.0, 12.0), (80.0, 140.0, 15.0)):
        s = (t - begin) / (end - begin)
        inside = (s > 0.0) & (s < 1.0)
        v[inside] = top * np.sin(np.pi * s[inside]) ** 2
        a[inside] = top * np.pi / (end - begin) * np.sin(2.0 * np.pi * s[inside])
    return v, a


def straight_log(
    *,
    rate: float = 100.0,
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    accel_bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    noise: float = 1.0,
    seconds: float = 160.0,
    gps: bool = True,
    axes: str = "RFU",
    seed: int = 1,
) -> Log:
    """A level drive due north with three stops; the Earth rate and gravity are in the samples.

    The road rocks it by 1 deg/s and 0.3 m/s2 at 1 to 2 Hz while it moves: without any vibration a
    straight drive cannot be told from rest. ``noise`` scales 0.05 deg/s and 0.02 m/s2 a sample. The
    transport rate (0.5 deg/h at 15 m/s) is left out of the gyro: 0.1 m here.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    v, a = speed_profile(t)
    lat = ORIGIN[0]
    omega = np.tile(WGS84.omega_ie * np.array([0.0, np.cos(lat), np.sin(lat)]), (t.size, 1))
    f = np.zeros((t.size, 3))
    f[:, 1] = a
    f[:, 2] = normal_gravity(lat, ORIGIN[2], WGS84)
    road = (v / (v + 1.0))[:, None] * np.sin(2.0 * np.pi * np.outer(t, [1.3, 1.7, 0.9]))
    omega += np.radians(1.0) * road
    f += 0.3 * road
    omega += np.array(gyro_bias) + noise * np.radians(0.05) * rng.normal(size=f.shape)
    f += np.array(accel_bias) + noise * 0.02 * rng.normal(size=f.shape)
    t_ns = START_NS + np.round(t * 1e9).astype(np.int64)
    log = Log("made.csv", Imu(t_ns, omega, f, axes=axes, source="made"))
    if not gps:
        return log
    distance = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    every = slice(None, None, int(rate))
    r_n = np.stack([0.0 * distance, distance, 0.0 * distance], axis=1)[every]
    lat_m, lon_m, _ = geodetic_from_local_enu(r_n, origin=ORIGIN)
    velocity = np.stack([0.0 * v, v, 0.0 * v], axis=1)[every]
    gnss = Gnss(t_ns[every], lat_m, lon_m, np.full(lat_m.size, ORIGIN[2]), velocity, source="/gps")
    return Log("made.csv", log.imu, gnss)
