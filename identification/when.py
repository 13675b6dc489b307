"""When to couple: the rule along a path, and as a small state for a controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from identification.arm import Arm, along, unit_vector
from identification.arrays import Array
from identification.coupling import Kind, State, coupled, decide
from identification.elastic import Beam


class CouplingRule:
    """Whether to be coupled now, from a live estimate of the single arm's stiffness.

    dead_band: relative; release only below `(1 - dead_band) * k_single`, so that a requirement
    that hovers about k_single does not make the coupling chatter. 0: the plain rule.
    """

    def __init__(self, dead_band: float = 0.0) -> None:
        if not 0 <= dead_band < 1:
            raise ValueError(f"dead band is {dead_band:g}; it must be at least 0 and below 1")
        self.dead_band = dead_band
        self.state: State = "single"

    def update(self, required: float, single: float, coupled_stiffness: float) -> State:
        """The state for a requirement and the stiffnesses of this moment, N/m each."""
        if not (required >= 0 and single > 0 and coupled_stiffness > 0):
            raise ValueError(
                f"required {required:g}, single {single:g} and coupled {coupled_stiffness:g} N/m: "
                "stiffnesses must be above 0, what is required at least 0"
            )
        new = decide(required, single, coupled_stiffness)
        held = self.state != "single" and required > (1 - self.dead_band) * single
        # within the band a coupled pair stays together
        self.state = "couple" if new == "single" and held and self.dead_band > 0 else new
        return self.state


@dataclass(frozen=True)
class Interval:
    """From `start` to `end` (s) the pair is in `state`; both ends are times of the path."""

    start: float
    end: float
    state: State


@dataclass(frozen=True, eq=False)
class Schedule:
    """time (n,) s; required, single and coupled (n,) N/m along each row's direction; states of the
    rows."""

    time: Array
    required: Array
    single: Array
    coupled: Array
    states: tuple[State, ...]

    def intervals(self) -> list[Interval]:
        """Rows of equal state, joined; an interval ends where the next begins."""
        out: list[Interval] = []
        for time, state in zip(self.time, self.states, strict=True):
            if out and out[-1].state == state:
                out[-1] = Interval(out[-1].start, float(time), state)
                continue
            if out:
                out[-1] = Interval(out[-1].start, float(time), out[-1].state)
            out.append(Interval(float(time), float(time), state))
        return out


def schedule(
    arm: Arm,
    time: ArrayLike,
    q: ArrayLike,
    direction: ArrayLike,
    required: ArrayLike,
    *,
    beta: float,
    tool: ArrayLike | None = None,
    kind: Kind = "rigid",
    half: Array | None = None,
    dead_band: float = 0.0,
    links: Sequence[Beam] = (),
    base: ArrayLike | None = None,
) -> Schedule:
    """Coupling and release along a path.

    time (n,) s, not decreasing; q (n, 6) rad; direction (n, 3) unit vectors in the base frame;
    required (n,) N/m; links, base: what bends besides the joints, as in `Arm.compliance`.
    Raises ValueError for rows that make no path.
    """
    t, need = np.asarray(time, dtype=float), np.asarray(required, dtype=float)
    if t.ndim != 1 or t.size == 0 or need.shape != t.shape:
        raise ValueError("a path needs at least one row, and one requirement a row")
    if (np.diff(t) < 0).any():
        raise ValueError(f"time goes back in row {int(np.argmax(np.diff(t) < 0)) + 2} of the path")
    C = arm.compliance(q, tool, links=links, base=base)
    n = unit_vector(direction)
    single, pair = along(C, n), along(coupled(C, beta, kind, half), n)
    rule = CouplingRule(dead_band)
    states = tuple(_run(rule, need, single, pair))
    return Schedule(t, need, single, pair, states)


def _run(rule: CouplingRule, need: Array, single: Array, pair: Array) -> Sequence[State]:
    return [
        rule.update(float(r), float(s), float(c))
        for r, s, c in zip(need, single, pair, strict=True)
    ]
