"""Whether a table's columns are in the units and signs that META speaks of. Told, not refused:
simulations are off by a lot at times. What no simulation is off by `rig.contradictions` refuses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, log

import numpy as np

from identification.arm import tool_offset
from identification.arrays import Flags
from identification.slips import FAR, LINE, slip
from rig.digits import brief
from rig.measurements import Stated
from rig.models.robot import load_robot
from rig.runs import of_setup
from rig.storage.columns import Values
from rig.units import MM_PER_M, N_PER_MM

_SEEN = 20.0  # standard uncertainties of one sample: a channel that goes less far has no slope
_U_LOG_FACTOR = 0.2  # of a stiffness beside a simulation that is not in doubt otherwise


def wrong_sign(meta: Stated, columns: Mapping[str, Values]) -> Iterator[str]:
    """A sentence on every pose and direction whose stiffness is below 0. columns: (n,) each, as of
    a data set."""
    for where, k, _ in _slopes(meta, columns):
        if k < 0:
            yield (
                f"{where}: displacement_mm falls while force_N rises, {brief(k, 3)} N/mm. Both "
                "count along the direction in META: turn the sign of the one that does not"
            )


def off_scale(meta: Stated, columns: Mapping[str, Values]) -> Iterator[str]:
    """A sentence on every pose and direction whose stiffness is of another order than META's
    simulation says. columns: (n,) each, as of a data set."""
    for where, k, simulated in _slopes(meta, columns):
        if k < 0 or not (k * FAR < simulated < inf or k > FAR * simulated):
            continue
        units = slip(log(k / simulated), _U_LOG_FACTOR)
        hint = "" if units is None else f" Are these {units}?"
        yield (
            f"{where}: {brief(k, 3)} N/mm, while META's simulation says {brief(simulated, 3)} "
            f"N/mm.{hint} Check the units of force_N (N) and displacement_mm (mm), and the "
            "stiffness in META"
        )


def _slopes(meta: Stated, columns: Mapping[str, Values]) -> Iterator[tuple[str, float, float]]:
    """Of every pose and direction: its name, and its stiffness in N/mm as measured and as META
    simulates it; without those that show none."""
    there = ~columns["discarded"] & np.isfinite(columns["force_N"].astype(float))
    there &= np.isfinite(columns["displacement_mm"].astype(float))
    setups = zip(columns["pose"][there].tolist(), columns["direction"][there].tolist(), strict=True)
    for pose, direction in dict.fromkeys(setups):
        k = _slope(meta, columns, there & of_setup(columns, pose, direction))
        if k is not None:
            name = " ".join(filter(None, (pose, direction)))
            yield name, k, _simulated(meta, pose, direction)


def _slope(meta: Stated, columns: Mapping[str, Values], rows: Flags) -> float | None:
    """N/mm: of the force over the displacement in the rows (n,), by least squares; None where one
    of the two stands, or does not go with the other. Below 0 only where force and displacement go
    apart from the first sample on: behind a peak a force falls while the stroke goes on."""
    force, moved = (columns[n][rows].astype(float) for n in ("force_N", "displacement_mm"))
    stated = meta.instruments
    if np.ptp(force) < _SEEN * stated.force.standard_uncertainty_N:
        return None
    if np.ptp(moved) < _SEEN * stated.displacement.standard_uncertainty_mm:
        return None
    sense = float((force - force[0]) @ (moved - moved[0]))
    force, moved = force - force.mean(), moved - moved.mean()
    square, product, own = float(force @ force), float(force @ moved), float(moved @ moved)
    alike = product**2 > LINE * square * own and product * sense > 0
    return square / product if alike else None


def _simulated(meta: Stated, pose: str, direction: str) -> float:
    """N/mm: what META's simulation says; nan without one, inf where no joint gives way."""
    simulation = meta.simulation
    if simulation is None:
        return float("nan")
    if simulation.stiffness_N_per_mm is not None:
        return float(simulation.stiffness_N_per_mm[direction])
    where = meta.poses[pose]
    tool = tool_offset(np.array(where.tcp_xyz_mm) / MM_PER_M)
    lever = load_robot(meta.robot).jacobian(where.q_rad, tool)[:3].T @ meta.directions[direction]
    compliance = float(np.sum(lever**2 / np.array(simulation.joint_stiffness_Nm_per_rad)))
    return N_PER_MM / compliance if compliance > 0 else inf
