"""What figures are drawn on."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORCE, DISPLACEMENT = "Force in N", "Displacement in mm"  # labels of axes


def blank(width: float, height: float) -> Figure:
    """A figure of its own, in inches, outside pyplot: nothing is kept open, no display needed."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
