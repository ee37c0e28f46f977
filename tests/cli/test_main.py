"""The shell around the commands: exit status, help, config files, what is imported when."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import click
import pytest
from click.testing import CliRunner, Result

from vehnav.cli import main as shell
from vehnav.cli.common import (
    axes_options,
    command,
    finding_line,
    finish,
    input_options,
    json_option,
    option,
    print_findings,
    print_json,
    progress,
    span_options,
    stops_options,
    strict_option,
)
from vehnav.errors import ConfigError, Finding, FormatError, LogError

HEAVY = ("numpy", "pandas", "pyproj", "numba", "scipy", "mcap")


@pytest.fixture
def demo(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A command ``run`` that stores what it got and does what its LOG says."""
    got: dict[str, Any] = {}

    @command("run", examples=["vehnav run x.mcap"])
    @click.argument("log")
    @input_options
    @span_options
    @axes_options
    @stops_options
    @option("method", "--reset/--no-reset", default=True, help="V := 0 at stops.")
    @strict_option
    @json_option
    def run(log: str, strict: bool, **kwargs: Any) -> None:
        """Do what LOG says."""
        got.update(kwargs)
        got["log"] = log
        doing = {
            "damaged": lambda: finish(damaged=True, strict=strict),
            "missed": lambda: finish(bar_missed=True, damaged=True),
            "found": lambda: finish(strict=strict, findings=[Finding("gap", "warning", "hole")]),
            "noted": lambda: finish(strict=strict, findings=[Finding("gap", "info", "hole")]),
            "log-error": lambda: _raise(LogError("x.mcap: no IMU topic")),
            "format-error": lambda: _raise(FormatError("x.csv: row 3")),
            "config-error": lambda: _raise(ConfigError("c.toml: no")),
            "no-file": lambda: Path("/nonexistent/x.mcap").read_bytes(),
            "bug": lambda: _raise(KeyError("oops")),
            "interrupt": lambda: _raise(KeyboardInterrupt()),
        }.get(log, lambda: None)
        doing()

    module = ModuleType("vehnav.cli.demo_for_test")
    module.run = run  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(shell, "COMMANDS", {"run": ("vehnav.cli.demo_for_test:run", "Demo.")})
    monkeypatch.setattr(shell.LazyGroup, "list_commands", lambda self, ctx: ["run"])
    return got


def _raise(error: BaseException) -> None:
    raise error


def invoke(*args: str) -> Result:
    return CliRunner().invoke(shell.cli, args)


def vehnav(*args: str, **kwargs: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "vehnav", *args], capture_output=True, text=True, **kwargs
    )


# ---- exit status -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("args", "status"),
    [
        (["fine"], 0),
        (["noted", "--strict"], 0),
        (["found"], 0),
        (["found", "--strict"], 1),
        (["missed"], 1),
        (["damaged", "--strict"], 1),
        (["damaged"], 3),
        (["log-error"], 2),
        (["format-error"], 2),
        (["config-error"], 2),
        (["no-file"], 2),
        ([], 2),
        (["fine", "--no-such-option"], 2),
        (["fine", "--max-gap", "-1"], 2),
        (["bug"], 70),
        (["interrupt"], 130),
    ],
)
def test_exit_status(demo: dict[str, Any], args: list[str], status: int) -> None:
    result = invoke("run", *args)
    assert result.exit_code == status, result.output
    assert result.stdout == ""
    if status in (2, 70):
        assert "vehnav: " in result.stderr
    assert ("Traceback" in result.stderr) == (status == 70)


def test_an_error_is_one_line_with_the_programs_name(demo: dict[str, Any]) -> None:
    assert invoke("run", "log-error").stderr == "vehnav: error: x.mcap: no IMU topic\n"
    assert invoke("run", "no-file").stderr.startswith("vehnav: error: /nonexistent/x.mcap: ")


def test_a_bug_says_where_to_report_it(demo: dict[str, Any]) -> None:
    text = invoke("run", "bug").stderr
    assert "KeyError: 'oops'" in text
    assert "report" in text.splitlines()[-1]


def test_unknown_names_get_the_nearest_one(demo: dict[str, Any]) -> None:
    wrong_command = invoke("rnu", "x.mcap")
    assert (wrong_command.exit_code, "'run'" in wrong_command.stderr) == (2, True)
    wrong_option = invoke("run", "x", "--max-gab", "1")
    assert (wrong_option.exit_code, "--max-gap" in wrong_option.stderr) == (2, True)
    assert invoke("zzzz").exit_code == 2


