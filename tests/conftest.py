"""What all tests share: where the real logs and the sample logs are."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real logs recorded by others; they are not part of the project."""
    if not SHARED.is_dir():
        pytest.skip("real logs (../shared/data) are not on this machine")
    return SHARED


@pytest.fixture(scope="session")
def sample_logs() -> Path:
    """Folder of the simulated logs that come with the project."""
    return ROOT / "sample_logs"
