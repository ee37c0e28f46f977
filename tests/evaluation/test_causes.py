"""What caused the error: the linear responses against the integration itself, and known causes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from vehnav.aiding.error_model import fill_error_matrix
from vehnav.classic import Drive, Start, dead_reckon, rest_of
from vehnav.config import Config
from vehnav.earth import WGS84, curvature_radii, position_difference
from vehnav.evaluation.cause_inertial import error_matrices, inertial_design
from vehnav.evaluation.cause_models import TYPICAL_NOISE
from vehnav.evaluation.cause_offline import leg_sigma, offline_design
from vehnav.evaluation.cause_text import parts, sentence, value_text
from vehnav.evaluation.causes import Causes, find_causes
from vehnav.logs.log import Log
from vehnav.pipeline import METHODS, Run, run, search_stops
from vehnav.rotation import angles_from_c_nb, c_nb_from_angles
from vehnav.sensors import Sensor, Triad
from vehnav.simulate import SimulatedLog, simulate
from vehnav.stops import stopped_mask
from vehnav.strapdown.increments import increments_from_rates
from vehnav.strapdown.wander import mat3
from vehnav.trajectory import Trajectory
from vehnav.units import DEG, DEG_PER_HOUR, DEG_PER_SQRT_HOUR, MILLI_G

CITY = "city,duration=480,seed=3,first_stop=30,last_stop=20,stop_every=80"
QUIET = Sensor("quiet", gyro=Triad(noise=0.05 * DEG_PER_SQRT_HOUR), accel=Triad(noise=2e-4))
"""White noise alone, of a navigation grade."""


def test_the_matrix_is_that_of_the_error_model() -> None:
    """Element by element against aiding.error_model, which finite differences judge."""
    rng = np.random.default_rng(5)
    lat, height = 0.9, 120.0
    v_n = rng.normal(size=(4, 3)) * 15.0
    c_nb = c_nb_from_angles(rng.normal(size=4), *(0.1 * rng.normal(size=(2, 4))))
    found = error_matrices(np.full(4, lat), v_n, c_nb, height=height)
    radius_m, radius_n = curvature_radii(lat, height, WGS84)
    fill = getattr(fill_error_matrix, "py_func", fill_error_matrix)
    for v, c, own in zip(v_n, c_nb, found, strict=True):
        f = np.zeros((9, 15))
        omega_en = (-v[1] / radius_m, v[0] / radius_n, v[0] * np.tan(lat) / radius_n)
        axis = (0.0, np.cos(lat), np.sin(lat))
        fill(f, axis, height, tuple(v), mat3(c), omega_en, True, WGS84)
        assert own == pytest.approx(f, abs=1e-13)


# ---- responses against the integration ---------------------------------------------------------


@dataclass(frozen=True)
class Bench:
    """A perfect log, and solutions of it with one thing wrong."""

    drive: Drive
    heading: float
    position: tuple[float, float, float]
    t_ns: np.ndarray

    def solve(self, *, levelling: bool, reset: bool, heading=0.0, gyro=(0, 0, 0), accel=(0, 0, 0),
              gyro_scale=0.0):  # fmt: skip
        """As a run does: level and bias from the first stop, then forward."""
        drive = self.drive
        omega = drive.omega * np.array([1.0, 1.0, 1.0 + gyro_scale])
        f = drive.f + np.array(accel, float)
        increments = increments_from_rates(drive.t, omega, f, max_gap=0.5)
        drive = replace(drive, omega=omega, f=f, increments=increments)
        start = Start(
            self.position, rest_of(drive, drive.stops[0]).c_nb(0.0), np.zeros(3), np.zeros(3)
        )
        start = start.turned(drive, self.heading + heading)
        start = replace(start, gyro_bias=start.gyro_bias - np.array(gyro, float))
        return dead_reckon(drive, start, levelling=levelling, reset=reset)


@pytest.fixture(scope="module")
def bench() -> Bench:
    made = simulate(CITY, sensor="ideal", rate_hz=50.0)
    search = search_stops(replace_axes(made.log()), Config(axes="RFU"))
    samples = search.samples
    drive = Drive(samples.t, samples.omega, samples.f, samples.increments, search.stops, WGS84)
    k = drive.first
    truth = made.truth
    heading = float(angles_from_c_nb(truth.c_nb[k])[0])
    position = (float(truth.lat[k]), float(truth.lon[k]), float(truth.height[k]))
    return Bench(drive, heading, position, samples.t_ns)


def replace_axes(log: Log) -> Log:
    assert log.imu is not None
    return replace(log, imu=replace(log.imu, axes="RFU"))


SIZES = {
    "heading": (0.3 * DEG, {"heading": 0.3 * DEG}),
    "gyro-bias-up": (10 * DEG_PER_HOUR, {"gyro": (0, 0, 10 * DEG_PER_HOUR)}),
    "gyro-bias-right": (2 * DEG_PER_HOUR, {"gyro": (2 * DEG_PER_HOUR, 0, 0)}),
    "gyro-bias-forward": (2 * DEG_PER_HOUR, {"gyro": (0, 2 * DEG_PER_HOUR, 0)}),
    "accel-bias-right": (MILLI_G, {"accel": (MILLI_G, 0, 0)}),
    "accel-bias-forward": (MILLI_G, {"accel": (0, MILLI_G, 0)}),
    "gyro-scale-up": (0.001, {"gyro_scale": 0.001}),
}


@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("method", ["free", "as_published"])
def test_responses_are_those_of_the_integration(bench: Bench, name: str, method: str) -> None:
    """Solution with the error minus solution without, against the column, to 1 % of its largest.

    Half the attitude error (0.003 rad) and the grid of the equations explain that much.
    """
    on = {"levelling": METHODS[method].levelling, "reset": METHODS[method].reset}
    size, wrong = SIZES[name]
    true, off = bench.solve(**on), bench.solve(**on, **wrong)
    first = bench.drive.first
    t_ns = bench.t_ns[first:]
    track = Trajectory(
        t_ns, true.position[:, 0], true.position[:, 1], true.position[:, 2], true.v_n, true.c_nb,
        stopped_mask(bench.t_ns.size, bench.drive.stops)[first:],
    )  # fmt: skip
    at = np.arange(t_ns.size // 10, t_ns.size, t_ns.size // 20)
    design = inertial_design(track, t_ns[at], **on, noise=TYPICAL_NOISE, position_sigma=1.0)
    column = next(s.columns.start for s in design.sources if s.name == name)
    predicted = size * design.response[:, :, column]
    difference = position_difference(
        off.position[at, 0], off.position[at, 1], true.position[at, 0], true.position[at, 1],
        bench.position[2],
    )  # fmt: skip
    scale = np.abs(difference).max()
    assert scale > 1.0  # m: there is something to compare
    assert predicted == pytest.approx(difference, abs=0.01 * scale)


OFFLINE = {
    "heading": (0.01, 0.02),
    "gyro-scale-up": (0.003, 0.2),
    "accel-scale": (0.003, 0.2),
    "accel-scale-right": (0.003, 0.2),
}
"""Size of the error, and to what share of its effect the simple model has to be right."""
SLOW = ("gyro-scale-up", "accel-scale-right")


@pytest.fixture(scope="module")
def mems() -> tuple[SimulatedLog, Trajectory]:
    """A MEMS log and its track by the default method."""
    made = simulate(CITY, sensor="mems-industrial", rate_hz=50.0, seed=2)
    return made, wrong_run(made).trajectory


@pytest.mark.parametrize(
    "name", ["heading", "accel-scale", *(pytest.param(x, marks=pytest.mark.slow) for x in SLOW)]
)
def test_responses_of_the_offline_solution(mems, name: str) -> None:
    """The same with whole runs by the default method, the noise equal in both."""
    made, true = mems
    size, share = OFFLINE[name]
    wrong = {
        "heading": {"heading_deg": size / DEG},
        "gyro-scale-up": {"gyro_scale": size},
        "accel-scale": {"accel_scale": size},
        "accel-scale-right": {"right_scale": size},
    }[name]
    off = wrong_run(made, **wrong).trajectory
    at = np.arange(true.size // 10, true.size, true.size // 20)
    design = offline_design(true, true.t_ns[at], noise=TYPICAL_NOISE, position_sigma=1.0)
    column = next(s.columns.start for s in design.sources if s.name == name)
    difference = position_difference(
        off.lat[at], off.lon[at], true.lat[at], true.lon[at], true.height[at]
    )
    scale = np.abs(difference).max()
    assert scale > 0.5  # m
    assert size * design.response[:, :, column] == pytest.approx(difference, abs=share * scale)


# ---- known causes ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made() -> SimulatedLog:
    return simulate(CITY, sensor=QUIET, rate_hz=50.0, seed=4)


def wrong_run(
    made: SimulatedLog, *, heading_deg=0.0, gyro_up_dph=0.0, gyro_scale=0.0, accel_mg=(0.0, 0.0),
    accel_scale=0.0, right_scale=0.0, late=0.0,
) -> Run:  # fmt: skip
    """The log with one thing wrong; the heading is given, off by so much."""
    log = replace_axes(made.log())
    imu, gnss = log.imu, log.gnss
    assert imu is not None
    assert gnss is not None
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    gyro[:, 2] *= 1.0 + gyro_scale
    gyro[(imu.t_ns - imu.t_ns[0]) * 1e-9 > 30.0, 2] += gyro_up_dph * DEG_PER_HOUR
    accel[:, 1] *= 1.0 + accel_scale
    accel[:, 0] *= 1.0 + right_scale
    accel[:, :2] += np.array(accel_mg) * MILLI_G
    gnss = replace(gnss, t_ns=gnss.t_ns + np.int64(round(late * 1e9)))
    true = float(np.degrees(angles_from_c_nb(made.truth.c_nb[0])[0]))
    config = Config(axes="RFU", start_heading=true + heading_deg)
    return run(replace(log, imu=replace(imu, gyro=gyro, accel=accel), gnss=gnss), config)


def explained(found: Run, method: str) -> Causes:
    corrections = METHODS[method]
    causes = find_causes(
        method, found.method_errors[method], found.variants["default"],
        levelling=corrections.levelling, reset=corrections.reset, offline=corrections.refine,
        noise=found.noise,
    )  # fmt: skip
    assert causes is not None
    return causes


@pytest.mark.parametrize(
    ("name", "truth", "wrong", "methods"),
    [
        ("heading", 2.0, {"heading_deg": 2.0}, ("default", "as_published")),
        ("gyro-bias-up", 60.0, {"gyro_up_dph": 60.0}, ("as_published",)),
        ("gyro-scale-up", 1.0, {"gyro_scale": 0.01}, ("default", "as_published")),
        ("accel-bias-right", 5.0, {"accel_mg": (5.0, 0.0)}, ("as_published", "free")),
        ("accel-scale", 3.0, {"accel_scale": 0.03}, ("default",)),
        ("gps-delay", 0.8, {"late": 0.8}, ("default",)),
    ],
)
def test_the_dominant_cause_is_found(made, name, truth, wrong, methods) -> None:
    """First by share, nearly all of the error, its value within three sigma and 20 %."""
    found = wrong_run(made, **wrong)
    for method in methods:
        causes = explained(found, method)
        first = causes.causes[0]
        assert causes.needed
        assert first.name == name, sentence(causes)
        assert first.share == pytest.approx(1.0, abs=0.3)
        assert abs(first.value - truth) < 3.0 * first.sigma
        assert first.value == pytest.approx(truth, rel=0.2)
        assert first.significant
        assert first.seen
        assert abs(causes.unexplained) < 0.1
        total = sum(cause.share for cause in causes.causes) + causes.unexplained
        assert total == pytest.approx(1.0)
        assert first.label in sentence(causes)


def test_nothing_needs_explaining_on_a_perfect_log(made) -> None:
    causes = explained(wrong_run(made), "default")
    assert not causes.needed
    assert causes.causes == ()
    assert sentence(causes).startswith("nothing needs explaining")


def test_what_a_drive_does_not_show_is_said() -> None:
    """On a straight drive no turn shows the gyro's scale: the prior is all that is known."""
    made = simulate("straight,duration=240", sensor="hg1700", rate_hz=50.0, seed=2)
    found = wrong_run(made, heading_deg=3.0)
    causes = explained(found, "as_published")
    by_name = {cause.name: cause for cause in causes.causes}
    assert not by_name["gyro-scale-up"].seen
    assert not by_name["gyro-scale-up"].significant
    assert causes.condition > 100.0


