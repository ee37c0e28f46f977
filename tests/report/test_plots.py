"""Pictures for papers."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from vehnav.errors import ConfigError
from vehnav.pipeline import Run
from vehnav.report.figures import Curve
from vehnav.report.panels import panels
from vehnav.report.plots import write_plots

BEGINNINGS = {".png": b"\x89PNG\r\n\x1a\n", ".pdf": b"%PDF-", ".svg": b"<?xml"}


def test_the_chosen_pictures_in_the_chosen_formats(city: Run, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    folder = tmp_path / "new" / "plots"
    found = write_plots(city, folder, formats=("png", "pdf"), names=["overview"])
    assert [path.name for path in found] == ["overview.png", "overview.pdf"]
    assert sorted(folder.iterdir()) == sorted(found)
    for path in found:
        assert path.read_bytes().startswith(BEGINNINGS[path.suffix])
    # small enough for a repository, large enough to hold more than empty axes
    assert 40_000 < found[0].stat().st_size < 400_000


def test_the_same_run_gives_the_same_file(city: Run, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    first = write_plots(city, tmp_path / "a", formats=("pdf",), names=["error"])
    again = write_plots(city, tmp_path / "b", formats=("pdf",), names=["error"])
    assert first[0].read_bytes() == again[0].read_bytes()


@pytest.mark.slow
def test_every_plot_of_the_page_is_written(city: Run, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    found = write_plots(city, tmp_path, formats=("png",))
    keys = {panel.key for panel in panels(city)}
    assert {path.stem for path in found} == keys | {"map", "overview"}
    assert len(keys) == 8


def test_without_matplotlib_it_says_what_to_install(
    city: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ConfigError, match=r"pip install .vehnav\[plots\]"):
        write_plots(city, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_empty_curve_has_bounds() -> None:
    assert Curve("none", "gps", ()).bounds == (0.0, 0.0)
    assert Curve("none", "gps", ()).largest == 0.0
