"""``vehnav score --init DIR``: a first suite file from the logs that are found in a folder."""

from __future__ import annotations

import glob
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from vehnav.batch.places import find_places, folder_name
from vehnav.errors import ConfigError, VehnavError
from vehnav.export.atomic import atomic_path
from vehnav.logs.folders import FOLDERS
from vehnav.logs.read import identify, read_log
from vehnav.toml_text import quoted

NAME: Final = "suite.toml"
OPENED: Final = 10
"""Files of one kind in one folder that are read to see what is in them; the rest is like them."""
LARGE: Final = 500_000_000
"""Bytes from which a recording is not read for that."""
WITHOUT_GPS: Final = " without GPS"
MANY: Final = 4
"""Logs of a kind in a folder from which one pattern stands for them."""
MADE: Final = (".vehnav", "node_modules", "__pycache__")
"""Folders of outputs, and of programs."""


@dataclass(frozen=True)
class Found:
    """A recording: its path in the folder, with slashes, and whether it has GPS."""

    path: str
    gps: bool

    @property
    def group(self) -> str:
        """The folder that it is in, and whether bars on errors can be set for it."""
        parent = PurePosixPath(self.path).parent.name or "logs"
        return parent if self.gps else parent + WITHOUT_GPS


@dataclass(frozen=True)
class LeftOut:
    """A file that is no log for a suite, and why."""

    path: str
    reason: str


@dataclass(frozen=True)
class Example:
    """A suite file that was written, and what it is made from."""

    path: Path
    found: tuple[Found, ...]
    left_out: tuple[LeftOut, ...]


def write_example(folder: Path) -> Example:
    """Write ``suite.toml`` for the logs that are in ``folder`` and below it.

    Raises
    ------
    ConfigError
        No folder, no log in it, it is a recording itself, or there is a ``suite.toml`` already.
    """
    path = folder / NAME
    if not folder.is_dir():
        raise ConfigError(f"{folder}: no such folder")
    if path.exists():
        raise ConfigError(f"{path}: it exists; remove it first, nothing is overwritten")
    kind = _recording(folder)
    if kind is not None:
        raise ConfigError(
            f"{folder}: it is a recording itself ({kind}); give the folder that holds it"
        )
    found, left_out = find_logs(folder)
    if not found:
        reasons = "; ".join(f"{row.path}: {row.reason}" for row in left_out[:5])
        raise ConfigError(f"{folder}: no log with an IMU in it ({reasons or 'it is empty'})")
    with atomic_path(path) as temporary:
        temporary.write_text(example_text(folder, found), encoding="utf-8")
    return Example(path, tuple(found), tuple(left_out))


# ---- what is there -----------------------------------------------------------------------------


def find_logs(folder: Path) -> tuple[list[Found], list[LeftOut]]:
    """The recordings in a folder and below it, and the files that are none."""
    found: list[Found] = []
    left_out: list[LeftOut] = []
    whole: list[str] = []
    opened: dict[tuple[str, str], list[Found]] = {}
    for place in find_places("**/*", folder, str(folder), optional=True):
        path = Path(place.shown).as_posix()
        parents = [str(p) for p in PurePosixPath(path).parents]
        if any(part.endswith(MADE) for part in PurePosixPath(path).parts):
            continue
        if any(parent in whole for parent in parents):
            continue
        if Path(place.source).is_dir():
            if _recording(Path(place.source)) is None:
                continue
            whole.append(path)
        odd = _odd_name(path)
        if odd:
            left_out.append(LeftOut(ascii(path)[1:-1], odd))
            continue
        like = opened.setdefault((parents[0], PurePosixPath(path).suffix.lower()), [])
        row = _look(path, Path(place.source), like)
        if isinstance(row, Found):
            found.append(row)
            like.append(row)
        else:
            left_out.append(row)
    return found, left_out


def _recording(folder: Path) -> str | None:
    """The kind of recording that a folder is; a folder of MCAP files is one if ROS says so."""
    kind = next((kind for kind in FOLDERS if kind.matches(folder)), None)
    if kind is None:
        return None
    if kind.name.startswith("rosbag2") and not (folder / "metadata.yaml").is_file():
        return None
    return kind.name


def _odd_name(path: str) -> str:
    """Why a suite file cannot name it."""
    if "${" in path:
        return "its name holds ${, which a suite takes for the environment"
    try:
        path.encode()
    except UnicodeEncodeError:
        return "its name is not UTF-8"
    return ""


def _look(path: str, source: Path, like: Sequence[Found]) -> Found | LeftOut:
    """Open it and see; of many of a kind, and of a large one, its beginning is enough."""
    try:
        if source.is_file():
            kind = identify(str(source))
            if not kind.log:
                what = f"{kind.name}, no recording of an IMU"
                return LeftOut(path, "GPS only" if kind.gnss else what)
            many = len(like) >= OPENED
            if many or source.stat().st_size > LARGE:
                return Found(path, all(row.gps for row in like))
        log = read_log(str(source))
    except (VehnavError, OSError) as error:
        return LeftOut(path, _reason(error, str(source)))
    if log.imu is None or not log.imu.t_ns.size:
        return LeftOut(path, "no IMU in it")
    return Found(path, log.gnss is not None)


