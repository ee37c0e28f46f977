"""The console command keeps the linear algebra on one core, unless the user says otherwise."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from vehnav.blas import ONE_THREAD, stay_on_one_thread

TOLD = "import json, os; from vehnav.cli import main; main.cli.main = lambda **_: None; main.main()"


def test_the_command_sets_what_is_not_set():
    free = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    shown = subprocess.run(
        [sys.executable, "-c", f"{TOLD}; print(json.dumps(dict(os.environ)))"],
        env={**free, "OMP_NUM_THREADS": "3"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = json.loads(shown.stdout)
    assert {name: found[name] for name in ONE_THREAD} == {**ONE_THREAD, "OMP_NUM_THREADS": "3"}


@pytest.mark.parametrize("name", list(ONE_THREAD))
def test_what_the_user_says_stays(monkeypatch, name):
    monkeypatch.setattr(os, "environ", {name: "4"})
    stay_on_one_thread()
    assert os.environ[name] == "4"
