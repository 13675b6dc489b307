"""From second values to curves: where the assumptions of the evaluation sit.

1. Discarded samples do not count. A sample that the procedure marked as unsettled counts only
   where its level has no settled one, and there in the later half. A table that does not say what
   is settled: the first half of every hold is left out, because the arm creeps on after the screw
   has stopped; and samples that it has under the name of the level they leave count to the next
   one, where they lead. Repetitions that were taken up again midway count only where their setup
   has no others.
2. Zero lines. An amplifier drifts: between neighbouring zero-load plateaus of a run its zero is
   taken as a straight line over time and subtracted; before the first and after the last plateau
   it keeps its value. With a plateau on one side only, that one counts. Of a plateau that the load
   was still on its way to, the later half counts. The uncertainty of the line is part of every
   level's. A run without plateaus is taken as it is, and said to be so.
3. Datum. Displacement counts from the zero-load plateau before the run, whether the laser was
   zeroed once (`datum: setup`) or before each run: what a run did not load is no deflection under
   its load. How far the plateaus of the repetitions lie apart is noted. The plateau after the run
   is not used for it: what remains there may be the arm's (a joint that gave way).
4. A level's uncertainty is the scatter of its samples' mean and the stated uncertainty of a
   sample, in quadrature: the stated one is common to a hold and does not average out.
5. A recording that was not held at levels (no steps, or force running through half of its range
   within one and not coming to rest there) is cut at its turning points into passes of rising
   (`loading`) and falling force (`unloading`), and each pass into bins of equal width in force. If
   there is but one repetition, the cycles count as repetitions, neighbouring ones taken together
   where there are many: their errors are not independent.

No threshold here is absolute; all refer to ranges of the data or to stated uncertainties.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from identification.curve import Curve, Point
from identification.running import stretches
from identification.stairs import steps_of_stairs
from identification.turns import turning_points
from identification.ways import leading_on
from rig.arrays import Array
from rig.digits import counted
from rig.measurements import Measurements
from rig.passes import TURN, between_levels, binned, is_held
from rig.runs import (
    Run,
    blocks,
    ends_of_loading,
    left_out,
    of_setup,
    of_stitched,
    said_of_skipped,
    said_of_stitched,
    setups,
    stitched,
)
from rig.units import M_PER_MM

MOST_REPETITIONS = 50  # into which the cycles of a recording are gathered


@dataclass(frozen=True)
class _Plateau:
    """A zero-load hold: its middle in time, mean and standard uncertainty of the mean."""

    time: float
    force: float
    displacement: float
    u_force: float
    u_displacement: float


@dataclass(frozen=True)
class _Stated:
    """Standard uncertainty of one sample, N and m."""

    force: float
    displacement: float


def curves(dataset: Measurements) -> dict[tuple[str, str], Curve]:
    """(pose, direction) -> curve, in the order of measurement; pose "" without an arm."""
    stated = _Stated(
        dataset.meta.instruments.force.standard_uncertainty_N,
        dataset.meta.instruments.displacement.standard_uncertainty_mm * M_PER_MM,
    )
    result: dict[tuple[str, str], Curve] = {}
    torn = stitched(dataset.columns)
    whole = left_out(dataset.columns, of_stitched(dataset.columns, torn))
    way = between_levels(whole)
    columns = left_out(whole, way)
    for (pose, direction), taken in setups(columns):
        runs = [_leading_on(run, stated) for run in _numbered(taken, stated)]
        points: list[Point] = []
        notes: list[str] = []
        if (pose, direction) in torn:
            repetitions, others = torn[pose, direction]
            notes.append(said_of_stitched(repetitions, others=others))
        if _bare(taken) and not _bare(runs):
            notes.append("No steps are numbered; the levels at which the load stands were found.")
        lost = int(way[of_setup(columns, pose, direction)].sum())
        if lost:
            notes.append(f"{counted(lost, 'sample')} of held runs without a step: left out.")
        held = is_held([(r.branch, r.step, r.force, r.displacement) for r in runs])
        zeros = [_plateaus(run, stated) for run in runs]
        if held:
            for run, plateaus in zip(runs, zeros, strict=True):
                points += _levels(_zeroed(run, plateaus), run, plateaus, stated)
        else:
            points, note = _bins(runs, zeros, stated)
            notes.append(note)
        notes += _notes(runs, zeros, dataset.meta.datum)
        notes += said_of_skipped(dataset.events, pose, direction)
        result[pose, direction] = Curve(
            pose,
            direction,
            tuple(dataset.meta.directions[direction]),
            tuple(points),
            dataset.meta.instruments.force.gain_relative_sd,
            dataset.meta.instruments.displacement.gain_relative_sd,
            origin=all(zeros),
            held=held,
            ends=_ends(dataset, pose, direction),
            notes=tuple(notes),
        )
    return result


def _ends(dataset: Measurements, pose: str, direction: str) -> frozenset[int]:
    """Steps at which loading ended before the force had come to them."""
    columns = dataset.columns
    mine = of_setup(columns, pose, direction)
    ends = ends_of_loading(columns, dataset.events)
    return frozenset(
        step
        for at, step, recorded in ends
        if recorded and mine[at] and not columns["discarded"][at]
    )


def _bare(runs: list[Run]) -> bool:
    """Whether no step of any run bears a number."""
    return all(bool(np.all(run.step < 0)) for run in runs)


def _numbered(runs: list[Run], stated: _Stated) -> list[Run]:
    """The runs with the steps of staircases numbered that bear no numbers; samples without a value
    like the one before."""
    there = [np.isfinite(run.force) & np.isfinite(run.displacement) for run in runs]
    if not _bare(runs) or not all(read.any() for read in there):
        return runs
    values = [(r.force[read], r.displacement[read]) for r, read in zip(runs, there, strict=True)]
    found = steps_of_stairs(values, (stated.force, stated.displacement))
    if found is None:
        return runs
    out = []
    for run, read, (step, at) in zip(runs, there, found, strict=True):
        like = np.maximum(np.cumsum(read) - 1, 0)
        branch = run.branch[np.flatnonzero(read)[at]]
        out.append(replace(run, step=step[like], branch=branch[like]))
    return out


def _leading_on(run: Run, stated: _Stated) -> Run:
    """The run with samples that a table has under the name of the level they leave, on their way to
    the next one, under the name of that. The procedure marks what is settled, and names no way."""
    branch, step = run.branch.copy(), run.step.copy()
    read = np.flatnonzero(np.isfinite(run.force) & np.isfinite(run.displacement))
    if run.settled is not None or not read.size:
        return run
    hold = stretches(branch, step)
    _, named = np.unique(hold[read], return_inverse=True)
    sd = stated.force, stated.displacement
    for leaves, b in leading_on(run.force[read], run.displacement[read], sd, named):
        way = slice(read[leaves], read[b])
        branch[way], step[way] = branch[read[b]], step[read[b]]
    return replace(run, branch=branch, step=step)


def _settled(run: Run, block: slice) -> NDArray[np.intp]:
    """Rows of a hold that count (assumption 1), those without a value left out."""
    rows = np.arange(block.start, block.stop)
    if run.settled is not None and run.settled[rows].any():
        rows = rows[run.settled[rows]]
    else:
        rows = rows[rows.size // 2 :]
    valid = np.isfinite(run.force[rows]) & np.isfinite(run.displacement[rows])
    return rows[valid]


def _mean(values: Array, stated: float) -> tuple[float, float]:
    """Mean, and the standard uncertainty of the mean from the scatter (one sample: as stated)."""
    if values.size == 0:
        return float("nan"), stated
    if values.size == 1:
        return float(values[0]), stated
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(values.size))


def _plateaus(run: Run, stated: _Stated) -> list[_Plateau]:
    """The run's zero-load holds; all their samples count, since nothing creeps there that the
    load has moved before the run; but not the way down, where that was recorded under their name:
    then the later half."""
    found, still = [], _STILL * float(np.nanmax(np.abs(run.force), initial=0.0))
    for block in blocks(run):
        if run.branch[block.start] != "zero":
            continue
        rows = np.arange(block.start, block.stop)
        rows = rows[np.isfinite(run.force[rows]) & np.isfinite(run.displacement[rows])]
        if rows.size and np.ptp(run.force[rows]) > still:
            rows = rows[rows.size // 2 :]
        if rows.size:
            force, u_force = _mean(run.force[rows], stated.force)
            displacement, u_displacement = _mean(run.displacement[rows], stated.displacement)
            time = float(run.time[rows].mean())
            found.append(_Plateau(time, force, displacement, u_force, u_displacement))
    return found


_STILL = 0.05  # of the largest force of the run: no load is further from none


def _zeroed(run: Run, plateaus: list[_Plateau]) -> Run:
    """Force from the zero line, displacement from the first plateau (assumptions 2, 3)."""
    if not plateaus:
        return run
    line = np.interp(run.time, [p.time for p in plateaus], [p.force for p in plateaus])
    first = plateaus[0].displacement
    return replace(run, force=run.force - line, displacement=run.displacement - first)


def _zero_uncertainty(plateaus: list[_Plateau], time: float) -> tuple[float, float]:
    """Of the force's zero line at a time, and of the displacement's zero; N, m."""
    if not plateaus:
        return 0.0, 0.0
    times = [p.time for p in plateaus]
    shares = [np.interp(time, times, np.eye(len(times))[i]) for i in range(len(times))]
    squares = sum((s * p.u_force) ** 2 for s, p in zip(shares, plateaus, strict=True))
    return float(np.sqrt(squares)), plateaus[0].u_displacement


def _levels(zeroed: Run, run: Run, plateaus: list[_Plateau], stated: _Stated) -> Iterator[Point]:
    before = 0.0
    for block in blocks(run):
        rows = _settled(run, block)
        force, scatter_force = _mean(zeroed.force[rows], stated.force)
        displacement, scatter_displacement = _mean(zeroed.displacement[rows], stated.displacement)
        branch = str(run.branch[block.start])
        if branch == "cycle":  # held, and not said in which sense
            branch = "loading" if abs(force) >= abs(before) else "unloading"
        before = force
        time = float(run.time[block].mean())
        zero_force, zero_displacement = _zero_uncertainty(plateaus, time)
        yield Point(
            run.repetition,
            branch,
            int(run.step[block.start]),
            force,
            displacement,
            float(np.hypot(np.hypot(scatter_force, stated.force), zero_force)),
            float(np.hypot(np.hypot(scatter_displacement, stated.displacement), zero_displacement)),
            rows.size,
        )


def _bins(runs: list[Run], zeros: list[list[_Plateau]], stated: _Stated) -> tuple[list[Point], str]:
    """Points of a continuous recording (assumption 5), and the sentence that says so."""
    loaded = []
    for run, plateaus in zip(runs, zeros, strict=True):
        mask = (run.branch != "zero") & np.isfinite(run.force) & np.isfinite(run.displacement)
        z = _zeroed(run, plateaus)
        loaded.append((run.repetition, run.branch[mask], z.force[mask], z.displacement[mask]))
    forces = np.concatenate([force for _, _, force, _ in loaded])
    if forces.size == 0:
        return [], "There are no loaded samples."
    low, high = float(forces.min()), float(forces.max())
    pieces = [
        (repetition, _sense(str(branch[piece.start]), force[piece]), force[piece], moved[piece])
        for repetition, branch, force, moved in loaded
        for piece in _passes(branch, force, high - low)
    ]
    together = -(-len(pieces) // (2 * MOST_REPETITIONS))  # cycles in a repetition
    points = [
        Point(
            i // (2 * together) + 1 if len(runs) == 1 else repetition,
            word,
            number,
            f,
            u,
            stated.force,
            stated.displacement,
            n,
        )
        for i, (repetition, word, force, moved) in enumerate(pieces)
        for number, f, u, n in binned(force, moved, low, high)
    ]
    note = (
        f"A continuous recording of {counted(forces.size, 'sample')}: cut into {len(pieces)} "
        f"pass{'es' if len(pieces) != 1 else ''} at its turning points and binned by force; "
        "rising force counts as loading"
    )
    if len(runs) > 1 or len(pieces) == 1:
        return points, note + "."
    many = "every cycle" if together == 1 else f"every {together} cycles"
    return points, f"{note}, {many} as a repetition."


def _passes(branch: NDArray[np.str_], force: Array, span: float) -> Iterator[slice]:
    """Stretches of one branch; those called `cycle` are cut at their turning points."""
    edges = [0, *(int(i) + 1 for i in np.flatnonzero(branch[1:] != branch[:-1])), force.size]
    for a, b in pairwise(edges):
        if branch[a] != "cycle":
            yield slice(a, b)
            continue
        turns = [a, *(a + t for t in turning_points(force[a:b], TURN * span)), b]
        yield from (slice(i, j) for i, j in pairwise(turns) if j > i)


def _sense(branch: str, force: Array) -> str:
    if branch != "cycle":
        return branch
    return "loading" if force[-1] >= force[0] else "unloading"


def _lacking(repetitions: list[int], runs: int) -> str:
    """Which of so many runs have no zero line."""
    if len(repetitions) == runs:
        return "No run has a zero-load plateau"
    *first, last = map(str, repetitions)
    if not first:
        return f"Repetition {last} has no zero-load plateau"
    return f"Repetitions {', '.join(first)} and {last} have no zero-load plateau"


def _notes(runs: list[Run], zeros: list[list[_Plateau]], datum: str) -> list[str]:
    """What the zero lines were made of, in sentences."""
    without = [r.repetition for r, z in zip(runs, zeros, strict=True) if not z]
    if without:
        return [f"{_lacking(without, len(runs))}: force and displacement are taken as measured."]
    single = sum(1 for z in zeros if len(z) == 1)
    notes = []
    if single:
        notes.append(
            f"{single} of {len(runs)} runs have one zero-load plateau: "
            "a drift of the force within them can't be seen."
        )
    if datum == "setup" and len(zeros) > 1:
        firsts = [z[0].displacement for z in zeros]
        apart = (max(firsts) - min(firsts)) / M_PER_MM
        notes.append(
            f"The unloaded positions before the repetitions lie {_length(apart)} apart; "
            "each repetition counts from its own."
        )
    return notes


def _length(mm: float) -> str:
    """With no more digits than anybody reads a laser by."""
    return "less than 0.001 mm" if 0 < mm < _LEAST_MM else f"{mm:.2g} mm"


_LEAST_MM = 0.001