@pytest.mark.slow
def test_sigmas_are_honest_over_seeds() -> None:
    """Values against the drawn errors over 6 drives: nine in ten within two sigma, all in five.

    A gyro triad turned against the accelerometers looks like a bias of g times the angle.
    """
    scaled = []
    for seed in range(1, 7):
        made = simulate(
            f"city,duration=900,seed={seed}", sensor="mems-industrial", rate_hz=50.0, seed=seed
        )
        found = wrong_run(made, heading_deg=2.0)
        drawn = made.errors
        level = drawn.accel_bias + (drawn.accel_matrix - drawn.gyro_matrix)[:, 2] * 9.81
        truth = {
            "heading": 2.0,
            "gyro-scale-up": 100.0 * drawn.gyro_matrix[2, 2],
            "accel-bias-right": level[0] / MILLI_G,
            "accel-bias-forward": level[1] / MILLI_G,
        }
        for method in ("default", "as_published", "free"):
            for cause in explained(found, method).causes:
                if cause.name in truth:
                    scaled.append((cause.value - truth[cause.name]) / cause.sigma)
    size = np.abs(scaled)
    assert np.mean(size < 2.0) > 0.85
    assert np.max(size) < 5.0


# ---- parts -------------------------------------------------------------------------------------


def test_leg_noise_is_the_conditional_variance_of_the_integrals() -> None:
    """By sampling: a random walk (tilt), its integrals (velocity, position), regressed."""
    rng = np.random.default_rng(8)
    n, duration, q, g = 400, 60.0, 1e-4, 9.81
    dt = duration / n
    tilt = np.cumsum(q * np.sqrt(dt) * rng.normal(size=(4000, n)), axis=1)
    velocity = g * np.cumsum(tilt, axis=1) * dt
    position = np.sum(velocity, axis=1) * dt
    ends = np.stack([tilt[:, -1], velocity[:, -1]], axis=1)
    left = position - ends @ np.linalg.lstsq(ends, position, rcond=None)[0]
    noise = replace(TYPICAL_NOISE, gyro_white=q, accel_white=0.0, gravity=g)
    # 4000 draws: 1.1 % of a standard deviation; the rest is the step of the sums
    assert leg_sigma(duration, noise) == pytest.approx(np.std(left), rel=0.05)


