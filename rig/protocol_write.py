"""The lines that every protocol file written here has, whatever it is to tell."""

from __future__ import annotations

from dataclasses import asdict, fields
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from identification.times import SETTLE_S
from rig.protocolfile import Limit, Limits, Settle

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


# Of the rig, whatever is done with it, where nobody said otherwise before.
_USUAL = Limits(
    displacement_rate_mm_per_s=Limit(max=3, at="warn"),
    joint_deviation_deg=Limit(max=5, at="stop"),
    joint_temperature_C=Limit(max=60, at="stop"),
)


def limit_lines(top_N: float, displacement_mm: float, before: Limits) -> list[str]:
    """What is watched: the force, up to the largest load top_N and a little more; a displacement;
    of the rig itself what is usual. Nothing is allowed that was not before, but for a load that is
    asked for."""
    force = float(round(1.15 * top_N + 5))
    allowed = before.force_N.max if before.force_N is not None else inf
    if top_N < allowed / _OVER < force:
        force = allowed
    far = before.displacement_mm
    watched = {
        "force_N": Limit(max=force, at=before.force_N.at if before.force_N else "stop"),
        "displacement_mm": Limit(
            max=displacement_mm if far is None else min(displacement_mm, far.max),
            at="stop" if far is None else far.at,
        ),
    }
    for f in fields(Limits):
        limit = getattr(before, f.name) or getattr(_USUAL, f.name)
        if limit is not None:
            watched.setdefault(f.name, limit)
    return ["limits:", *(f"  {k}: {{max: {v.max:.6g}, at: {v.at}}}" for k, v in watched.items())]


def numbers(values: ArrayLike, digits: int) -> str:
    """`1, 2.5, -3`, with so many digits."""
    return ", ".join(f"{v:.{digits}g}" for v in np.asarray(values, dtype=float))
