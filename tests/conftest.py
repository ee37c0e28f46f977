"""What all tests share: where the real logs and the sample logs are, a browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from report.headless import Browser, find_browser

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


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A real browser; the tests of a module share its one page."""
    program = find_browser()
    if program is None:
        pytest.skip("no browser is installed")
    with Browser(program, tmp_path_factory.mktemp("profile")) as found:
        yield found
