"""What caused the error: the error model's sources, fitted to the observed error.

The observed position error is linear in the sources (:mod:`vehnav.evaluation.cause_models`), so
their most likely values are a weighted least squares fit with priors: the noise of the GPS is
correlated in time, and the noise of the sensors is fitted too, as slow changes of known size. The
parts of the sources and what is left add up to the error; each one's share is its projection on
the error, so that the shares add up to one (a source that works against the others has a negative
share).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation.cause_inertial import inertial_design
from vehnav.evaluation.cause_models import (
    TYPICAL_NOISE,
    Design,
    Source,
)
from vehnav.evaluation.cause_offline import offline_design
from vehnav.evaluation.errors import Errors
from vehnav.legs import LegNoise
from vehnav.trajectory import Trajectory
from vehnav.units import NS

Array = npt.NDArray[np.float64]

BLOCKS: Final = 300
"""Means of neighbouring fixes that take part, at most."""
BLOCK: Final = 2.0
"""s: the shortest mean."""
CORRELATED: Final = 0.7
"""Share of a receiver's variance that is slow (atmosphere, multipath)."""
CORRELATION_TIME: Final = 100.0
"""s, of the slow part."""
PLAIN_SIGMA: Final = 2.0
"""m per axis, of a receiver that gives no sigma."""
LEAST_SIGMA: Final = 0.05
"""m per axis: antenna and clock leave this even where a receiver claims less."""
LINEARISATION: Final = 0.01
"""Of the error: what a linear model misses for attitude errors of a degree (spec B 1.5)."""
NOISE_FACTOR: Final = 2.0
"""Errors within this multiple of the GPS's uncertainty need no cause: fixes gave the start too,
and few independent ones scatter."""
ALIKE: Final = 0.9
"""Correlation from which two causes cannot be told apart."""
SEEN: Final = 0.5
"""Of the prior's sigma: a fit that narrows it less than that has seen nothing."""
STRAINED: Final = 0.1
INVALID: Final = 0.5
"""rad of attitude error beyond which the linear model is strained, and not valid (spec B 1.5)."""
OFFLINE_FACTOR: Final = 2.0
"""Times the formal sigmas of the offline model: over simulated drives with MEMS sensors they are
that much too small (its legs are not all alike), while those of the inertial model fit."""
NOISE_SCALES: Final = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Times the noise that the log's rest promises under way; the most probable one is taken."""
FEWEST: Final = 10
"""Judged fixes below which nothing is fitted."""


@dataclass(frozen=True)
class Cause:
    """One source and what it explains.

    Attributes
    ----------
    name, label, unit : str
    value, sigma : float
        In ``unit``, estimate minus truth; of a source in pieces the rms over them.
    values : tuple of float
        The columns one by one.
    share, share_sigma : float
        Of the squared error over all fixes; may be negative.
    share_end : float
        Of the error at the last fix, along it.
    rms_m : float
        Of the source's own part.
    seen : bool
        Whether the drive tells its value better than was known before.
    single : bool
        Whether it is one value, not pieces.
    """

    name: str
    label: str
    unit: str
    value: float
    sigma: float
    values: tuple[float, ...]
    share: float
    share_sigma: float
    share_end: float
    rms_m: float
    seen: bool
    single: bool

    @property
    def significant(self) -> bool:
        """Whether the value, or the share of noise in pieces, is told from zero by two sigma."""
        if not self.single:
            return self.share > 2.0 * self.share_sigma
        return self.seen and abs(self.value) > 2.0 * self.sigma

    def to_dict(self) -> dict[str, Any]:
        """Plain data for the report."""
        return {
            "source": self.name,
            "label": self.label,
            "unit": self.unit,
            "value": self.value,
            "sigma": self.sigma,
            "values": list(self.values),
            "share": self.share,
            "share_sigma": self.share_sigma,
            "share_end": self.share_end,
            "rms_m": self.rms_m,
            "seen": self.seen,
        }


