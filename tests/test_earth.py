"""The Earth against pyproj, published constants, the exact normal potential, finite differences."""

from __future__ import annotations

import math

import numpy as np
import pyproj
import pytest

from vehnav.earth import (
    KRASOVSKY,
    WGS84,
    Ellipsoid,
    c_en,
    curvature_radii,
    earth_rate,
    ecef_from_geodetic,
    geodetic_from_ecef,
    geodetic_from_local_enu,
    in_axes_of,
    local_enu,
    normal_gravity,
    position_difference,
    radii,
    transport_rate,
)

DEG = math.pi / 180.0
GM = 3.986004418e14
"""m3/s2, WGS84 (NIMA TR8350.2)."""
MGAL = 1e-5
TO_ECEF = pyproj.Transformer.from_pipeline("+proj=cart +ellps=WGS84")
GEOD = pyproj.Geod(ellps="WGS84")
LATITUDES = [-89.9, -47.2, -1e-9, 0.0, 30.0, 55.75, 89.999]


def points() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """10 000 places (rad, rad, m): everywhere, and at the poles, the equator and the date line."""
    rng = np.random.default_rng(0)
    lat = np.arcsin(rng.uniform(-1, 1, 10_000)) / DEG
    lon = rng.uniform(-180, 180, 10_000)
    height = rng.uniform(-500, 20_000, 10_000)
    special = [90.0, 90.0 - 1e-9, -90.0, -90.0 + 1e-9, 0.0, 1e-9, -1e-9]
    lat[: len(special)] = special
    lon[10:16] = [180.0, -180.0, 180.0 - 1e-9, 0.0, 90.0, -90.0]
    return lat * DEG, lon * DEG, height


def ecef_of_pyproj(lat: np.ndarray, lon: np.ndarray, h: np.ndarray) -> np.ndarray:
    return np.stack(TO_ECEF.transform(lon / DEG, lat / DEG, h), axis=-1)


# ---- coordinates -------------------------------------------------------------------------------


def test_ecef_equals_pyproj() -> None:
    lat, lon, h = points()
    off = ecef_from_geodetic(lat, lon, h) - ecef_of_pyproj(lat, lon, h)
    assert np.abs(off).max() < 1e-8  # m; the coordinates carry 1e-9


def test_geodetic_equals_pyproj_and_comes_back() -> None:
    lat, lon, h = points()
    got_lat, got_lon, got_h = geodetic_from_ecef(ecef_of_pyproj(lat, lon, h))
    assert np.abs(got_lat - lat).max() < 1e-12  # rad
    assert np.abs(got_h - h).max() < 1e-8  # m
    # at the poles a longitude is worth what it moves
    turned = np.remainder(got_lon - lon + math.pi, 2 * math.pi) - math.pi
    assert np.abs(turned * np.cos(lat)).max() < 1e-12
    back = ecef_from_geodetic(got_lat, got_lon, got_h) - ecef_from_geodetic(lat, lon, h)
    assert np.abs(back).max() < 1e-8


def test_geodetic_at_the_documented_heights() -> None:
    lat, lon, _ = points()
    for height in (-10_000.0, 100_000.0):
        h = np.full(lat.size, height)
        got_lat, _, got_h = geodetic_from_ecef(ecef_of_pyproj(lat, lon, h))
        assert np.abs(got_lat - lat).max() < 1e-12
        assert np.abs(got_h - h).max() < 1e-8


def test_scalars_and_shapes() -> None:
    assert ecef_from_geodetic(0.0, 0.0, 0.0).tolist() == [WGS84.a, 0.0, 0.0]
    assert ecef_from_geodetic(np.zeros((2, 1)), np.zeros(3), 0.0).shape == (2, 3, 3)
    lat, lon, h = geodetic_from_ecef([[[WGS84.a + 5.0, 0.0, 0.0]]])
    assert lat.shape == lon.shape == h.shape == (1, 1)
    assert (float(lat[0, 0]), float(lon[0, 0])) == (0.0, 0.0)
    assert float(h[0, 0]) == pytest.approx(5.0, abs=1e-8)