def test_without_arguments_the_help_is_shown_on_stderr() -> None:
    result = invoke()
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "Usage: vehnav" in result.stderr


def test_module_and_version() -> None:
    result = vehnav("--version")
    source = Path(shell.__file__).parent.with_name("_version.py").read_text()
    version = re.search(r'__version__ = "(.*)"', source)
    assert version is not None
    assert result.stdout == f"vehnav {version.group(1)}\n"
    assert vehnav("no-such-command").returncode == 2


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX")
def test_a_closed_pipe_is_silent() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as closed:
        result = subprocess.run(
            [sys.executable, "-m", "vehnav", "--help"], stdout=closed, stderr=subprocess.PIPE
        )
    assert result.stderr == b""
    assert result.returncode == 128 + signal.SIGPIPE


# ---- help --------------------------------------------------------------------------------------


def all_commands() -> list[tuple[str, click.Command]]:
    ctx = click.Context(shell.cli)
    commands = [(name, shell.cli.get_command(ctx, name)) for name in shell.cli.list_commands(ctx)]
    return [(name, found) for name, found in commands if found is not None]


def test_every_command_and_option_has_help_and_an_example() -> None:
    ctx = click.Context(shell.cli)
    assert [name for name, _ in all_commands()] == shell.cli.list_commands(ctx)
    for name, found in all_commands():
        text = found.get_help(click.Context(found, info_name=f"vehnav {name}"))
        assert found.help, name
        assert re.search(rf"^Examples?:\n(.*\n)*?.*vehnav {name}\b", text, re.MULTILINE), name
        for param in found.params:
            if isinstance(param, click.Option):
                assert param.help, f"{name} {param.opts}"


def test_every_command_can_print_json() -> None:
    for name, found in all_commands():
        assert any("--json" in param.opts for param in found.params), name


def test_every_row_of_the_table_names_its_own_command() -> None:
    for name, found in all_commands():
        assert found.name == name


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from vehnav.cli.main import cli\n"
        "try:\n    cli.main(['--help'])\n"
        "except SystemExit as leaving:\n    assert leaving.code == 0\n"
        "commands = [m for m in sys.modules if m.startswith('vehnav.cli.')]\n"
        f"print('HEAVY', [m for m in {HEAVY!r} if m in sys.modules], sorted(commands))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    shell_modules = ["main", "status"]
    wanted = f"HEAVY [] {[f'vehnav.cli.{name}' for name in shell_modules]}"
    assert result.stdout.splitlines()[-1] == wanted, result.stderr


def test_help_of_a_command_loads_nothing_heavy() -> None:
    for name, _ in all_commands():
        code = (
            "import sys\n"
            "from vehnav.cli.main import cli\n"
            f"try:\n    cli.main([{name!r}, '--help'])\nexcept SystemExit:\n    pass\n"
            f"print('HEAVY', [m for m in {HEAVY!r} if m in sys.modules])"
        )
        result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert result.stdout.splitlines()[-1] == "HEAVY []", name


@pytest.mark.parametrize("kind", ["bash", "zsh", "fish"])
def test_shell_completion(kind: str) -> None:
    result = vehnav(env={**os.environ, "_VEHNAV_COMPLETE": f"{kind}_source"})
    assert "_VEHNAV_COMPLETE" in result.stdout
    assert result.stderr == ""


# ---- options -----------------------------------------------------------------------------------


def test_read_options_reach_the_command(demo: dict[str, Any]) -> None:
    args = ["--columns", "gyro_x=wx, gyro_y=wy", "--gyro-unit", "deg/s", "--gps-time-offset", "-.5"]
    assert invoke("run", "x.csv", *args).exit_code == 0
    options = demo["read_options"]
    assert dict(options.columns) == {"gyro_x": "wx", "gyro_y": "wy"}
    assert (options.gyro_unit, options.gps_time_offset, options.time) == ("deg/s", -0.5, None)


@pytest.mark.parametrize("bad", ["gyro_x", "gyro_x=", "=a", "a=b,a=c"])
def test_columns_refuse_what_is_not_a_mapping(demo: dict[str, Any], bad: str) -> None:
    assert invoke("run", "x.csv", "--columns", bad).exit_code == 2


