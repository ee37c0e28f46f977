"""MCAP files and rosbag2 folders -> Log."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, FormatError, LogError
from vehnav.logs.log import Log, ReadOptions
from vehnav.logs.mcap import records as rec
from vehnav.logs.mcap.delivery import Delivery
from vehnav.logs.mcap.indexed import (
    IndexedChunk,
    Summary,
    learn_topics,
    read_index,
    read_indexed,
    read_summary,
)
from vehnav.logs.mcap.report import Report
from vehnav.logs.mcap.scan import Scan
from vehnav.logs.messages.assemble import Assembler, UnusableError
from vehnav.logs.messages.choice import Candidate, choose
from vehnav.logs.messages.topics import Topic, Topics

WARM_BYTES = 32 << 20

_Late = dict[Path, tuple[list[rec.Schema], list[rec.Channel]]]


class _LateDeclarationError(Exception):
    """Messages came before the declaration of their channel; read again, knowing it."""


def read_mcap(path: str | Path, options: ReadOptions) -> Log:
    """Read an MCAP file, or the MCAP files of a rosbag2 folder as one recording.

    Parameters
    ----------
    path : str or Path
        A file, or a folder whose ``*.mcap`` files are read in order of their numbers.
    options : ReadOptions
        ``imu_topic``, ``gps_topic``, ``speed_topic``, ``time`` and the units count.

    Returns
    -------
    Log
        ``imu`` is None where the recording has none; ``contents`` lists every topic.

    Raises
    ------
    LogError
        No file, nothing in it, not MCAP, a topic that is not there or not what was asked for.
    """
    place = Path(path)
    files = _files(place)
    rejected: dict[tuple[str, str], str] = {}
    late: _Late = {}
    earlier: dict[Finding, None] = {}
    _keep_pages()
    while True:
        reading = _Reading(str(path), options, rejected, late)
        try:
            reading.read(files)
            return reading.log(list(earlier))
        except UnusableError as error:
            candidate = error.candidate
            earlier.update(dict.fromkeys(reading.damage()))
            rejected[candidate.role.name, candidate.topic.name] = error.why
        except _LateDeclarationError:
            continue


def _keep_pages() -> None:
    """Make the C library keep freed chunk buffers instead of returning them page by page.

    glibc raises its limit for that when a large block is freed; 5 times faster on many chunks.
    """
    block = np.empty(WARM_BYTES - 4096, np.uint8)  # never touched: costs no memory
    del block


def _files(path: Path) -> list[Path]:
    """The MCAP files to read; LogError where those of a folder are not one recording's parts."""
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=_split_order)
    if not files:
        raise LogError(f"{path}: no .mcap file in this folder")
    recordings = {_split_order(file)[0] for file in files}
    if len(recordings) > 1 and not (path / "metadata.yaml").is_file():
        names = ", ".join(file.name for file in files[:3])
        raise LogError(
            f"{path}: {len(files)} MCAP files that are not the parts of one recording ({names}"
            f"{', ...' if len(files) > 3 else ''}): no metadata.yaml and other names; name one file"
        )
    return files


def _split_order(path: Path) -> tuple[str, int, str]:
    """``name_2.mcap`` before ``name_10.mcap``."""
    stem, _, number = path.stem.rpartition("_")
    return (stem, int(number), path.name) if number.isdigit() else (path.stem, -1, path.name)


def _check_magic(source: rec.Source, *, alone: bool) -> None:
    start = source.read(0, len(rec.MAGIC))
    if not source.size and not alone:
        return  # the last file of a split recording that lost power
    if not source.size:
        raise LogError(f"{source.path}: the file is empty (0 bytes): nothing was recorded")
    if start != rec.MAGIC:
        raise LogError(
            f"{source.path}: not an MCAP file (it begins with {start!r} instead of {rec.MAGIC!r})"
        )


@dataclass
class _File:
    """One file that is open: what is known of it before its messages are read."""

    source: rec.Source
    delivery: Delivery
    report: Report
    summary: Summary | None = None
    index: list[IndexedChunk] | None = None


