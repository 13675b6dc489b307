"""What may be a slip in a table that can be taken all the same: notes of `rig import`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.running import first_rows, stretches
from rig.digits import brief, counted
from rig.meta import Meta
from rig.passes import between_levels
from rig.storage.columns import AXES, JOINTS, NO_STEP, Values

CHANNELS = {
    "joint readings": [f"q{j}_rad" for j in JOINTS],
    "force components": [f"force_{a}_N" for a in AXES],
}
# Of force_N beside its own components: an axis that is askew by 18 degrees, or cross-talk of that
# size, is no alignment any more; gains are known ten times as well.
_ASIDE = 0.05
_GAINS = 5.0  # stated standard deviations of the gain
_SEEN = 20.0  # standard uncertainties of one sample: a force that goes less far has no ratio
_PLAIN = 5.0  # the same, from one level to the next
_SEVERAL = 3  # steps
_CLOCKS = 2.0  # times as fast
_PARTS = 10  # of a stretch without levels


def oddities(meta: Meta, columns: Mapping[str, Values]) -> Iterator[str]:
    """Sentences on columns (n,) of a table that was read whole."""
    yield from incomplete_channels(meta, columns)
    yield from _steps(columns)
    yield from _components(meta, columns)
    yield from _branches(meta, columns)
    yield from _clocks(columns)


def incomplete_channels(meta: Meta, columns: Mapping[str, Values]) -> Iterator[str]:
    """Channels that count only whole, and have some of their columns."""
    for what, names in CHANNELS.items():
        missing = [n for n in names if n not in columns]
        if not 0 < len(missing) < len(names) or (meta.robot == "none" and names[0] == "q1_rad"):
            continue
        verb = "is" if len(missing) == 1 else "are"
        yield f"{', '.join(missing)} {verb} missing: the {what} that are there are not used"


def _steps(columns: Mapping[str, Values]) -> Iterator[str]:
    way = np.flatnonzero(between_levels(columns))
    if way.size:
        yield (
            f"step is empty in {counted(way.size, 'sample')} of held runs, first in sample "
            f"{way[0] + 1}: left out, as on the way from level to level"
        )


# ------------------------------------------------------------------ force and its components


def _components(meta: Meta, columns: Mapping[str, Values]) -> Iterator[str]:
    """How force_N goes with what its components are along the direction."""
    if not all(name in columns for name in CHANNELS["force components"]):
        return
    stated = meta.instruments.force
    allowed = max(_ASIDE, _GAINS * stated.gain_relative_sd)
    vector = np.stack([columns[name] for name in CHANNELS["force components"]], axis=-1)
    there = ~columns["discarded"] & np.isfinite(vector).all(axis=-1)
    for name, unit_vector in meta.directions.items():
        rows = there & (columns["direction"] == name)
        if not rows.any():
            continue
        along = vector[rows] @ np.array(unit_vector)
        force = columns["force_N"][rows]
        if max(np.ptp(along), np.ptp(force)) < _SEEN * stated.standard_uncertainty_N:
            continue
        if np.ptp(along) < _SEEN * stated.standard_uncertainty_N:
            yield (
                f"direction {name}: force_x_N, force_y_N and force_z_N have no force along it, "
                f"while force_N covers {brief(float(np.ptp(force)), 3)} N; force_N counts. Check "
                "the direction in META, and the columns"
            )
            continue
        off = along - along.mean()
        ratio = float(off @ (force - force.mean()) / (off @ off))
        if abs(ratio - 1) > allowed:
            yield (
                f"direction {name}: force_N is {brief(ratio, 3)} times what force_x_N, force_y_N "
                f"and force_z_N are along it (expected: 1 within {100 * allowed:.3g} %); force_N "
                "counts. Check its gain, and the direction in META"
            )


# ------------------------------------------------------------------ clocks


def _clocks(columns: Mapping[str, Values]) -> Iterator[str]:
    """Two clocks of the same runs that do not go alike, from sample to sample."""
    if "session_s" not in columns:
        return
    run = stretches(*(columns[n] for n in ("pose", "direction", "repetition")))
    time, session = np.diff(columns["time_s"]), np.diff(columns["session_s"])
    rows = (np.diff(run) == 0) & (time > 0) & (session > 0)
    if not rows.any():
        return
    ratio = float(np.median(time[rows] / session[rows]))
    if not 1 / _CLOCKS < ratio < _CLOCKS:
        yield (
            f"time_s goes {brief(ratio, 3)} times as fast as session_s: both are in seconds. Check "
            "the unit of the two"
        )


# ------------------------------------------------------------------ branches


def _branches(meta: Meta, columns: Mapping[str, Values]) -> Iterator[str]:
    """Labels that go against the force in most steps of most runs."""
    run, sense = _senses(columns, _PLAIN * meta.instruments.force.standard_uncertainty_N)
    plain = sense != 0
    runs = np.unique(run[plain])
    against = [r for r in runs if sense[run == r].sum() < 0]
    if np.count_nonzero(plain) >= _SEVERAL and 2 * len(against) > len(runs):
        yield (
            f"in {len(against)} of {counted(len(runs), 'run')} the force falls, and what it moves "
            "goes back, along samples labelled loading, or both go up along those labelled "
            "unloading: are the two exchanged? The stiffness is that of loading"
        )


def _senses(columns: Mapping[str, Values], least: float) -> tuple[Ints, Ints]:
    """Of every step from one level of a run to the next, labelled loading or unloading: its run,
    and 1 where size of force and displacement go as the label says, -1 where they go the other way,
    0 where neither is plain: friction, slip and relaxation let a force fall while what it moves
    goes on. least: N. What is called loaded in step 0 is on its way, and left out."""
    way = (columns["branch"] != "zero") & (columns["step"] == 0)
    rows = np.flatnonzero(~columns["discarded"] & ~way)
    if not rows.size:
        return rows, rows
    branch, step = columns["branch"][rows], columns["step"][rows]
    run = stretches(*(columns[n][rows] for n in ("pose", "direction", "repetition")))
    part = _parts(stretches(run, branch), step)
    first = first_rows(run, branch, step, part)
    count = np.diff(np.append(first, rows.size))
    force, moved = (
        np.add.reduceat(columns[n][rows], first) / count for n in ("force_N", "displacement_mm")
    )
    run, branch = run[first], branch[first]
    force = force - _unloaded(run, branch == "zero", force, count)
    label = np.where(branch == "loading", 1, np.where(branch == "unloading", -1, 0))[1:]
    goes = np.diff(np.abs(force))
    onward = np.diff(moved) * np.sign(force[1:] + force[:-1])
    sense = np.sign(goes) * (np.abs(goes) > least) * (np.sign(goes) == np.sign(onward)) * label
    return run[1:], np.where(run[1:] == run[:-1], sense, 0).astype(np.int64)


def _parts(pass_: Ints, step: Ints) -> Ints:
    """(n,) number of the part of its pass, where that has no levels; 0 where it has."""
    first = first_rows(pass_)
    count = np.diff(np.append(first, pass_.size))
    at = np.arange(pass_.size) - first[pass_]
    return np.where(step == NO_STEP, at * _PARTS // count[pass_], 0)


def _unloaded(run: Ints, zero: Flags, force: Array, count: Ints) -> Array:
    """(h,) N: what the force of a run is without load, 0 where that was not read. All (h,)."""
    weight = np.where(zero, count, 0)
    total, often = np.bincount(run, weight * force), np.bincount(run, weight)
    return np.asarray((total / np.maximum(often, 1))[run])
