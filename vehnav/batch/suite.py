"""A suite file becomes records: logs, configurations, bars, baseline; every field is checked.

::

    [suite]
    name = "nightly"          # also: time_limit (s), memory_limit ("2G"), keep

    [[log]]
    path = "drives/*.mcap"    # a file, folder, pattern or URL; relative to the suite file
    group = "city"            # also: name, optional, and the options of `vehnav run`
    configs = ["published"]   # without it: all

    [[log]]
    scenario = "city"         # simulated: the options of `vehnav simulate`
    seed = 1
    runs = 4                  # seeds 1 to 4: four logs

    [[config]]
    name = "published"        # and the options of `vehnav run`; several make a matrix
    as_published = true

    [[bar]]
    group = "city"            # also: log, config; without them the bar is for all
    metric = "errors.horizontal_m.max"
    max = 60.0                # or min

    [baseline]
    file = "baseline.json"    # relative to the suite file
    max_regression = "5%"     # of the median; also: max_log_regression, of one log

``${NAME}`` and ``${NAME:-default}`` in a path are taken from the environment.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from vehnav.batch.bar_scopes import check_scopes
from vehnav.batch.fields import check_keys, fraction_of, hints, nearest, size_of, value_of
from vehnav.batch.metric_paths import check_metric
from vehnav.batch.model import METRICS, Bound
from vehnav.batch.options import check_options, config_options, run_options
from vehnav.batch.places import beside, expanded, find_places, folder_name
from vehnav.batch.simulation import Simulation
from vehnav.errors import ConfigError

Keep = Literal["figures", "report", "trajectory"]
TABLES: Final = ("suite", "log", "config", "bar", "baseline")


@dataclass(frozen=True)
class LogSpec:
    """One log of a suite.

    Attributes
    ----------
    name, group : str
        The name is unique in the suite, and is the name of a folder.
    source : str or None
        File, folder or URL; None for a simulated log.
    shown : str
        As messages call it: relative to the suite file.
    simulation : Simulation or None
    options : mapping
        Options of ``vehnav run`` for this log.
    configs : tuple of str or None
        Configurations that the log runs with; None: all.
    """

    name: str
    group: str
    source: str | None
    shown: str
    simulation: Simulation | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    configs: tuple[str, ...] | None = None

    def runs_with(self, config: str) -> bool:
        """Whether the log runs with this configuration."""
        return self.configs is None or config in self.configs


@dataclass(frozen=True)
class ConfigSpec:
    """One configuration: options of ``vehnav run`` that count more than those of the log."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Bar:
    """A limit on a metric; ``group``, ``log``, ``config`` None: for all."""

    metric: str
    bound: Bound
    limit: float
    group: str | None = None
    log: str | None = None
    config: str | None = None

    def applies(self, group: str, log: str, config: str) -> bool:
        """Whether the bar is for this log and configuration."""
        mine = ((self.group, group), (self.log, log), (self.config, config))
        return all(wanted is None or wanted == name for wanted, name in mine)


@dataclass(frozen=True)
class BaselineSpec:
    """What the suite says of its baseline.

    Attributes
    ----------
    file : Path or None
    max_regression, max_log_regression : float or None
        Largest allowed worsening of a group and of a log, fractions; None: no gate, and the gate's
        own limit.
    """

    file: Path | None = None
    max_regression: float | None = None
    max_log_regression: float | None = None


@dataclass(frozen=True)
class Suite:
    """A suite file that was read.

    Attributes
    ----------
    name, path : str, Path
    logs, configs, bars : tuples of LogSpec, ConfigSpec, Bar
    baseline : BaselineSpec
    time_limit : float or None
        s for each log and configuration.
    memory_limit : int or None
        Bytes that a log may take.
    keep : {"figures", "report", "trajectory"}
        What is written of every log: nothing but its figures, its report, or all.
    skipped : tuple of str
        A sentence for each optional log that is not there.
    """

    name: str
    path: Path
    logs: tuple[LogSpec, ...]
    configs: tuple[ConfigSpec, ...]
    bars: tuple[Bar, ...] = ()
    baseline: BaselineSpec = BaselineSpec()
    time_limit: float | None = None
    memory_limit: int | None = None
    keep: Keep = "report"
    skipped: tuple[str, ...] = ()

    @property
    def metrics(self) -> tuple[str, ...]:
        """Kept for every log: the usual ones and those of the bars."""
        return tuple(sorted({*METRICS, *(bar.metric for bar in self.bars)}))

    def matrix(self) -> list[tuple[LogSpec, ConfigSpec]]:
        """Every log with every configuration of it: the first configuration first."""
        return [
            (x, config) for config in self.configs for x in self.logs if x.runs_with(config.name)
        ]