def _reason(error: Exception, source: str) -> str:
    """The first clause of an error without the name of the file."""
    text = str(error).removeprefix(source).lstrip(": ").split("; ")[0].split("\n")[0]
    return text if len(text) <= 120 else text[:117] + "..."


# ---- the suite file ----------------------------------------------------------------------------

_HEAD: Final = """\
# A suite: logs, configurations, and the bars that their errors must keep.
#   vehnav score {name}                      runs it
#   vehnav score {name} --update-baseline    makes the result what later runs are compared with

[suite]
name = {suite}
# time_limit = 600         # s for a log; a longer one fails alone
# memory_limit = "4G"
# keep = "report"          # of each log: "figures", "report" (its page, too) or "trajectory"

# ---- logs: a file, a folder, a pattern or a URL, with any option of `vehnav run` ----
# ---- (--gps-time-offset is the key gps_time_offset; --no-reset is reset, false) ----
"""

_MIDDLE: Final = """\
# ---- configurations: every log runs with each of them ----

[[config]]
name = "default"

# [[config]]
# name = "published"
# as_published = true

# ---- bars: any figure of report.json by its dotted path; on the limit passes ----
"""

_TAIL: Final = """\
# ---- baseline: worse than this by more fails, even where the bars are kept ----
# Take the marks away, then: vehnav score {name} --update-baseline

# [baseline]
# file = "baseline.json"
# max_regression = "5%"          # of the median over the logs of a group, beyond chance
# max_log_regression = "50%"     # of a single log
"""


def example_text(folder: Path, found: Sequence[Found]) -> str:
    """The suite file for the logs that were found in ``folder``.

    >>> text = example_text(Path("drives"), [Found("a.mcap", True), Found("b/a.csv", False)])
    >>> [line for line in text.splitlines() if line.startswith(("path", "name", "group"))]
    ... # doctest: +NORMALIZE_WHITESPACE
    ['name = "drives"', 'path = "a.mcap"', 'group = "logs"', 'name = "a-mcap"', 'path = "b/a.csv"',
     'group = "b without GPS"', 'name = "b-a-csv"', 'name = "default"', 'group = "logs"',
     'group = "b without GPS"']
    """
    suite = folder_name(folder.resolve().name)
    names = _names(found)
    groups: dict[str, list[Found]] = {}
    for row in found:
        groups.setdefault(row.group, []).append(row)
    parts = [_HEAD.format(name=NAME, suite=quoted(suite))]
    for group, rows in groups.items():
        parts += _log_rows(folder, group, rows, names)
    parts.append(_MIDDLE)
    parts += [_bar(group) for group in groups]
    parts.append(_TAIL.format(name=NAME))
    return "\n".join(parts)


def _names(found: Sequence[Found]) -> dict[str, str]:
    """Path -> a name of its own, for the logs whose stem another log has, too."""
    stems = [folder_name(PurePosixPath(row.path).stem).lower() for row in found]
    count = Counter(stems)
    names: dict[str, str] = {}
    taken = {stem for stem in stems if count[stem] == 1}
    for row, stem in zip(found, stems, strict=True):
        if count[stem] == 1:
            continue
        name = plain = folder_name(row.path.replace(".", "-"))
        k = 1
        while name.lower() in taken:
            k += 1
            name = f"{plain}-{k}"
        taken.add(name.lower())
        names[row.path] = name
    return names


def _log_rows(
    folder: Path, group: str, rows: Sequence[Found], names: Mapping[str, str]
) -> list[str]:
    """A pattern for many logs of a kind in a folder where it fits, else a table for each."""
    alike: dict[tuple[str, str], list[Found]] = {}
    for row in rows:
        path = PurePosixPath(row.path)
        alike.setdefault((str(path.parent), path.suffix), []).append(row)
    out = []
    for (parent, suffix), some in alike.items():
        pattern = str(PurePosixPath(glob.escape(parent)) / f"*{glob.escape(suffix)}")
        places = find_places(pattern, folder, pattern, optional=True)
        same = {Path(place.shown).as_posix() for place in places} == {row.path for row in some}
        if len(some) >= MANY and same and not any(row.path in names for row in some):
            out.append(_log_row(pattern, group, remark=f"  # {len(some)} logs"))
        else:
            out += [_log_row(glob.escape(r.path), group, name=names.get(r.path)) for r in some]
    return out


def _log_row(path: str, group: str, *, name: str | None = None, remark: str = "") -> str:
    lines = ["[[log]]", f"path = {quoted(path)}{remark}", f"group = {quoted(group)}"]
    lines += [f"name = {quoted(name)}"] if name else []
    return "\n".join(lines) + "\n"


def _bar(group: str) -> str:
    """On the errors where GPS judges them, else on the stops."""
    metric, limit = "errors.horizontal_m.max", "max = 5000.0    # m; tighten it to what is reached"
    if group.endswith(WITHOUT_GPS):
        metric, limit = "stops.count", "min = 1    # without GPS nothing judges the errors"
    return f"[[bar]]\ngroup = {quoted(group)}\nmetric = {quoted(metric)}\n{limit}\n"
