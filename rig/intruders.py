"""`drivers` and `identification` are common names: make sure that they are ours."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from rig.errors import InputError

PACKAGES = ("rig", "drivers", "identification")


def refuse_intruders() -> None:
    """Raises InputError when one of the three packages comes from somewhere else."""
    home = Path(__file__).resolve().parent.parent
    for name in PACKAGES:
        spec = find_spec(name)
        origin = None if spec is None or spec.origin is None else Path(spec.origin).resolve()
        if origin is None or origin.parent.parent != home:
            raise InputError(
                f"the package {name} comes from {origin or 'nowhere'}, not from {home}: another "
                "distribution has installed the same name. Install stiffness-rig into a virtual "
                "environment of its own."
            )