def test_local_enu_equals_pyproj_topocentric() -> None:
    lat0, lon0, h0 = 47.2, 179.999, 450.0
    to_enu = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lat_0={lat0} +lon_0={lon0} +h_0={h0}"
    )
    rng = np.random.default_rng(1)
    lat = lat0 + rng.uniform(-1, 1, 1000)
    lon = np.remainder(lon0 + rng.uniform(-1, 1, 1000) + 180, 360) - 180
    h = rng.uniform(-100, 3000, 1000)
    wanted = np.stack(to_enu.transform(lon, lat, h), axis=-1)
    origin = (lat0 * DEG, lon0 * DEG, h0)
    got = local_enu(lat * DEG, lon * DEG, h, origin=origin)
    assert np.abs(got - wanted).max() < 1e-8
    back_lat, back_lon, back_h = geodetic_from_local_enu(got, origin=origin)
    assert np.abs(back_lat - lat * DEG).max() < 1e-12
    assert np.abs(back_lon - lon * DEG).max() < 1e-12
    assert np.abs(back_h - h).max() < 1e-8


def test_c_en_holds_east_north_up() -> None:
    lat, lon = 55.75 * DEG, -71.0 * DEG
    step = 1e-5  # rad: 2e-11 of truncation, 1e-11 of rounding
    here = (np.array([lat]), np.array([lon]), np.array([0.0]))
    east = ecef_of_pyproj(here[0], here[1] + step, here[2]) - ecef_of_pyproj(
        here[0], here[1] - step, here[2]
    )
    north = ecef_of_pyproj(here[0] + step, here[1], here[2]) - ecef_of_pyproj(
        here[0] - step, here[1], here[2]
    )
    up = ecef_of_pyproj(here[0], here[1], here[2] + 1e3) - ecef_of_pyproj(*here)
    for column, direction in enumerate((east, north, up)):
        unit = direction[0] / np.linalg.norm(direction)
        assert np.abs(c_en(lat, lon)[:, column] - unit).max() < 1e-10


def in_axes_by_pyproj(v: np.ndarray, place: np.ndarray, other: np.ndarray) -> np.ndarray:
    """A vector at one place (deg), by way of ECEF, in the axes of the other; both at h = 0."""
    cart, topo = "+proj=cart +ellps=WGS84", "+proj=topocentric +ellps=WGS84"
    here, there = (f"{topo} +lat_0={lat:.17g} +lon_0={lon:.17g}" for lat, lon in (place, other))
    to_ecef = pyproj.Transformer.from_pipeline(f"+proj=pipeline +step +inv {here}")
    from_ecef = pyproj.Transformer.from_pipeline(f"+proj=pipeline +step {there}")
    origin = pyproj.Transformer.from_pipeline(cart).transform([other[1]], [other[0]], [0.0])
    head, tail = (np.array(to_ecef.transform(*x)) for x in (v, np.zeros(3)))
    return np.array(from_ecef.transform(*(np.ravel(origin) + head - tail)))


def test_axes_of_a_near_place_turn_beyond_85_degrees_only() -> None:
    """Vectors and their matrices; a metre from the pole, over the pole, and on both sides of 85."""
    at = np.array([[89.99999, 10.0], [89.99999, 0.0], [-88.0, 179.9], [84.9999, 20.0],
                   [85.0001, 20.0], [47.0, 8.0]])  # fmt: skip
    to = np.array([[89.99999, 80.0], [89.99999, 180.0], [-88.1, -179.9], [85.0001, 20.4],
                   [84.9999, 20.4], [47.0, 8.4]])  # fmt: skip
    c = np.random.default_rng(4).normal(scale=1000.0, size=(6, 3, 3))
    turned = np.abs(to[:, 0]) > 85.0
    assert turned.tolist() == [True, True, True, True, False, False]
    wanted = c.copy()
    for n in np.flatnonzero(turned):
        for k in range(3):
            wanted[n, :, k] = in_axes_by_pyproj(c[n, :, k], at[n], to[n])
    lat, lon, to_lat, to_lon = (*(at * DEG).T, *(to * DEG).T)
    got = in_axes_of(c, lat, lon, to_lat=to_lat, to_lon=to_lon)
    assert np.abs(got - wanted).max() < 1e-8  # m; the coordinates carry 1e-9
    vectors = in_axes_of(c[:, :, 0], lat, lon, to_lat=to_lat, to_lon=to_lon)
    assert np.abs(vectors - wanted[:, :, 0]).max() < 1e-8
    assert np.abs(got - c)[turned].max(axis=(1, 2)).min() > 1.0  # turns of 0.2 degrees and more


