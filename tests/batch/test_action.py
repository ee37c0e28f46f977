"""The GitHub Action and the snippets of the README: their schemas, and their shell run for real."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

import click
import pytest
import yaml
from check_jsonschema.cli.main_command import main as check_jsonschema
from click.testing import CliRunner

from vehnav.cli.main import cli

ROOT = Path(__file__).resolve().parents[2]
ACTION = ROOT / ".github" / "actions" / "score" / "action.yml"
BIN = sysconfig.get_path("scripts")
unix = pytest.mark.skipif(sys.platform == "win32", reason="runs bash on paths of Unix")
EVIL = "$(touch pwned) `touch pwned` ; touch pwned \" ' \\"


@pytest.fixture(scope="module")
def action() -> dict[str, Any]:
    return yaml.safe_load(ACTION.read_text(encoding="utf-8"))


def steps(action: dict[str, Any]) -> list[dict[str, Any]]:
    return action["runs"]["steps"]


def snippet(word: str, path: Path) -> dict[str, Any]:
    """The one YAML block of the README that holds a word; written to ``path``, too."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    (block,) = [block for block in blocks if word in block]
    path.write_text(block, encoding="utf-8")
    return yaml.safe_load(block)


def accepted(schema: str, path: Path) -> None:
    """By the schema that the vendor publishes; it comes with check-jsonschema."""
    found = CliRunner().invoke(check_jsonschema, ["--builtin-schema", schema, str(path)])
    assert found.exit_code == 0, found.output


def test_the_schema_of_github_accepts_it() -> None:
    accepted("vendor.github-actions", ACTION)


def judged(*paths: Path) -> None:
    """By zizmor: injected input, rights, loose references; it comes with the extra "dev"."""
    program = shutil.which("zizmor", path=os.pathsep.join([BIN, os.environ.get("PATH", "")]))
    if program is None:
        pytest.skip("no zizmor")
    found = subprocess.run(
        [program, "--offline", "--no-progress", "--config", str(ROOT / ".github" / "zizmor.yml"),
         *map(str, paths)],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert found.returncode == 0, found.stdout + found.stderr


def test_zizmor_finds_nothing(tmp_path: Path) -> None:
    snippet("actions/score", tmp_path / "workflow.yml")
    text = (tmp_path / "workflow.yml").read_text(encoding="utf-8")
    own = tmp_path / "own.yml"  # as a user writes it whose action is pinned
    own.write_text(text.replace("@main", f"@{'0123456789' * 4}"), encoding="utf-8")
    judged(ACTION, ROOT / ".github" / "workflows" / "ci.yml", own)


def test_every_input_is_described_and_used(action: dict[str, Any]) -> None:
    text = ACTION.read_text(encoding="utf-8")
    for name, row in action["inputs"].items():
        assert row["description"], name
        assert row.get("required") or "default" in row, name
        assert f"inputs.{name}" in text, name
    assert set(re.findall(r"inputs\.([\w-]+)", text)) <= set(action["inputs"])
    assert action["runs"]["using"] == "composite"
    for step in steps(action):
        assert ("uses" in step) != ("run" in step)
        assert "run" not in step or step["shell"] == "bash"
        assert "uses" not in step or re.fullmatch(r"actions/[\w-]+@v\d+", step["uses"])


def test_no_input_becomes_text_of_a_script(action: dict[str, Any]) -> None:
    for step in steps(action):
        assert "${{" not in step.get("run", "")


# ---- its shell, run with programs that write down how they were called ---------------------------


def called(folder: Path, script: str, given: dict[str, str], status: int = 0) -> tuple[int, Path]:
    """Run a script as GitHub does; vehnav and python write their arguments into ``folder``."""
    tools = folder / "bin"
    tools.mkdir()
    for name in ("vehnav", "python"):
        program = tools / name
        program.write_text(
            f'#!/bin/bash\nprintf "%s\\n" "$@" > "{folder}/{name}.called"\nexit {status}\n'
        )
        program.chmod(0o755)
    file = folder / "script.sh"
    file.write_text(script)
    environment = {
        "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}",
        "GITHUB_OUTPUT": str(folder / "output"),
        **given,
    }
    found = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(file)],
        cwd=folder, env=environment, check=False, timeout=60,
    )  # fmt: skip
    return found.returncode, folder


