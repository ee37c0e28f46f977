"""What ``vehnav budget`` prints for a person."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vehnav.units import DEG

if TYPE_CHECKING:
    from vehnav.budget.forward import Budget
    from vehnav.budget.inverse import Solution
    from vehnav.budget.montecarlo import MonteCarlo
    from vehnav.budget.study import Interval, Study
    from vehnav.budget_legs import LegCheck

SMALL = 5e-4
"""Share under which sources are summed up in one line."""


def number(value: float) -> str:
    """Four digits, no exponent where it can be avoided.

    >>> number(0.01234), number(2468.13), number(73272.9)
    ('0.01234', '2468', '73273')
    """
    if value == 0.0:
        return "0"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def assumptions(study: Study) -> list[str]:
    """The drive and what is assumed about it."""
    drive, procedure, initial = study.drive, study.procedure, study.initial
    stops = procedure.stops
    standing = f"{len(stops)} of {len(drive.stops)} stops with reset and levelling"
    if procedure.gyro_from_stops and stops:
        standing += " and gyro bias"
    tilt = "levelled" if procedure.levelled else f"tilt {number(initial.tilt / DEG)} deg"
    model = {"full": "full equations", "paper": "equations of paper 001",
             "simplified": "simplified equations"}[study.model]  # fmt: skip
    return [
        f"{drive.name}: {drive.duration:.0f} s, {drive.path_length() / 1000.0:.2f} km; {standing}",
        f"start: {tilt}, heading {number(initial.heading / DEG)} deg, velocity "
        f"{number(initial.velocity)} m/s, position {number(initial.position)} m; height "
        f"{'held' if study.held else 'free'}; {model}",
    ]


def forward_lines(study: Study, budget: Budget) -> list[str]:
    """Table of sources at the last time, totals at all, validity."""
    time = study.time
    lines = [
        *assumptions(study), "",
        f"{budget.sensor.name} at {time:g} s, effect of one sigma",
        f"{'source':40}{'sigma':>9} {'unit':15}{'east m':>10}{'north m':>10}{'radial m':>10}"
        f"{'share':>8}",
    ]  # fmt: skip
    small = 0
    for row in budget.rows(time):
        if row.share < SMALL:
            small += 1
            continue
        lines.append(
            f"{row.source:40}{number(row.sigma):>9} {row.unit:15}{number(row.east):>10}"
            f"{number(row.north):>10}{number(row.radial):>10}{100.0 * row.share:>7.1f}%"
        )
    if small:
        lines.append(f"and {small} more of under {100.0 * SMALL:g} % each")
    return [*lines, "", *total_lines(study, budget)]


def total_lines(study: Study, budget: Budget) -> list[str]:
    """Totals at all times and the validity of the last."""
    head = f"{'TOTAL at':>10}{'east m':>10}{'north m':>10}{'DRMS m':>10}{'CEP50 m':>10}"
    lines = [head + f"{'CEP95 m':>10}" + ("" if study.held else f"{'up m':>10}")]
    for time in study.times:
        found = budget.totals(time)
        cells = [found[name] for name in ("east", "north", "drms", "cep50", "cep95")]
        if not study.held:
            cells.append(budget.sigma_up(time))
        lines.append(f"{time:>8g} s" + "".join(f"{number(x):>10}" for x in cells))
    return [*lines, budget.validity(study.time).text]


def drawn_lines(drawn: MonteCarlo, budget: Budget, times: tuple[float, ...]) -> list[str]:
    """Monte Carlo beside the linear totals."""
    lines = [
        "",
        f"Monte Carlo: {drawn.runs} runs of the nonlinear mechanization, seed {drawn.seed}",
        f"{'at':>10}{'DRMS m':>10}{'CEP50 m':>10}{'CEP95 m':>10}{'linear / Monte Carlo, DRMS':>28}",
    ]
    for time in times:
        found, linear = drawn.totals(time), budget.totals(time)
        ratio = f"{linear['drms'] / found['drms']:.3f}" if found["drms"] > 0.0 else "-"
        cells = "".join(f"{number(found[name]):>10}" for name in ("drms", "cep50", "cep95"))
        lines.append(f"{time:>8g} s{cells}{ratio:>28}")
    return lines


def inverse_lines(study: Study, found: Solution, name: str) -> list[str]:
    """What a requirement allows, beside the sensor in hand (``name``) and the catalogue."""
    from vehnav.budget.inverse import grades_within

    need = found.requirement
    lines = [*assumptions(study), ""]
    lines.append(f"{need.metric} of {need.value:g} m at {need.time:g} s, --solve {found.how}")
    if not found.feasible:
        return [*lines, found.text]
    lines.append(
        f"{'parameter':24}{'allowed':>10} {'unit':15}{name:>15}{'factor':>9}  grades that have it"
    )
    for row in found.allowed:
        factor = "-" if row.factor is None else number(row.factor)
        lines.append(
            f"{row.parameter:24}{number(row.value):>10} {row.unit:15}{number(row.given):>15}"
            f"{factor:>9}  {', '.join(grades_within(row)) or '-'}"
        )
    if found.how == "equal":
        lines.append("of these alone, in equal shares: every other source and start error is none")
    return [*lines, f"achieved: {found.text}"]


def rank_lines(study: Study, ranked: list[Budget], metric: str) -> list[str]:
    """The catalogue on this drive, the best first."""
    time = study.time
    bias = study.procedure.gyro_from_stops or not study.procedure.stops
    other = None if bias else study.with_gyro_from_stops()
    heads = "".join(f"{f'{t:g} s':>10}" for t in study.times)
    lines = [
        *assumptions(study), "",
        f"{f'{metric}, m':21}{heads}" + ("" if bias else f"{'gyro bias from stops':>22}")
        + f"  {'linear':9} largest source",
    ]  # fmt: skip
    for budget in ranked:
        cells = "".join(f"{_valid(budget, t, metric):>10}" for t in study.times)
        if other is not None:
            cells += f"{_valid(other.budget(budget.sensor), time, metric):>22}"
        rows = budget.rows(time)
        largest = f"{rows[0].source} {100.0 * rows[0].share:.0f} %" if rows else "-"
        verdict = budget.validity(time).verdict
        lines.append(f"{budget.sensor.name:21}{cells}  {verdict:9} {largest}")
    if any(budget.validity(time).verdict == "invalid" for budget in ranked):
        lines.append("invalid: attitude error beyond 0.5 rad, so no figure; --mc gives one")
    if other is not None:
        lines.append(
            f"gyro bias from stops: at {time:g} s, with the bias that every stop shows taken off, "
            "as `vehnav run` does; --gyro-bias-from-stops"
        )
    return lines


def _valid(budget: Budget, time: float, metric: str) -> str:
    if budget.validity(time).verdict == "invalid":
        return "-"
    return number(budget.totals(time)[metric])


def sweep_lines(study: Study, sweep: list[Interval]) -> list[str]:
    """Error against the interval between corrections."""
    lines = [
        *assumptions(study), "",
        f"{sweep[0].budget.sensor.name} at {study.time:g} s against the interval of corrections",
        f"{'stops at least':>16}{'used':>6}{'longest leg s':>15}{'DRMS m':>10}{'CEP95 m':>10}",
    ]  # fmt: skip
    for item in sweep:
        asked = {0.0: "all", None: "none"}.get(item.every, f"{item.every or 0:g} s apart")
        found = item.budget.totals(study.time)
        lines.append(
            f"{asked:>16}{item.stops:>6}{item.longest:>15.0f}{number(found['drms']):>10}"
            f"{number(found['cep95']):>10}"
        )
    return lines


def legs_lines(check: LegCheck) -> list[str]:
    """Predicted and real error of every leg."""
    lines = [
        f"{check.name}: error that each leg adds, predicted from {check.sensor} and real by GPS",
        f"{'leg':>4}{'from s':>9}{'to s':>9}{'driven m':>10}{'95 % within m':>15}{'real m':>9}"
        "  largest source; where outside, what would explain it",
    ]
    for k, leg in enumerate(check.legs, start=1):
        note = leg.largest if leg.inside else f"{leg.largest}; OUTSIDE: {leg.lacks}"
        lines.append(
            f"{k:>4}{leg.start:>9.1f}{leg.end:>9.1f}{leg.distance:>10.0f}"
            f"{leg.predicted95:>15.1f}{leg.real:>9.1f}  {note}"
        )
    inside = sum(leg.inside for leg in check.legs)
    lines.append(
        f"inside the predicted 95 %: {inside} of {len(check.legs)} legs "
        f"({100.0 * check.inside:.0f} %)"
    )
    driven = check.driven()
    lines.append(
        f"of legs of 50 m and more: {sum(leg.inside for leg in driven)} of {len(driven)}; nothing "
        "was fitted to them"
    )
    if check.unjudged:
        lines.append(f"{check.unjudged} legs have no fix at one of their ends")
    return lines
