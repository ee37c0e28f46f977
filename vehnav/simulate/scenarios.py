"""Named scenarios: what is driven. ``"circle,lat=47.2,duration=900"`` names one with parameters.

Angles in the parameters are degrees, lengths metres, times seconds. Every default is frozen: a
test holds a digest of the truth of each scenario, so that figures may be bound to it.
"""

from __future__ import annotations

import difflib
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from vehnav.errors import ConfigError
from vehnav.simulate import ways
from vehnav.simulate.motion import Motion


@dataclass(frozen=True)
class Scenario:
    """A motion with a name.

    Attributes
    ----------
    name : str
    motion : Motion
    """

    name: str
    motion: Motion


SCENARIOS: Final[Mapping[str, Callable[..., Motion]]] = MappingProxyType(
    {
        "static": ways.static,
        "straight": ways.straight,
        "circle": ways.circle,
        "shake": ways.shake,
        "town": ways.town,
        "city": ways.city,
        "paper002": ways.paper002,
        "motorway": ways.motorway,
        "polar": ways.polar,
        "flight": ways.flight,
        "route": ways.route,
    }
)
"""Name -> function that makes the motion; its keywords are the parameters."""


SHORT: Final[Mapping[str, str]] = MappingProxyType({"T": "duration"})
"""Short names of parameters."""
LONGEST: Final = 604800.0
"""s, a week: longer drives are not even planned."""


def scenario_parameters(name: str) -> dict[str, Any]:
    """Parameter -> default of a scenario; ConfigError when there is no such scenario."""
    if name not in SCENARIOS:
        close = difflib.get_close_matches(name, SCENARIOS, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise ConfigError(f"no scenario {name!r}{hint}; there are {', '.join(SCENARIOS)}")
    signature = inspect.signature(SCENARIOS[name])
    return {key: p.default for key, p in signature.parameters.items()}


def make_scenario(text: str, **more: Any) -> Scenario:
    """The scenario of ``NAME[,KEY=VALUE...]``; ``more`` overrides what the text says.

    ``T`` stands for the duration, the name of a GPX, GeoJSON or CSV file for ``route,file=NAME``.
    ConfigError for an unknown name or parameter, a value that is not of its kind, or a drive that
    is too long.
    """
    name, *pairs = (part.strip() for part in text.split(","))
    chosen: dict[str, Any] = {}
    if name.lower().endswith((".gpx", ".geojson", ".json", ".csv")):
        name, chosen["file"] = "route", name
    defaults = scenario_parameters(name)
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise ConfigError(f"scenario {name}: {pair!r} is not KEY=VALUE")
        chosen[SHORT.get(key.strip(), key.strip())] = value.strip()
    chosen.update(more)
    for key, value in chosen.items():
        if key not in defaults:
            close = difflib.get_close_matches(key, defaults, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else f"; it has {', '.join(defaults)}"
            raise ConfigError(f"scenario {name} has no parameter {key!r}{hint}")
        chosen[key] = _as_kind(value, defaults[key], f"scenario {name}: {key}")
    duration = chosen.get("duration", 0.0)
    if duration > LONGEST:
        raise ConfigError(
            f"scenario {name}: duration must be at most {LONGEST:g} s (a week), not {duration:g}: "
            f"at 100 Hz these are {duration / 1e4:.4g} million samples, of about 1 kB of memory "
            "each"
        )
    return Scenario(name, SCENARIOS[name](**chosen))


def _as_kind(value: Any, default: Any, what: str) -> Any:
    """The value as the kind of the default: int, float or str."""
    if isinstance(default, str):
        return str(value)
    try:
        number = int(value) if isinstance(default, int) else float(value)
    except (TypeError, ValueError):
        raise ConfigError(f"{what} must be a number, not {value!r}") from None
    if not math.isfinite(number):
        raise ConfigError(f"{what} must be finite, not {value!r}")
    return number
