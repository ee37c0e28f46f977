"""The encoder of fixed decimals, judged by Python's own formatting and by exact decimals."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehnav.export.decimals import Column, column, encode_rows
from vehnav.rotation import exact_degrees


def encoded(*columns: Column, separator: str = ",") -> str:
    return b"".join(encode_rows(columns, separator=separator)).decode()


def test_by_hand() -> None:
    text = encoded(
        Column("t", np.array([1_711_483_800_000_000_001, 5, -1_500_000_000]), 9),
        column("x", [0.0, -0.00004, 123.45678], 4),
        column("k", [1.0, 0.0, -12.0], 0),
    )
    assert text == (
        "1711483800.000000001,0.0000,1\n0.000000005,0.0000,0\n-1.500000000,123.4568,-12\n"
    )


@given(
    st.lists(st.floats(-1e7, 1e7, allow_nan=False), min_size=1, max_size=30),
    st.integers(0, 9),
)
def test_every_number_is_the_nearest_decimal(values: list[float], decimals: int) -> None:
    """Half a unit of the last decimal, and the rounding of x * 10^d to 53 bits on top."""
    unit = Decimal(1).scaleb(-decimals)
    for value, text in zip(values, encoded(column("x", values, decimals)).split(), strict=True):
        slack = abs(Decimal(value)) * Decimal(2) ** -53
        assert abs(Decimal(text) - Decimal(value)) <= unit / 2 + slack
        _, _, fraction = text.partition(".")
        assert len(fraction) == decimals


def test_equal_to_printf() -> None:
    """Away from ties: the text of '%.*f', a minus in front of a rounded zero excepted."""
    rng = np.random.default_rng(2)
    values = rng.normal(0.0, 10.0 ** rng.integers(-4, 6, 20_000))
    for decimals in (0, 1, 3, 4, 5, 9, 10):
        sharp = values[np.abs(values) * 10.0**decimals < 2.0**33]  # ties are told apart
        ours = encoded(column("x", sharp, decimals)).split()
        theirs = [f"{v:.{decimals}f}" for v in sharp]
        theirs = [t[1:] if float(t) == 0.0 and t[0] == "-" else t for t in theirs]
        assert ours == theirs


def test_times_of_int64_are_exact_across_blocks() -> None:
    t = 1_711_483_800_000_000_000 + np.arange(10_000, dtype=np.int64) * 10_000_019
    ours = encoded(Column("t", t, 9)).split()
    assert ours == [f"{v // 10**9}.{v % 10**9:09d}" for v in t.tolist()]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_with_its_row(bad: float) -> None:
    with pytest.raises(ValueError, match=r"height_m.*row 2"):
        column("height_m", [1.0, bad], 4)


def test_too_large_is_refused() -> None:
    with pytest.raises(ValueError, match="too large"):
        column("x", [1e12], 10)


def test_degrees_that_give_the_same_radians() -> None:
    """Every angle that was once read as degrees; ``np.degrees`` alone fails for 5 %."""
    rng = np.random.default_rng(9)
    for angle in (np.radians(rng.uniform(-180.0, 180.0, 50_000)), np.radians([0.0, 90.0, -180.0])):
        assert np.array_equal(np.radians(exact_degrees(angle)), angle)
        assert np.allclose(exact_degrees(angle), np.degrees(angle), rtol=1e-15, atol=0.0)
