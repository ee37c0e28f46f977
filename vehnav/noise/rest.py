"""The noise of a sensor from the rest in a log: ``rest_noise(log, config) -> RestNoise``."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.allan import AxisFit, Curve, PieceMeans, allan_curve, fit_axes
from vehnav.allan.between import FEWEST, Structure, structure
from vehnav.config import Config
from vehnav.earth import WGS84, normal_gravity
from vehnav.errors import Finding, LogError
from vehnav.logs.log import Log
from vehnav.mounting import right_handed_axes
from vehnav.noise.earth import EarthRates, earth_rates
from vehnav.pipeline import StopSearch, search_stops
from vehnav.prepare import split_log
from vehnav.units import DEG, NS

Array = npt.NDArray[np.float64]

GUARD: Final = 1.0
"""s left out at both ends of a stop: the car rocks, the driver moves."""
LOST: Final = 5.0
"""Median steps without a sample at which a rest is cut in two."""
SHORTEST: Final = 2.0
"""s, the shortest piece that counts."""
NEEDED: Final = 3.0
"""s that the longest piece must have: noise from clusters of over a second."""
TINY: Final = 1e-20
"""(rad/s)^2, far below the variance of any mean: a dead axis has none."""
DEFAULTS: Final = Config()


@dataclass(frozen=True)
class Instrument:
    """What the rest shows of three gyroscopes or three accelerometers, on the sensor's own axes.

    Attributes
    ----------
    curve : Curve
    fits : tuple of AxisFit
        x, y, z.
    mean : (3,)
        Over all pieces, by their length; rad/s or m/s2.
    sample_sigma : (3,)
        Standard deviation of a sample about the mean of its piece.
    between : Structure or None
        Of the means of the pieces, where they count.
    """

    curve: Curve
    fits: tuple[AxisFit, ...]
    mean: Array
    sample_sigma: Array
    between: Structure | None


@dataclass(frozen=True)
class RestNoise:
    """The rest of a log and what it shows of the sensor.

    Attributes
    ----------
    log : Log
    searches : tuple of StopSearch
        One; several where holes cut the log.
    pieces : (p, 2)
        s from the start of the log, first and last instant of each.
    gyro, accel : Instrument
    gyro_bias : (3,)
        Mean rates without the Earth's, rad/s.
    gyro_bias_sigma : (3,)
        Of that: noise, and the Earth rate on an axis whose heading is not known.
    headings : int
        Rests whose heading is known.
    gravity : float or None
        m/s2, where the log says where it was recorded.
    findings : tuple of Finding
        Of the log, of its axes and clocks, and of the rest.
    """

    log: Log
    searches: tuple[StopSearch, ...]
    pieces: Array
    gyro: Instrument
    accel: Instrument
    gyro_bias: Array
    gyro_bias_sigma: Array
    headings: int
    gravity: float | None
    findings: tuple[Finding, ...]

    @property
    def total(self) -> float:
        """Rest used, s."""
        return float(np.sum(self.pieces[:, 1] - self.pieces[:, 0]))

    @property
    def longest(self) -> float:
        """Longest piece, s."""
        return float(np.max(self.pieces[:, 1] - self.pieces[:, 0]))

    @property
    def force_excess(self) -> float | None:
        """m/s2 by which the force at rest exceeds gravity; None where the place is not known."""
        if self.gravity is None:
            return None
        return float(np.linalg.norm(self.accel.mean)) - self.gravity


def rest_noise(log: Log, config: Config = DEFAULTS) -> RestNoise:
    """Noise, bias and walk of the sensor from every stop of a log.

    Within a stop by the Allan deviation; beyond it by the mean rates of the stops, for the
    gyroscopes only: the mean of an accelerometer shows the slope of the road. A hole in the IMU
    cuts the log and does no harm.

    Raises
    ------
    LogError
        As :func:`vehnav.pipeline.search_stops`; or the log has no rest of three seconds.
    """
    parts, left_out = _parts(log, config)
    _check_length(log.path, parts)
    dt = float(sum(p.seconds for p in parts) / sum(p.steps for p in parts))
    start = np.array([x for p in parts for x in p.instants(0)]) - 0.5 * dt
    end = np.array([x for p in parts for x in p.instants(1)]) + 0.5 * dt
    rates = [piece for p in parts for piece in p.pieces(p.gyro)]
    forces = [piece for p in parts for piece in p.pieces(p.accel)]
    own = np.array([r.mean(axis=0) for r in rates])
    earth = np.concatenate([p.earth.rate for p in parts])
    unknown = np.concatenate([p.earth.variance for p in parts])
    means = PieceMeans(start, end, own - earth, unknown)
    gyros, accels = _instrument(rates, dt, means), _instrument(forces, dt, None)
    bias, sigma = _bias(gyros, means)
    # which way is forward matters to no figure
    about = [f for p in parts for f in p.search.samples.findings if f.code != "axes-unverified"]
    return RestNoise(
        log,
        tuple(p.search for p in parts),
        np.stack([start, end], axis=1),
        gyros,
        accels,
        bias,
        sigma,
        sum(int(np.count_nonzero(np.isfinite(p.earth.headings))) for p in parts),
        _gravity(log),
        (*log.findings, *left_out, *about, *_dead_axes(gyros, accels)),
    )


@dataclass(frozen=True)
class _Part:
    """A stretch of the log without a long hole: its rests, on the sensor's own axes."""

    search: StopSearch
    spans: list[tuple[int, int]]
    offset: float
    gyro: Array
    accel: Array
    earth: EarthRates

    @property
    def seconds(self) -> float:
        t = self.search.samples.t
        return float(sum(t[b] - t[a] for a, b in self.spans))

    @property
    def steps(self) -> int:
        return sum(b - a for a, b in self.spans)

    def instants(self, end: int) -> list[float]:
        """First (0) or last (1) instants of the rests, s from the start of the log."""
        return [float(self.search.samples.t[span[end]]) + self.offset for span in self.spans]

    def pieces(self, values: Array) -> list[Array]:
        """The rests of an array (n, 3)."""
        return [values[a : b + 1] for a, b in self.spans]


