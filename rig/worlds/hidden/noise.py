"""What is random in a hidden measurement, and gains that all its samples share."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden.gap import spring_columns
from rig.worlds.hidden.scene import Scene

_SCATTER = 0.4  # of the stated uncertainty: whole runs sit a little higher or lower
_VIBRATION = 0.3
Q_NOISE_RAD = 1.0e-5
_READ_OFF = 0.5  # of the measurements: joints stand a little elsewhere in every run and setup
_OFF_RUN_RAD, _OFF_SETUP_RAD = (1.0e-6, 5.0e-6), (2.0e-6, 1.2e-5)  # standard deviations
_Q_DIGIT_RAD = 1.0e-6
GAIN_BOUND = 2.0  # stated standard deviations
CROSSTALK = 0.005  # at most, of a channel into another


@dataclass(frozen=True)
class Noise:
    """Drawn once per measurement: displacement (m) mm, force (m, 3) N, q (m, 6) rad, and the
    gains; crosstalk (3, 3) maps the true load to the amplifier's channels."""

    displacement_mm: Array
    force_N: Array
    q: Array
    displacement_gain: float
    force_gain: float
    crosstalk: Array


def draw_noise(scene: Scene, random: Generator) -> Noise:
    """Noise of instruments as stated, scatter of whole runs and vibration within it; where joints
    stand, in some."""
    plan, history = scene.plan, scene.history
    count, runs = len(history.sample), int(history.run[-1]) + 1
    u = plan.instruments.displacement_mm
    white = u * np.sqrt(1 - _SCATTER**2 - _VIBRATION**2)
    scatter = _SCATTER * u * random.standard_normal(runs)
    moved = white * random.standard_normal(count) + scatter[history.run[history.sample]]
    moved += _VIBRATION * u * _ringing(random, count)
    crosstalk = np.eye(3) + CROSSTALK * random.uniform(-1, 1, (3, 3)) * (1 - np.eye(3))
    noise = Noise(
        displacement_mm=moved,
        force_N=plan.instruments.force_N * random.standard_normal((count, 3)),
        q=Q_NOISE_RAD * random.standard_normal((count, 6)),
        displacement_gain=1 + plan.instruments.displacement_gain * _gain(random),
        force_gain=1 + plan.instruments.force_gain * _gain(random),
        crosstalk=crosstalk,
    )
    return replace(noise, q=noise.q + _standing(scene, random))


def _standing(scene: Scene, random: Generator) -> Array:
    """(count, 6) rad: the controller's deadband, and friction, leave joints elsewhere."""
    history = scene.history
    sample = history.sample
    run, setup = (random.uniform(*limits) for limits in (_OFF_RUN_RAD, _OFF_SETUP_RAD))
    of_run = run * random.standard_normal((int(history.run[-1]) + 1, 6))
    of_setup = setup * random.standard_normal((len(scene.plan.setups), 6))
    off = of_run[history.run[sample]] + of_setup[history.setup[sample]]
    return np.asarray(off if random.random() < _READ_OFF else np.zeros_like(off))


def _gain(random: Generator) -> float:
    """Standard deviations by which a gain is off."""
    return float(np.clip(random.standard_normal(), -GAIN_BOUND, GAIN_BOUND))


def _ringing(random: Generator, count: int) -> Array:
    """(m) sd 1: what the building shakes, sampled once a second, half correlated."""
    steps = random.standard_normal(count)
    out = np.empty(count)
    state = steps[0]
    for i in range(count):
        state = 0.5 * state + np.sqrt(0.75) * steps[i]
        out[i] = state
    return out


def noise_rms_mm(scene: Scene, noise: Noise) -> float:
    """rms in mm of all that is random, force by way of the springs' compliance."""
    unit = scene.unit[scene.history.setup[scene.history.sample]]
    force = np.sum(noise.force_N * unit, axis=1)
    late = spring_columns(scene, force) @ (1 / scene.plan.springs)
    return float(np.sqrt(np.mean((noise.displacement_mm - late) ** 2)))


def to_digits(values: Array, digit: float) -> Array:
    """Values as the last digit shows them."""
    decimals = max(0, int(np.ceil(-np.log10(digit))) + 1)
    return np.asarray(np.round(np.round(values / digit) * digit, decimals))


def q_digits(q: Array) -> Array:
    """(m, 6) rad as the controller writes them."""
    return to_digits(q, _Q_DIGIT_RAD)
