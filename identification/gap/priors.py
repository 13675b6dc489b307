"""How likely explanations are before the data are looked at.

Prior odds: a rig whose simulation misses nothing is as likely as one effect; a second effect has
odds 1:20, a third again 1:20. Within a count all words (or sets of words) are equally likely, but
for what some data make rarer.
"""

from __future__ import annotations

from math import comb, log

from identification.gap.bench import Bench
from identification.gap.effects import WORDS
from identification.gap.penalties import CURVES

LOG_NONE, LOG_UNKNOWN = log(0.5), log(0.05)
LOG_ONE = log(0.37)
LOG_MORE = log(0.05)
# A bolted stand slips less often than a joint or its controller gives way.
LOG_RARE = {"base_slip": log(0.5)}
# Friction that was never seen to make a loop; a target that warms up while it is held in place.
LOG_UNSEEN, LOG_HELD = log(0.05), log(0.05)

# Loops at one rate are commonly friction; what comes late differs from it in details of the curve
# only (tempered, as all of a running recording: odds of 40).
LOG_ONE_RATE = -30.0
# A single pull that ends nearly flat: of 12 such records of others, 11 were of what yields
# (tempered: odds of 10).
LOG_FLOWS = -20.0
# A way at no force before all of it: what is not there yet has no curve (tempered: odds of 10).
LOG_APPROACH = -20.0
# Loaded from one side and let go again and again: friction that is seen the first time only, metal
# that flows back under a pull (tempered: odds of 40 and 10).
LOG_NO_LOOP, LOG_ALL_LOOPS = -30.0, -20.0
_LATE = frozenset({"joint_creep", "time_lag"})


def prior_of(words: frozenset[str], bench: Bench | None = None) -> float:
    """log prior of one set of words; bench: data that make some of them rarer."""
    if not words:
        return LOG_NONE
    rare = sum(LOG_RARE.get(w, 0.0) for w in words)
    if bench is not None:
        rare += LOG_UNSEEN * ("joint_hysteresis" in words and bench.once)
        rare += LOG_HELD * ("thermal_drift" in words and bench.imposed)
        rare += LOG_ONE_RATE * (bool(words & _LATE) and bench.one_rate)
        bent = bool(words & CURVES) and "joint_yield" not in words
        rare += LOG_FLOWS * (bent and bench.flows_out)
        touches = "contact_seating" in words or "joint_backlash" in words
        rare += LOG_APPROACH * (bool(words) and not touches and bench.approaches)
        rare += LOG_NO_LOOP * ("joint_hysteresis" in words and bench.comes_back_as_it_went)
        flows = "joint_yield" in words and "joint_hysteresis" not in words
        rare += LOG_ALL_LOOPS * (flows and bench.rubs)
        rare += _by_calibration(words, bench)
    return LOG_ONE + (len(words) - 1) * LOG_MORE - log(comb(len(WORDS), len(words))) + rare


def _by_calibration(words: frozenset[str], bench: Bench) -> float:
    """One direction of a rig without an arm shows one factor, whoever is off: the words share it in
    proportion to the relative sd that is stated for each (the far tails of Cauchy priors)."""
    meter = bench.data.instruments
    stated = {
        "joint_stiffness_error": float(bench.data.compliance_relative_sd.max(initial=0.0)),
        "force_scale": meter.force_gain,
        "displacement_scale": meter.displacement_gain,
    }
    total = sum(stated.values())
    if bench.data.arm or not total > 0:
        return 0.0
    return sum(log(max(3 * stated[w] / total, 1e-3)) for w in words & stated.keys())
