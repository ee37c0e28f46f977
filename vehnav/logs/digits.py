"""Decimals kept as bytes become integers without loss.

A float64 keeps 0.1 us of Unix seconds; a file with nine decimals says more. Eight digits are worked
on as one integer.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vehnav.logs.log import TimeArray

WORD: Final = 8
"""Bytes, and digits, in an integer."""
BLOCK: Final = 1 << 13
"""Fields taken at once: they stay in the cache of the processor."""
_EACH: Final = np.uint64(0x0101010101010101)

Characters = npt.NDArray[np.uint8]


def fixed_point(fields: npt.NDArray[np.bytes_], whole: int, part: int) -> TimeArray | None:
    """(n,) int64: ``whole`` digits, a point and ``part`` digits, times 10**part.

    None unless every field looks like that and fits.

    >>> fixed_point(np.array([b"12.50", b"07.25"], "S8"), 2, 2).tolist()
    [1250, 725]
    >>> fixed_point(np.array([b"12.50", b"7.25"], "S8"), 2, 2) is None
    True
    """
    values = np.zeros(fields.size, np.int64)
    for first in range(0, fields.size, BLOCK):
        block = _block(fields[first : first + BLOCK], whole, part)
        if block is None:
            return None
        values[first : first + BLOCK] = block
    return values


def _block(fields: npt.NDArray[np.bytes_], whole: int, part: int) -> TimeArray | None:
    """:func:`fixed_point` of some fields."""
    length = fields.dtype.itemsize
    rows = np.ascontiguousarray(fields).view(np.uint8).reshape(fields.size, length)
    end = whole + 1 + part
    if length <= end or np.any(rows[:, end]) or np.any(rows[:, whole] != ord(".")):
        return None
    high, low = _digits(rows[:, :whole]), _digits(rows[:, whole + 1 : end])
    if high is None or low is None:
        return None
    if high.size and high.max() >= np.iinfo(np.int64).max // 10**part:
        return None
    return np.asarray(high * 10**part + low, np.int64)


def _digits(characters: Characters) -> TimeArray | None:
    """(n,) int64 of (n, k) digits; None if others are among them."""
    count = characters.shape[1]
    value = np.zeros(len(characters), np.int64)
    for first in range(0, count, WORD):
        block = characters[:, first : first + WORD]
        word = np.full((len(block), WORD), ord("0"), np.uint8)
        word[:, WORD - block.shape[1] :] = block
        joined = _joined(word.view("<u8")[:, 0])
        if joined is None:
            return None
        value = value * 10 ** block.shape[1] + joined
    return value


def _joined(word: npt.NDArray[np.uint64]) -> TimeArray | None:
    """Eight digits as one number: joined to pairs, to fours, to eight; None if not digits."""
    word = word ^ (_EACH * np.uint64(ord("0")))  # a digit becomes its value
    if np.any((word | (word + _EACH * np.uint64(6))) & (_EACH * np.uint64(0xF0))):
        return None
    word = (word * np.uint64(1 + (10 << 8)) >> np.uint64(8)) & np.uint64(0x00FF00FF00FF00FF)
    word = (word * np.uint64(1 + (100 << 16)) >> np.uint64(16)) & np.uint64(0x0000FFFF0000FFFF)
    return (word * np.uint64(1 + (10_000 << 32)) >> np.uint64(32)).astype(np.int64)
