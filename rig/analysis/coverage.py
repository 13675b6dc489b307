"""Over how much of the asked range a stiffness was taken: levels of loading, and the largest force.

On a curved characteristic k is an average over the levels, so the k of a part of them is another
quantity, and an interval about it says nothing of the whole (`identification.cut_short` says the
same of single repetitions, and has the measured figures).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from identification.cut_short import NEARLY
from identification.stiffness import Stiffness
from rig.digits import counted, number
from rig.measurements import Measurements
from rig.protocol import MeasurementProtocol
from rig.runs import ends_of_loading, of_setup

_MOST_MISSING = 0.5  # of the levels asked for


@dataclass(frozen=True)
class Coverage:
    """Levels of loading that were measured in at least one repetition, and their largest force N;
    what the protocol asks for, None without one. ended: loading was to end early, where the
    displacement passed the run's own limit; then asked are the levels up to there."""

    levels: int
    reached_N: float
    asked: int | None = None
    asked_N: float | None = None
    ended: bool = False

    @property
    def partial(self) -> bool:
        """Whether k is no stiffness over the range."""
        if self.levels == 1:
            return True
        if self.asked is None or self.asked_N is None:
            return False
        few = self.levels < _MOST_MISSING * self.asked
        return few or (not self.ended and self.reached_N < NEARLY * self.asked_N)

    @property
    def words(self) -> str:
        """`1 of 5 levels, up to 60.0 of 200.0 N`."""
        if self.asked is None or self.asked_N is None:
            return f"{counted(self.levels, 'level')}, up to {number(self.reached_N, 3)} N"
        levels = f"{self.levels} of {counted(self.asked, 'level')}"
        return f"{levels}, up to {number(self.reached_N, 3)} of {number(self.asked_N, 3)} N"

    def doubt(self, key: str) -> str:
        """The sentence on k in the direction that is called `key`; empty for a whole curve."""
        if not self.partial:
            return ""
        of = "" if self.asked is None else " in the protocol"
        why = "an average over a part of the levels is no stiffness over the range"
        if self.levels == 1:
            why = "a secant through one level is no stiffness over a range"
        missing = self.asked is not None and self.asked > self.levels
        which = "the levels that are missing" if missing else "more levels"
        return (
            f"k in {key} rests on {self.words}{of}: {why}. Where the curve bends, k of the whole "
            f"range is another, and may lie outside of the interval. Measure {which} before you "
            "quote k."
        )

    def to_json(self) -> dict[str, Any]:
        """Units in the keys, null for what no protocol says."""
        return {
            "measured": self.levels,
            "asked": self.asked,
            "largest_force_N": self.reached_N,
            "asked_force_N": self.asked_N,
            "partial": self.partial,
        }


def coverage(
    dataset: Measurements,
    protocol: MeasurementProtocol | None,
    found: Mapping[tuple[str, str], Stiffness],
) -> dict[tuple[str, str], Coverage]:
    """(pose, direction) -> what its k rests on; without those that have no k."""
    out = {}
    for setup, result in found.items():
        forces = {p.step: abs(p.force) for p in result.levels if p.branch == "loading"}
        if result.k is None or not forces:
            continue
        measured = Coverage(len(forces), max(forces.values()))
        out[setup] = measured if protocol is None else _beside(measured, dataset, protocol, setup)
    return out


def _beside(
    measured: Coverage,
    dataset: Measurements,
    protocol: MeasurementProtocol,
    setup: tuple[str, str],
) -> Coverage:
    """With what the protocol asks for in that pose and direction."""
    asked = {
        step.number: abs(step.target_N)
        for run in protocol.runs
        if (run.pose, run.direction) == setup
        for step in protocol.steps(run)
        if step.branch == "loading"
    }
    if not asked:
        return measured
    end = _end(dataset, setup)
    if end is not None:
        asked = {n: force for n, force in asked.items() if n <= end} or asked
    levels, reached = measured.levels, measured.reached_N
    return Coverage(levels, reached, len(asked), max(asked.values()), end is not None)


def _end(dataset: Measurements, setup: tuple[str, str]) -> int | None:
    """The last step to which the displacement let loading come, where it ended loading."""
    mine = of_setup(dataset.columns, *setup)
    ends = [
        step if recorded else step - 1
        for at, step, recorded in ends_of_loading(dataset.columns, dataset.events)
        if at and mine[at - 1]
    ]
    return max(ends, default=None)
