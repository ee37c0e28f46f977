"""Topics of a recording and what was gathered from them, whatever container they came in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from vehnav.errors import FormatError
from vehnav.logs.messages.decoder import make_decoder, type_tree
from vehnav.logs.messages.objects import learn_json
from vehnav.logs.messages.payload import Batch, Declaration, Decoder
from vehnav.logs.messages.roles import Role, find_roles
from vehnav.logs.messages.stamps import Clock
from vehnav.logs.messages.types import Struct

Ints = npt.NDArray[np.int64]
FEW = 1000
"""Messages of a topic in one chunk below which they are decoded together with the next ones."""
MAX_WAITING = 16 << 20
"""Bytes of them that wait at most."""

State = Literal["sound", "unverified", "recovered"]


class Column:
    """Rows that come in batches, in one array: no second copy of them at the end."""

    def __init__(self, first: npt.NDArray[Any], expected: int) -> None:
        shape = (max(expected, len(first)), *first.shape[1:])
        self._rows = np.empty(shape, first.dtype.newbyteorder("="))
        self.size = 0
        self.append(first)

    def append(self, rows: npt.NDArray[Any]) -> None:
        """More rows."""
        end = self.size + len(rows)
        if end > len(self._rows):
            larger = np.empty((max(end, 3 * end // 2), *self._rows.shape[1:]), self._rows.dtype)
            larger[: self.size] = self._rows[: self.size]
            self._rows = larger
        self._rows[self.size : end] = rows
        self.size = end

    def array(self) -> npt.NDArray[Any]:
        """All rows."""
        return self._rows[: self.size]


@dataclass
class Collector:
    """What one role of a topic delivered so far.

    Attributes
    ----------
    expected : int
        Messages that will come, as far as known.
    read, recovered, unverified, bad : int
        Messages delivered; of these from damaged parts; from parts with a wrong checksum; and
        messages that do not agree with their schema.
    bad_span, unverified_span : (first, last) log time or None
    doubtful : list of (begin, end)
        Rows from damaged parts or from parts with a wrong checksum.
    """

    role: Role
    decoder: Decoder
    expected: int = 0
    kept: dict[str, Column] = field(default_factory=dict)
    read: int = 0
    recovered: int = 0
    unverified: int = 0
    bad: int = 0
    bad_span: tuple[int, int] | None = None
    unverified_span: tuple[int, int] | None = None
    doubtful: list[tuple[int, int]] = field(default_factory=list)

    def add(self, batch: Batch, state: State) -> None:
        """Decode a batch and keep the result."""
        decoded = self.decoder.decode(batch)
        row = decoded.row
        if row.size < batch.start.size:
            left = np.delete(batch.log_ns, row)
            self.bad += left.size
            self.bad_span = _widen(self.bad_span, left)
        if not row.size:
            return
        if state != "sound":
            self.doubtful.append((self.read, self.read + row.size))
        self.read += row.size
        self.recovered += row.size if state == "recovered" else 0
        whole = row.size == batch.start.size
        log_ns = batch.log_ns if whole else batch.log_ns[row]
        if state == "unverified":
            self.unverified += row.size
            self.unverified_span = _widen(self.unverified_span, log_ns)
        columns = {"log": log_ns, "publish": batch.publish_ns if whole else batch.publish_ns[row]}
        for name, values in (columns | decoded.columns).items():
            if name in self.kept:
                self.kept[name].append(values)
            else:
                self.kept[name] = Column(values, self.expected)

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """Everything kept, in order of log time; can be called once.

        Rows from damaged parts are marked in a column "doubtful", where there are any.
        """
        joined = {name: self.kept.pop(name).array() for name in list(self.kept)}
        if "log" not in joined:
            return joined
        if self.doubtful:
            joined["doubtful"] = np.zeros(self.read, np.bool_)
            for begin, end in self.doubtful:
                joined["doubtful"][begin:end] = True
        log = _usable(joined["log"])
        if np.any(log[1:] < log[:-1]):
            order = np.argsort(log, kind="stable")
            joined = {name: values[order] for name, values in joined.items()}
        return joined


def _usable(log_ns: Ints) -> Ints:
    """Log times to sort by: one that is zero or rolled over counts as the one before it."""
    good = log_ns > 0
    if good.all() or not good.any():
        return log_ns
    before = np.maximum.accumulate(np.where(good, np.arange(log_ns.size), -1))
    return log_ns[np.where(before < 0, np.argmax(good), before)]


def _widen(span: tuple[int, int] | None, times: Ints) -> tuple[int, int]:
    low, high = int(times.min()), int(times.max())
    return (low, high) if span is None else (min(low, span[0]), max(high, span[1]))


@dataclass
class Waiting:
    """Payloads of one size from small batches, until they are worth a decoder's trouble."""

    state: State
    size: int
    count: int = 0
    payloads: list[npt.NDArray[Any]] = field(default_factory=list)
    log_ns: list[Ints] = field(default_factory=list)
    publish_ns: list[Ints] = field(default_factory=list)

    def append(self, batch: Batch) -> int:
        """Copy a batch's payloads; how many wait now."""
        places = batch.data.size - self.size + 1
        window: npt.NDArray[Any] = np.ndarray((places,), f"V{self.size}", batch.data, 0, (1,))
        self.payloads.append(window[batch.start])
        self.log_ns.append(batch.log_ns)
        self.publish_ns.append(batch.publish_ns)
        self.count += batch.start.size
        return self.count

    def batch(self) -> Batch:
        """All of them side by side."""
        data = np.concatenate(self.payloads).view(np.uint8)
        start = self.size * np.arange(self.count, dtype=np.int64)
        size = np.full(self.count, self.size, np.int64)
        log_ns, publish_ns = np.concatenate(self.log_ns), np.concatenate(self.publish_ns)
        return Batch(data, start, size, log_ns, publish_ns)


