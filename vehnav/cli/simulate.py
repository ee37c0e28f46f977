"""``vehnav simulate``: logs of named scenarios and of routes, with their truth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vehnav.cli.common import (
    command,
    finish,
    json_option,
    print_findings,
    print_json,
    progress,
    quiet_option,
    strict_option,
)
from vehnav.cli.simulate_options import drive_options, gps_options, wheel_options
from vehnav.errors import ConfigError, Finding

if TYPE_CHECKING:
    from vehnav.sensors import Sensor
    from vehnav.simulate import GnssModel, Scenario, Setup, SimulatedLog


@command(
    "simulate",
    examples=[
        "vehnav simulate --list",
        "vehnav simulate city -o city.mcap --sensor hg1700 --seed 3",
        "vehnav simulate town,v=12,stop=20 -o town.csv --sampling increments --duration 900",
        "vehnav simulate street.gpx -o street.mcap --wheel --outage 200:260",
        "vehnav simulate circle,lat=47.2 -o mc.mcap --sensor l3g4200d --runs 20 --rate 10",
    ],
    config=False,
)
@click.argument("scenario", required=False, metavar="SCENARIO[,KEY=VALUE...]")
@drive_options
@gps_options
@wheel_options
@json_option
@strict_option
@quiet_option
def simulate(
    scenario: str | None, output: str | None, listing: bool, as_json: bool, strict: bool,
    quiet: bool, **options: Any,
) -> None:  # fmt: skip
    """Write the log of a drive whose truth is known.

    SCENARIO is a name of --list with parameters (angles in degrees), or a GPX, GeoJSON or CSV file
    of way-points. MCAP: ROS 2 messages, axes forward-left-up; CSV: axes right-forward-up, fixes
    and speed in files beside it. The truth is written beside the log as LOG-stem.truth.csv. The
    same scenario and seed give the same log.
    """
    if listing:
        _list(as_json=as_json)
        finish()
    if scenario is None or output is None:
        raise click.UsageError("SCENARIO and -o LOG are needed, or --list")
    way, setup, every = _prepared(scenario, options)
    document, findings = _write(way, setup, options, output, every, quiet=quiet)
    if as_json:
        print_json(document)
    elif not quiet:
        click.echo(_screen(document))
    print_findings(findings, start_ns=setup.start_ns)
    finish(strict=strict, findings=findings)


def _prepared(scenario: str, options: dict[str, Any]) -> tuple[Scenario, Setup, int]:
    """The way, what is simulated on it, and how many samples make a row of the truth."""
    from vehnav.sensors import load_sensor
    from vehnav.simulate import Setup, WheelModel, make_scenario

    names = {"duration": options["duration"], "ellipsoid": options["ellipsoid"]}
    way = make_scenario(scenario, **{k: v for k, v in names.items() if v is not None})
    rate = options["rate"]
    truth_rate = options["truth_rate"] or rate
    every = round(rate / truth_rate)
    if every < 1 or abs(every * truth_rate - rate) > 1e-6 * rate:
        raise ConfigError(f"--truth-rate {truth_rate:g}: must divide the rate of the IMU, {rate:g}")
    wheel = WheelModel(
        rate_hz=options["wheel_rate"],
        noise=options["wheel_noise"],
        scale=options["wheel_scale"] / 100.0,
    )
    setup = Setup(
        sensor=load_sensor(options["sensor"]),
        rate_hz=rate,
        sampling=options["sampling"],
        gnss=_receiver(options, way.motion.duration) if options["gps"] else None,
        wheel=wheel if options["wheel"] else None,
    )
    return way, setup, every


def _receiver(options: dict[str, Any], duration: float) -> GnssModel:
    from vehnav.simulate import GnssModel
    from vehnav.simulate.receivers import repeated_outages

    outages: list[tuple[float, float]] = []
    for outage in options["outages"]:
        if isinstance(outage, dict):
            outages += repeated_outages(
                every=outage["every"],
                length=outage["length"],
                start=outage["from"],
                duration=duration,
            )
        else:
            outages.append(outage)
    return GnssModel(
        rate_hz=options["gps_rate"],
        noise=options["gps_noise"],
        drift=options["gps_drift"],
        drift_time=options["gps_drift_time"],
        velocity_noise=options["gps_velocity_noise"],
        latency=options["gps_latency"],
        outages=tuple(outages),
    )


def _write(
    way: Scenario, setup: Setup, options: dict[str, Any], output: str, every: int, *, quiet: bool
) -> tuple[dict[str, Any], list[Finding]]:
    """Write the runs; what ``--json`` prints, and what was found."""
    from vehnav.simulate import simulate_runs, write_runs

    count = options["runs"]
    document: dict[str, Any] = {}
    rows: list[dict[str, Any]] = []
    findings: list[Finding] = []
    with progress("simulating", total=count if count > 1 else None, quiet=quiet) as advance:
        runs = simulate_runs(way, setup, seed=options["seed"], runs=count)
        for run, files in write_runs(runs, output, count=count, truth_every=every):
            document = document or _drive_document(way, setup, run)
            rows.append({"run": run.run, "files": [str(path) for path in files], **_drawn(run)})
            findings += run.findings
            advance(len(rows))
    return {**document, "runs": rows}, findings


def _drive_document(way: Scenario, setup: Setup, run: SimulatedLog) -> dict[str, Any]:
    """What is common to all runs."""
    starts = run.truth.stopped[:-1] & ~run.truth.stopped[1:]
    return {
        "scenario": way.name,
        "duration_s": round(way.motion.duration, 6),
        "distance_m": run.truth.path_length(),
        "departures": int(starts.sum()),
        "standing_percent": 100.0 * float(run.truth.stopped.mean()),
        "start_unix_ns": setup.start_ns,
        "imu": {
            "samples": int(run.imu.t_ns.size),
            "rate_hz": setup.rate_hz,
            "sampling": setup.sampling,
            "sensor": _sensor_document(setup.sensor),
        },
        "fixes": 0 if run.gnss is None else int(run.gnss.t_ns.size),
        "wheel_speeds": 0 if run.speed is None else int(run.speed.t_ns.size),
        "seed": run.seed,
    }


def _sensor_document(sensor: Sensor) -> dict[str, Any]:
    """Name and the figures that are not zero, in the units of a sensor file."""
    import tomllib

    from vehnav.sensors import sensor_toml

    table: dict[str, Any] = tomllib.loads(sensor_toml(sensor))["sensor"]
    return table


def _drawn(run: SimulatedLog) -> dict[str, Any]:
    from vehnav.units import DEG_PER_HOUR, MILLI_G

    return {
        "gyro_bias_dph": run.errors.gyro_bias / DEG_PER_HOUR,
        "accel_bias_mg": run.errors.accel_bias / MILLI_G,
    }


def _screen(document: dict[str, Any]) -> str:
    imu = document["imu"]
    lines = [
        f"{document['scenario']}: {document['duration_s']:.0f} s, "
        f"{document['distance_m'] / 1000.0:.2f} km, {document['departures']} departures, "
        f"standing {document['standing_percent']:.0f} %",
        f"{imu['sensor']['name']}: {imu['samples']} {imu['sampling']} at {imu['rate_hz']:g} Hz, "
        f"{document['fixes']} fixes, {document['wheel_speeds']} wheel speeds, "
        f"seed {document['seed']}",
    ]
    lines += ["wrote " + ", ".join(run["files"]) for run in document["runs"]]
    return "\n".join(lines)


def _list(*, as_json: bool) -> None:
    """The scenarios with their parameters, and the sensors."""
    from vehnav.sensors import CATALOGUE
    from vehnav.simulate import SCENARIOS, scenario_parameters

    if as_json:
        scenarios = {name: scenario_parameters(name) for name in SCENARIOS}
        sensors = {name: _sensor_document(sensor) for name, sensor in CATALOGUE.items()}
        print_json({"scenarios": scenarios, "sensors": sensors})
        return
    click.echo("Scenarios, with their parameters (degrees, metres, seconds):\n")
    for name, make in SCENARIOS.items():
        click.echo(f"  {name}: {(make.__doc__ or '').strip().splitlines()[0]}")
        pairs = (f"{key}={value}" for key, value in scenario_parameters(name).items())
        click.echo(click.wrap_text(" ".join(pairs), 98, "      ", "      "))
    click.echo("\nSensors (--sensor; one standard deviation each):\n")
    for name, sensor in CATALOGUE.items():
        figures = {k: v for k, v in _sensor_document(sensor).items() if k != "name"}
        text = " ".join(f"{key}={value:g}" for key, value in figures.items()) or "no errors"
        click.echo(click.wrap_text(f"{name}: {text}", 98, "  ", "      "))
