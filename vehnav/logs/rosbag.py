"""ROS 1 bags and rosbag2 databases, through the optional package ``rosbags``.

Only the container is its work: payloads go through the same decoders as those of MCAP, in batches.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from vehnav.errors import Finding, LogError
from vehnav.logs.log import Log, ReadOptions
from vehnav.logs.messages.assemble import Assembler, UnusableError
from vehnav.logs.messages.choice import Candidate, choose
from vehnav.logs.messages.payload import Batch, Declaration
from vehnav.logs.messages.topics import Topic, Topics

BATCH: Final = 2000
"""Messages that are decoded at once."""


def read_rosbag(path: str | Path, options: ReadOptions) -> Log:
    """Read a ``.bag``, a ``.db3``, or a rosbag2 folder of the latter.

    Parameters
    ----------
    path : str or Path
    options : ReadOptions
        As for :func:`vehnav.logs.mcap.read_mcap`.

    Raises
    ------
    LogError
        The optional package is missing (with the two ways out), or the bag cannot be read.
    """
    place = Path(path)
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
    except ImportError:
        kind, convert = _conversion(place)
        raise LogError(
            f"{path}: {kind}; pip install 'vehnav[rosbag]' to read it, or convert it: {convert}"
        ) from None
    rejected: dict[tuple[str, str], str] = {}
    while True:
        try:
            with AnyReader([_bag(place)]) as reader:
                return _read(str(path), reader, options, rejected)
        except UnusableError as error:
            candidate = error.candidate
            rejected[candidate.role.name, candidate.topic.name] = error.why
        except LogError:
            raise
        except (AnyReaderError, OSError, ValueError, KeyError) as error:
            kind, convert = _conversion(place)
            raise LogError(
                f"{path}: {kind} that cannot be read ({error}); was it closed? "
                "'rosbag reindex' repairs a .bag, 'ros2 bag reindex' a folder; to convert it: "
                + convert
            ) from error


def _conversion(place: Path) -> tuple[str, str]:
    """What a place holds, and the command that makes MCAP of it."""
    if place.suffix == ".bag":
        kind, source, target = "a ROS 1 bag", place, place.stem
    else:
        kind = "a rosbag2 SQLite database"
        source = place.parent if place.suffix == ".db3" else place
        target = f"{place.stem}_mcap"
    command = f"rosbags-convert --src {source} --dst {target} --dst-storage mcap"
    return kind, f"pip install rosbags && {command}"


def _bag(place: Path) -> Path:
    """The folder of a database that is one file of a rosbag2 recording, else the place itself."""
    if place.suffix == ".db3" and (place.parent / "metadata.yaml").is_file():
        return place.parent
    return place


def _read(
    path: str, reader: Any, options: ReadOptions, rejected: dict[tuple[str, str], str]
) -> Log:
    topics, of_connection = Topics(), {}
    for connection in reader.connections:
        declared = _declaration(connection, ros2=reader.is2)
        topic = topics.get(connection.topic, declared)
        topic.see(np.zeros(0, np.int64), connection.msgcount)
        of_connection[connection.id, id(connection.owner)] = topic
    if not any(topic.count for topic in topics):
        raise LogError(f"{path}: the recording holds no messages")
    chosen, notes = choose(path, list(topics), options, rejected)
    used = _gather(chosen)
    wanted = [c for c in reader.connections if of_connection[c.id, id(c.owner)] in used]
    damage = _pour(path, reader.messages(wanted) if wanted else [], of_connection)
    topics.flush()
    return Assembler(path, topics, options).log(chosen, damage, notes)


def _gather(chosen: Mapping[str, Candidate]) -> list[Topic]:
    for candidate in chosen.values():
        candidate.topic.gather(candidate.role)
    return [candidate.topic for candidate in chosen.values()]


def _declaration(connection: Any, *, ros2: bool) -> Declaration:
    """What the bag, or without it the standard, says of a connection's messages."""
    from rosbags.interfaces import MessageDefinitionFormat
    from rosbags.typesys import Stores, get_typestore
    from rosbags.typesys.base import TypesysError

    name, text, language = connection.msgtype, connection.msgdef.data, "msg"
    if connection.msgdef.format is MessageDefinitionFormat.NONE or not text.strip():
        store = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
        try:
            text = store.generate_msgdef(name, ros_version=2 if ros2 else 1)[0]
        except TypesysError:
            text = ""
    elif connection.msgdef.format is MessageDefinitionFormat.IDL:
        language = "idl"
    encoding = "cdr" if ros2 else "ros1"
    return Declaration(encoding, name, f"ros{2 if ros2 else 1}{language}", text.encode())


def _pour(
    path: str, messages: Iterable[tuple[Any, int, bytes]], of_connection: dict[Any, Topic]
) -> list[Finding]:
    """All messages to their topics, in batches; damage that ended it early."""
    waiting: dict[int, tuple[Topic, list[tuple[int, bytes]]]] = {}
    damage = []
    last = None
    try:
        for connection, log_ns, payload in messages:
            topic = of_connection[connection.id, id(connection.owner)]
            last = log_ns
            batch = waiting.setdefault(id(topic), (topic, []))[1]
            batch.append((log_ns, payload))
            if len(batch) == BATCH:
                _deliver(topic, batch)
    except Exception as error:  # whatever the package meets in a broken bag ends it, not us
        text = f"{path}: the bag breaks off ({type(error).__name__}: {str(error)[:120]})"
        damage.append(Finding("bag-damaged", "error", text, last, None))
    for topic, batch in waiting.values():
        if batch:
            _deliver(topic, batch)
    return damage


def _deliver(topic: Topic, batch: list[tuple[int, bytes]]) -> None:
    log_ns = np.array([t for t, _ in batch], np.int64)
    size = np.array([len(payload) for _, payload in batch], np.int64)
    data = np.frombuffer(b"".join(payload for _, payload in batch), np.uint8)
    batch.clear()
    topic.see(log_ns, 0)
    topic.add(Batch(data, np.cumsum(size) - size, size, log_ns, log_ns), "sound")