@pytest.mark.parametrize("bad", ["FL", "FLUX", "FBU", "XYZ", "FFU", ""])
def test_axes_refuse_what_is_not_a_frame(demo: dict[str, Any], bad: str) -> None:
    result = invoke("run", "x.csv", "--axes", bad)
    assert result.exit_code == 2
    assert "one of F B" in result.stderr


def test_axes_and_mount(demo: dict[str, Any]) -> None:
    args = ["--axes", "flu", "--accel-axes", "BRD", "--mount", "1,-2.5,90"]
    assert invoke("run", "x.csv", *args).exit_code == 0
    assert (demo["axes"], demo["accel_axes"], demo["mount"]) == ("FLU", "BRD", (1.0, -2.5, 90.0))
    assert invoke("run", "x.csv", "--axes", "auto").exit_code == 0
    assert demo["axes"] == "auto"
    for bad in ("1,2", "1,2,x", "1,2,nan"):
        assert invoke("run", "x.csv", "--mount", bad).exit_code == 2


@pytest.mark.parametrize(
    ("text", "unix_clock", "wanted"),
    [
        ("12.5", True, 1_000 + 12_500_000_000),
        ("12.5", False, 1_000 + 12_500_000_000),
        ("-1", True, 1_000 - 1_000_000_000),
        # 2001-09-09T01:46:40Z is 1e9 Unix seconds
        ("2001-09-09T01:46:40Z", True, 1_000_000_000 * 10**9),
        ("2001-09-09T01:46:40.25", True, 1_000_000_000_250 * 10**6),
        ("2001-09-09T03:46:40+02:00", True, 1_000_000_000 * 10**9),
    ],
)
def test_start_and_end(demo: dict[str, Any], text: str, unix_clock: bool, wanted: int) -> None:
    assert invoke("run", "x.csv", "--start", text).exit_code == 0
    assert demo["start"].on_clock(1_000, unix_clock=unix_clock) == wanted


def test_an_iso_time_needs_a_log_with_unix_time(demo: dict[str, Any]) -> None:
    assert invoke("run", "x.csv", "--end", "2001-09-09T01:46:40Z").exit_code == 0
    with pytest.raises(ConfigError, match="no Unix time"):
        demo["end"].on_clock(0, unix_clock=False)
    for bad in ("soon", "nan", "inf"):
        assert invoke("run", "x.csv", "--end", bad).exit_code == 2


@pytest.mark.parametrize("bad", ["nan", "inf", "-0.1", "x"])
def test_numbers_are_finite_and_in_range(demo: dict[str, Any], bad: str) -> None:
    assert invoke("run", "x.csv", f"--max-gap={bad}").exit_code == 2


# ---- config files ------------------------------------------------------------------------------

CONFIG = """
[input]
axes = "BRU"
max_gap = 2
mount = [0, 1.5, 0]
columns = {gyro_x = "w,x", gyro_y = "w=y"}
start = 2001-09-09T01:46:40Z
[stops]
stop_statistic = "rms"
"""


def test_config_file_fills_in_what_is_not_given(demo: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(CONFIG)
    assert invoke("run", "x.csv", "--config", str(path), "--max-gap", "3").exit_code == 0
    assert (demo["axes"], demo["max_gap"], demo["mount"]) == ("BRU", 3.0, (0.0, 1.5, 0.0))
    assert dict(demo["read_options"].columns) == {"gyro_x": "w,x", "gyro_y": "w=y"}
    assert demo["start"].unix_ns == 10**18
    assert (demo["stop_statistic"], demo["stop_dwell"]) == ("rms", None)


def test_printed_config_is_a_config_file(demo: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text(CONFIG)
    printed = invoke("run", "--config", str(path), "--stop-dwell", "4", "--print-config")
    assert (printed.exit_code, printed.stderr, demo) == (0, "", {})
    tables = tomllib.loads(printed.stdout)
    assert tables["stops"] == {"stop_statistic": "rms", "stop_dwell": 4.0}
    assert re.search(r"^stop_dwell = 4.0  # command line$", printed.stdout, re.MULTILINE)
    assert re.search(r"^max_gap = 2.0  # config file$", printed.stdout, re.MULTILINE)
    path.write_text(printed.stdout)
    again = invoke("run", "--config", str(path), "--print-config")
    assert tomllib.loads(again.stdout) == tables


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[input]\nmax_gab = 1", "did you mean 'max_gap'"),
        ("[inputs]\nmax_gap = 1", "did you mean 'input'"),
        ("[gps]\nmax_gap = 1", r"belongs in \[input\]"),
        ("[input]\nmax_gap = 'x'", r"\[input\] max_gap: 'x' is not a valid number"),
        ("[input]\nmax_gap = true", "not a boolean"),
        ("[input]\nmount = [1, 2]", "3 numbers"),
        ("[input]\ngyro_unit = 'deg'", "gyro_unit: 'deg' is not one of"),
        ("input = 3", "must be a table"),
        ("[input", "not a TOML file"),
    ],
)
def test_config_errors_name_file_and_field(
    demo: dict[str, Any], tmp_path: Path, text: str, says: str
) -> None:
    path = tmp_path / "c.toml"
    path.write_text(text)
    result = invoke("run", "x.csv", "--config", str(path))
    assert result.exit_code == 2
    assert str(path) in result.stderr
    assert re.search(says, result.stderr), result.stderr
    assert demo == {}