@dataclass
class _Reading:
    """One pass over a recording."""

    path: str
    options: ReadOptions
    rejected: dict[tuple[str, str], str]
    late: _Late
    topics: Topics = field(default_factory=Topics)
    reports: list[Report] = field(default_factory=list)
    chosen: dict[str, Candidate] = field(default_factory=dict)
    notes: list[Finding] = field(default_factory=list)

    def read(self, files: list[Path]) -> None:
        """Indexes of all files first, so that topics can be chosen by count; then messages."""
        opened: list[_File] = []
        try:
            for path in files:
                source = _open(path)
                opened.append(_File(source, Delivery(self.topics), Report(path.name)))
                _check_magic(source, alone=len(files) == 1)
            with_data = [file for file in opened if file.source.size]
            for file in with_data:
                self._look(file)
            if all(file.index is not None for file in with_data):
                for file in with_data:
                    learn_topics(file.source, file.index or [], file.delivery)
                self._choose()
            else:
                self.topics.gather_all()
            for file in with_data:
                self._read_messages(file)
            self.topics.flush()
        finally:
            for file in opened:
                file.source.close()
        self.reports = [file.report for file in opened]

    def _look(self, file: _File) -> None:
        """Summary and indexes, as far as they can be relied on."""
        schemas, channels = self.late.get(file.source.path, ([], []))
        try:
            file.summary = read_summary(file.source)
            schemas, channels = schemas + file.summary.schemas, channels + file.summary.channels
        except (FormatError, MemoryError) as error:
            file.report.doubt = str(error)
        for schema in schemas:
            file.delivery.declare_schema(schema)
        for channel in channels:
            file.delivery.declare_channel(channel)
        if file.summary is None:
            return
        seen = _Seen(file.delivery)
        try:
            file.index = read_index(file.source, file.summary, seen.see)
            seen.commit()
        except FormatError as error:
            file.report.doubt = str(error)

    def _choose(self) -> None:
        topics = list(self.topics)
        self.chosen, self.notes = choose(self.path, topics, self.options, self.rejected)
        for candidate in self.chosen.values():
            candidate.topic.gather(candidate.role)

    def _read_messages(self, file: _File) -> None:
        if file.index is not None:
            read_indexed(file.source, file.index, file.delivery, file.report)
            return
        Scan(file.source, file.delivery, file.report).run()
        self._undeclared(file)
        counts = file.summary.counts if file.summary is not None else None
        for channel, count in (counts or {}).items():
            topic = file.delivery.topic(channel)
            if topic is not None:
                topic.declared_count += count

    def _undeclared(self, file: _File) -> None:
        """Messages before their declaration: read again with it; without any: lost."""
        delivery, path = file.delivery, file.source.path
        if any(delivery.known[channel] for channel in delivery.unknown):
            self.late[path] = (list(delivery.schemas.values()), list(delivery.channels.values()))
            raise _LateDeclarationError
        if delivery.unknown:
            count = sum(delivery.unknown.values())
            ids = ", ".join(map(str, sorted(delivery.unknown)[:8]))
            file.report.note(
                "undeclared-channel", f"{count} messages of channels never declared (ids {ids})"
            )

    def damage(self) -> list[Finding]:
        """Damage of all files."""
        return [finding for report in self.reports for finding in report.damage()]

    def log(self, earlier: list[Finding]) -> Log:
        """What was read.

        Parameters
        ----------
        earlier : list of Finding
            Damage met where another topic was tried.

        Raises
        ------
        UnusableError
            A chosen topic holds nothing usable.
        """
        topics = list(self.topics)
        if not any(topic.count for topic in topics):
            raise LogError(
                f"{self.path}: the recording holds no messages ({len(topics)} topics declared): "
                "the recorder ran, but nothing was published"
            )
        if not self.chosen:
            self.chosen, self.notes = choose(self.path, topics, self.options, self.rejected)
        damage = list(dict.fromkeys([*earlier, *self.damage()]))
        notes = [finding for report in self.reports for finding in report.notes()]
        return Assembler(self.path, topics, self.options).log(
            self.chosen, damage, [*notes, *self.notes]
        )


class _Seen:
    """Messages by the indexes of one file; they count once all of these prove sound."""

    def __init__(self, delivery: Delivery) -> None:
        self.delivery = delivery
        self.parts: list[tuple[Topic, int, npt.NDArray[np.int64]]] = []

    def see(self, channel: int, log_ns: npt.NDArray[np.int64]) -> bool:
        """Note log times of a channel; whether the channel may be of use."""
        topic = self.delivery.topic(channel)
        if topic is None:
            return False
        ends = np.array([log_ns.min(), log_ns.max()])
        self.parts.append((topic, log_ns.size, ends))
        return bool(topic.roles) or topic.unlearnt

    def commit(self) -> None:
        """Let them count."""
        for topic, count, ends in self.parts:
            topic.see(ends, count)


def _open(path: Path) -> rec.Source:
    try:
        return rec.Source(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be opened: {error.strerror or error}") from error