# ---- curvature, rates --------------------------------------------------------------------------


@pytest.mark.parametrize("lat_deg", LATITUDES)
@pytest.mark.parametrize("h", [0.0, 2500.0])
def test_curvature_radii_are_the_derivatives_of_ecef(lat_deg: float, h: float) -> None:
    step = 1e-5  # rad
    lat = np.array([lat_deg * DEG])
    zero, height = np.zeros(1), np.array([h])
    along = ecef_of_pyproj(lat + step, zero, height) - ecef_of_pyproj(lat - step, zero, height)
    across = ecef_of_pyproj(lat, zero + step, height) - ecef_of_pyproj(lat, zero - step, height)
    radius_m, radius_n = curvature_radii(lat_deg * DEG, h, WGS84)
    # the step's truncation is 2e-11, the coordinates' rounding 1e-9 m in 128 m
    assert radius_m == pytest.approx(np.linalg.norm(along) / (2 * step), rel=1e-10)
    circle = np.linalg.norm(across) / (2 * math.sin(step))
    assert radius_n * math.cos(lat[0]) == pytest.approx(circle, rel=1e-10, abs=1e-3)


def test_radii_at_the_poles_are_the_published_one() -> None:
    """NIMA TR8350.2: polar radius of curvature 6399593.6258 m."""
    for lat in (math.pi / 2, -math.pi / 2):
        assert curvature_radii(lat, 0.0, WGS84) == pytest.approx((6399593.6258,) * 2, abs=1e-4)


@pytest.mark.parametrize("lat_deg", [-80.0, -30.0, 0.0, 47.2, 75.0])
def test_earth_rate_is_the_axis_seen_from_enu(lat_deg: float) -> None:
    axis = c_en(lat_deg * DEG, 1.0).T @ [0.0, 0.0, WGS84.omega_ie]
    assert earth_rate(lat_deg * DEG, WGS84) == pytest.approx(tuple(axis), abs=1e-19)


@pytest.mark.parametrize("v_n", [(30.0, 0.0, 0.0), (0.0, 30.0, 0.0), (-12.0, 25.0, 3.0)])
@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 47.2, 80.0])
def test_transport_rate_is_the_turning_of_enu(
    lat_deg: float, v_n: tuple[float, float, float]
) -> None:
    """C_en(t) of a vehicle moved by pyproj: omega_en_n from C_en^T dC_en/dt."""
    lat, h, dt = lat_deg * DEG, 100.0, 10.0
    velocity = c_en(lat, 0.0) @ v_n
    r0 = ecef_of_pyproj(np.array([lat]), np.zeros(1), np.array([h]))[0]
    to_geodetic = pyproj.Transformer.from_pipeline("+inv +proj=cart +ellps=WGS84")

    def frame(t: float) -> np.ndarray:
        lon, latitude, _ = to_geodetic.transform(*(r0 + velocity * t))
        return c_en(latitude * DEG, lon * DEG)

    turning = frame(0.0).T @ (frame(dt) - frame(-dt)) / (2 * dt)
    wanted = np.array([turning[2, 1], turning[0, 2], turning[1, 0]])
    radius_m, radius_n = curvature_radii(lat, h, WGS84)
    got = transport_rate(v_n, radius_m, radius_n, math.tan(lat))
    # truncation (v dt tan(lat) / R)^2 is below 1e-7 of the rate
    assert np.abs(np.array(got) - wanted).max() < 1e-6 * np.abs(wanted).max()


# ---- gravity -----------------------------------------------------------------------------------


