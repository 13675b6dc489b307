"""From a trial to physical sizes, and what a simulator and the instruments' makers say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.trial import SCALES, Form, Trial, log_uniform

NO_ERROR_SD = 1.2  # stated standard deviations by which the spring of a clean case may be off
_ERROR_SD = (4.5, 15.0)  # by which it is off where that is the effect


@dataclass(frozen=True)
class Stated:
    """Of the simulated spring (N/mm) and the gains, with relative standard deviations."""

    stiffness: float
    relative_sd: float
    force_gain_sd: float
    displacement_gain_sd: float

    @property
    def slope_sd(self) -> float:
        """Relative, of the line that spring and gains give together."""
        return float(
            np.hypot(np.hypot(self.relative_sd, self.force_gain_sd), self.displacement_gain_sd)
        )


@dataclass(frozen=True, eq=False)
class Rig:
    """A trial in N, mm and s, without noise; off: relative errors of force, displacement, spring.

    stiffness N/mm: the slope that the specimen had at first.
    """

    trial: Trial
    time: Array
    force: Array
    displacement: Array
    stiffness: float
    stated: Stated
    off: dict[str, float]

    @property
    def by_force(self) -> bool:
        """Whether the force was driven."""
        return self.trial.imposed == "force"

    @property
    def mean_slope(self) -> float:
        """N/mm, of the whole test; 0 where a channel stands."""
        return secant(self.force, self.displacement)

    def response(self, force: Array, displacement: Array) -> Array:
        """(n,) mm: what was not driven, a force over the simulated spring."""
        return displacement if self.by_force else force / self.stated.stiffness

    def simulated(self) -> Array:
        """(n,) mm: the response that the spring as stated gives."""
        return self.force / self.stated.stiffness if self.by_force else self.displacement


def secant(force: Array, displacement: Array) -> float:
    """N/mm: spread over spread; 0 where either stands (what rounding leaves does not count)."""
    if not (np.ptp(force) > 0 and np.ptp(displacement) > 0):
        return 0.0
    return float(force.std() / displacement.std())


def make_rig(form: Form, word: str, trial: Trial, random: Generator) -> Rig:
    """Sizes drawn within the form's bounds; gains off within what is stated, or beyond it where
    that is the effect."""
    n = len(trial.time)
    most_force = float(np.abs(trial.force).max()) or 1.0
    most_moved = float(np.abs(trial.displacement).max()) or 1.0
    scale_force = log_uniform(random, *form.force_N) / most_force
    scale_moved = log_uniform(random, *form.displacement_mm) / most_moved
    duration = max(log_uniform(random, *form.duration_s), n / 5000.0)
    true = trial.stiffness * scale_force / scale_moved
    force, moved = scale_force * trial.force, scale_moved * trial.displacement
    if word in SCALES or word == "none":
        stated, off = _straight(word, true, random)
    else:
        stated, off = _bent(trial, true, force, moved, random)
    force = force * (1 + off["force_scale"])
    moved = moved * (1 + off["displacement_scale"])
    return Rig(trial, trial.time * duration, force, moved, true, stated, off)


def _gains(random: Generator) -> tuple[float, float]:
    return (
        float(random.choice([0.002, 0.005, 0.01, 0.02])),
        float(random.choice([0.001, 0.003, 0.01])),
    )


def _straight(word: str, true: float, random: Generator) -> tuple[Stated, dict[str, float]]:
    """A straight spring: all three relative errors act alike, and only one may be beyond what is
    stated of them together."""
    force_sd, moved_sd = _gains(random)
    spring_sd = log_uniform(random, 0.01, 0.3 if word == "none" else 0.06)
    sds = {
        "force_scale": force_sd,
        "displacement_scale": moved_sd,
        "joint_stiffness_error": spring_sd,
    }
    off = {w: sd * float(np.clip(random.standard_normal(), -0.7, 0.7)) for w, sd in sds.items()}
    if word != "none":
        total = float(np.linalg.norm(list(sds.values())))
        size = random.uniform(*_ERROR_SD) * total
        off[word] = -min(size, 0.6) if random.random() < 0.5 else size
    else:
        off["joint_stiffness_error"] = spring_sd * random.uniform(-NO_ERROR_SD, NO_ERROR_SD)
    stated = Stated(
        _digits(true / (1 + off["joint_stiffness_error"]), 4),
        _digits(spring_sd, 2),
        force_sd,
        moved_sd,
    )
    return stated, off


def _bent(
    trial: Trial, true: float, force: Array, moved: Array, random: Generator
) -> tuple[Stated, dict[str, float]]:
    """What one believes of a spring that is none: its first slope, a data sheet's, a secant, or
    something far off; a clean one is known within its uncertainty."""
    force_sd, moved_sd = _gains(random)
    off = {
        w: sd * float(np.clip(random.standard_normal(), -1, 1))
        for w, sd in (("force_scale", force_sd), ("displacement_scale", moved_sd))
    }
    way = 0.0 if trial.clean else random.random()
    if way < 0.55:
        sd = log_uniform(random, 0.03, 0.3)
        k = true * (1 + sd * random.uniform(-1, 1))
    elif way < 0.75:
        sd, k = random.uniform(0.3, 0.5), true * log_uniform(random, 0.5, 2.0)
    elif way < 0.87:
        sd, k = random.uniform(0.1, 0.3), secant(force, moved)
        k = k if k > 0.05 * true else true
    else:
        sd = log_uniform(random, 0.1, 1.0)
        k = true * 10.0 ** (random.choice([-1, 1]) * random.uniform(0.5, 1.0))
    off["joint_stiffness_error"] = true / k - 1
    return Stated(_digits(k, 3), _digits(sd, 2), force_sd, moved_sd), off


def _digits(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")
