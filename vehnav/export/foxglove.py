"""MCAP for Foxglove: the track on the map panel, the vehicle in the 3D panel, GPS beside it.

``/vehnav/fix`` and ``/gps/fix`` are ``foxglove.LocationFix``, ``/tf`` is
``foxglove.FrameTransform`` (map, East-North-Up at the first state, to base_link,
forward-left-up), ``/vehnav/track`` one ``foxglove.GeoJSON`` with the whole track and the stops.
JSON messages with their JSON schema: every MCAP tool can read them without more packages.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.evaluation import Errors
from vehnav.export.columns import decimate
from vehnav.export.maps import geojson
from vehnav.export.poses import first_position, map_poses
from vehnav.logs.log import Gnss
from vehnav.rotation import quaternion_from_c
from vehnav.trajectory import Trajectory

Array = npt.NDArray[np.float64]
Message = tuple[int, int, bytes]
"""(stamp ns, channel, text)"""

RATE: Final = 10.0
"""Hz, unless asked for: a map needs no more."""
UNKNOWN: Final = 0
DIAGONAL: Final = 2
"""Types of covariance."""

_TIME: Final = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
_NUMBER: Final = {"type": "number"}
_TEXT: Final = {"type": "string"}


def _xyz(letters: str) -> dict[str, Any]:
    return {"type": "object", "properties": dict.fromkeys(letters, _NUMBER)}


SCHEMAS: Final[dict[str, dict[str, Any]]] = {
    "foxglove.LocationFix": {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "latitude": _NUMBER,
        "longitude": _NUMBER,
        "altitude": _NUMBER,
        "position_covariance": {"type": "array", "items": _NUMBER, "minItems": 9, "maxItems": 9},
        "position_covariance_type": {"type": "integer"},
    },
    "foxglove.FrameTransform": {
        "timestamp": _TIME,
        "parent_frame_id": _TEXT,
        "child_frame_id": _TEXT,
        "translation": _xyz("xyz"),
        "rotation": _xyz("xyzw"),
    },
    "foxglove.GeoJSON": {"geojson": _TEXT},
}
"""Fields of the messages."""
CHANNELS: Final = (
    ("/vehnav/track", "foxglove.GeoJSON"),
    ("/vehnav/fix", "foxglove.LocationFix"),
    ("/tf", "foxglove.FrameTransform"),
    ("/gps/fix", "foxglove.LocationFix"),
)


def _stamp(t_ns: int) -> str:
    sec, nsec = divmod(t_ns, 1_000_000_000)
    return f'"timestamp":{{"sec":{sec},"nsec":{nsec}}}'


def _fixes(
    t_ns: npt.NDArray[np.int64],
    place: tuple[Array, Array, Array],
    sigma: Array | None,
    *,
    frame: str,
    channel: int,
) -> list[Message]:
    """LocationFix messages; ``place`` is (lat rad, lon rad, height m)."""
    lat, lon = np.degrees(place[0]).tolist(), np.degrees(place[1]).tolist()
    height = place[2].tolist()
    variance = np.zeros((t_ns.size, 3)) if sigma is None else sigma**2
    kind = UNKNOWN if sigma is None else DIAGONAL
    rows = zip(t_ns.tolist(), lat, lon, height, variance.tolist(), strict=True)
    return [
        (
            t,
            channel,
            (
                f'{{{_stamp(t)},"frame_id":"{frame}","latitude":{a!r},"longitude":{b!r},'
                f'"altitude":{h!r},"position_covariance":[{e!r},0,0,0,{n!r},0,0,0,{u!r}],'
                f'"position_covariance_type":{kind}}}'
            ).encode(),
        )
        for t, a, b, h, (e, n, u) in rows
    ]


def _transforms(states: Trajectory, channel: int) -> list[Message]:
    """FrameTransform messages, map to base_link."""
    position, c_map_flu = map_poses(states, first_position(states))
    q = quaternion_from_c(c_map_flu)
    rows = zip(states.t_ns.tolist(), position.tolist(), q.tolist(), strict=True)
    return [
        (
            t,
            channel,
            (
                f'{{{_stamp(t)},"parent_frame_id":"map","child_frame_id":"base_link",'
                f'"translation":{{"x":{x!r},"y":{y!r},"z":{z!r}}},'
                f'"rotation":{{"x":{qx!r},"y":{qy!r},"z":{qz!r},"w":{qw!r}}}}}'
            ).encode(),
        )
        for t, (x, y, z), (qw, qx, qy, qz) in rows
    ]


def write_mcap(
    trajectory: Trajectory,
    path: Path,
    *,
    unix_clock: bool = True,
    rate_hz: float | None = None,
    errors: Errors | None = None,
    gnss: Gnss | None = None,
    **_: Any,
) -> None:
    """Track, vehicle and, if given, GPS; zstd chunks in order of time."""
    states = decimate(trajectory, RATE if rate_hz is None else rate_hz)
    track = json.dumps(geojson(trajectory, unix_clock=False, errors=errors))
    place = (states.lat, states.lon, states.height)
    messages = [(int(states.t_ns[0]), 0, json.dumps({"geojson": track}).encode())]
    messages += _fixes(states.t_ns, place, states.sigma_pos, frame="base_link", channel=1)
    messages += _transforms(states, 2)
    if gnss is not None:
        place = (gnss.lat, gnss.lon, gnss.height)
        messages += _fixes(gnss.t_ns, place, gnss.sigma_pos, frame="gps", channel=3)
    _write_messages(path, sorted(messages, key=lambda message: message[:2]))


def _write_messages(path: Path, messages: list[Message]) -> None:
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="", library="vehnav")
        channels = {}
        for number in sorted({message[1] for message in messages}):
            topic, name = CHANNELS[number]
            schema = {"title": name, "type": "object", "properties": SCHEMAS[name]}
            schema_id = writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            channels[number] = writer.register_channel(topic, "json", schema_id)
        for sequence, (t_ns, number, text) in enumerate(messages):
            writer.add_message(channels[number], t_ns, text, t_ns, sequence)
        writer.finish()
