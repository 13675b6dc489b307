"""What a table and its META can't both say: another unit, another pose, another rig.

Such data are refused where table and META meet, at `rig import`, and before anything is computed
from a data set that was written earlier. Every limit is relative to the data or to the robot's
nominal model: forces of 1e-8 N are as good as others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import pi

import numpy as np

from identification.arrays import Array, Flags
from rig.dataset import Dataset
from rig.digits import brief
from rig.errors import InputError
from rig.meta import Meta
from rig.models.robot import load_robot
from rig.storage.columns import JOINTS, Values
from rig.yaml.yamlwords import Path, place

# An arm that stands elsewhere than META says is a finding (`pose_error`), up to a few tenths of a
# radian; beyond this its levers are off by half of themselves, and no result speaks of that arm.
_ELSEWHERE_RAD = 0.5
_ALIKE = 0.1  # rad, and as a share: near enough to say what the readings probably are
# Of the largest reading: 24 bits are 6e-8 of a force, and no dynamometer is known to 1e-6;
# an interferometer tells a nanometre in 100 m.
_BEST = {"force": 1e-7, "displacement": 1e-11}
# Units are off by 1e3; simulations of rigs are off by up to 1e2.
_FAR = 1e4
_FARTHEST = 1e12  # uncertainties of a displacement, in which a spring is said to go
_NOISE = 20.0  # standard uncertainties of one sample: the range of a channel that reads but noise


def contradictions(meta: Meta, columns: Mapping[str, Values]) -> Iterator[tuple[Path, str]]:
    """Places in META, and what is wrong there. columns: as of a data set, (n,) each."""
    used = ~columns["discarded"]
    yield from _uncertainties(meta, columns, used)
    if meta.robot == "none":
        yield from _springs(meta, columns, used)
        return
    yield from _joints(meta)
    for pose in meta.poses:
        yield from _pose(meta, columns, used & (columns["pose"] == pose), pose)


def refuse_contradictions(dataset: Dataset) -> None:
    """InputError for a data set that holds some."""
    where = dataset.path or "data set"
    found = list(contradictions(dataset.meta, dataset.columns))
    if found:
        raise InputError("\n".join(f"{where}: META: {place(at)}: {what}" for at, what in found))


# ------------------------------------------------------------------ instruments


def _range(columns: Mapping[str, Values], name: str, rows: Flags) -> float:
    values = np.asarray(columns[name][rows], dtype=np.float64)
    values = values[np.isfinite(values)]
    return float(np.ptp(values)) if values.size else 0.0


def _largest(columns: Mapping[str, Values], name: str, rows: Flags) -> float:
    values = np.abs(np.asarray(columns[name][rows], dtype=np.float64))
    return float(values[np.isfinite(values)].max(initial=0.0))


def _uncertainties(
    meta: Meta, columns: Mapping[str, Values], used: Flags
) -> Iterator[tuple[Path, str]]:
    stated = meta.instruments
    for instrument, unit, u in (
        ("force", "N", stated.force.standard_uncertainty_N),
        ("displacement", "mm", stated.displacement.standard_uncertainty_mm),
    ):
        largest = _largest(columns, f"{instrument}_{unit}", used)
        least = _BEST[instrument] * largest
        if u < least:
            yield (
                ("instruments", instrument, f"standard_uncertainty_{unit}"),
                f"{brief(u)} {unit} is not allowed: {instrument}_{unit} goes up to "
                f"{brief(largest)} {unit}, and no instrument knows one sample that well; wanted: "
                f"{brief(least)} {unit} or more. State what one sample is really uncertain by, and "
                "check the unit of the column.",
            )


# ------------------------------------------------------------------ stiffnesses


def _springs(meta: Meta, columns: Mapping[str, Values], used: Flags) -> Iterator[tuple[Path, str]]:
    """Of a rig without an arm: against the slope of all that was measured in the direction; where
    nothing moved, or the force stood, against what an instrument can tell of its own range."""
    springs = None if meta.simulation is None else meta.simulation.stiffness_N_per_mm
    u_force = meta.instruments.force.standard_uncertainty_N
    u_moved = meta.instruments.displacement.standard_uncertainty_mm
    for name, k in (springs or {}).items():
        rows = used & (columns["direction"] == name)
        force, moved = (_range(columns, n, rows) for n in ("force_N", "displacement_mm"))
        largest = _largest(columns, "force_N", rows)
        soft = moved > 0 and force > _FAR * k * max(moved, _NOISE * u_moved)
        soft |= largest > k * u_moved * _FARTHEST
        # what moves without a load drifts, however stiff the rig
        stiff = force > _NOISE * u_force and k * moved > _FAR * force
        if soft or stiff:
            yield (
                ("simulation", "stiffness_N_per_mm", name),
                f"{brief(k)} N/mm is not allowed: the readings cover {brief(force)} N (up to "
                f"{brief(largest)} N) over {brief(moved)} mm, of which one sample is uncertain by "
                f"{brief(u_moved)} mm; wanted: within a factor of {_FAR:.0f} of the slope that was "
                "measured. Check the units of these numbers and of the columns.",
            )


def _joints(meta: Meta) -> Iterator[tuple[Path, str]]:
    """Of an arm: against the robot's nominal model."""
    stated = None if meta.simulation is None else meta.simulation.joint_stiffness_Nm_per_rad
    for j, k in enumerate(stated or ()):
        nominal = float(load_robot(meta.robot).joint_stiffness[j])
        if not nominal / _FAR <= k <= nominal * _FAR:
            yield (
                ("simulation", "joint_stiffness_Nm_per_rad", j),
                f"{brief(k)} Nm/rad is not allowed: joint {j + 1} of a {meta.robot} has about "
                f"{brief(nominal)} Nm/rad; wanted: within a factor of {_FAR:.0f} of that. "
                "Check the unit.",
            )


