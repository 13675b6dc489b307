"""Independent parts of a computation side by side: numpy lets go of the interpreter while it works
on blocks of this size."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

_Out = TypeVar("_Out")
_MOST = 4


def side_by_side(function: Callable[..., _Out], *items: Iterable[Any]) -> list[_Out]:
    """`list(map(function, *items))`, in threads; the order is kept."""
    return list(_pool(os.getpid()).map(function, *items))


@cache
def _pool(process: int) -> ThreadPoolExecutor:
    """Of a process: a fork has the object of its parent, but none of the threads."""
    return ThreadPoolExecutor(min(_MOST, os.cpu_count() or 1), f"gap-{process}")
