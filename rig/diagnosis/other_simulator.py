"""Curves of another simulator, as a table, in place of the six springs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.gap.data import Curve, GapData, Setup
from identification.gap.model.other_springs import springs_along
from rig.arrays import Array
from rig.errors import InputError
from rig.storage.columns import Values
from rig.storage.csvblocks import Block, CsvFile
from rig.storage.csvcells import Reading, parse, shown
from rig.units import MM_PER_M

NUMBERS = ("force_N", "displacement_mm")
WANTED = "pose, direction, force_N, displacement_mm"
# Forces that lie closer, as a part of the curve's range, are one level with the rounding of whoever
# wrote the table: the slope between them would be nothing but that.
SAME_FORCE = 1e-9


def with_curves(data: GapData, csv: Path) -> GapData:
    """With the curves (pose, direction, force_N, displacement_mm) of the data's setups; a rig
    without an arm is as stiff as these say, in place of what META does. Points at one force count
    as their mean, and where that is no small matter a note says so. InputError for a table that
    holds no such curves, or contradicts itself.
    """
    table = _read(csv)
    curves, notes = list[Curve](), list(data.notes)
    for s, setup in enumerate(data.setups):
        curve, apart = _curve(csv, table, setup)
        measured = data.force[data.setup == s]
        notes += _doubts(csv, curve, apart, setup, measured, data.instruments.force)
        curves.append(curve)
    told = replace(data, curves=tuple(curves), notes=tuple(notes))
    return told if data.arm else replace(told, compliance=springs_along(told))


def _doubts(
    csv: Path, curve: Curve, apart: Array, setup: Setup, measured: Array, noise: float
) -> Iterator[str]:
    """What is odd about a curve, whose values at one force are apart (k,) m, beside the forces (n,)
    N that were measured with that noise, N. InputError where it covers too little of them."""
    where = f"direction {setup.direction}" + (f" in pose {setup.pose}" if setup.pose else "")
    low, high = float(measured.min()), float(measured.max())
    first, last = float(curve.force[0]), float(curve.force[-1])
    needed = f"simulated from {first:.4g} to {last:.4g} N, measured from {low:.4g} to {high:.4g} N"
    covered = min(last, high) - max(first, low)
    moves = high - low > _MOVES * noise
    if moves and covered < _THIRD * (high - low):
        raise InputError(
            f"{csv}: {where}: {needed}; wanted: curves over the range of force. Simulate that, too."
        )
    if moves and max(first - low, high - last) > _LITTLE * (high - low):
        yield f"The curve of {where} was {needed}: it was taken to go straight on beyond its ends."
    size = float(np.ptp(curve.displacement))
    if apart.max() > _LITTLE * size:
        at = float(curve.force[apart.argmax()])
        yield (
            f"The curve of {where} has values that are {MM_PER_M * apart.max():.3g} mm apart "
            f"at {at:.4g} N: their mean was taken."
        )
    unloaded = float(curve.at(np.zeros(1))[0])
    if first <= 0 <= last and abs(unloaded) > _LITTLE * size:
        yield (
            f"The curve of {where} shows {MM_PER_M * unloaded:.3g} mm without load, where the "
            "laser reads zero: that counts in what the simulation misses, and in no effect."
        )


_THIRD, _LITTLE = 1 / 3, 0.1  # of the measured range of force; of that, and of the simulated one
_MOVES = 20.0  # standard uncertainties: a force that goes no further stands still


def _read(csv: Path) -> dict[str, Values]:
    with CsvFile(csv) as file:
        _check_names(file)
        readings: dict[str, Reading] = {
            name: "number" if name in NUMBERS else "word" for name in file.names
        }
        parts: dict[str, list[Values]] = {name: [] for name in (*file.names, _LINE)}
        for block in file.blocks():
            columns = parse(file, block, readings)
            for name, values in columns.items():
                if name in NUMBERS:
                    _check_finite(file, block, name, values)
                parts[name].append(values)
            parts[_LINE].append(block.lines)
    return {name: np.concatenate(p) if p else np.empty(0) for name, p in parts.items()}


_LINE = "line of the file"  # no column's name: these have no blanks


def _check_names(file: CsvFile) -> None:
    missing = sorted(set(NUMBERS) - set(file.names))
    if missing:
        raise InputError(f"{file.path}: lacks the column {missing[0]}; wanted: {WANTED}.")
    if "time_s" in file.names:
        raise InputError(
            f"{file.path}: these are readings in time (column time_s), as of a measurement, and no "
            f"simulated curves; wanted: {WANTED}, from a simulator."
        )
    if "branch" in file.names:
        raise InputError(
            f"{file.path}: these curves depend on the path that they were simulated along (branch, "
            "repetition). Give the model itself: --model MODEL.yaml."
        )


def _check_finite(file: CsvFile, block: Block, name: str, values: Values) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        cell = block.cells(bad[0])[file.names.index(name)]
        what = f'"{shown(cell)}"' if cell else "an empty cell"
        unit = name.rpartition("_")[2]
        raise file.error(
            int(block.lines[bad[0]]),
            f"column {name}: {what} is not allowed; wanted: a finite number in {unit}.",
        )


def _curve(csv: Path, table: dict[str, Values], setup: Setup) -> tuple[Curve, Array]:
    """Of a setup, and how far (k,) m its values at one force are apart."""
    mine = np.ones(len(table["force_N"]), dtype=bool)
    for key, value in (("pose", setup.pose), ("direction", setup.direction)):
        if key in table:
            mine &= table[key] == value
    order = np.argsort(table["force_N"][mine], kind="stable")
    force = table["force_N"][mine][order]
    displacement = table["displacement_mm"][mine][order] / MM_PER_M
    new = np.ones(len(force), dtype=bool)
    new[1:] = np.diff(force) > SAME_FORCE * np.ptp(force) if len(force) else True
    level = np.cumsum(new) - 1
    count = np.bincount(level)
    if len(count) < 2:
        raise InputError(
            f"{csv}: {len(force)} rows for pose {setup.pose or '-'}, direction {setup.direction}"
            f"{', all at one force' if len(force) > 1 else ''}; wanted: at least 2 different "
            "forces, over the range of force."
        )
    starts = np.flatnonzero(new)
    apart = np.maximum.reduceat(displacement, starts) - np.minimum.reduceat(displacement, starts)
    mean = np.bincount(level, displacement) / count
    if apart.max() > _CONTRADICTS * np.ptp(mean):
        at = level == apart.argmax()
        lines = ", ".join(str(int(n)) for n in np.sort(table[_LINE][mine][order][at])[:_SHOWN])
        raise InputError(
            f"{csv}: lines {lines}: displacements that are {MM_PER_M * apart.max():.3g} mm apart "
            f"at one force, {force[at][0]:.4g} N (pose {setup.pose or '-'}, direction "
            f"{setup.direction}); wanted: one displacement at every force. Leave the wrong ones "
            "out; of curves that depend on the path give the model itself: --model MODEL.yaml."
        )
    return Curve(np.bincount(level, force) / count, mean), apart


_CONTRADICTS = 0.5  # of all that the curve does: no branches of a loop are so far apart
_SHOWN = 4  # lines
