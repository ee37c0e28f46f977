"""Rules of the house that no other tool checks: sizes, rooms in the import contracts, leftovers."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = sorted((ROOT / "vehnav").rglob("*.py"))
LONGEST_MODULE = 400
LONGEST_FUNCTION = 60
PHYSICS = {
    "strapdown", "aiding", "stops", "alignment", "corrections", "mounting", "rest", "earth",
    "rotation", "legs", "classic", "offline", "expected", "clues", "mounting_auto", "units_auto",
}  # fmt: skip
JUDGED = PHYSICS - {"earth", "rotation"}
"""What the simulator judges, and therefore does not use."""


def contracts() -> dict[str, dict[str, object]]:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return {row["id"]: row for row in settings["tool"]["importlinter"]["contracts"]}


def rooms() -> set[str]:
    return {path.relative_to(ROOT / "vehnav").parts[0].removesuffix(".py") for path in SOURCES}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_sizes(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= LONGEST_MODULE
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            if body:
                lines = (body[-1].end_lineno or 0) - body[0].lineno + 1
                assert lines <= LONGEST_FUNCTION, node.name


def test_no_leftovers() -> None:
    unwanted = re.compile(
        "|".join(["TO" + "DO", "FIX" + "ME", "NotImplemented" + "Error", r"(?<!\w)/wo" + "rk/"])
    )
    for folder in ("vehnav", "tests", ".ci", ".github"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in {".py", ".yml", ".toml", ".c", ""} and path.is_file():
                found = unwanted.search(path.read_text(encoding="utf-8"))
                assert found is None, f"{path}: {found}"


def test_every_room_of_physics_is_under_the_contract() -> None:
    listed = {
        str(name).removeprefix("vehnav.") for name in contracts()["physics"]["source_modules"]
    }
    assert rooms() & PHYSICS <= listed


def test_the_simulator_judges_from_outside() -> None:
    contract = contracts()["judge"]
    assert contract["source_modules"] == ["vehnav.simulate"]
    listed = {str(name).removeprefix("vehnav.") for name in contract["forbidden_modules"]}
    assert rooms() & JUDGED <= listed
