"""Compiled kernels: equal to plain Python bit for bit, never stale, at home everywhere."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import vehnav
from vehnav import kernel

PACKAGE = Path(vehnav.__file__).parent

LOOP = """
from vehnav.kernel import entry_kernel, kernel
from vehnav.trial_formula import formula

@entry_kernel
def loop(n):
    total = 0.0
    for k in range(n):
        total += formula(k)
    return total
"""
FORMULA = """
from vehnav.kernel import kernel

FACTOR = 2.0

@kernel
def formula(k):
    return FACTOR * k
"""
RUN_LOOP = """
import json
from vehnav import kernel, trial_loop
value = trial_loop.loop(4)
stats = getattr(trial_loop.loop, "stats", None)
hits = sum(stats.cache_hits.values()) if stats else 0
folder = kernel._cache_folder("vehnav.trial_loop")
print(json.dumps({"value": value, "hits": hits, "folder": folder and folder.name}))
"""
SIX = 2.0 * (0 + 1 + 2 + 3)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package with a small loop and, in a sibling, the formula that it calls."""
    copied = tmp_path / "source" / "vehnav"
    shutil.copytree(PACKAGE, copied, ignore=shutil.ignore_patterns("__pycache__"))
    (copied / "trial_loop.py").write_text(LOOP)
    (copied / "trial_formula.py").write_text(FORMULA)
    return copied


