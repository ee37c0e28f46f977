"""Six figures of a series of errors, as ``report.json`` gives them."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Statistics:
    """A series of errors in six figures, in the unit of the series.

    Attributes
    ----------
    rms : float
        Root of the mean square.
    mean, median : float
        Signed where the series is signed: a bias shows here.
    p95, max : float
        95th percentile and largest of the magnitude.
    end : float
        The last one, signed.
    """

    rms: float
    mean: float
    median: float
    p95: float
    max: float
    end: float

    def to_dict(self) -> dict[str, float]:
        """The six figures by name."""
        return asdict(self)


def statistics(series: npt.ArrayLike) -> Statistics | None:
    """:class:`Statistics` of a series (n,); None of an empty one.

    >>> statistics([3.0, -4.0]).rms ** 2
    12.5
    """
    x = np.asarray(series, float)
    if x.size == 0:
        return None
    size = np.abs(x)
    return Statistics(
        rms=float(np.sqrt(np.mean(x * x))),
        mean=float(np.mean(x)),
        median=float(np.median(x)),
        p95=float(np.percentile(size, 95.0)),
        max=float(np.max(size)),
        end=float(x[-1]),
    )