def _parts(log: Log, config: Config) -> tuple[list[_Part], list[Finding]]:
    """The stretches between holes of over ten seconds that can be used; what of the others."""
    whole = config.start is not None or config.end is not None
    logs = [log] if whole else split_log(log)
    parts: list[_Part] = []
    failed: list[LogError] = []
    for piece in logs:
        try:
            parts.append(_part(piece, config, log.start_ns))
        except LogError as error:
            failed.append(error)
    if not parts:
        raise failed[0]
    out = [
        Finding("part-left-out", "info", f"between two holes nothing can be learnt: {error}")
        for error in failed
    ]
    return parts, out


def _part(log: Log, config: Config, start_ns: int) -> _Part:
    search = _search(log, config)
    samples, spans = search.samples, _rest_spans(search)
    c_gyro, c_accel = samples.orientation.matrices()
    return _Part(
        search,
        spans,
        (log.start_ns - start_ns) * NS,
        samples.omega @ c_gyro,
        samples.f @ c_accel,
        earth_rates(log, samples, spans, c_gyro),
    )


def _search(log: Log, config: Config) -> StopSearch:
    """The stops; a case that lies on its side on a bench is as good as any.

    Where gravity contradicts the axes of the format and no drive shows the true ones, any axes
    that fit gravity do: nothing here hangs on which way is forward.
    """
    try:
        return search_stops(log, config)
    except LogError:
        if config.axes not in (None, "auto") or log.imu is None:
            raise
        fitting = axes_with_up(log.imu.accel.mean(axis=0))
        with suppress(LogError):
            return search_stops(log, replace(config, axes=fitting))
        raise


def axes_with_up(f_s: Array) -> str:
    """The first right-handed axes whose up is along the largest component of a force (3,).

    >>> axes_with_up(np.array([0.1, -0.2, -9.8]))
    'BLD'
    """
    axis = int(np.argmax(np.abs(f_s)))
    wanted = "U" if f_s[axis] > 0.0 else "D"
    return next(letters for letters in right_handed_axes() if letters[axis] == wanted)


