"""Work over all cores: threads for compiled loops, which leave the interpreter, else processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from vehnav.blas import ONE_THREAD

T = TypeVar("T")
R = TypeVar("R")


def cores() -> int:
    """How many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def by_threads(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """[work(item), ...] in the order of the items, on all cores."""
    with ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(work, items))


def by_processes(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """The same for work that holds the interpreter; ``work`` is a function of a module."""
    todo = list(items)
    if cores() == 1 or len(todo) == 1:
        return [work(item) for item in todo]
    context = multiprocessing.get_context("spawn")
    with (
        _single_threaded_children(),
        ProcessPoolExecutor(min(cores(), len(todo)), mp_context=context) as pool,
    ):
        return list(pool.map(work, todo))


@contextmanager
def _single_threaded_children() -> Iterator[None]:
    """Processes started inside do their linear algebra on one core each: they share the cores."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
