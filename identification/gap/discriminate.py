"""What to measure next: the procedure that would tell two explanations apart.

Every pair of words differs in what some observation would show; among those that the data lack,
the one that separates best is proposed. Order: signals that separate for certain first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from identification.gap.bench import Bench
from identification.gap.compare import LINEAR
from identification.gap.data import UNLOADING

IN_JOINTS = frozenset(
    [
        "joint_yield",
        "joint_backlash",
        "joint_nonlinear_stiffness",
        "joint_hysteresis",
        "joint_creep",
        "joint_stiffness_error",
    ]
)
_LASTING = frozenset({"joint_yield", "base_slip", "joint_hysteresis"})
_REVERSIBLE = frozenset({"joint_nonlinear_stiffness", "contact_seating", "joint_backlash"} | LINEAR)
_SLOW = frozenset({"joint_creep", "time_lag", "thermal_drift", "force_drift", "zero_shift"})


@dataclass(frozen=True)
class NextMeasurement:
    """What to do, which two words it separates, and a short key of the kind of procedure."""

    text: str
    separates: tuple[str, str]
    kind: str


def next_measurement(bench: Bench, first: str, second: str) -> NextMeasurement | None:
    """The proposal for two words; None where these data hold all that would separate them."""
    words = {first, second}
    for kind, separates, missing, text in _PROCEDURES:
        if separates(words) and missing(bench):
            return NextMeasurement(text, (first, second), kind)
    return None


def _no_q(bench: Bench) -> bool:
    return bench.data.arm and not bench.has_q


def _no_unloading(bench: Bench) -> bool:
    falling = np.diff(np.abs(bench.load))
    return not bool(np.any(bench.rows.branch == UNLOADING)) and not (
        bench.rows.continuous and falling.min() < -0.2 * np.ptp(bench.load)
    )


def _one_pose(bench: Bench) -> bool:
    return bench.data.arm and len({s.pose for s in bench.data.setups}) < 2


def _no_components(bench: Bench) -> bool:
    return bench.data.arm and bench.rows.tangential is None


def _no_plateaus(bench: Bench) -> bool:
    return int(bench.rows.zero.sum()) < 2 * len(np.unique(bench.rows.run))


def _short_holds(bench: Bench) -> bool:
    return float(np.median(bench.rows.hold_weight)) < 30


def _always(_: Bench) -> bool:
    return True


def _across(one: frozenset[str], other: frozenset[str]) -> Callable[[set[str]], bool]:
    return lambda words: bool(words & one) and bool(words & other)


def _joint_or_not(words: set[str]) -> bool:
    return len(words & IN_JOINTS) == 1


_PROCEDURES: tuple[tuple[str, Callable[[set[str]], bool], Callable[[Bench], bool], str], ...] = (
    ("readings", _joint_or_not, _no_q,
     "Record the joint positions (output encoders) during the same procedure: what happens in a "
     "joint shows in its reading, what happens in the base, the links or instruments does not."),
    ("unload", _across(_LASTING, _REVERSIBLE), _no_unloading,
     "Unload in the same steps and hold at zero load after every run: what comes back is elastic, "
     "what stays is yield or slip."),
    ("components", lambda w: "load_misalignment" in w, _no_components,
     "Record all three components of the force: a load that acts askew shows in the other two."),
    ("poses", lambda w: len(w & LINEAR) == 2, _one_pose,
     "Repeat the procedure in a second pose with another lever (TCP 300 mm nearer to the base, and "
     "elbow turned): springs, links, base and gains scale differently with the pose."),
    ("directions", lambda w: len(w & LINEAR) == 2, lambda b: len(b.data.setups) < 6,
     "Load along all three base axes, in both senses: leverage differs per axis, gains do not."),
    ("plateaus", _across(frozenset({"force_drift", "thermal_drift", "zero_shift"}),
                         IN_JOINTS | _SLOW), _no_plateaus,
     "Hold at zero load for one minute before and after every run: the drift of the force, of the "
     "displacement, and jumps of the datum show there without any load."),
    ("holds", _across(_SLOW, IN_JOINTS | _SLOW), _short_holds,
     "Hold every step for two minutes, and the last one for ten: creep goes on, friction and lags "
     "do not."),
    ("calibrate", lambda w: len(w & LINEAR) == 2, _always,
     "Check the gains: a known weight on the dynamometer (1 %), a gauge block under the laser "
     "(0.2 %); what then remains is the arm's."),
    ("steps", _across(IN_JOINTS, IN_JOINTS | frozenset({"base_slip", "contact_seating"})), _always,
     "Repeat with half the step size and cycles of growing amplitude (30, 60, 100 % of the load), "
     "unloading fully in between: thresholds, loops and curves respond differently to amplitude."),
)  # fmt: skip
