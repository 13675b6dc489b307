"""Which version of this software is at work."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache
def software_version() -> str:
    """`stiffness-rig 0.1.0`, as stored in every file."""
    try:
        return f"stiffness-rig {version('stiffness-rig')}"
    except PackageNotFoundError:
        return "stiffness-rig (not installed)"
