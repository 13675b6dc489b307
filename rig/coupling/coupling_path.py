"""A path that asks for stiffness: CSV of time, pose, direction and requirement."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.arm import Arm
from identification.when import Schedule, schedule
from rig.arrays import Array
from rig.errors import InputError
from rig.models.model import ArmModel, CouplingSpec
from rig.units import N_PER_MM

_Q = tuple(f"q{i}_rad" for i in range(1, 7))
_DIRECTION = ("direction_x", "direction_y", "direction_z")
_COLUMNS = ("time_s", *_Q, *_DIRECTION, "required_N_per_mm")
_WANTED = (
    "time_s, direction_x, direction_y, direction_z, required_N_per_mm; q1_rad ... q6_rad, all or "
    "none of them"
)


@dataclass(frozen=True, eq=False)
class Path6:
    """time (n,) s, q (n, 6) rad or None (the model's pose throughout), direction (n, 3) in the
    base frame, required (n,) N/m; lines (n,) of the file."""

    name: str
    lines: tuple[int, ...]
    time: Array
    q: Array | None
    direction: Array
    required: Array


def read_path(path: Path) -> Path6:
    """Columns time_s, q1_rad ... q6_rad (all or none), direction_x, _y, _z, required_N_per_mm.

    `#` starts a comment line. Raises InputError with the line and the column.
    """
    try:
        text = path.read_text("utf-8-sig")
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read: {error.strerror or error}. Check the name of the table."
        ) from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read as a UTF-8 table: {error}.") from error
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1)]
    lines = [(i, line) for i, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(f"{path}: no rows; a header and at least one row are wanted.")
    header = [name.strip() for name in next(csv.reader([lines[0][1]]))]
    with_q = any(name in header for name in _Q)
    wanted = [name for name in _COLUMNS if with_q or name not in _Q]
    missing = [name for name in wanted if name not in header]
    if missing:
        many = len(missing) > 1
        raise InputError(
            f"{path}:{lines[0][0]}: the column{'s' * many} {', '.join(missing)} "
            f"{'are' if many else 'is'} missing; the header has {', '.join(header)}. "
            f"Wanted: {_WANTED}."
        )
    places = {name: header.index(name) for name in wanted}
    rows = np.array(
        [[_number(path, i, line, n, places[n]) for n in wanted] for i, line in lines[1:]]
    )
    table = dict(zip(wanted, rows.T, strict=True))
    return Path6(
        str(path),
        tuple(i for i, _ in lines[1:]),
        table["time_s"],
        np.stack([table[n] for n in _Q], axis=-1) if with_q else None,
        np.stack([table[n] for n in _DIRECTION], axis=-1),
        table["required_N_per_mm"] / N_PER_MM,
    )


def run_path(
    model: ArmModel, spec: CouplingSpec, path: Path6, dead_band: float, *, meet: bool = True
) -> Schedule:
    """The schedule of coupling and release; InputError for rows that make no path. meet: whether
    the arms can meet at all; else where they had to couple is infeasible."""
    q = path.q if path.q is not None else np.broadcast_to(model.q, (path.time.size, 6))
    _check_rows(model, path, q)
    try:
        found = schedule(
            model.arm,
            path.time,
            q,
            path.direction,
            path.required,
            beta=spec.beta,
            tool=model.tool,
            kind=spec.kind,
            half=spec.half,
            dead_band=dead_band,
            links=model.links,
            base=model.mounting,
        )
    except ValueError as error:
        raise InputError(f"{path.name}: {error}.") from error
    if meet:
        return found
    alone = ("infeasible" if s == "couple" else s for s in found.states)
    return replace(found, states=tuple(alone))


def _check_rows(model: ArmModel, path: Path6, q: Array) -> None:
    """Refuses the first row that breaks a rule, with its line, value and what is allowed."""
    arm = model.arm
    length = np.linalg.norm(path.direction, axis=1)
    back = np.diff(path.time, prepend=path.time[0]) < 0
    outside = (q < arm.q_min) | (q > arm.q_max)
    checks: list[tuple[NDArray[np.bool_], Callable[[int], str]]] = [
        (
            path.required < 0,
            lambda i: (
                f"required_N_per_mm is {path.required[i] * N_PER_MM:g} N/mm; "
                "wanted: at least 0 N/mm"
            ),
        ),
        (back, lambda i: f"time_s goes back to {path.time[i]:g} s; wanted: rows in order of time"),
        (
            np.abs(length - 1) > 1e-3,
            lambda i: (
                f"direction_x, _y, _z have length {length[i]:.6g}; "
                "wanted: a unit vector in the base frame"
            ),
        ),
        (np.asarray(outside.any(axis=1)), lambda i: _outside(arm, q[i])),
    ]
    for broken, says in checks:
        if broken.any():
            i = int(np.argmax(broken))
            raise InputError(f"{path.name}:{path.lines[i]}: {says(i)}.")


def _outside(arm: Arm, q: Array) -> str:
    j = int(np.argmax((q < arm.q_min) | (q > arm.q_max)))
    return (
        f"q{j + 1}_rad is {q[j]:g} rad; wanted: {arm.q_min[j]:.4g} to {arm.q_max[j]:.4g} rad, "
        f"the joint limits of {arm.name}"
    )


def _number(path: Path, line_number: int, line: str, column: str, place: int) -> float:
    cells = next(csv.reader([line]))
    cell = cells[place].strip() if place < len(cells) else ""
    try:
        value = float(cell)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f'{path}:{line_number}: {column} is "{cell}"; wanted: a finite number.')
    return value