def script(action: dict[str, Any], name: str) -> tuple[str, set[str]]:
    step = next(step for step in steps(action) if step.get("name") == name)
    return step["run"], set(step["env"])


def score_inputs(**given: str) -> dict[str, str]:
    return {"SUITE": "s.toml", "BASELINE": "", "OUTPUT": "out", "ARGS": "", **given}


@unix
def test_scores_with_what_is_given(action: dict[str, Any], tmp_path: Path) -> None:
    text, names = script(action, "Score")
    given = score_inputs(
        SUITE="my drives/suite.toml", BASELINE="base line.json", OUTPUT="the reports",
        ARGS="--max-regression 5%   --quiet\n--jobs 4\n",
    )  # fmt: skip
    assert set(given) == names
    status, folder = called(tmp_path, text, given)
    assert status == 0
    assert (folder / "vehnav.called").read_text().splitlines() == [
        "score", "-o", "the reports", "--junit", "the reports/junit.xml",
        "--table", "the reports/results.csv", "--baseline", "base line.json",
        "--max-regression", "5%", "--quiet", "--jobs", "4", "--", "my drives/suite.toml",
    ]  # fmt: skip
    assert (folder / "output").read_text().splitlines() == [
        "status=0", "results=the reports/results.json",
    ]  # fmt: skip


@unix
@pytest.mark.parametrize("status", [0, 1, 2, 3, 70, 130])
def test_ends_as_the_command_does(action: dict[str, Any], tmp_path: Path, status: int) -> None:
    found, folder = called(tmp_path, script(action, "Score")[0], score_inputs(), status)
    assert found == status
    assert f"status={status}\n" in (folder / "output").read_text()
    assert "--baseline" not in (folder / "vehnav.called").read_text()


@unix
def test_inputs_are_never_run(action: dict[str, Any], tmp_path: Path) -> None:
    given = score_inputs(SUITE=EVIL, BASELINE=EVIL, OUTPUT=EVIL, ARGS=EVIL + " *")
    _, folder = called(tmp_path, script(action, "Score")[0], given)
    assert not (folder / "pwned").exists()
    arguments = (folder / "vehnav.called").read_text().splitlines()
    assert arguments.count(EVIL) == 3
    assert "*" in arguments  # names of files are not put in its place


@unix
@pytest.mark.parametrize(
    ("extras", "wanted"),
    [
        ("", "{here}/../../.."),
        ("rosbag,protobuf", "{here}/../../..[rosbag,protobuf]"),
        (EVIL, "{here}/../../..[" + EVIL + "]"),
    ],
)
def test_installs_what_it_comes_with(
    action: dict[str, Any], tmp_path: Path, extras: str, wanted: str
) -> None:
    text, names = script(action, "Install vehnav")
    here = str(ACTION.parent)
    given = {"EXTRAS": extras, "HERE": here}
    assert set(given) == names
    _, folder = called(tmp_path, text, given)
    arguments = (folder / "python.called").read_text().splitlines()
    assert arguments == ["-m", "pip", "install", wanted.format(here=here)]
    assert not (folder / "pwned").exists()
    assert (Path(f"{here}/../../..") / "pyproject.toml").is_file()


