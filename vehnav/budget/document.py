"""Budgets as plain data, for JSON and CSV; the units of the command line."""

from __future__ import annotations

from typing import Any

from vehnav.budget.forward import Budget
from vehnav.budget.inverse import Solution, grades_within
from vehnav.budget.montecarlo import MonteCarlo
from vehnav.budget.sources import INITIAL_UNITS
from vehnav.budget.study import Interval, Study

CSV_HEAD = "time_s,source,sigma,unit,east_m,north_m,radial_m,share"


def study_document(study: Study) -> dict[str, Any]:
    """What was assumed."""
    procedure, drive = study.procedure, study.drive
    initial = {
        f"{name}_{unit.replace('/', '_')}": getattr(study.initial, name) / factor
        for name, (factor, unit) in INITIAL_UNITS.items()
        if not (name == "tilt" and procedure.levelled)
    }
    return {
        "source": drive.name,
        "duration_s": drive.duration,
        "distance_m": drive.path_length(),
        "model": study.model,
        "vertical": "held" if study.held else "free",
        "stops": [list(span) for span in procedure.stops],
        "gyro_bias_from_stops": procedure.gyro_from_stops,
        "levelling_window_s": procedure.window,
        "initial": {"levelled": procedure.levelled, **initial},
    }


def totals_document(budget: Budget, time: float, *, held: bool) -> dict[str, Any]:
    """Totals at a time with their validity."""
    found = budget.totals(time)
    validity = budget.validity(time)
    total = {
        "sigma_e_m": found["east"],
        "sigma_n_m": found["north"],
        "drms_m": found["drms"],
        "cep50_m": found["cep50"],
        "cep95_m": found["cep95"],
    }
    if not held:
        total["sigma_u_m"] = budget.sigma_up(time)
    return {
        "time_s": time,
        "total": total,
        "validity": {
            "max_psi_rad": validity.max_psi,
            "linear_ok": validity.verdict != "invalid",
            "verdict": validity.verdict,
        },
    }


def budget_document(study: Study, budget: Budget) -> dict[str, Any]:
    """Sources, noise and totals at the last time; totals at all times; the growth curve."""
    rows = budget.rows(study.time)
    noise = {f"{r.parameter}_m": r.radial for r in rows if r.source in ("arw", "vrw")}
    curve = {name: budget.curve(name) for name in ("drms", "cep50", "cep95")}
    return {
        **study_document(study),
        "sensor": budget.sensor.name,
        **totals_document(budget, study.time, held=study.held),
        "sources": [
            {
                "name": row.source, "sigma": row.sigma, "unit": row.unit, "east_m": row.east,
                "north_m": row.north, "radial_m": row.radial, "share": row.share,
            }
            for row in rows
        ],
        "noise": noise,
        "at": [totals_document(budget, time, held=study.held) for time in study.times],
        "curve": {"time_s": budget.t.tolist(), **{f"{n}_m": c.tolist() for n, c in curve.items()}},
    }  # fmt: skip


def drawn_document(drawn: MonteCarlo, budget: Budget, times: tuple[float, ...]) -> dict[str, Any]:
    """Totals of a Monte Carlo beside the linear ones."""
    at = []
    for time in times:
        found, linear = drawn.totals(time), budget.totals(time)
        ratio = linear["drms"] / found["drms"] if found["drms"] > 0.0 else None
        at.append({"time_s": time, **{f"{n}_m": x for n, x in found.items()},
                   "linear_over_mc": ratio})  # fmt: skip
    return {"runs": drawn.runs, "seed": drawn.seed, "at": at}


def inverse_document(found: Solution) -> dict[str, Any]:
    """What a requirement allows."""
    need = found.requirement
    return {
        "solve": found.how,
        "require_m": need.value,
        "metric": need.metric,
        "time_s": need.time,
        "feasible": found.feasible,
        "others_m": found.others,
        "achieved_m": found.achieved,
        "allowed": [
            {
                "parameter": a.parameter, "value": a.value, "unit": a.unit, "given": a.given,
                "factor": a.factor, "grades": list(grades_within(a)),
            }
            for a in found.allowed
        ],
    }  # fmt: skip


def rank_document(study: Study, ranked: list[Budget]) -> dict[str, Any]:
    """The grades on a drive, the best first."""
    return {
        **study_document(study),
        "grades": [
            {
                "sensor": budget.sensor.name,
                "at": [totals_document(budget, time, held=study.held) for time in study.times],
                "largest": budget.rows(study.time)[0].source if budget.rows(study.time) else None,
            }
            for budget in ranked
        ],
    }


def sweep_document(study: Study, sweep: list[Interval]) -> dict[str, Any]:
    """Error against the interval between corrections."""
    return {
        **study_document(study),
        "sensor": sweep[0].budget.sensor.name,
        "intervals": [
            {
                "every_s": item.every, "stops": item.stops, "longest_s": item.longest,
                **totals_document(item.budget, study.time, held=study.held),
            }
            for item in sweep
        ],
    }  # fmt: skip


def budget_csv(study: Study, budget: Budget) -> str:
    """One line per source and time, and the total of each time."""
    lines = [CSV_HEAD]
    for time in study.times:
        for row in budget.rows(time):
            lines.append(
                f"{time:g},{row.source},{row.sigma:.9g},{row.unit},{row.east:.6g},{row.north:.6g},"
                f"{row.radial:.6g},{row.share:.6g}"
            )
        total = budget.totals(time)
        lines.append(
            f"{time:g},TOTAL,,,{total['east']:.6g},{total['north']:.6g},{total['drms']:.6g},1"
        )
    return "\n".join(lines) + "\n"
