"""What a specimen did on its bench, in units of its own, and what a law has to say of itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.arrays import Array

Ints: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]
Imposed: TypeAlias = Literal["force", "displacement"]
Span: TypeAlias = tuple[float, float]

WORDS: tuple[str, ...] = (
    "joint_yield",
    "joint_hysteresis",
    "joint_creep",
    "joint_nonlinear_stiffness",
    "joint_backlash",
    "contact_seating",
    "force_drift",
    "thermal_drift",
    "time_lag",
    "zero_shift",
    "force_scale",
    "displacement_scale",
    "joint_stiffness_error",
    "none",
    "unknown",
)
SCALES = frozenset({"force_scale", "displacement_scale", "joint_stiffness_error"})


@dataclass(frozen=True, eq=False)
class Trial:
    """One test without noise.

    time (n,) from 0 to 1 of its duration. force, displacement (n,) in units in which `stiffness`
    is the slope that the untouched specimen has at first. imposed: what the machine drove.
    accept: words that explain these data as well as the true one, the true one aside.
    repetition (n,) from 1; zero (n,): the specimen is released. timeless: the law asks for the
    order of the samples only, so that a table without a clock is fair. clean: the bench adds
    nothing of its own beyond noise.
    """

    time: Array
    force: Array
    displacement: Array
    imposed: Imposed = "displacement"
    stiffness: float = 1.0
    accept: frozenset[str] = frozenset()
    parameters: dict[str, Any] = field(default_factory=dict)
    repetition: Ints | None = None
    zero: Flags | None = None
    timeless: bool = True
    clean: bool = False

    @property
    def response(self) -> Array:
        """What was not driven."""
        return self.force if self.imposed == "displacement" else self.displacement

    @property
    def driven(self) -> Array:
        """What the machine drove."""
        return self.displacement if self.imposed == "displacement" else self.force


@dataclass(frozen=True)
class Form:
    """A law by name, and the sizes such rigs have.

    force_N, displacement_mm: bounds of the largest readings; duration_s: bounds of a test.
    """

    name: str
    draw: Callable[[Generator], Trial]
    force_N: Span = (0.1, 5000.0)
    displacement_mm: Span = (0.01, 20.0)
    duration_s: Span = (2.0, 3000.0)


def log_uniform(random: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def whole(random: Generator, low: int, high: int) -> int:
    """A whole number, both ends included."""
    return int(random.integers(low, high + 1))


def bent(x: Array, y: Array) -> float:
    """rms of what no straight line in x explains of y (n,)."""
    x, y = x - x.mean(), y - y.mean()
    power = float(x @ x)
    left = y - x * (float(x @ y) / power) if power > 0 else y
    return float(np.sqrt(np.mean(left**2)))