def load_suite(path: str | Path) -> Suite:
    """Read a suite file.

    Raises
    ------
    ConfigError
        Unreadable; an unknown key, with the nearest name; a value of the wrong kind; a log that is
        not there and not optional; a bar that is for nothing.
    """
    path = Path(path)
    if path.is_dir():
        raise ConfigError(
            f"{path}: a folder; vehnav score --init {path} writes a suite of its logs"
        )
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be read: {error.strerror or error}; vehnav score --init DIR writes a "
            "first suite from the logs in a folder"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from error
    check_keys(content, TABLES, str(path))
    head = _head(_table(content, "suite", path), f"{path}: [suite]")
    logs: list[LogSpec] = []
    skipped: list[str] = []
    for where, table in _rows(content, "log", path):
        found, word = _logs(table, where, path.parent)
        logs += found
        skipped += word
    configs = [
        _config(table, where, path.parent) for where, table in _rows(content, "config", path)
    ]
    _check_names(logs, configs or [ConfigSpec("default")], path)
    bars = [_bar(table, where) for where, table in _rows(content, "bar", path)]
    if "log" not in content:
        raise ConfigError(f"{path}: no [[log]]: a suite needs at least one")
    suite = Suite(
        path=path,
        logs=tuple(logs),
        configs=tuple(configs) or (ConfigSpec("default"),),
        bars=tuple(bars),
        baseline=_baseline(_table(content, "baseline", path), f"{path}: [baseline]", path.parent),
        skipped=tuple(skipped),
        **head,
    )
    if not skipped:  # a bar may be for what is not there
        check_scopes(suite.bars, suite.matrix(), str(path))
    return suite


# ---- tables ------------------------------------------------------------------------------------


