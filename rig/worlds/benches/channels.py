"""Drifts, lags, jumps, gains, and nothing at all: a straight spring, or no load.

What is accepted beside the word: a drift of the load cell and one of the displacement are the same
on a straight spring that is never let go; a displacement that lags is a spring with a dashpot
beside it (joint_creep), a force that lags gives energy back, which no material does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.memory import lowpass, rough, slider
from rig.worlds.benches.paths import Path, samples, through, to_and_fro
from rig.worlds.benches.trial import Form, Imposed, Trial, bent, log_uniform, whole


def _wander(random: Generator, time: Array) -> tuple[Array, str]:
    """(n,) a drift from 0 of size about 1: warming up, a daily swing, a random walk."""
    kind = whole(random, 0, 3)
    if kind == 0:
        tau = log_uniform(random, 0.1, 1.5)
        return np.asarray(-np.expm1(-time / tau) / -np.expm1(-1 / tau)), "warming"
    if kind == 1:
        turns, phase = random.uniform(0.5, 4), random.uniform(0, 2 * np.pi)
        return 0.5 * (np.sin(2 * np.pi * turns * time + phase) - np.sin(phase)), "swing"
    if kind == 2:
        return time * (1 + random.uniform(-0.5, 1.0) * time), "slope"
    path = rough(random, len(time), whole(random, 30, 300))
    return path / max(float(np.ptp(path)), 1e-300), "walk"


def nothing_loaded_moves(random: Generator) -> Trial:
    """A sensor watches a target that nobody loads: it warms up, or the room does."""
    time = np.linspace(0, 1, samples(random, 4))
    drift, kind = _wander(random, time)
    if random.random() < 0.4:
        drift = drift + random.uniform(0.05, 0.3) * _wander(random, time)[0]
    return Trial(
        time,
        np.zeros_like(time),
        float(random.choice([-1, 1])) * drift,
        "force",
        parameters={"law": kind},
        timeless=False,
        clean=True,
    )


def cell_at_rest(random: Generator) -> Trial:
    """A load cell with nothing on it: charge leaks, bridges warm; the displacement stands."""
    time = np.linspace(0, 1, samples(random, 4))
    drift, kind = _wander(random, time)
    force = float(random.choice([-1, 1])) * drift
    return Trial(
        time, force, np.zeros_like(time), parameters={"law": kind}, timeless=False, clean=True
    )


def _springs(random: Generator, least: int = 2) -> Path:
    """Cycles of a straight spring, through zero or from it."""
    low = float(random.choice([-1.0, 0.0]))
    points = to_and_fro(low, 1.0, whole(random, least, 12))
    return through(points, samples(random, len(points)), eased=bool(random.random() < 0.5))


def drift_under_cycles(random: Generator) -> Trial:
    """The zero of the load cell moves while a spring is cycled without a pause."""
    path = _springs(random, 4)
    drift, kind = _wander(random, path.time)
    size = random.uniform(0.05, 0.5)
    return Trial(
        path.time,
        path.value + size * drift,
        path.value,
        timeless=False,
        clean=True,
        accept=frozenset({"thermal_drift"}),
        parameters={"law": kind},
    )


def drift_between_pauses(random: Generator) -> Trial:
    """The same with pauses in which the spring is let go: there the force that is shown moves,
    and the displacement does not."""
    cycles = whole(random, 3, 8)
    points, seconds = [0.0, 0.0], [1.0]
    for _ in range(cycles):
        points += [1.0, 0.0, 0.0]
        seconds += [1.0, 1.0, 1.0]
    path = through(points, samples(random, 3 * cycles, 8000), seconds=seconds)
    zero = np.isin(path.leg % 3, [0])
    drift, kind = _wander(random, path.time)
    force = path.value + random.uniform(0.05, 0.5) * drift
    return Trial(
        path.time,
        force,
        path.value,
        "force",
        zero=zero,
        timeless=False,
        clean=True,
        parameters={"law": kind},
    )


def warming_under_cycles(random: Generator) -> Trial:
    """The frame grows while a spring is loaded by weights, to and fro."""
    path = _springs(random, 4)
    drift, kind = _wander(random, path.time)
    moved = path.value + random.uniform(0.05, 0.5) * drift
    return Trial(
        path.time,
        path.value,
        moved,
        "force",
        timeless=False,
        clean=True,
        accept=frozenset({"force_drift"}),
        parameters={"law": kind},
    )


def late_channel(random: Generator) -> Trial:
    """Faster and faster cycles of a spring, one channel filtered or delayed: the loop grows with
    the rate and nothing is left of it when slow."""
    cycles = whole(random, 5, 15)
    seconds = np.repeat(np.geomspace(random.uniform(4, 12), 1, cycles), 2).tolist()
    low = float(random.choice([-1.0, 0.0]))
    points = to_and_fro(low, 1.0, cycles)
    path = through(points, samples(random, 3 * len(points)), seconds=seconds, eased=True)
    lag = random.uniform(0.03, 0.25) * seconds[-1] / sum(seconds)
    filtered = bool(random.random() < 0.6)
    late = (
        lowpass(path.time, path.value, lag)
        if filtered
        else np.interp(path.time - lag, path.time, path.value)
    )
    in_force = bool(random.random() < 0.5)
    extra = {"lag_share": lag, "filter": filtered}
    if in_force:
        return Trial(path.time, late, path.value, timeless=False, clean=True, parameters=extra)
    return Trial(
        path.time,
        path.value,
        late,
        "force",
        accept=frozenset({"joint_creep"}),
        timeless=False,
        clean=True,
        parameters=extra,
    )


def datum_that_jumps(random: Generator) -> Trial:
    """Whole runs sit higher or lower: the sensor was touched in between."""
    cycles = whole(random, 4, 9)
    points = to_and_fro(0.0, 1.0, cycles)
    path = through(points, samples(random, len(points), 8000))
    repetition = np.minimum(path.repetition, cycles)
    jump = random.uniform(0.03, 0.4) * random.standard_normal(cycles)
    jump[0] = 0.0
    moved = path.value + jump[repetition - 1]
    return Trial(path.time, path.value, moved, "force", repetition=repetition, clean=True)


def straight_spring(random: Generator) -> Trial:
    """A spring for calibration, to and fro or in one pull; either side may be driven."""
    once = random.random() < 0.2
    path = through([0.0, 1.0], samples(random, 2)) if once else _springs(random, 1)
    imposed: Imposed = "force" if random.random() < 0.5 else "displacement"
    return Trial(path.time, path.value, path.value.copy(), imposed, clean=True)


def spring_of_a_machine(random: Generator) -> Trial:
    """A spring as it is in a machine: a little curved, rubbing or late, by an rms of a hundredth of
    its way at most, beside an error that does several times that."""
    trial = straight_spring(random)
    u = trial.driven
    flaw = _flaw(random, trial.time, u)
    size = log_uniform(random, 0.001, 0.01) * float(u.std())
    response = u + size * flaw / max(bent(u, flaw), 1e-9)
    if trial.imposed == "force":
        return replace(trial, displacement=response, timeless=False)
    return replace(trial, force=response, timeless=False)


def _flaw(random: Generator, time: Array, u: Array) -> Array:
    """(n,) a curve, a loop or a delay, of any size."""
    kind, sign = whole(random, 0, 2), float(random.choice([-1, 1]))
    if kind == 0:
        return np.asarray(sign * np.expm1(random.uniform(0.5, 4.0) * u))
    if kind == 1:
        return sign * slider(u / random.uniform(0.02, 0.3), np.ones(len(u)))
    return lowpass(time, u, log_uniform(random, 0.001, 0.01)) - u


_SLOW = (60.0, 2e5)
_SIZES = (1e-6, 5e4), (1e-6, 50.0)
_STRAIGHT = Form("straight_spring", straight_spring, *_SIZES)

FORMS: dict[str, tuple[Form, ...]] = {
    "thermal_drift": (
        Form("nothing_loaded_moves", nothing_loaded_moves, (0.1, 100.0), (1e-6, 0.2), _SLOW),
        Form("warming_under_cycles", warming_under_cycles, (1.0, 5000.0), (1e-3, 1.0), _SLOW),
    ),
    "force_drift": (
        Form("cell_at_rest", cell_at_rest, (1e-4, 50.0), (1e-3, 1.0), _SLOW),
        Form("drift_under_cycles", drift_under_cycles, (0.1, 5000.0), (0.01, 20.0), _SLOW),
        Form("drift_between_pauses", drift_between_pauses, (0.1, 5000.0), (0.01, 20.0), _SLOW),
    ),
    "time_lag": (Form("late_channel", late_channel, (0.1, 5e3), (0.01, 20.0), (1.0, 60.0)),),
    "zero_shift": (Form("datum_that_jumps", datum_that_jumps, (0.1, 5e3), (1e-3, 10.0)),),
    "none": (_STRAIGHT,),
    **{
        word: (_STRAIGHT, Form("spring_of_a_machine", spring_of_a_machine, *_SIZES))
        for word in ("force_scale", "displacement_scale", "joint_stiffness_error")
    },
}