def python(code: str, *, package: Path = PACKAGE, **environment: str) -> str:
    """What a new process prints that imports ``package``; its warnings are errors."""
    env = {**os.environ, "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    env.pop("NUMBA_DISABLE_JIT", None)
    env.pop("NUMBA_CACHE_DIR", None)
    result = subprocess.run(
        [sys.executable, "-c", code],
        env={**env, **environment}, capture_output=True, text=True, cwd=package.parent,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    return result.stdout


def run_loop(copy: Path, cache: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(python(RUN_LOOP, package=copy, VEHNAV_CACHE_DIR=str(cache)))
    return found


# ---- compiled equals plain ---------------------------------------------------------------------

EVERY_KERNEL = """
import random
from vehnav import earth, rotation
from vehnav.earth import KRASOVSKY, WGS84

draw = random.Random(0)
vec = lambda size: tuple(draw.uniform(-size, size) for _ in range(3))
mat = lambda: tuple(draw.uniform(-1, 1) for _ in range(9))
out = []
for number in range(300):
    a, b, k = vec(10.0), vec(10.0), draw.uniform(-3, 3)
    m, n = mat(), mat()
    size = 10.0 ** draw.uniform(-9, 0.7)
    phi = tuple(size * x for x in vec(1.0))
    lat, h = draw.uniform(-1.55, 1.55), draw.uniform(-100, 9000)
    ellipsoid = WGS84 if number % 2 else KRASOVSKY
    radii = earth.curvature_radii(lat, h, ellipsoid)
    for result in (
        rotation.cross(a, b), rotation.add(a, b), rotation.subtract(a, b), rotation.scale(k, a),
        (rotation.dot(a, b),),
        rotation.mat_vec(m, a), rotation.mat_t_vec(m, a), rotation.mat_mat(m, n),
        rotation.rotation_coefficients(size), rotation.dcm_from_rotvec(phi), radii,
        (earth.normal_gravity(lat, h, ellipsoid),), earth.earth_rate(lat, ellipsoid),
        earth.transport_rate(a, *radii, k),
    ):
        out.extend(float(x).hex() for x in result)
print(type(rotation.cross).__name__)
print("\\n".join(out))
"""


def test_compiled_kernels_equal_plain_python_bit_for_bit() -> None:
    compiled = python(EVERY_KERNEL).splitlines()
    plain = python(EVERY_KERNEL, NUMBA_DISABLE_JIT="1").splitlines()
    assert (compiled[0], plain[0]) == ("CPUDispatcher", "function")
    assert compiled[1:] == plain[1:]
    assert len(plain) > 10_000


def test_every_kernel_of_the_foundation_is_compared() -> None:
    from vehnav import earth, rotation

    for module in (earth, rotation):
        for name, value in vars(module).items():
            if hasattr(value, "py_func"):
                assert f"{module.__name__.split('.')[-1]}.{name}(" in EVERY_KERNEL, name


# ---- the cache ---------------------------------------------------------------------------------


def test_machine_code_is_kept_and_never_stale(copy: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    first = run_loop(copy, cache)
    assert (first["value"], first["hits"]) == (SIX, 0)
    again = run_loop(copy, cache)
    assert (again["value"], again["hits"], again["folder"]) == (SIX, 1, first["folder"])
    # a constant in the sibling's file, which numba's own cache does not look at
    (copy / "trial_formula.py").write_text(FORMULA.replace("FACTOR = 2.0", "FACTOR = 5.0"))
    edited = run_loop(copy, cache)
    assert (edited["value"], edited["hits"]) == (5.0 * SIX / 2.0, 0)
    assert edited["folder"] != first["folder"]


def test_a_cache_that_cannot_be_written_is_done_without(copy: Path, tmp_path: Path) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("a file where the folder should be")
    for _ in range(2):
        found = run_loop(copy, in_the_way / "cache")
        assert found == {"value": SIX, "hits": 0, "folder": None}


def test_old_folders_are_removed_but_for_the_newest(tmp_path: Path) -> None:
    kept_others = kernel.KEPT_FOLDERS - 1
    for age in range(kept_others + 5):
        folder = tmp_path / f"kernels-{age}"
        folder.mkdir()
        (folder / "code.nbi").touch()
        os.utime(folder, (1_000_000 - age, 1_000_000 - age))
    (tmp_path / "something-else").mkdir()
    current = tmp_path / "kernels-current"
    current.mkdir()
    os.utime(current, (0, 0))  # whatever its age
    kernel._prune(current)
    kept = {path.name for path in tmp_path.iterdir()}
    newest = {f"kernels-{age}" for age in range(kept_others)}
    assert kept == {"kernels-current", "something-else"} | newest


def test_a_new_source_prunes(copy: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    for age in range(kernel.KEPT_FOLDERS + 6):
        (cache / f"kernels-old{age}").mkdir(parents=True)
    run_loop(copy, cache)
    assert len(list(cache.iterdir())) == kernel.KEPT_FOLDERS


DIGESTS = """
import json
from vehnav import kernel
print(json.dumps([kernel.source_digest("vehnav.trial_loop"), kernel.source_digest("vehnav.units")]))
"""


def test_digest_follows_the_imports_and_nothing_else(copy: Path) -> None:
    """An edited callee, or a constant behind it, changes it; an edited command does not."""

    def digests() -> list[str]:
        found: list[str] = json.loads(python(DIGESTS, package=copy))
        return found

    first = digests()
    with (copy / "cli" / "main.py").open("a") as file:
        file.write("# edited\n")
    assert digests() == first
    with (copy / "units.py").open("a") as file:
        file.write("SEVEN = 7\n")
    alone = digests()
    assert alone[0] == first[0]
    assert alone[1] != first[1]
    text = (copy / "trial_formula.py").read_text()
    (copy / "trial_formula.py").write_text(f"from vehnav import units\n{text}")
    reached = digests()
    assert reached[0] != alone[0]
    with (copy / "units.py").open("a") as file:
        file.write("EIGHT = 8\n")
    assert digests()[0] != reached[0]


def test_cache_root_follows_the_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("VEHNAV_CACHE_DIR", str(tmp_path / "own"))
    assert kernel.cache_root() == tmp_path / "own"
    monkeypatch.delenv("VEHNAV_CACHE_DIR")
    monkeypatch.setattr(kernel.sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert kernel.cache_root() == tmp_path / "vehnav"
    monkeypatch.setattr(kernel.sys, "platform", "darwin")
    assert kernel.cache_root() == Path.home() / "Library" / "Caches" / "vehnav"
    monkeypatch.setattr(kernel.sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))
    assert kernel.cache_root() == tmp_path / "vehnav"


# ---- without numba -----------------------------------------------------------------------------


def test_without_numba_the_same_source_runs_with_one_warning(copy: Path) -> None:
    code = """
import sys, warnings
sys.modules["numba"] = None
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    from vehnav import rotation, strapdown, trial_loop
    import vehnav.strapdown.enu
print([str(warning.message) for warning in caught])
print(trial_loop.loop(4), rotation.cross((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
"""
    warned, result = python(code, package=copy).splitlines()
    assert warned.count("numba cannot be imported") == 1
    assert warned.count("'") == 2  # one string: one warning
    assert result == f"{SIX} (0.0, 0.0, 1.0)"
