"""Digits of a fixed place in every line of a text file, as integers.

A float64 keeps 0.1 us of Unix seconds; a file with nine decimals says more. Taking the decimals
from the bytes is cheaper than parsing the file again.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from vehnav.logs.log import TimeArray

BLOCK: Final = 1 << 20
"""Bytes taken at once: they stay in the cache of the processor."""


def digits_at(path: str, *, skip: int, rows: int, place: int, count: int) -> TimeArray | None:
    """(rows,) int64: ``count`` digits from ``place`` of every line after the first ``skip``.

    None unless the file has just that many lines, each with a point before the digits.
    """
    powers = 10 ** np.arange(count - 1, -1, -1)
    parts: list[TimeArray] = []
    for data in _whole_lines(path):
        starts = np.concatenate(([0], np.flatnonzero(data == ord("\n"))[:-1] + 1))
        starts, skip = starts[skip:], max(skip - starts.size, 0)
        if not starts.size:
            continue
        if starts[-1] + place + count > data.size:
            return None
        digits = sliding_window_view(data, count)[starts + place] - ord("0")
        if np.any(data[starts + place - 1] != ord(".")) or np.any(digits > 9):
            return None
        parts.append(digits @ powers)
    values = np.concatenate(parts) if parts else np.zeros(0, np.int64)
    return values if values.size == rows else None


def _whole_lines(path: str) -> Iterator[npt.NDArray[np.uint8]]:
    """The bytes of a file in blocks that end with a line."""
    rest = b""
    with Path(path).open("rb") as file:
        while block := file.read(BLOCK):
            rest += block
            end = rest.rfind(b"\n") + 1
            if end:
                yield np.frombuffer(rest, np.uint8, count=end)
            rest = rest[end:]
    if rest:
        yield np.frombuffer(rest + b"\n", np.uint8)