@pytest.mark.parametrize(
    ("text", "reset"),
    [("reset = false", False), ("no_reset = true", False), ("no_reset = false", True)],
)
def test_a_switch_by_either_name(
    demo: dict[str, Any], tmp_path: Path, text: str, reset: bool
) -> None:
    path = tmp_path / "c.toml"
    path.write_text(f"[method]\n{text}")
    assert invoke("run", "x.csv", "--config", str(path)).exit_code == 0
    assert demo["reset"] is reset
    assert invoke("run", "x.csv", "--config", str(path), "--reset").exit_code == 0
    assert demo["reset"] is True


def test_missing_config_file(demo: dict[str, Any], tmp_path: Path) -> None:
    result = invoke("run", "x.csv", "--config", str(tmp_path / "none.toml"))
    assert (result.exit_code, "cannot be read" in result.stderr) == (2, True)


# ---- printing ----------------------------------------------------------------------------------


def test_json_is_one_versioned_document(capsys: pytest.CaptureFixture[str]) -> None:
    import numpy as np

    print_json({"x": np.arange(3), "y": np.float64(0.1), "where": Path("a")})
    captured = capsys.readouterr()
    wanted = {"version": 1, "x": [0, 1, 2], "y": 0.1, "where": "a"}
    assert json.loads(captured.out) == wanted
    with pytest.raises(ValueError, match="JSON"):
        print_json({"x": float("nan")})
    with pytest.raises(TypeError):
        print_json({"x": object()})


def test_findings_are_lines_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    start = 5 * 10**9
    findings = [
        Finding("gap", "warning", "hole", 17 * 10**9, 24_400_000_000),
        Finding("unit-inferred", "info", "gyros in deg/s"),
        Finding("stamp", "error", "back", 6 * 10**9, 6 * 10**9),
    ]
    print_findings(findings, start_ns=start)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines() == [
        "warning: [gap] 12.0-19.4 s: hole",
        "info: [unit-inferred] gyros in deg/s",
        "error: [stamp] 1.0 s: back",
    ]
    print_findings(findings, start_ns=start, least="warning")
    assert len(capsys.readouterr().err.splitlines()) == 2
    assert finding_line(findings[1]) == "info: [unit-inferred] gyros in deg/s"


def shown_by_progress(
    capsys: pytest.CaptureFixture[str], *, after_s: float = 0.0, quiet: bool = False
) -> str:
    with progress("reading", total=10, after_s=after_s, quiet=quiet) as advance:
        advance(5)
        deadline = time.monotonic() + (0.0 if after_s or quiet else 5.0)
        shown = ""
        while "50 %" not in shown and time.monotonic() < deadline and sys.stderr.isatty():
            time.sleep(0.01)
            shown += capsys.readouterr().err
    return shown + capsys.readouterr().err


def test_progress_only_on_a_terminal_and_after_a_while(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert shown_by_progress(capsys) == ""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert shown_by_progress(capsys, after_s=60.0) == ""
    assert shown_by_progress(capsys, quiet=True) == ""
    shown = shown_by_progress(capsys)
    assert re.search(r"\r\x1b\[Kreading 50 %  \d+ s", shown)
    assert shown.endswith("\r\x1b[K")