@dataclass(frozen=True)
class Causes:
    """What explains the error of one method.

    Attributes
    ----------
    method : str
        Whose error.
    rms_m, end_m : float
        Horizontal error over the fixes (means of neighbours), and at the last of them.
    noise_m : float
        Horizontal sigma of the GPS.
    needed : bool
        Whether there is anything to explain: the error is above the noise of the GPS.
    causes : tuple of Cause
        The largest share first; empty where nothing needs explaining.
    unexplained : float
        Share that is left; ``residual_m`` its rms, m.
    residual_m : float
    misfit : float
        Root of chi square per observation, 1 where the noise is what it was taken for; above 1
        all sigmas are already multiplied by it.
    noise_scale : float
        The noise of the sensors under way that the errors suggest, over the one taken from rest.
    condition : float
        Of the scaled equations: largest over smallest singular value of the single sources.
    alike : tuple of (label, label, correlation)
        Sources that cannot be told apart.
    tilt : float
        rad, largest attitude error that the fit implies; 0 where the model has none.
    """

    method: str
    rms_m: float
    end_m: float
    noise_m: float
    needed: bool
    causes: tuple[Cause, ...] = ()
    unexplained: float = 0.0
    residual_m: float = 0.0
    misfit: float = 0.0
    noise_scale: float = 1.0
    condition: float = 1.0
    alike: tuple[tuple[str, str, float], ...] = ()
    tilt: float = 0.0

    @property
    def linear(self) -> str:
        """``ok``, ``strained`` or ``invalid``: whether the attitude error is small enough."""
        return "ok" if self.tilt < STRAINED else "strained" if self.tilt < INVALID else "invalid"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for the report."""
        return {
            "needed": self.needed,
            "rms_m": self.rms_m,
            "end_m": self.end_m,
            "gps_noise_m": self.noise_m,
            "causes": [cause.to_dict() for cause in self.causes],
            "unexplained": self.unexplained,
            "residual_m": self.residual_m,
            "misfit": self.misfit,
            "noise_scale": self.noise_scale,
            "condition": self.condition,
            "alike": [
                {"sources": [one, other], "correlation": rho} for one, other, rho in self.alike
            ],
            "largest_attitude_error_rad": self.tilt,
            "linear": self.linear,
        }


@dataclass(frozen=True)
class _Observed:
    """Means over blocks of neighbouring fixes: m instants, east and north."""

    t_ns: npt.NDArray[np.int64]
    error: Array
    sigma: Array
    fixes: Array


def find_causes(
    method: str,
    errors: Errors,
    track: Trajectory,
    *,
    levelling: bool = True,
    reset: bool = True,
    offline: bool = False,
    noise: LegNoise | None = None,
) -> Causes | None:
    """Fit the sources to the error of a method; None with under ten fixes after the first stop.

    Parameters
    ----------
    method : str
        Its name, for the result.
    errors : Errors
        Of the method, against GPS.
    track : Trajectory
        What the model is linearised about: the best track of the drive there is.
    levelling, reset : bool
        What the method does at a stop.
    offline : bool
        Whether velocity and level are tied down at both ends of the legs (the default method).
    noise : LegNoise or None
        Of the sensor, from its rest.
    """
    first = int(track.t_ns[int(np.argmax(track.stopped))])
    inside = (errors.t_ns >= first) & (errors.t_ns <= track.t_ns[-1])
    if np.count_nonzero(inside) < FEWEST:
        return None
    seen = _observed(errors, np.flatnonzero(inside))
    size = np.hypot(seen.error[:, 0], seen.error[:, 1])
    rms, end = float(np.sqrt(np.mean(size**2))), float(size[-1])
    gps = float(np.sqrt(2.0 * np.mean(seen.sigma**2)))
    if rms <= NOISE_FACTOR * gps:
        return Causes(method, rms, end, gps, needed=False)
    known = TYPICAL_NOISE if noise is None else noise
    start = max(float(np.median(seen.sigma)), 1.0)
    if offline:
        design = offline_design(track, seen.t_ns, noise=known, position_sigma=start)
    else:
        design = inertial_design(
            track, seen.t_ns, levelling=levelling, reset=reset, noise=known, position_sigma=start
        )
    factor = OFFLINE_FACTOR if offline else 1.0
    return _explain(Causes(method, rms, end, gps, needed=True), seen, design, factor)


def _observed(errors: Errors, index: npt.NDArray[np.int64]) -> _Observed:
    """Means of the fixes over blocks of equal time."""
    t_ns = errors.t_ns[index]
    t = (t_ns - t_ns[0]) * NS
    length = max(BLOCK, float(t[-1]) / BLOCKS)
    _, block = np.unique((t / length).astype(np.int64), return_inverse=True)
    fixes = np.bincount(block).astype(float)

    def mean(x: Array) -> Array:
        return np.asarray(np.bincount(block, weights=x) / fixes)

    if errors.reference_sigma is None:
        sigma = np.full(fixes.size, PLAIN_SIGMA)
    else:
        square = np.mean(errors.reference_sigma[index, :2] ** 2, axis=1)
        sigma = np.maximum(np.sqrt(mean(square)), LEAST_SIGMA)
    error = np.stack([mean(errors.east[index]), mean(errors.north[index])], axis=1)
    middle = t_ns[0] + np.rint(mean(t) / NS).astype(np.int64)
    return _Observed(middle, error, sigma, fixes)


def _noise_root(seen: _Observed) -> Array:
    """(m, m) lower factor of the covariance of one axis: GPS, and what the model misses."""
    t = (seen.t_ns - seen.t_ns[0]) * NS
    missed = LINEARISATION * np.hypot(seen.error[:, 0], seen.error[:, 1])
    slow = np.sqrt(CORRELATED * seen.sigma**2 + missed**2)
    apart = np.abs(t[:, None] - t[None, :])
    covariance = slow[:, None] * slow[None, :] * np.exp(-apart / CORRELATION_TIME)
    covariance += np.diag((1.0 - CORRELATED) * seen.sigma**2 / seen.fixes)
    return np.asarray(np.linalg.cholesky(covariance))


@dataclass(frozen=True)
class _Fit:
    """Values (p,), their covariance, chi square over observations, log evidence."""

    x: Array
    covariance: Array
    misfit: float
    evidence: float


def _fit(reduced: Array, z: Array, outside: float, prior: Array, count: int) -> _Fit:
    """Bayesian least squares: ``z = reduced x + unit noise``, x of covariance ``prior``.

    ``outside``: squared length of the observations that no column reaches; ``count`` of them all.
    """
    root = np.linalg.cholesky(prior)
    u, s, vt = np.linalg.svd(reduced @ root)
    size = np.zeros(vt.shape[0])
    size[: s.size] = s
    projected = np.zeros(vt.shape[0])
    projected[: s.size] = u.T[: s.size] @ z
    scaled = vt.T @ (size / (1.0 + size**2) * projected)
    rest = z - reduced @ (root @ scaled)
    cost = float(outside + rest @ rest + scaled @ scaled)
    misfit = float(np.sqrt(cost / count))
    spread = root @ (vt.T / np.sqrt(1.0 + size**2))
    evidence = -0.5 * (cost + float(np.sum(np.log1p(size**2))))
    return _Fit(root @ scaled, spread @ spread.T * max(misfit, 1.0) ** 2, misfit, evidence)


def _explain(blank: Causes, seen: _Observed, design: Design, sigma_factor: float) -> Causes:
    """The fit, and what each source has to do with the error."""
    root = _noise_root(seen)
    white = np.linalg.solve(root, np.concatenate([design.response, seen.error[:, :, None]], axis=2)
                            .reshape(seen.t_ns.size, -1))  # fmt: skip
    white = white.reshape(2 * seen.t_ns.size, -1)
    q, reduced = np.linalg.qr(white[:, :-1])
    z = q.T @ white[:, -1]
    outside = max(float(white[:, -1] @ white[:, -1] - z @ z), 0.0)
    fits = {
        factor: _fit(reduced, z, outside, design.prior_with(factor), white.shape[0])
        for factor in NOISE_SCALES
    }
    factor, fit = max(fits.items(), key=lambda found: found[1].evidence)
    x, covariance = fit.x, fit.covariance * sigma_factor**2
    causes = [_cause(source, design, seen.error, x, covariance) for source in design.sources]
    left = seen.error - design.response @ x
    singles = [source for source in design.sources if source.single]
    index = [source.columns.start for source in singles]
    prior = design.prior[index, index]
    size = np.linalg.svd(white[:, index] * np.sqrt(prior), compute_uv=False)
    return Causes(
        blank.method, blank.rms_m, blank.end_m, blank.noise_m, needed=True,
        causes=tuple(sorted(causes, key=lambda cause: -cause.share)),
        unexplained=float(np.sum(left * seen.error) / np.sum(seen.error**2)),
        residual_m=float(np.sqrt(np.mean(np.sum(left**2, axis=1)))),
        misfit=fit.misfit,
        noise_scale=factor,
        condition=float(size[0] / max(size[-1], 1e-12 * size[0])),
        alike=_alike(singles, covariance[np.ix_(index, index)]),
        tilt=float(np.max(np.linalg.norm(design.turn @ x, axis=1), initial=0.0)),
    )  # fmt: skip


def _cause(source: Source, design: Design, error: Array, x: Array, covariance: Array) -> Cause:
    columns = source.columns
    response = design.response[:, :, columns]
    part = response @ x[columns]
    # the share is linear in the values: its sigma is theirs
    slope = np.einsum("mkp,mk->p", response, error) / np.sum(error**2)
    own = covariance[columns, columns]
    values = x[columns] / source.factor
    variance = np.diag(own) / source.factor**2
    single = source.single
    before = np.mean(np.diag(design.prior)[columns])
    return Cause(
        name=source.name,
        label=source.label,
        unit=source.unit,
        value=float(values[0]) if single else float(np.sqrt(np.mean(values**2))),
        sigma=float(np.sqrt(np.mean(variance))),
        values=tuple(float(v) for v in values),
        share=float(slope @ x[columns]),
        share_sigma=float(np.sqrt(max(float(slope @ own @ slope), 0.0))),
        share_end=float(part[-1] @ error[-1] / max(float(error[-1] @ error[-1]), 1e-12)),
        rms_m=float(np.sqrt(np.mean(np.sum(part**2, axis=1)))),
        seen=bool(np.mean(np.diag(own)) < SEEN**2 * before),
        single=single,
    )


def _alike(sources: list[Source], covariance: Array) -> tuple[tuple[str, str, float], ...]:
    """Pairs of single sources whose values go together, though the drive shows their sum."""
    sigma = np.sqrt(np.diag(covariance))
    rho = covariance / np.outer(sigma, sigma)
    pairs = [
        (sources[j].label, sources[k].label, float(rho[j, k]))
        for j in range(len(sources))
        for k in range(j + 1, len(sources))
        if abs(rho[j, k]) >= ALIKE
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))
