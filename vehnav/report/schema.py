"""The JSON Schema of ``report.json``, for its readers: loads nothing that a run needs."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any


@cache
def schema() -> dict[str, Any]:
    """The JSON Schema of the document of a run; shared, not to be changed."""
    text = resources.files("vehnav.report").joinpath("report.schema.json").read_text("utf-8")
    loaded: dict[str, Any] = json.loads(text)
    return loaded
