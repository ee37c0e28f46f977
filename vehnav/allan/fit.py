"""The figures of a sensor axis from its Allan variances and the means of its pieces.

Generalised least squares of the variances on the four kinds of :mod:`processes`, none negative,
with the covariance that these very figures imply, iterated: the estimate is unbiased, and its
uncertainty is the scatter of the estimator, not of a picture. Kinds enter one after the other, and
only where the data ask for them (a score test: under the covariance without them). The shortest
clusters are left out as long as they contradict the rest: engine vibration and the sensor's own
filter live there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.allan.between import FEWEST, PieceMeans, Structure, mean_covariance, structure
from vehnav.allan.curve import Curve, octaves
from vehnav.allan.processes import KINDS, PEAK, Powers, allan_form, mean_form
from vehnav.allan.spread import Spread

Array = npt.NDArray[np.float64]

ASKED: Final = 8.0
"""Fall of chi square from which a kind is there (2.8 sigma)."""
ASKED_TWO: Final = 12.0
"""The same of a bias, which brings two figures."""
PREFERRED: Final = 4.0
"""Of twice the log likelihood by which a bias must beat a walk, or both must beat one."""
LATEST: Final = 2.0
"""s: clusters longer than this are never left out for being short."""
SHORTEST_TIME: Final = 5.0
"""s: what changes faster is no bias."""
SEEN: Final = 3.0
"""Degrees of freedom of a cluster from which its peak would be seen."""
TIMES_PER_DECADE: Final = 8
PASSES: Final = 3
"""Times the covariance is put to the figures found."""
QUANTILE: Final = 2.33
"""Sigmas of chi square from which the shortest clusters contradict the rest (1 in 100)."""
CHANCE: Final = 2.0
"""Times the least misfit at which a longer range of clusters is preferred: that much is chance at
the long ones; vibration at the short ones contradicts by factors of ten."""
LEAST: Final = 4
"""Clusters below which nothing can be fitted."""
ONE_SIDED: Final = 1.645
"""Sigmas of a 95 % limit."""
SMALLEST_QUANTILE: Final = 0.02
"""Chi square of one or two degrees of freedom is hardly ever smaller."""


@dataclass(frozen=True)
class Figure:
    """One figure with its uncertainty, or a limit, or neither.

    Attributes
    ----------
    value, sigma : float or None
        One sigma; None where it cannot be told.
    limit : float or None
        95 % upper limit where there is no value.
    """

    value: float | None = None
    sigma: float | None = None
    limit: float | None = None


@dataclass(frozen=True)
class AxisFit:
    """What an axis shows.

    Attributes
    ----------
    white, bias, walk, angle : Figure
        N (unit sqrt(s)), sigma of the bias (unit), K (unit / sqrt(s)), Q (unit s).
    time : float or None
        Time constant of the bias, s.
    still_growing : bool
        The deviation grows to the longest time seen: a walk and a bias look alike.
    powers : Powers
        In force, to draw.
    first_tau : float
        s, the shortest cluster that counted.
    reach : float
        s, the longest time seen, in a piece or between two.
    chi_square, freedom : float, int
        Of the fit.
    dead : bool
        The reading does not change: nothing was fitted.
    """

    white: Figure
    bias: Figure
    walk: Figure
    angle: Figure
    time: float | None
    still_growing: bool
    powers: Powers
    first_tau: float
    reach: float
    chi_square: float
    freedom: int
    dead: bool = False


@dataclass(frozen=True)
class _Trial:
    """A fit with given kinds: powers, chi square, twice the negative log likelihood."""

    kinds: tuple[str, ...]
    powers: Powers
    chi_square: float
    objective: float


class _Data:
    """Variances of one axis from one cluster on, and what they should be."""

    def __init__(
        self,
        curve: Curve,
        axis: int,
        first: int,
        spread: Spread,
        means: PieceMeans | None,
        pairs: Structure | None,
    ) -> None:
        self.curve = curve.at(curve.clusters[first:])
        self.first, self.spread = first, spread
        self.axis = axis
        self.means, self.pairs = means, pairs
        self.y = self.curve.variance[:, axis]
        self.known = np.zeros(self.y.size)
        if means is not None and pairs is not None:
            other = pairs.expected(np.diag(means.other[:, axis]))
            self.y = np.concatenate([self.y, pairs.value[:, axis]])
            self.known = np.concatenate([self.known, other])

    @property
    def reach(self) -> float:
        """s, the longest time that shows."""
        between = 0.0 if self.means is None else self.means.span
        return max(float(self.curve.tau[-1]), between)

    def times(self) -> Array:
        """Time constants whose peak would be seen."""
        seen = self.curve.tau[self.curve.dof >= SEEN]
        between = 0.0 if self.means is None else 0.5 * self.means.span
        last = max(float(seen[-1]) if seen.size else 0.0, between) / PEAK
        if last < SHORTEST_TIME:
            return np.empty(0)
        count = 1 + int(TIMES_PER_DECADE * math.log10(last / SHORTEST_TIME))
        return np.asarray(last * 10.0 ** (-np.arange(count) / TIMES_PER_DECADE))

    def column(self, kind: str, time: float) -> Array:
        """Expected values of a kind of power one."""
        own = allan_form(kind, self.curve.tau, time)
        if self.means is None or self.pairs is None:
            return own
        form = mean_form(kind, self.means.start, self.means.end, time)
        return np.concatenate([own, self.pairs.expected(form)])

    def covariance(self, powers: Powers) -> Array:
        """Of the data, for these powers."""
        own = self.spread.covariance(powers)[self.first :, self.first :]
        if self.means is None or self.pairs is None:
            return own
        between = self.pairs.spread(mean_covariance(self.means, self.axis, powers))
        out = np.zeros((self.y.size, self.y.size))
        out[: own.shape[0], : own.shape[0]] = own
        out[own.shape[0] :, own.shape[0] :] = between
        return out


def fit_axes(curve: Curve, means: PieceMeans | None = None) -> list[AxisFit]:
    """Noise, bias and walk of every axis.

    Parameters
    ----------
    curve : Curve
        Its clusters of 1, 2, 4, ... samples count.
    means : PieceMeans or None
        Of the pieces, in time; fewer than three are left alone.

    Raises
    ------
    ValueError
        Fewer than four clusters.
    """
    if means is not None and means.start.size < FEWEST:
        means = None
    curve = curve.at(octaves(2 * int(curve.clusters[-1])))
    if curve.clusters.size < LEAST:
        raise ValueError(f"at least {LEAST} clusters are needed")
    pairs = None if means is None else structure(means)
    spread = Spread(curve.lengths, curve.clusters, curve.weights, curve.dt)
    axes = range(curve.variance.shape[1])
    return [_fit_axis(curve, axis, spread, means, pairs) for axis in axes]


def _fit_axis(
    curve: Curve, axis: int, spread: Spread, means: PieceMeans | None, pairs: Structure | None
) -> AxisFit:
    """The shortest clusters are left out until the rest agrees, or agrees best.

    Nothing is said of a dead axis.
    """
    if np.min(curve.variance[:LEAST, axis]) <= 0.0:
        nothing = Figure()
        tau = float(curve.tau[0])
        return AxisFit(
            nothing, nothing, nothing, nothing, None, False, Powers(), tau, tau, 0.0, 0, True
        )  # fmt: skip
    last = int(np.count_nonzero(curve.tau[:-LEAST] <= LATEST))
    trials = []
    for first in range(last + 1):
        data = _Data(curve, axis, first, spread, means, pairs)
        best, growing = _choose(data)
        freedom = max(data.y.size - len(best.kinds) - ("bias" in best.kinds), 1)
        misfit = best.chi_square / (freedom * _quantile(freedom, QUANTILE))
        trials.append((misfit, data, best, freedom, growing))
        if misfit <= 1.0:
            break
    allowed = max(1.0, CHANCE * min(trial[0] for trial in trials))
    _, data, best, freedom, growing = next(trial for trial in trials if trial[0] <= allowed)
    return _report(data, best, freedom, growing)


def _quantile(freedom: float, sigmas: float) -> float:
    """Quantile of chi square over its degrees of freedom (Wilson and Hilferty)."""
    part = 2.0 / (9.0 * freedom)
    return float(max(1.0 - part + sigmas * math.sqrt(part), 0.0) ** 3)


# ---- choice ------------------------------------------------------------------------------------


def _choose(data: _Data) -> tuple[_Trial, bool]:
    """Which kinds there are; and whether a walk and a bias look alike."""
    base = _converge(data, ("white",), _start(data))
    for trial in _grow(data, base, [("angle", "white")]):
        base = trial
    grown = _grow(data, base, [(*base.kinds, "walk"), (*base.kinds, "bias")])
    if not grown:
        return base, False
    by_kind = {trial.kinds[-1]: trial for trial in grown}
    walk, bias = by_kind.get("walk"), by_kind.get("bias")
    if walk is None and bias is not None:
        best, growing = bias, False
    elif bias is None and walk is not None:
        best, growing = walk, True
    else:
        assert walk is not None
        assert bias is not None
        growing = bias.objective > walk.objective - PREFERRED
        best = walk if growing else bias
    both = _grow(data, best, [(*base.kinds, "walk", "bias")])
    if both and both[0].objective < best.objective - PREFERRED and both[0].powers.bias > 0.0:
        return both[0], False
    return best, growing


def _grow(data: _Data, base: _Trial, wanted: Sequence[tuple[str, ...]]) -> list[_Trial]:
    """Those of the wanted sets of kinds that the data ask for beyond ``base``, converged."""
    inverse = _inverse(data.covariance(base.powers))
    found = []
    for kinds in wanted:
        powers, chi_square = _least_squares(data, kinds, inverse)
        asked = ASKED_TWO if "bias" in kinds and "bias" not in base.kinds else ASKED
        if base.chi_square - chi_square > asked:
            found.append(_converge(data, kinds, powers))
    return found


def _start(data: _Data) -> Powers:
    """White noise of the size that the clusters show in the middle."""
    return Powers(white=float(np.median(data.curve.variance[:, data.axis] * data.curve.tau)))


def _converge(data: _Data, kinds: tuple[str, ...], powers: Powers) -> _Trial:
    """Least squares with the covariance of its own result."""
    for _ in range(PASSES):
        inverse = _inverse(data.covariance(powers))
        powers, chi_square = _least_squares(data, kinds, inverse)
    sign, log_det = np.linalg.slogdet(inverse)
    objective = chi_square - float(log_det) if sign > 0 else math.inf
    return _Trial(kinds, powers, chi_square, objective)


def _inverse(covariance: Array) -> Array:
    """Inverse, well conditioned: the variances scaled to one."""
    scale = 1.0 / np.sqrt(np.diagonal(covariance))
    correlation = covariance * scale[:, None] * scale[None, :]
    values, vectors = np.linalg.eigh(correlation)
    values = np.maximum(values, 1e-3)
    inverse = (vectors / values) @ vectors.T
    return np.asarray(inverse * scale[:, None] * scale[None, :])


def _least_squares(data: _Data, kinds: tuple[str, ...], inverse: Array) -> tuple[Powers, float]:
    """Powers of the kinds, none negative, and chi square; the time constant is searched."""
    times = data.times() if "bias" in kinds else np.array([Powers().time])
    best = (Powers(), math.inf)
    for time in times.tolist():
        columns = np.stack([data.column(kind, time) for kind in kinds], axis=1)
        values, chi_square = _nonnegative(columns, data.y - data.known, inverse)
        if chi_square < best[1]:
            powers = dict(zip(kinds, values.tolist(), strict=True))
            best = (Powers(**powers, time=time), chi_square)
    return best


def _nonnegative(a: Array, y: Array, inverse: Array) -> tuple[Array, float]:
    """Least squares without negative values, by trying every subset of at most four columns."""
    scale = 1.0 / np.sqrt(np.einsum("ik,ij,jk->k", a, inverse, a))
    a = a * scale
    normal, right, total = a.T @ inverse @ a, a.T @ inverse @ y, float(y @ inverse @ y)
    best, found = math.inf, np.zeros(a.shape[1])
    for size in range(1, a.shape[1] + 1):
        for subset in combinations(range(a.shape[1]), size):
            chosen = list(subset)
            x = np.linalg.lstsq(normal[np.ix_(chosen, chosen)], right[chosen], rcond=None)[0]
            chi_square = total - float(x @ right[chosen])
            if np.all(x >= 0.0) and chi_square < best - 1e-9:
                best, found = chi_square, np.zeros(a.shape[1])
                found[chosen] = x
    return found * scale, max(best, 0.0)


# ---- report ------------------------------------------------------------------------------------


def _report(data: _Data, best: _Trial, freedom: int, growing: bool) -> AxisFit:
    """Figures with uncertainties; limits of the kinds that did not enter."""
    swell = max(1.0, best.chi_square / freedom)
    longest = data.times()
    figures = {kind: Figure() for kind in KINDS}
    for kind in KINDS:
        powers = best.powers
        if kind in ("bias", "walk") and getattr(powers, kind) == 0.0 and longest.size == 0:
            continue  # too short to say anything of what is slow
        if kind == "bias" and powers.bias == 0.0:
            powers = replace(powers, time=float(longest[0]))
        figures[kind] = _figure(data, kind, powers, swell)
    growing = growing and figures["walk"].value is not None
    if growing:
        figures["bias"] = Figure()
    told = figures["bias"].value is not None
    return AxisFit(
        figures["white"], figures["bias"], figures["walk"], figures["angle"],
        best.powers.time if told else None, growing, best.powers,
        float(data.curve.tau[0]), data.reach, best.chi_square, freedom,
    )  # fmt: skip


def _figure(data: _Data, kind: str, powers: Powers, swell: float) -> Figure:
    """Root of a power with its uncertainty, or the limit of one that is not there."""
    power = getattr(powers, kind)
    sigma = math.sqrt(swell) * _sigma(data, kind, powers)
    if power > sigma:
        return Figure(math.sqrt(power), sigma / (2.0 * math.sqrt(power)))
    return Figure(limit=math.sqrt(_limit(data, kind, powers, power, swell)))


def _limit(data: _Data, kind: str, powers: Powers, power: float, swell: float) -> float:
    """95 % upper limit of a power: what hides it, over what a larger one would scatter down to.

    A process of which the record holds a few correlation times shows a chi square of as few
    degrees of freedom: it may by chance be far smaller than it is.
    """
    others = replace(powers, **{kind: 0.0})
    if not any(getattr(others, name) for name in KINDS):
        others = powers
    hidden = power + ONE_SIDED * math.sqrt(swell) * _sigma(data, kind, others)
    large = 10.0 * hidden
    freedom = 2.0 * (large / _sigma(data, kind, replace(powers, **{kind: large}))) ** 2
    return hidden / max(_quantile(freedom, -ONE_SIDED), SMALLEST_QUANTILE)


def _sigma(data: _Data, kind: str, powers: Powers) -> float:
    """Standard deviation of the estimate of a power, the others estimated beside it."""
    inverse = _inverse(data.covariance(powers))
    present = [k for k in KINDS if getattr(powers, k) > 0.0 or k == kind]
    columns = [data.column(k, powers.time) for k in present]
    if powers.bias > 0.0:  # the time constant is a figure too
        step = 1.02
        change = data.column("bias", powers.time * step) - data.column("bias", powers.time / step)
        columns.append(powers.bias * change / (2.0 * math.log(step)))
    a = np.stack(columns, axis=1)
    scale = 1.0 / np.sqrt(np.einsum("ik,ij,jk->k", a, inverse, a))
    covariance = np.linalg.pinv((a * scale).T @ inverse @ (a * scale), rcond=1e-9)
    k = present.index(kind)
    return math.sqrt(max(float(covariance[k, k]), 0.0)) * float(scale[k])
