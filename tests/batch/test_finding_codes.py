"""Bars on findings: the list of codes against the sources, and what a mistyped one says."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import vehnav
from vehnav.batch.finding_codes import CODES
from vehnav.batch.metric_paths import check_metric
from vehnav.errors import ConfigError

SOURCES = Path(vehnav.__file__).parent
COMPOSED = {"f'{what}-beside'": {"gps-beside", "speed-beside"}}
"""Codes that are put together, by the expression."""


def name_of(call: ast.Call) -> str:
    return getattr(call.func, "id", getattr(call.func, "attr", ""))


def makers(trees: list[ast.Module]) -> set[str]:
    """Finding itself and the functions that take a code for one."""
    functions = [
        node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    ]
    takers = {
        f.name
        for f in functions
        if "code" in {a.arg for a in f.args.args}
        and any(isinstance(n, ast.Call) and name_of(n) == "Finding" for n in ast.walk(f))
    }
    return {"Finding"} | takers


def codes_of(node: ast.expr, tree: ast.Module) -> Iterator[str]:
    """The texts that an expression can be; a name stands for all that is assigned to it."""
    if isinstance(node, ast.Constant):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from codes_of(node.body, tree)
        yield from codes_of(node.orelse, tree)
    elif isinstance(node, ast.Name):
        assert node.id == "code", ast.unparse(node)  # of a maker: its callers are read
        for other in ast.walk(tree):
            if isinstance(other, ast.Assign) and ast.unparse(other.targets[0]) == "code":
                yield from codes_of(other.value, tree)
    else:
        yield from COMPOSED[ast.unparse(node)]


def test_the_list_is_that_of_the_sources() -> None:
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in SOURCES.rglob("*.py")]
    names = makers(trees)
    assert {"Finding", "finding_at", "note"} <= names
    found = set()
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and name_of(node) in names and node.args:
                found |= set(codes_of(node.args[0], tree))
    assert found == CODES


def test_a_mistyped_code_is_refused_with_the_nearest() -> None:
    check_metric("findings.axes-contradiction", "bar")
    with pytest.raises(
        ConfigError, match="bar: no finding has the code 'axes-contradicton'; did"
    ) as e:
        check_metric("findings.axes-contradicton", "bar")
    assert "did you mean 'axes-contradiction'?" in str(e.value)
    with pytest.raises(ConfigError, match="no finding has the code 'foo'"):
        check_metric("findings.foo", "bar")
    with pytest.raises(ConfigError, match="no finding has the code ''"):
        check_metric("findings.", "bar")