def test_words_add_up(made) -> None:
    causes = explained(wrong_run(made, heading_deg=2.0), "default")
    shares = [int(text.split(" %")[0]) for text in parts(causes)]
    assert abs(sum(shares) - 100) <= len(shares)  # each is rounded
    assert "initial heading" in sentence(causes)
    assert value_text(causes.causes[0]).endswith(" deg")


def test_cost_of_an_hour() -> None:
    """The steps are bounded, so an hour costs no more than a quarter: counted, not timed."""
    from vehnav.evaluation.cause_models import MAX_STEPS, motion_of

    t = np.arange(0.0, 3600.0, 0.1)
    speed = np.where((t > 30.0) & (t < 3500.0), 10.0, 0.0)
    zero = np.zeros_like(t)
    track = Trajectory(
        (t * 1e9).astype(np.int64), zero + 0.9, 1e-7 * np.cumsum(speed), zero,
        np.stack([speed, zero, zero], axis=1), np.broadcast_to(np.eye(3), (t.size, 3, 3)),
        speed == 0.0,
    )  # fmt: skip
    assert motion_of(track).t.size <= MAX_STEPS + 10


def test_too_few_fixes_explain_nothing(made) -> None:
    found = wrong_run(made, heading_deg=2.0)
    errors = found.method_errors["default"]
    last = int(errors.t_ns[5])
    some = {name: getattr(errors, name)[errors.t_ns <= last] for name in ("east", "north", "t_ns")}
    assert find_causes("default", replace(errors, **some), found.variants["default"]) is None