@unix
@pytest.mark.slow
def test_with_the_real_program(action: dict[str, Any], tmp_path: Path) -> None:
    """What a job would see: status, summary, files."""
    (tmp_path / "suite.toml").write_text(
        '[suite]\nname = "town"\n[[log]]\nscenario = "city,duration=90,first_stop=20"\nrate = 50\n'
        '[[bar]]\nmetric = "errors.horizontal_m.max"\nmax = 0.001\n'
    )
    file = tmp_path / "script.sh"
    file.write_text(script(action, "Score")[0])
    found = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(file)],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120,
        env={
            **os.environ, "PATH": os.pathsep.join([BIN, os.environ["PATH"]]),
            "GITHUB_ACTIONS": "true", "GITHUB_OUTPUT": str(tmp_path / "output"),
            "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md"),
            **score_inputs(SUITE="suite.toml", ARGS="--jobs 1\n--timeout 60\n"),
        },
    )  # fmt: skip
    assert found.returncode == 1, found.stderr
    assert "MISSED errors.horizontal_m.max" in found.stdout
    assert (tmp_path / "output").read_text().splitlines() == [
        "status=1", "results=out/results.json",
    ]  # fmt: skip
    assert (tmp_path / "summary.md").read_text().startswith("### town: failed")
    for name in ("results.json", "index.html", "junit.xml", "results.csv"):
        assert (tmp_path / "out" / name).is_file(), name


def options_of_score() -> set[str]:
    context = click.Context(cli)
    command = cli.get_command(context, "score")
    assert command is not None
    return {name for param in command.params for name in param.opts}


def test_the_options_exist(action: dict[str, Any]) -> None:
    text, _ = script(action, "Score")
    named = set(re.findall(r"(?<!\w)--[a-z-]+|-o\b", text)) - {"--"}
    assert {"-o", "--junit", "--baseline"} <= named <= options_of_score()


def used(workflow: dict[str, Any]) -> list[dict[str, Any]]:
    """The steps of a workflow that use the action."""
    every = [step for job in workflow["jobs"].values() for step in job["steps"]]
    return [step for step in every if "actions/score" in step.get("uses", "")]


def check_inputs(step: dict[str, Any], action: dict[str, Any]) -> None:
    required = {name for name, row in action["inputs"].items() if row.get("required")}
    assert required <= set(step["with"]) <= set(action["inputs"])


def test_our_own_changes_go_through_it(action: dict[str, Any]) -> None:
    path = ROOT / ".github" / "workflows" / "ci.yml"
    accepted("vendor.github-workflows", path)
    (step,) = used(yaml.safe_load(path.read_text(encoding="utf-8")))
    check_inputs(step, action)
    assert (ROOT / step["uses"] / "action.yml").is_file()
    assert (ROOT / step["with"]["suite"]).is_file()


# ---- the README --------------------------------------------------------------------------------


def test_the_workflow_of_the_readme(action: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "workflow.yml"
    workflow = snippet("actions/score", path)
    accepted("vendor.github-workflows", path)
    (step,) = used(workflow)
    check_inputs(step, action)
    named = set(re.findall(r"--[a-z-]+", step["with"].get("args", "")))
    assert named <= options_of_score()


def test_the_job_for_gitlab_of_the_readme(tmp_path: Path) -> None:
    path = tmp_path / "gitlab-ci.yml"
    pipeline = snippet("artifacts:", path)
    accepted("vendor.gitlab-ci", path)
    (job,) = pipeline.values()
    written = re.search(r"--junit (\S+)", "\n".join(job["script"])).group(1)
    assert job["artifacts"]["reports"]["junit"] == written
    assert job["artifacts"]["when"] == "always"  # the reports are wanted when it fails
    named = set(re.findall(r"--[a-z-]+", "\n".join(job["script"])))
    assert named <= options_of_score()


def test_nothing_is_installed_from_where_it_is_not(action: dict[str, Any], tmp_path: Path) -> None:
    """vehnav is on no index: the one place that installs it by name names the repository."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (owner,) = set(re.findall(r"uses: (\S+)/\.github/actions/score@", text))
    (line,) = [row for row in snippet("artifacts:", tmp_path / "x.yml")["score"]["script"]
               if row.startswith("pip install")]  # fmt: skip
    assert line == f"pip install git+https://github.com/{owner}"
    assert not re.search(r"pip install (-U )?vehnav\b", text)
    assert "version" not in action["inputs"]
