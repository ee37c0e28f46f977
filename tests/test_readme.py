"""The words of the README are true: its session, its table of commands, its files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from vehnav.cli.main import COMMANDS, cli

ROOT = Path(__file__).parent.parent
NUMBER = re.compile(r"[-+]?\d+\.?\d*")


def session() -> list[str]:
    """The lines that the README shows below `vehnav run`."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text.split("```console\n$ vehnav run sample_logs/city.mcap\n")[1].split("```")[0]
    return block.rstrip().splitlines()


def test_the_session_is_what_the_command_prints(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(ROOT)
    result = CliRunner().invoke(cli, ["run", "sample_logs/city.mcap", "--out-dir", str(tmp_path)])
    assert result.exit_code == 0
    printed, shown = result.stdout.rstrip().splitlines()[:-1], session()[:-1]
    assert len(printed) == len(shown)
    for ours, theirs in zip(printed, shown, strict=True):
        assert NUMBER.sub("#", ours) == NUMBER.sub("#", theirs)
        numbers = [[float(x) for x in NUMBER.findall(line)] for line in (ours, theirs)]
        # three printed digits; another platform's libm may round the last one otherwise
        assert numbers[0] == pytest.approx(numbers[1], rel=0.01, abs=0.11)


def test_every_command_is_in_the_readme_and_every_one_there_exists() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| `vehnav (\w+)", text, re.MULTILINE))
    context = cli.make_context("vehnav", ["--help"], resilient_parsing=True)
    assert listed == set(cli.list_commands(context))
    assert listed <= set(COMMANDS)


@pytest.mark.slow
def test_the_table_of_the_papers_is_what_the_command_prints() -> None:
    """Verdicts to the letter, figures to the printed digits of another platform's libm."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = [line for line in text.splitlines() if re.match(r"\| (000|001|002|003|004|all) ", line)]
    result = CliRunner().invoke(cli, ["papers", "--fast", "--markdown"])
    printed = [x for x in result.stdout.splitlines() if re.match(r"\| (00\d|all) ", x)]
    assert len(shown) == len(printed) > 15
    for ours, theirs in zip(printed, shown, strict=True):
        assert NUMBER.sub("#", ours) == NUMBER.sub("#", theirs)
        numbers = [[float(x) for x in NUMBER.findall(line)] for line in (ours, theirs)]
        assert numbers[0] == pytest.approx(numbers[1], rel=0.02, abs=0.11)


def test_named_files_exist() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"(?<![.\w])((?:vehnav|tests|sample_logs)/[\w./]+\.\w+)", text))
    assert "vehnav/legs.py" in named
    assert [name for name in sorted(named) if not (ROOT / name).is_file()] == []
