"""What caused the error, in words."""

from __future__ import annotations

from typing import Final

import numpy as np

from vehnav.evaluation.causes import Cause, Causes

NAMED: Final = 0.05
"""Share from which a cause is named in the sentence."""
LINEAR_NOTES: Final = {
    "strained": "with {tilt:.0f} deg of attitude error the linear model is off by some percent",
    "invalid": "with {tilt:.0f} deg of attitude error the linear model does not hold: take the "
    "values as hints",
}


def value_text(cause: Cause) -> str:
    """The value with its uncertainty, in the unit of the trade.

    >>> value_text(Cause("heading", "initial heading", "deg", 1.93, 0.12, (1.93,), 0.9, 0.1, 0.9,
    ...                  12.0, True, True))
    '+1.93 ± 0.12 deg'
    """
    digits = int(np.clip(1 - np.floor(np.log10(max(cause.sigma, 1e-9))), 0, 3))
    if not cause.single:
        return f"{cause.value:.{digits}f} {cause.unit} rms"
    return f"{cause.value:+.{digits}f} ± {cause.sigma:.{digits}f} {cause.unit}"


def parts(found: Causes) -> list[str]:
    """What explains how much of the error, named causes first; the percentages add up to 100."""
    named = [c for c in found.causes if c.significant and c.share >= NAMED]
    texts = [f"{100.0 * c.share:.0f} % {c.label} {value_text(c)}" for c in named]
    rest = 1.0 - found.unexplained - sum(cause.share for cause in named)
    texts.append(f"{100.0 * rest:.0f} % noise of the sensors and causes within their uncertainty")
    texts.append(f"{100.0 * found.unexplained:.0f} % unexplained")
    return texts


def sentence(found: Causes) -> str:
    """What explains the error, in one line."""
    if not found.needed:
        return (
            f"nothing needs explaining: {found.rms_m:.1f} m rms is within the noise of the GPS "
            f"({found.noise_m:.1f} m)"
        )
    text = f"of the {found.rms_m:.3g} m rms: {'; '.join(parts(found))}"
    note = LINEAR_NOTES.get(found.linear)
    return text if note is None else f"{text}; {note.format(tilt=np.degrees(found.tilt))}"
