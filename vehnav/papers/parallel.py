"""Work over all cores: threads for compiled loops, which leave the interpreter, else processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import TypeVar

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
    with ProcessPoolExecutor(min(cores(), len(todo)), mp_context=context) as pool:
        return list(pool.map(work, todo))
