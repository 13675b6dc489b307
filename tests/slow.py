"""Cases of a test that takes many seconds each: a few always, the others with -m slow."""

from __future__ import annotations

from collections.abc import Container, Iterable
from typing import Any

import pytest


def slow_ones(cases: Iterable[Any], slow: Container[Any]) -> list[Any]:
    """The cases for `parametrize`, marked where they are among the slow ones; a tuple of several
    values goes by its first."""
    out = []
    for case in cases:
        values = case if isinstance(case, tuple) else (case,)
        out.append(pytest.param(*values, marks=[pytest.mark.slow] if values[0] in slow else []))
    return out
