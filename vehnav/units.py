"""Unit factors: multiply to get SI and radians, divide to print.

>>> round(90 * DEG, 6)
1.570796
"""

from __future__ import annotations

import math
from typing import Final

DEG: Final = math.pi / 180.0
"""rad in a degree."""
DEG_PER_HOUR: Final = DEG / 3600.0
"""rad/s in a degree per hour."""
DEG_PER_SQRT_HOUR: Final = DEG / 60.0
"""rad/sqrt(s) in a degree per square root of an hour (angle random walk)."""
M_S_PER_SQRT_HOUR: Final = 1.0 / 60.0
"""m/s/sqrt(s) in a metre per second per square root of an hour (velocity random walk)."""
STANDARD_GRAVITY: Final = 9.80665
"""m/s2 in a g."""
MILLI_G: Final = 1e-3 * STANDARD_GRAVITY
"""m/s2 in a milli-g."""
PPM: Final = 1e-6
MRAD: Final = 1e-3
NS: Final = 1e-9
"""seconds in a nanosecond."""

GYRO_UNITS: Final = {"rad/s": 1.0, "deg/s": DEG, "deg/h": DEG_PER_HOUR, "mrad/s": MRAD}
ACCEL_UNITS: Final = {"m/s2": 1.0, "g": STANDARD_GRAVITY, "mg": MILLI_G}