def exact_normal_gravity(lat: float, h: float) -> float:
    """Magnitude of the gradient of the exact normal potential of WGS84 (Heiskanen, Moritz 2-7).

    By central differences of the potential in Cartesian coordinates: 5e-10 m/s2 of truncation,
    1e-9 of rounding.
    """
    a, e2, omega = WGS84.a, WGS84.e2, WGS84.omega_ie
    b, e_lin = a * math.sqrt(1 - e2), a * math.sqrt(e2)

    def q(u: float) -> float:
        x = e_lin / u
        terms = ((-1) ** (k + 1) * k * x ** (2 * k + 1) / ((2 * k + 1) * (2 * k + 3))
                 for k in range(1, 9))  # fmt: skip
        return 2 * sum(terms)

    def potential(p: float, z: float) -> float:
        s = p * p + z * z - e_lin**2
        u = math.sqrt(0.5 * s * (1 + math.sqrt(1 + 4 * (e_lin * z / s) ** 2)))
        attraction = GM / e_lin * math.atan(e_lin / u)
        bulge = 0.5 * omega**2 * a**2 * q(u) / q(b) * ((z / u) ** 2 - 1 / 3)
        return attraction + bulge + 0.5 * omega**2 * p * p

    x, _, z = (float(v) for v in ecef_from_geodetic(lat, 0.0, h))
    step = 30.0
    g_x = potential(x + step, z) - potential(x - step, z)
    g_z = potential(x, z + step) - potential(x, z - step)
    return math.hypot(g_x, g_z) / (2 * step)


@pytest.mark.parametrize("lat_deg", [0.0, 20.0, -45.0, 55.75, 89.0])
@pytest.mark.parametrize(("h", "within"), [(0.0, 5e-9), (1e3, 1.2e-7), (1e4, 1e-6)])
def test_gravity_is_the_gradient_of_the_normal_potential(
    lat_deg: float, h: float, within: float
) -> None:
    """At 0: the differences of the judge; above: the terms f^2 h/a (1e-7 per km) left out."""
    exact = exact_normal_gravity(lat_deg * DEG, h)
    assert normal_gravity(lat_deg * DEG, h, WGS84) == pytest.approx(exact, abs=within)


def test_gravity_has_the_published_values() -> None:
    assert normal_gravity(0.0, 0.0, WGS84) == pytest.approx(9.7803253359, abs=1e-12)
    assert normal_gravity(90 * DEG, 0.0, WGS84) == pytest.approx(9.8321849379, abs=1e-10)
    # k of the closed formula as NIMA TR8350.2 prints it
    k, s2 = 0.00193185265241, 0.5
    at_45 = 9.7803253359 * (1 + k * s2) / math.sqrt(1 - 0.00669437999014 * s2)
    assert normal_gravity(45 * DEG, 0.0, WGS84) == pytest.approx(at_45, abs=1e-10)
    assert normal_gravity(-45 * DEG, 0.0, WGS84) == normal_gravity(45 * DEG, 0.0, WGS84)