def _rows(content: Mapping[str, Any], name: str, path: Path) -> list[tuple[str, dict[str, Any]]]:
    """The rows of ``[[name]]``, each with how messages call it."""
    rows = content.get(name, [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ConfigError(f"{path}: {name} must be written [[{name}]]")
    named = []
    for k, row in enumerate(rows):
        what = next((row[key] for key in ("name", "path", "scenario", "metric") if key in row), "")
        named.append((f"{path}: [[{name}]] {k + 1}" + (f" ({what})" if what else ""), row))
    return named


def _table(content: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: {name} must be written [{name}]")
    return table


def _head(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    check_keys(table, ("name", "time_limit", "memory_limit", "keep"), where)
    if "name" not in table:
        raise ConfigError(f'{where}: no name; a suite begins with [suite] name = "..."')
    limit = table.get("time_limit")
    seconds = None if limit is None else value_of(limit, float, f"{where} time_limit")
    if seconds is not None and seconds <= 0.0:
        raise ConfigError(f"{where} time_limit: expected a number above 0, not {limit!r}")
    memory = table.get("memory_limit")
    return {
        "name": value_of(table["name"], str, f"{where} name"),
        "time_limit": seconds,
        "memory_limit": None if memory is None else size_of(memory, f"{where} memory_limit"),
        "keep": value_of(table.get("keep", "report"), Keep, f"{where} keep"),
    }


def _logs(table: Mapping[str, Any], where: str, folder: Path) -> tuple[list[LogSpec], list[str]]:
    """The logs of one row; or none, and a sentence, where an optional one is not there."""
    if ("path" in table) == ("scenario" in table):
        raise ConfigError(f"{where}: expected either path or scenario")
    group = value_of(table.get("group", ""), str, f"{where} group")
    configs = value_of(table.get("configs", []), tuple[str, ...], f"{where} configs")
    configs = tuple(folder_name(name) for name in configs) or None
    if "scenario" in table:
        return _simulated(table, where, group, configs, folder), []
    known = ("path", "name", "group", "configs", "optional")
    check_keys(table, (*known, *run_options()), where)
    options = check_options(table, where, folder, leave=known)
    optional = value_of(table.get("optional", False), bool, f"{where} optional")
    pattern = value_of(table["path"], str, f"{where} path")
    places = find_places(pattern, folder, where, optional=optional)
    if not places:
        return [], [f"{pattern}: not there"]
    name = value_of(table["name"], str, f"{where} name") if "name" in table else None
    if name is not None and len(places) > 1:
        raise ConfigError(f"{where} name: {len(places)} logs match the pattern, a name is for one")
    return [
        LogSpec(
            folder_name(name or place.name),
            group,
            place.source,
            place.shown,
            None,
            options,
            configs,
        )
        for place in places
    ], []


def _simulated(
    table: Mapping[str, Any],
    where: str,
    group: str,
    configs: tuple[str, ...] | None,
    folder: Path,
) -> list[LogSpec]:
    """A log for each seed."""
    fields = hints(Simulation)
    check_keys(table, ("name", "group", "configs", "runs", *fields), where)
    values = {
        key: value_of(table[key], fields[key], f"{where} {key}") for key in table if key in fields
    }
    for key in ("scenario", "sensor"):
        if key in values:
            values[key] = beside(values[key], folder)
    runs = value_of(table.get("runs", 1), int, f"{where} runs")
    first = Simulation(**values)
    if runs < 1 or first.seed < 0:
        raise ConfigError(f"{where}: runs must be at least 1 and seed at least 0")
    try:
        first.check()
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    shown = values["scenario"].split(",")[0]
    name = folder_name(value_of(table.get("name", Path(shown).stem), str, f"{where} name"))
    digits = len(str(first.seed + runs - 1))
    return [
        LogSpec(
            name if runs == 1 else f"{name}-{seed:0{digits}d}",
            group,
            None,
            f"{table['scenario']} seed {seed}",
            Simulation(**{**values, "seed": seed}),
            configs=configs,
        )
        for seed in range(first.seed, first.seed + runs)
    ]


def _config(table: Mapping[str, Any], where: str, folder: Path) -> ConfigSpec:
    check_keys(table, ("name", "file", *run_options()), where)
    if "name" not in table:
        raise ConfigError(f"{where}: no name")
    options = check_options(table, where, folder, leave=("name", "file"))
    if "file" in table:
        file = folder / value_of(table["file"], str, f"{where} file")
        options = {**config_options(file, where), **options}
    return ConfigSpec(folder_name(value_of(table["name"], str, f"{where} name")), options)


def _bar(table: Mapping[str, Any], where: str) -> Bar:
    check_keys(table, ("group", "log", "config", "metric", "max", "min"), where)
    if "metric" not in table or ("max" in table) == ("min" in table):
        raise ConfigError(f"{where}: expected metric, and either max or min")
    bound: Bound = "max" if "max" in table else "min"
    scope = {
        key: value_of(table[key], str, f"{where} {key}")
        for key in ("group", "log", "config")
        if key in table
    }
    metric = value_of(table["metric"], str, f"{where} metric")
    if "." not in metric:
        raise ConfigError(
            f"{where} metric: expected a dotted path of report.json such as "
            f"errors.horizontal_m.max, not {metric!r}"
        )
    check_metric(metric, f"{where} metric")
    return Bar(metric, bound, value_of(table[bound], float, f"{where} {bound}"), **scope)


def _baseline(table: Mapping[str, Any], where: str, folder: Path) -> BaselineSpec:
    limits = ("max_regression", "max_log_regression")
    check_keys(table, ("file", *limits), where)
    file = table.get("file")
    return BaselineSpec(
        None if file is None else folder / expanded(value_of(file, str, f"{where} file")),
        **{key: fraction_of(table[key], f"{where} {key}") for key in limits if key in table},
    )


def _check_names(logs: Sequence[LogSpec], configs: Sequence[ConfigSpec], path: Path) -> None:
    """ConfigError where two logs or two configurations would share a folder."""
    for what, specs in (("log", logs), ("config", configs)):
        seen: dict[str, str] = {}
        for spec in specs:
            shown = spec.shown if isinstance(spec, LogSpec) else spec.name
            if spec.name.lower() in seen:
                raise ConfigError(
                    f"{path}: two [[{what}]] are called {spec.name!r} "
                    f"({seen[spec.name.lower()]} and {shown}); give each a name of its own"
                )
            seen[spec.name.lower()] = shown
    names = [config.name for config in configs]
    for log in logs:
        for name in log.configs or ():
            if name not in names:
                raise ConfigError(
                    f"{path}: [[log]] {log.shown}: no configuration {name!r}{nearest(name, names)}"
                )
