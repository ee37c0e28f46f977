"""Outputs appear whole or not at all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vehnav.export.atomic import atomic_path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_the_file_appears_at_the_end(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "a.csv.gz") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".gz"
        temporary.write_text("new")
        assert not (tmp_path / "a.csv.gz").exists()
    assert names(tmp_path) == ["a.csv.gz"]
    assert (tmp_path / "a.csv.gz").read_text() == "new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_after_an_error_the_old_file_is_there_and_nothing_else(
    tmp_path: Path, error: type[BaseException]
) -> None:
    target = tmp_path / "a.csv"
    target.write_text("old")

    def write() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        write()
    assert names(tmp_path) == ["a.csv"]
    assert target.read_text() == "old"


def test_a_writer_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError), atomic_path(tmp_path / "a.csv"):
        pass
    assert names(tmp_path) == []


@pytest.mark.skipif(os.name == "nt", reason="links and devices of POSIX")
def test_links_are_followed_and_devices_kept(tmp_path: Path) -> None:
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    with atomic_path(tmp_path / "link.csv") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new"
    with atomic_path("/dev/null") as device:
        assert device == Path("/dev/null")
        device.write_text("gone")
    assert Path("/dev/null").is_char_device()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "none" / "a.csv") as temporary:
        temporary.write_text("x")


def test_writing_whole_costs_no_format_and_no_compiler() -> None:
    """Budgets, Allan tables and suites write whole files without reading any trajectory."""
    program = (
        "import sys; import vehnav.export.atomic; "
        "print([m for m in sys.modules if m in ('numba', 'vehnav.export.formats')])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("[]", "")


@pytest.mark.parametrize("begun", [True, False])
def test_what_cannot_be_written_is_named_as_it_was_asked_for(tmp_path: Path, begun: bool) -> None:
    target = tmp_path / "missing" / "a.csv"

    def write() -> None:
        with atomic_path(target) as temporary:
            if begun:
                temporary.write_text("new")

    with pytest.raises(FileNotFoundError) as caught:
        write()
    assert caught.value.filename == str(target)
    assert caught.value.strerror == "its folder does not exist"