@dataclass
class Topic:
    """A topic: its messages' declaration, what could be used of it, what was seen of it.

    Attributes
    ----------
    problem : str
        Why its messages cannot be understood, or "".
    count : int
        Messages seen, or named by indexes that proved to be complete.
    span : (first, last) log time or None
    declared_count : int
        Messages by the container's statistics, where they were not used otherwise.
    collectors : list of Collector
        For what is wanted only.
    clock : Clock or None
        The stamps that were chosen, once it is used.
    used_as : list of str
        Roles it took.
    """

    name: str
    declared: Declaration
    tree: Struct | None = None
    roles: list[Role] = field(default_factory=list)
    problem: str = ""
    count: int = 0
    span: tuple[int, int] | None = None
    declared_count: int = 0
    collectors: list[Collector] = field(default_factory=list)
    clock: Clock | None = None
    used_as: list[str] = field(default_factory=list)
    waiting: Waiting | None = None

    @property
    def unlearnt(self) -> bool:
        """Whether a first message must tell what the messages are like (JSON without schema)."""
        return self.tree is not None and not self.tree.fields and self.declared.encoding == "json"

    def learn(self, payload: bytes) -> None:
        """Understand the topic by its first message."""
        self.tree = learn_json(self.declared.type_name, payload)
        self.roles = find_roles(self.tree)

    def see(self, log_ns: Ints, count: int | None = None) -> None:
        """Note messages of these log times."""
        self.count += log_ns.size if count is None else count
        if log_ns.size:
            self.span = _widen(self.span, log_ns)

    def gather(self, role: Role) -> Collector:
        """Begin to collect a role."""
        if self.tree is None:
            raise ValueError(f"topic {self.name} is not understood")
        decoder = make_decoder(self.declared, self.tree, role.wanted())
        collector = Collector(role, decoder, self.count)
        self.collectors.append(collector)
        return collector

    def add(self, batch: Batch, state: State) -> None:
        """Messages for all that is collected; few of them wait for more."""
        size = int(batch.size[0]) if batch.size.size else 0
        few = 0 < batch.size.size < FEW and 0 < size <= MAX_WAITING // FEW
        if few and np.all(batch.size == size):
            if self.waiting and (self.waiting.state, self.waiting.size) != (state, size):
                self.flush()
            self.waiting = self.waiting or Waiting(state, size)
            if self.waiting.append(batch) >= FEW:
                self.flush()
            return
        self.flush()
        for collector in self.collectors:
            collector.add(batch, state)

    def flush(self) -> None:
        """Decode what waits."""
        waiting, self.waiting = self.waiting, None
        if waiting is not None:
            for collector in self.collectors:
                collector.add(waiting.batch(), waiting.state)


class Topics:
    """Topics by name and declaration; channels of several files or publishers share them."""

    def __init__(self) -> None:
        self._topics: dict[tuple[str, Declaration], Topic] = {}
        self._gather_new = False

    def gather_all(self) -> None:
        """Collect every role of every topic, also of those yet to come."""
        self._gather_new = True
        for topic in self:
            self._gather(topic)

    def learn(self, topic: Topic, payload: bytes) -> None:
        """A first message of a topic that its schema does not explain."""
        topic.learn(payload)
        self._gather(topic)

    def flush(self) -> None:
        """Decode what waits."""
        for topic in self:
            topic.flush()

    def _gather(self, topic: Topic) -> None:
        if self._gather_new:
            for role in topic.roles:
                topic.gather(role)

    def __iter__(self) -> Iterator[Topic]:
        return iter(self._topics.values())

    def get(self, name: str, declared: Declaration) -> Topic:
        """The topic, made and understood at its first mention."""
        key = (name, declared)
        if key not in self._topics:
            topic = Topic(name, declared)
            try:
                topic.tree = type_tree(declared)
                topic.roles = find_roles(topic.tree)
            except FormatError as error:
                topic.problem = str(error)
            self._topics[key] = topic
            self._gather(topic)
        return self._topics[key]
