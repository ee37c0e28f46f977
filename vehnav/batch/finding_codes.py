"""The codes of all findings that a run, its readers and its checks can make.

A bar on any other would never see a finding and pass for ever. A test reads the codes out of the
sources and holds this list against them.
"""

from __future__ import annotations

from typing import Final

CODES: Final = frozenset({
    "axes-contradiction", "axes-doubt", "axes-found", "axes-unusual", "axes-unverified",
    "backward-stamps", "bad-messages", "bad-rows", "bag-damaged", "below-gps-noise",
    "bytes-lost", "checksum-mismatch", "chunk-damaged", "chunk-lost", "chunk-refused", "clock",
    "clock-choice", "clock-offset", "contradiction", "dead-axis", "duplicate-stamps", "gap",
    "gnss-form", "gps-beside", "gps-delay", "gps-height-missing", "gps-offset-applied",
    "gps-offset-unknown", "gps-rejected", "gps-sigma-invalid", "gps-start-nearest",
    "gps-velocity-missing", "gyrocompass", "heading-unknown", "leap-seconds", "local-frame",
    "messages-lost", "near-pole", "no-checksum", "no-date", "no-gps-start", "non-finite",
    "not-closed", "not-indexed", "not-navigable", "odometer-scale", "part-left-out",
    "saturated", "sensor-noise", "set-on-fixes", "short-stop", "speed-beside", "speed-rejected",
    "stamps-regressed", "stop-margin", "stop-speed", "stop-vetoed", "topic-choice",
    "topic-unusable", "undeclared-channel", "unit-assumed", "unit-contradiction", "unit-doubt",
    "unit-inferred", "unverified",
})  # fmt: skip
"""As :class:`vehnav.errors.Finding` has them."""
