"""How good the data are: punctuality, invalid values, drifts, what was discarded or skipped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from identification.running import first_rows
from rig.arrays import Array
from rig.dataset import Dataset
from rig.measurements import Measurements
from rig.zeroing import tared_under_load

# What an operator or a device did that a reader of the results should know.
NOTABLE = (
    "band_not_reached",
    "behind",
    "device_failed",
    "limit",
    "no_value",
    "not_settled",
    "note",
    "pause",
    "pose_accepted",
    "repetition_redone",
    "resumed",
    "step_left_out",
    "stopped",
    "tared_under_load",
    "top",
    "touched",
    "unloaded_elsewhere",
    "values_lost",
)
MOST_EVENTS = 40
STILL = 0.05  # of a run's span of force: a zero-load hold moves by less, unless something is wrong
_HELD = ("loading", "unloading")
_LEVEL = ("pose", "direction", "repetition", "branch", "step")


class Recorded(Measurements, Protocol):
    """What the functions here ask of a data set that `rig analyze` reads, too."""

    @property
    def used(self) -> NDArray[Any]:
        """(n,) bool: samples that were not discarded."""


@dataclass(frozen=True)
class Plateau:
    """One zero-load hold: middle in time s, mean force N and displacement mm."""

    time: float
    force: float
    displacement: float


@dataclass(frozen=True)
class RunZeros:
    """The zero-load holds of one run, in the order of measurement.

    span_N: between the largest and the smallest force of the run; 0 if it holds no load.
    under_load: it looks as if it was tared while the screw still pressed.
    """

    pose: str
    direction: str
    repetition: int
    plateaus: tuple[Plateau, ...]
    span_N: float = 0.0
    under_load: bool = False

    @property
    def change_N(self) -> float | None:
        """Force at zero load: last hold minus first one; None with fewer than two."""
        if len(self.plateaus) < 2:
            return None
        return self.plateaus[-1].force - self.plateaus[0].force

    @property
    def drift_N_per_min(self) -> float | None:
        """The same per minute."""
        change = self.change_N
        if change is None:
            return None
        minutes = (self.plateaus[-1].time - self.plateaus[0].time) / 60.0
        return change / minutes if minutes > 0 else None


@dataclass(frozen=True)
class Quality:
    """zeros: run by run; facts: as JSON, units in the keys, null for what was not recorded."""

    zeros: tuple[RunZeros, ...]
    facts: dict[str, Any]


def assess(dataset: Dataset) -> Quality:
    """All that a data set says of its own quality. Never fails: what is not there is null."""
    zeros = zeros_of(dataset)
    used = dataset.used
    unsettled = unsettled_levels(dataset)
    facts: dict[str, Any] = {
        "samples": dataset.rows,
        "used": int(used.sum()),
        "discarded": int((~used).sum()),
        "discards": _discards(dataset),
        "duration_s": _duration(dataset),
        "lateness_s": _lateness(dataset),
        "slots_missed": slots_missed(dataset),
        "clock": next((d["clock"] for d in dataset.devices.values() if "clock" in d), None),
        "devices": _devices(dataset),
        "unsettled_levels": None if unsettled is None else unsettled[0],
        "force_zero": _force_zero(zeros),
        "displacement_zero": _displacement_zero(zeros),
        "temperature_C": _temperature(dataset),
        "events": _events(dataset),
    }
    return Quality(zeros, facts)


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]


def _lateness(dataset: Dataset) -> dict[str, float] | None:
    if "lateness_s" not in dataset.columns:
        return None
    late = _finite(dataset.columns["lateness_s"].astype(float))
    if late.size == 0:
        return None
    median, p95, top = np.quantile(late, [0.5, 0.95, 1.0])
    return {"median": float(median), "p95": float(p95), "max": float(top)}


def _total(dataset: Recorded, column: str) -> int | None:
    if column not in dataset.columns:
        return None
    return int(_finite(dataset.columns[column].astype(float)).sum())


def _devices(dataset: Dataset) -> list[dict[str, Any]]:
    columns, found = dataset.columns, []
    for name in dataset.devices:
        if f"{name}_count" not in columns:
            continue
        valid, invalid = int(columns[f"{name}_count"].sum()), _total(dataset, f"{name}_invalid")
        ages = _finite(columns.get(f"{name}_age_s", np.array([])).astype(float))
        empty = int((columns[f"{name}_count"] == 0).sum())
        found.append(
            {
                "name": name,
                "values": valid,
                "invalid": invalid,
                "samples_without_value": empty,
                "oldest_value_s": float(ages.max()) if ages.size else None,
            }
        )
    return found


def _discards(dataset: Dataset) -> list[dict[str, Any]]:
    return [
        {"reason": str(e.get("reason", e["text"])), "samples": int(e["last"]) - int(e["first"]) + 1}
        for e in dataset.events
        if e["kind"] == "discard"
    ]


def slots_missed(dataset: Recorded) -> int | None:
    """Sampling slots of which no row was made; None where nothing says so."""
    return _total(dataset, "slots_missed")


def unsettled_levels(dataset: Recorded) -> tuple[int, int] | None:
    """Held levels that had not settled when they were sampled, and held levels in all; None where
    nothing says what settled is.

    Not settled is a level of which no sample counts as settled, and one whose settling ended at its
    deadline: older files mark what was sampled after that as settled.
    """
    columns = dataset.columns
    if "settled" not in columns:
        return None
    held = dataset.used & np.isin(columns["branch"], _HELD) & (columns["step"] > 0)
    level = np.zeros(int(held.sum()), dtype=np.int64)
    for key in _LEVEL:
        _, number = np.unique(columns[key][held], return_inverse=True)
        level = level * (int(number.max(initial=0)) + 1) + number
    settled = columns["settled"][held] == 1
    late = _rows_at_deadlines(dataset)[held]
    open_ = np.union1d(np.setdiff1d(level, level[settled]), level[late])
    return int(open_.size), int(np.unique(level).size)


def _rows_at_deadlines(dataset: Recorded) -> NDArray[np.bool_]:
    """(n,): the last sample of a settling that ended at its deadline. Where the step was measured
    anew after that, this sample is among the discarded ones."""
    columns = dataset.columns
    found = np.zeros(len(columns["step"]), dtype=bool)
    for event in dataset.events:
        row = int(event.get("sample", 0)) - 1
        if event["kind"] == "not_settled" and 0 <= row < found.size:
            found[row] = event.get("step") == columns["step"][row]
    return found


def zeros_of(dataset: Recorded) -> tuple[RunZeros, ...]:
    """Zero-load holds by run, from the samples in use that have both values."""
    return tuple(_zeros(dataset))


def _zeros(dataset: Recorded) -> Iterator[RunZeros]:
    columns = dataset.columns
    rows = np.flatnonzero(dataset.used)
    if rows.size == 0:
        return
    time = columns["session_s"] if "session_s" in columns else columns["time_s"]
    place = [columns[k][rows] for k in ("pose", "direction", "repetition")]
    for first, last in _stretches(*place):
        mine = rows[first:last]
        zero = columns["branch"][mine] == "zero"
        span = 0.0 if zero.all() else _span(columns["force_N"][mine])
        plateaus = tuple(
            _plateau(dataset, time, mine[a:b], span) for a, b in _stretches(zero) if zero[a]
        )
        known = tuple(p for p in plateaus if p is not None)
        if known:
            pose, direction, repetition = (p[first] for p in place)
            under_load = _under_load(dataset, mine[~zero], known)
            yield RunZeros(str(pose), str(direction), int(repetition), known, span, under_load)


def _under_load(dataset: Recorded, loaded: NDArray[np.intp], plateaus: tuple[Plateau, ...]) -> bool:
    """loaded: rows (n,) of the run that are no zero-load hold."""
    force = dataset.columns["force_N"][loaded].astype(float)
    moved = dataset.columns["displacement_mm"][loaded].astype(float)
    good = np.isfinite(force) & np.isfinite(moved)
    pairs = list(zip(force[good].tolist(), moved[good].tolist(), strict=True))
    before, after = ((p.force, p.displacement) for p in (plateaus[0], plateaus[-1]))
    return tared_under_load(before, pairs, after)


def _span(force: NDArray[Any]) -> float:
    values = _finite(force.astype(float))
    return float(np.ptp(values)) if values.size else 0.0


def _stretches(*keys: NDArray[Any]) -> Iterator[tuple[int, int]]:
    """Those in which no key (n,) changes, as (first, behind the last)."""
    return pairwise([*first_rows(*keys).tolist(), keys[0].size])


def _plateau(
    dataset: Recorded, time: NDArray[Any], rows: NDArray[np.intp], span: float
) -> Plateau | None:
    """Of a hold that the load was still on its way to, the later half counts, as for k."""
    force = dataset.columns["force_N"][rows].astype(float)
    moved = dataset.columns["displacement_mm"][rows].astype(float)
    good = np.isfinite(force) & np.isfinite(moved) & np.isfinite(time[rows].astype(float))
    if not good.any():
        return None
    kept = np.flatnonzero(good)
    if span > 0 and np.ptp(force[kept]) > STILL * span:
        kept = kept[kept.size // 2 :]
    when = time[rows][kept].astype(float)
    return Plateau(float(when.mean()), float(force[kept].mean()), float(moved[kept].mean()))


def _force_zero(zeros: tuple[RunZeros, ...]) -> dict[str, Any] | None:
    """How far the force at zero load moved within the runs."""
    changes = [abs(c) for r in zeros if (c := r.change_N) is not None]
    drifts = [abs(d) for r in zeros if (d := r.drift_N_per_min) is not None]
    if not changes:
        return None
    return {
        "runs": len(changes),
        "largest_change_N": max(changes),
        "largest_drift_N_per_min": max(drifts, default=None),
        "median_drift_N_per_min": float(np.median(drifts)) if drifts else None,
    }


def _displacement_zero(zeros: tuple[RunZeros, ...]) -> list[dict[str, Any]]:
    """How far the unloaded positions before the repetitions of a setup lie apart."""
    by_setup: dict[tuple[str, str], list[float]] = {}
    for run in zeros:
        by_setup.setdefault((run.pose, run.direction), []).append(run.plateaus[0].displacement)
    return [
        {"pose": pose, "direction": direction, "repetitions": len(v), "apart_mm": max(v) - min(v)}
        for (pose, direction), v in by_setup.items()
        if len(v) > 1
    ]


def _duration(dataset: Dataset) -> float | None:
    """From the session's start to its last sample; None without that clock."""
    times = _finite(dataset.columns.get("session_s", np.array([])).astype(float))
    return float(times.max()) if times.size else None


def _temperature(dataset: Dataset) -> list[float] | None:
    """The lowest and the highest of all joints."""
    names = [f"temperature{j}_C" for j in range(1, 7)]
    known = [_finite(dataset.columns[n].astype(float)) for n in names if n in dataset.columns]
    values = np.concatenate(known) if known else np.array([])
    return [float(values.min()), float(values.max())] if values.size else None


def _events(dataset: Dataset) -> list[dict[str, Any]]:
    """What happened beside the plan, the first ones if there are many."""
    found = [
        {"session_s": _time(e), "kind": str(e["kind"]), "text": str(e.get("text", ""))}
        for e in dataset.events
        if e["kind"] in NOTABLE
    ]
    return found[:MOST_EVENTS]


def _time(event: dict[str, Any]) -> float | None:
    value = event.get("session_s")
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None
