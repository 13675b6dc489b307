"""The lines that every protocol file written here has, whatever it is to tell."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from numpy.typing import ArrayLike

from identification.times import SETTLE_S
from rig.protocolfile import Settle

# Where no earlier protocol says what counts as settled.
_SETTLE = Settle(
    window_s=SETTLE_S,
    force_slope_N_per_s=0.05,
    force_spread_N=0.3,
    displacement_slope_mm_per_s=0.002,
    displacement_spread_mm=0.01,
    deadline_s=60,
    at_deadline="record",
)


_ANGLE_DIGITS = 6  # of degrees: a hundredth of a micrometre at a metre
_OVER = 1.01  # the widest band about a load that is written


def pose_line(name: str, q: ArrayLike, tcp_mm: ArrayLike) -> str:
    """A pose q (6,) rad with its tool tcp_mm (3,), where somebody else brings the arm. Degrees, as
    the teach pendant and every protocol here; rounded to what no arm can tell."""
    tool = f"tcp_xyz_mm: [{numbers(tcp_mm, 6)}]"
    degrees = np.round(np.rad2deg(q), _ANGLE_DIGITS) + 0.0  # no -0
    return f"  {name}: {{q_deg: [{numbers(degrees, 9)}], {tool}, program: null}}"


def settle_lines(settle: Settle = _SETTLE) -> list[str]:
    """When the arm counts as at rest."""
    written = {k: v if isinstance(v, str) else f"{v:.9g}" for k, v in asdict(settle).items()}
    return ["settle:", *(f"  {k}: {v}" for k, v in written.items())]


def limit_lines(
    top_N: float, displacement_mm: str, *more: str, most_N: float = float("inf")
) -> list[str]:
    """What stops the measurement: a force beyond the largest load top_N, and beyond most_N, which
    was allowed before, if that load is not; a displacement; more: further lines, after these."""
    force = float(round(1.15 * top_N + 5))
    if top_N < most_N / _OVER < force:
        force = most_N
    return [
        "limits:",
        f"  force_N: {{max: {force:.6g}, at: stop}}",
        f"  displacement_mm: {{max: {displacement_mm}, at: stop}}",
        *more,
        "  joint_deviation_deg: {max: 5, at: stop}",
        "  joint_temperature_C: {max: 60, at: stop}",
    ]


def numbers(values: ArrayLike, digits: int) -> str:
    """`1, 2.5, -3`, with so many digits."""
    return ", ".join(f"{v:.{digits}g}" for v in np.asarray(values, dtype=float))