def _rest_spans(search: StopSearch) -> list[tuple[int, int]]:
    """First and last sample of every piece: the settled inside of a stop, between losses."""
    t = search.samples.t
    hole = np.flatnonzero(np.diff(t) > LOST * float(np.median(np.diff(t))))
    spans = []
    for stop in search.stops:
        first = int(np.searchsorted(t, max(stop.start + GUARD, stop.settled), side="left"))
        last = int(np.searchsorted(t, stop.end - GUARD, side="right")) - 1
        cuts = hole[(hole >= first) & (hole < last)]
        edges = [first, *(cuts + 1).tolist(), last + 1]
        pieces = [(a, b - 1) for a, b in pairwise(edges)]
        spans += [(a, b) for a, b in pieces if b > a and t[b] - t[a] >= SHORTEST]
    return spans


def _check_length(path: str, parts: list[_Part]) -> None:
    """LogError where there is nothing to learn from."""
    lengths = [b - a for p in parts for a, b in zip(p.instants(0), p.instants(1), strict=True)]
    longest = max(lengths, default=0.0)
    if longest >= NEEDED:
        return
    advice = (
        "Let the vehicle stand for half a minute with the recording running, engine off if you "
        "can; ten minutes and more show the bias instability too"
    )
    stops = [(stop.duration, stop.start + p.offset) for p in parts for stop in p.search.stops]
    if not stops:
        search = parts[0].search
        quiet = search.quietest()
        raise LogError(
            f"{path}: the vehicle never stands, so nothing tells the sensor's noise from the "
            f"drive. The quietest moment, at {quiet['time_s']:.1f} s, has {quiet['rate_deg_s']:.3f}"
            f" deg/s (threshold {search.rule.threshold / DEG:.2f}) and {quiet['force_m_s2']:.3f} "
            f"m/s2 (threshold {search.statistics.force_threshold:.2f}); raise --stop-threshold if "
            f"it did stand. {advice}"
        )
    duration, begin = max(stops)
    raise LogError(
        f"{path}: the longest rest, at {max(begin, 0.0):.1f} s, lasts {duration:.1f} s, of which "
        f"{longest:.1f} s are settled; {NEEDED:g} s are needed. {advice}"
    )


def _instrument(pieces: list[Array], dt: float, means: PieceMeans | None) -> Instrument:
    curve = allan_curve(pieces, dt)
    own = [p.mean(axis=0) for p in pieces]
    count = np.array([len(p) for p in pieces])
    squares = sum(((p - m) ** 2).sum(axis=0) for p, m in zip(pieces, own, strict=True))
    return Instrument(
        curve,
        tuple(fit_axes(curve, means)),
        np.asarray(count @ np.array(own) / count.sum()),
        np.asarray(np.sqrt(squares / (count.sum() - count.size))),
        None if means is None or means.start.size < FEWEST else structure(means),
    )


def _bias(item: Instrument, means: PieceMeans) -> tuple[Array, Array]:
    """Mean (3,) of the rests weighed by what is uncertain of each, and its sigma (3,)."""
    white = np.array([(fit.white.value or 0.0) ** 2 for fit in item.fits])
    weight = 1.0 / (white / (means.end - means.start)[:, None] + means.other + TINY)
    total = weight.sum(axis=0)
    return (weight * means.mean).sum(axis=0) / total, np.asarray(1.0 / np.sqrt(total))


def _gravity(log: Log) -> float | None:
    """m/s2, by GPS."""
    if log.gnss is None or log.gnss.t_ns.size == 0:
        return None
    lat, height = float(np.median(log.gnss.lat)), float(np.median(log.gnss.height))
    return float(normal_gravity(lat, height, WGS84))


def _dead_axes(gyro: Instrument, accel: Instrument) -> list[Finding]:
    """Axes that hardly ever change at rest: counts larger than the noise, or no sensor."""
    out = []
    for name, item in (("gyro", gyro), ("accelerometer", accel)):
        dead = [axis for axis, fit in zip("xyz", item.fits, strict=True) if fit.dead]
        if dead:
            text = (
                f"{name} {', '.join(dead)}: the reading does not change at rest, so its noise is "
                "hidden under one count of the output; nothing is said of it"
            )
            out.append(Finding("dead-axis", "warning", text))
    return out
