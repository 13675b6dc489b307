"""Processes that a test has started."""

from __future__ import annotations

from contextlib import suppress

import psutil


def children_running(module: str) -> list[int]:
    """Numbers of those that run a module; what ends while one looks runs no longer."""
    found = []
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if module in child.cmdline():
                found.append(child.pid)
    return found
