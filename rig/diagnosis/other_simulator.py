"""Curves of another simulator, as a table, in place of the six springs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.gap.data import GapData, Setup
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
    """Displacement that the curves (pose, direction, force_N, displacement_mm) give per sample.

    Straight between the points and beyond the ends; points at one force count as their mean.
    InputError for a table that holds no such curves.
    """
    table = _read(csv)
    simulated = np.empty(len(data.force))
    for s, setup in enumerate(data.setups):
        force, displacement = _curve(csv, table, setup)
        rows = data.setup == s
        simulated[rows] = _along(data.force[rows], force, displacement)
    return replace(data, simulated=simulated)


def _read(csv: Path) -> dict[str, Values]:
    with CsvFile(csv) as file:
        _check_names(file)
        readings: dict[str, Reading] = {
            name: "number" if name in NUMBERS else "word" for name in file.names
        }
        parts: dict[str, list[Values]] = {name: [] for name in file.names}
        for block in file.blocks():
            columns = parse(file, block, readings)
            for name, values in columns.items():
                if name in NUMBERS:
                    _check_finite(file, block, name, values)
                parts[name].append(values)
    return {name: np.concatenate(p) if p else np.empty(0) for name, p in parts.items()}


def _check_names(file: CsvFile) -> None:
    missing = sorted(set(NUMBERS) - set(file.names))
    if missing:
        raise InputError(f"{file.path}: lacks the column {missing[0]}; wanted: {WANTED}.")
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


def _curve(csv: Path, table: dict[str, Values], setup: Setup) -> tuple[Array, Array]:
    """Forces (n,) N, ascending and distinct, and displacements (n,) m of a setup."""
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
    return np.bincount(level, force) / count, np.bincount(level, displacement) / count


def _along(force: Array, f: Array, u: Array) -> Array:
    """Linear between the curve's points, straight on beyond its ends."""
    inner = np.interp(force, f, u)
    below = u[0] + (force - f[0]) * (u[1] - u[0]) / (f[1] - f[0])
    above = u[-1] + (force - f[-1]) * (u[-1] - u[-2]) / (f[-1] - f[-2])
    return np.where(force < f[0], below, np.where(force > f[-1], above, inner))
