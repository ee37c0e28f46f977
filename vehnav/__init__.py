"""vehnav: vehicle dead reckoning from IMU logs.

Conventions, fixed for the whole package
----------------------------------------
Frames
    i inertial, e Earth-fixed, n local **East-North-Up**, w wander (n turned in azimuth),
    q quasi-Greenwich, b vehicle body **right-forward-up**, s sensor case as logged.
Rotation
    ``c_nb`` takes b to n: ``v_n = c_nb @ v_b``; letters cancel: ``c_eb = c_en @ c_nb``;
    ``c_nb`` is the unit matrix when the vehicle is level and heads north. Quaternion ``q_nb`` is
    (w, x, y, z).
Rate
    ``omega_ib_b`` is the rate of b relative to i, in b axes; ``omega_in = omega_ie + omega_en``.
Angles
    heading clockwise from north, pitch nose up, roll right side down; *yaw* only for ROS.
Units
    SI and radians inside; a unit stands in a name only where a number leaves the program.
Time
    int64 nanoseconds in logs and files, float seconds since the start in the mathematics.
Error
    estimate minus truth.

Symbols of the papers
---------------------
=============================  =================================================================
paper                          code
=============================  =================================================================
004 M_CE, 000 Lambda           ``c_nb``; quaternion body to inertial ``q_ib``
004 n, 000 a, 001 n, 003 f     specific force ``f_b``, ``f_n``
004 omega_b, z^omega           gyro output ``omega_ib_b``
004 omega_gamma                ``omega_in_n``: absolute rate of the ENU frame
004 R_phi, R_lambda            ``radius_m``, ``radius_n`` (height included)
000 theta_n, b_n               increments ``dtheta``, ``dvel``
002 k                          ``levelling gain / g``; Delta omega is ``levelling_rate``
003 epsilon                    ``wander``
=============================  =================================================================
"""

from __future__ import annotations

from vehnav._version import __version__

__all__ = ["__version__"]