def test_mean_gravity_over_the_ellipsoid_is_the_published_one() -> None:
    """NIMA TR8350.2: 9.7976432222 m/s2."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    lat = nodes * math.pi / 2
    radii = np.array([curvature_radii(x, 0.0, WGS84) for x in lat])
    area = radii[:, 0] * radii[:, 1] * np.cos(lat) * weights
    gravity = np.array([normal_gravity(x, 0.0, WGS84) for x in lat])
    assert np.sum(gravity * area) / np.sum(area) == pytest.approx(9.7976432222, abs=2e-10)


def test_gravity_of_another_published_ellipsoid() -> None:
    """GRS80 at 45 degrees: 9.806199203 m/s2 (Moritz 2000)."""
    grs80 = Ellipsoid(
        a=6378137.0, e2=0.00669438002290, gamma_e=9.7803267715, gamma_p=9.8321863685,
        omega_ie=7.292115e-5, f=1 / 298.257222101, m=0.00344978600308,
    )  # fmt: skip
    assert normal_gravity(45 * DEG, 0.0, grs80) == pytest.approx(9.806199203, abs=1e-9)


@pytest.mark.parametrize("lat_deg", [0.0, 45.0, -70.0, 90.0])
def test_free_air_gradient_is_the_published_one(lat_deg: float) -> None:
    """-(0.3087691 - 0.0004398 sin^2) h + 7.2125e-8 h^2 mGal (Hinze and others 2005, eq. 5)."""
    s2 = math.sin(lat_deg * DEG) ** 2
    at_0 = normal_gravity(lat_deg * DEG, 0.0, WGS84)
    for h in (-100.0, 500.0, 3000.0):
        wanted = (-(0.3087691 - 0.0004398 * s2) * h + 7.2125e-8 * h * h) * MGAL
        fall = normal_gravity(lat_deg * DEG, h, WGS84) - at_0
        # their coefficients are fitted and rounded; f^2 is 1.1e-5
        assert fall == pytest.approx(wanted, rel=5e-5, abs=0.0)


def test_constants_belong_together() -> None:
    ellipsoid = pyproj.CRS("EPSG:4979").ellipsoid
    assert ellipsoid is not None
    assert WGS84.a == ellipsoid.semi_major_metre
    assert 1 / WGS84.f == pytest.approx(ellipsoid.inverse_flattening, rel=1e-12)
    assert WGS84.e2 == pytest.approx(WGS84.f * (2 - WGS84.f), abs=5e-15)
    b = WGS84.a * (1 - WGS84.f)
    assert WGS84.m == pytest.approx(WGS84.omega_ie**2 * WGS84.a**2 * b / GM, rel=1e-9)


def test_krasovsky_is_the_rounded_print_of_paper_004() -> None:
    exact = pyproj.Geod(ellps="krass")
    assert KRASOVSKY.a == exact.a
    assert KRASOVSKY.f == pytest.approx(exact.f, rel=1e-9)
    assert KRASOVSKY.e2 == pytest.approx(exact.es, abs=5e-8)  # seven decimals
    assert normal_gravity(0.0, 0.0, KRASOVSKY) == pytest.approx(9.780, abs=1e-12)
    assert normal_gravity(math.pi / 2, 0.0, KRASOVSKY) == pytest.approx(9.832, abs=1e-9)
    b = exact.a * (1 - exact.f)
    m = KRASOVSKY.omega_ie**2 * exact.a**2 * b / GM
    assert KRASOVSKY.m == pytest.approx(m, rel=2e-5)  # five digits


# ---- differences -------------------------------------------------------------------------------


def test_position_difference_is_the_geodesic() -> None:
    """Length and direction at the middle, up to 5 km and 80 degrees, over the date line too."""
    rng = np.random.default_rng(2)
    n = 2000
    lat0, lon0 = rng.uniform(-80, 80, n), rng.uniform(-180, 180, n)
    lon0[:20] = 180.0
    azimuth, distance = rng.uniform(0, 360, n), rng.uniform(0, 5000, n)
    lon1, lat1, back = GEOD.fwd(lon0, lat0, azimuth, distance)
    got = position_difference(lat1 * DEG, lon1 * DEG, lat0 * DEG, lon0 * DEG)
    turned = np.remainder(back + 180 - azimuth + 180, 360) - 180
    middle = (azimuth + 0.5 * turned) * DEG
    wanted = distance[:, None] * np.stack([np.sin(middle), np.cos(middle)], axis=-1)
    # the square of the convergence of the meridians, (d tan(lat) / R)^2 / 24
    assert np.abs(got - wanted).max() < 1e-6 * 5000
    small = distance < 100
    assert np.abs(got - wanted)[small].max() < 1e-6


def test_position_difference_at_height() -> None:
    lat0, lon0, h = np.array([47.2 * DEG]), np.array([0.3]), np.array([3000.0])
    d_lat, d_lon = 1e-6, -2e-6
    got = position_difference(lat0 + d_lat, lon0 + d_lon, lat0, lon0, h)
    moved = ecef_of_pyproj(lat0 + d_lat, lon0 + d_lon, h) - ecef_of_pyproj(lat0, lon0, h)
    assert np.linalg.norm(got) == pytest.approx(np.linalg.norm(moved), rel=1e-8)
    assert got[0, 0] < 0 < got[0, 1]
    assert position_difference(0.1, 0.2, 0.1, 0.2).tolist() == [0.0, 0.0]
    assert position_difference(np.zeros((4, 5)), 0.0, 0.0, 0.0).shape == (4, 5, 2)


def test_radii_of_arrays_are_those_of_the_kernel() -> None:
    lat, h = np.radians([-90.0, -33.0, 0.0, 47.2, 89.9]), np.array([0.0, 100.0, -50.0, 3e3, 1e4])
    expected = np.array(
        [curvature_radii(float(a), float(b), WGS84) for a, b in zip(lat, h, strict=True)]
    )
    np.testing.assert_allclose(np.stack(radii(lat, h), axis=1), expected, rtol=1e-15)
