"""Noise, digits and clocks of the sensors; the table and META that come of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.arrays import Array
from rig.worlds.benches.memory import rough
from rig.worlds.benches.rig import Rig
from rig.worlds.benches.trial import log_uniform, whole

_IDLE_SHARE = (1e-4, 1e-2)  # noise of a channel that shows nothing, of its largest value
_KNOWN, _MISJUDGED = 0.2, (0.5, 3.0)  # stated over true noise: within a fifth, or between these


@dataclass(frozen=True, eq=False)
class Readings:
    """Force N and displacement mm (n,) as shown, and the standard uncertainties stated."""

    force: Array
    displacement: Array
    force_u: float
    displacement_u: float


def read(rig: Rig, noise_mm: float, random: Generator) -> Readings:
    """The channels with noise whose response together is about `noise_mm` rms."""
    turn = random.uniform(0.15, 1.4)
    here, there = np.cos(turn) * noise_mm, np.sin(turn) * noise_mm
    k = rig.stated.stiffness
    slope = rig.mean_slope
    if rig.by_force:
        moved_sd, force_sd = here, there * slope
    else:
        # Between the first slope and the mean one: who drives a specimen far beyond its first slope
        # still wants to see that slope.
        steep = np.sqrt(rig.stiffness * slope)
        force_sd, moved_sd = here * k, there * k / steep if slope else 0.0
    idle = log_uniform(random, *_IDLE_SHARE)
    most_force, most_moved = (float(np.abs(x).max()) for x in (rig.force, rig.displacement))
    force_sd = force_sd or idle * (most_force or most_moved * k)
    moved_sd = moved_sd or idle * (most_moved or most_force / k)
    force, force_u = _shown(rig.force, force_sd, random)
    moved, moved_u = _shown(rig.displacement, moved_sd, random)
    return Readings(force, moved, force_u, moved_u)


def _shown(true: Array, sd: float, random: Generator) -> tuple[Array, float]:
    """Readings (n,) and the standard uncertainty stated of them. A part of the noise may be of
    low frequency; digits are up to three times the noise, where they are all that one sees."""
    low = float(random.random() < 0.4) * random.uniform(0.0, 0.6)
    wander = rough(random, len(true), whole(random, 20, 200))
    wander = (wander - wander.mean()) / max(float(wander.std()), 1e-300)
    noise = np.sqrt(1 - low**2) * random.standard_normal(len(true)) + low * wander
    digit = _nice(sd * log_uniform(random, 0.05, 3.0))
    shown = np.round((true + sd * noise) / digit) * digit
    stated = np.hypot(sd, digit / np.sqrt(12)) * _judged(random.random())
    decimals = max(0, int(np.ceil(-np.log10(digit))) + 1)
    return np.round(shown, decimals), float(f"{stated:.2g}")


def _judged(x: float) -> float:
    """Stated over true noise, of x uniform from 0 to 1: half the makers know it, the others round
    up, or look at a quiet moment only."""
    if x < 0.5:
        return 1.0 + _KNOWN * (4 * x - 1)
    low, high = _MISJUDGED
    return float(low * (high / low) ** (2 * x - 1))


def _nice(value: float) -> float:
    """The next smaller of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(m for m in (1, 2, 5) if m * power <= value * (1 + 1e-9)))


def noise_rms_mm(rig: Rig, readings: Readings) -> float:
    """rms in mm of all that is random in the response, the driven channel by way of the mean
    slope."""
    force = readings.force - rig.force
    moved = readings.displacement - rig.displacement
    slope = rig.mean_slope
    if rig.by_force:
        error = moved - (force / slope if slope else 0.0)
    else:
        error = (force - slope * moved) / rig.stated.stiffness
    return float(error.std())


def columns_of(rig: Rig, readings: Readings, random: Generator) -> dict[str, NDArray[Any]]:
    """Columns by their contracted names; what a bench's software leaves out is left out."""
    trial, n = rig.trial, len(rig.time)
    keep = _kept(rig, random)
    columns: dict[str, NDArray[Any]] = {}
    clock = rig.time[keep] - rig.time[keep][0]
    digit = 10.0 ** np.floor(np.log10(rig.time[-1] / n / 20))
    if not trial.timeless or random.random() < 0.7:
        start = np.zeros(len(keep))
        if trial.repetition is not None:
            runs = trial.repetition[keep]
            first = np.searchsorted(runs, np.unique(runs))
            start = clock[first][np.searchsorted(runs[first], runs)]
            columns["session_s"] = _rounded(clock, digit)
        columns = {"time_s": _rounded(clock - start, digit), **columns}
    if random.random() < 0.7:
        columns["direction"] = np.full(len(keep), "x")
    if trial.repetition is not None:
        columns["repetition"] = trial.repetition[keep]
    branch = _branch(rig, random)
    if branch is not None:
        columns["branch"] = branch[keep]
    columns["force_N"] = readings.force[keep]
    columns["displacement_mm"] = readings.displacement[keep]
    return columns


def _rounded(seconds: Array, digit: float) -> Array:
    return np.asarray(np.round(seconds, max(0, int(-np.log10(digit)) + 1)))


def _kept(rig: Rig, random: Generator) -> NDArray[np.intp]:
    """Samples (m,) that were stored: all, or at irregular moments."""
    n = len(rig.time)
    every = np.arange(n)
    if rig.trial.clean or n < 300 or random.random() > 0.25:
        return every
    lost = random.random(n) < random.uniform(0.05, 0.5)
    lost[0] = lost[-1] = False
    if rig.trial.repetition is not None:  # a run keeps its ends
        ends = np.flatnonzero(np.diff(rig.trial.repetition))
        lost[ends] = lost[ends + 1] = False
    return every[~lost]


def _branch(rig: Rig, random: Generator) -> NDArray[Any] | None:
    """(n,) words, or None where the table has no such column."""
    trial, driven = rig.trial, rig.trial.driven
    one_sided = float(driven.min()) >= -0.05 * float(np.abs(driven).max())
    words = np.full(len(driven), "cycle", dtype="<U9")
    if trial.zero is not None:
        words[trial.zero] = "zero"
        return words
    if not one_sided or random.random() < 0.5:
        return words if random.random() < 0.5 else None
    step = np.diff(driven, append=driven[-1])
    back = step < 0
    back[-1] = back[-2]
    words[:] = np.where(back, "unloading", "loading")
    return words


def meta_of(rig: Rig, readings: Readings, random: Generator) -> dict[str, Any]:
    """What META.yaml holds; what was driven stands there in half the cases."""
    stated = rig.stated
    meta: dict[str, Any] = {
        "robot": "none",
        "directions": {"x": [1.0, 0.0, 0.0]},
        "instruments": {
            "force": {
                "standard_uncertainty_N": readings.force_u,
                "gain_relative_sd": stated.force_gain_sd,
            },
            "displacement": {
                "standard_uncertainty_mm": readings.displacement_u,
                "gain_relative_sd": stated.displacement_gain_sd,
            },
        },
        "simulation": {
            "stiffness_N_per_mm": {"x": stated.stiffness},
            "stiffness_relative_sd": stated.relative_sd,
        },
    }
    if random.random() < 0.5:
        meta["imposed"] = rig.trial.imposed
    return meta
