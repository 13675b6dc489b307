"""What a bench adds of its own: waves over the position, wander, wear, slack ends, late starts.

Each is a few hundredths of the effect at most, so that the effect stays the main cause, and yet up
to hundreds of times the noise: no formula comes down to the noise of a real test.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.arrays import Array
from rig.worlds.benches.memory import rough
from rig.worlds.benches.trial import Trial, bent, log_uniform, whole

_T = TypeVar("_T", bound=np.generic)
_MOST = 0.05  # of the effect, each


def imperfect(trial: Trial, random: Generator) -> Trial:
    """The trial as a real bench would have run it; a `clean` one as it is."""
    if trial.clean:
        return trial
    effect = bent(trial.driven, trial.response)
    response = trial.response + effect * _flaws(trial, random)
    if random.random() < 0.4:  # a specimen that wears or settles: the last cycle differs
        drift = _MOST * random.uniform(-1, 1) * trial.time
        response = response * (1 + drift)
    changed = (
        replace(trial, force=response)
        if trial.imposed == "displacement"
        else replace(trial, displacement=response)
    )
    changed = _late_start(changed, random) if random.random() < 0.25 else changed
    return _elsewhere(changed, random) if random.random() < 0.4 else changed


def _flaws(trial: Trial, random: Generator) -> Array:
    """(n,) in units of the effect."""
    n = len(trial.time)
    out = np.zeros(n)
    if random.random() < 0.6:
        span = float(np.ptp(trial.displacement)) or 1.0
        turns = trial.displacement / span * random.uniform(3, 25) + random.random()
        out += random.uniform(0, _MOST) * np.sin(2 * np.pi * turns)
    if random.random() < 0.6:
        out += random.uniform(0, _MOST) * rough(random, n, whole(random, 5, 60))
    if random.random() < 0.3:  # mains or a pump: an oscillation in time
        turns = trial.time * random.uniform(10, 300) + random.random()
        out += random.uniform(0, 0.02) * np.sin(2 * np.pi * turns)
    return np.asarray(out - out[0])


def _late_start(trial: Trial, random: Generator) -> Trial:
    """The recorder runs before the machine does."""
    n = max(3, int(len(trial.time) * log_uniform(random, 0.01, 0.1)))
    step = float(trial.time[1] - trial.time[0])

    def held(values: NDArray[_T]) -> NDArray[_T]:
        return np.concatenate([np.full(n, values[0], dtype=values.dtype), values])

    time = np.concatenate([step * np.arange(n), n * step + trial.time])
    return replace(
        trial,
        time=time / time[-1],
        force=held(trial.force),
        displacement=held(trial.displacement),
        repetition=None if trial.repetition is None else held(trial.repetition),
        zero=None if trial.zero is None else held(trial.zero),
    )


def _elsewhere(trial: Trial, random: Generator) -> Trial:
    """Neither channel was zeroed where the test begins."""
    force = random.uniform(-0.02, 0.02) * float(np.ptp(trial.force))
    moved = random.uniform(-0.05, 0.05) * float(np.ptp(trial.displacement))
    return replace(trial, force=trial.force + force, displacement=trial.displacement + moved)