# ------------------------------------------------------------------ poses


def _pose(
    meta: Meta, columns: Mapping[str, Values], rows: Flags, pose: str
) -> Iterator[tuple[Path, str]]:
    """Medians of the joint readings against the pose that META states."""
    stated = np.array(meta.poses[pose].q_rad)
    read = np.array([_median(columns, f"q{j}_rad", rows) for j in JOINTS])
    far = np.abs(without_turns(read - stated)) > _ELSEWHERE_RAD  # False where nothing was read
    if not far.any():
        return
    each = ", ".join(
        f"q{j + 1}_rad is {brief(read[j], 3)} rad (META: {brief(stated[j])} rad)"
        for j in np.flatnonzero(far)
    )
    yield (
        ("poses", pose, "q_rad"),
        f"the joints were read elsewhere in pose {pose}, by the median of the columns: {each}; "
        f"allowed: up to {_ELSEWHERE_RAD} rad beside META, whole turns aside. "
        f"{_what_to_do(read, stated, far)}",
    )


def _median(columns: Mapping[str, Values], name: str, rows: Flags) -> float:
    if name not in columns:
        return float("nan")
    values = np.asarray(columns[name][rows], dtype=np.float64)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else float("nan")


def without_turns(angle: Array) -> Array:
    """Angles (...), rad, with whole turns taken away: a joint reads the same pose on either side
    of zero."""
    return np.asarray(angle - 2 * pi * np.round(angle / (2 * pi)))


def _what_to_do(read: Array, stated: Array, far: Flags) -> str:
    """read, stated (6,) rad; far (6,): joints that were read elsewhere."""
    degrees = np.abs(read - np.degrees(stated)) <= _ALIKE * np.abs(np.degrees(stated))
    if np.mean(degrees[far]) > 0.5:
        return "Are these degrees? Convert the columns to rad."
    if np.all(np.abs(without_turns(read + stated))[far] <= _ALIKE):
        return "Are the signs of these columns turned? Correct them."
    alike = np.abs(without_turns(read[:, None] - stated[None, :])) <= _ALIKE
    others = [np.flatnonzero(alike[j] & far) for j in np.flatnonzero(far)]
    if all(len(o) for o in others):
        pairs = zip(np.flatnonzero(far), others, strict=True)
        like = ", ".join(f"q{j + 1}_rad is as META has joint {o[0] + 1}" for j, o in pairs)
        return f"Are columns mixed up ({like})? Rename them."
    return "Correct the pose in META, or the columns."
