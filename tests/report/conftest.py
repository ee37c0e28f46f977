"""One run of a sample log, for all tests of the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from vehnav.config import Config
from vehnav.logs.read import read_log
from vehnav.pipeline import Run, run
from vehnav.report.document import document


@pytest.fixture(scope="session")
def city(sample_logs: Path) -> Run:
    """The city drive by the default method."""
    return run(read_log(str(sample_logs / "city.mcap")), Config())


@pytest.fixture(scope="session")
def city_document(city: Run) -> dict[str, Any]:
    """Its document."""
    return document(city)
