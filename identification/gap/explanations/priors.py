"""How likely explanations are before the data are looked at.

0.5 for a rig whose simulation misses nothing, 0.37 for one effect, 0.05 for what no word names;
every further effect has odds 1:20. Within a count all words (or sets of words) are equally likely,
but for what some data make rarer.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from math import comb, exp, log
from typing import NamedTuple

from identification.gap.model.bench import Bench
from identification.gap.recording.load_history import LoadHistory
from identification.gap.words import CURVES, UNMODELLED, WORDS

LOG_NONE, LOG_UNKNOWN = log(0.5), log(0.05)
# Of a table that shows a curve of the load, and nothing else: that has a word, whatever its form.
LOG_UNKNOWN_CURVE = log(0.002)
LOG_ONE = log(0.37)
LOG_SHAPED = log(0.5)  # share of what is unknown whose shapes are known
LOG_MORE = log(0.05)
# A bolted stand slips less often than a joint or its controller gives way.
LOG_RARE = {"base_slip": log(0.5)}


def log_unknown(course: LoadHistory) -> float:
    """Of what no word names, whatever its shape."""
    return LOG_UNKNOWN_CURVE if course.only_a_curve else LOG_UNKNOWN


class Rarer(NamedTuple):
    """Sets with one of the words, and with none of those `without`, are so many nats rarer where
    the course of the load is such."""

    nats: float
    words: frozenset[str]
    without: frozenset[str]
    where: Callable[[LoadHistory], bool]


_HYSTERESIS, _YIELD = frozenset({"joint_hysteresis"}), frozenset({"joint_yield"})
_CREEP, _LAG = frozenset({"joint_creep"}), frozenset({"time_lag"})
_TOUCHES = frozenset({"contact_seating", "joint_backlash"})
_ANY, _NO_WORD = frozenset(WORDS), frozenset[str]()
# Evidence of running recordings is tempered: 10 nats there are odds of about 3, 20 of 10, 30 of 40.
RARER = (
    # Friction that was never seen to make a loop.
    Rarer(log(0.05), _HYSTERESIS, _NO_WORD, lambda c: c.monotonic),
    # A force that drifts, made up for by a load that goes the other way.
    Rarer(-30.0, frozenset({"force_drift"}), _NO_WORD, lambda c: c.turns_alike),
    # A target that warms up while it is held in place.
    Rarer(log(0.05), frozenset({"thermal_drift"}), _NO_WORD, lambda c: c.imposed),
    # Loops at one rate are commonly friction; what comes late differs from it in details only, and
    # two of that kind in more of them.
    Rarer(-30.0, _CREEP, _NO_WORD, lambda c: c.one_rate),
    Rarer(-30.0, _LAG, _NO_WORD, lambda c: c.one_rate),
    # A single pull that ends nearly flat: of 12 such records of others, 11 were of what yields.
    Rarer(-20.0, CURVES, _YIELD, lambda c: c.flows_out),
    # The force falls while the stroke goes on, which of what is elastic only what snaps over does:
    # of 13 such records of others (by a fortieth to a fifth) none was.
    Rarer(-20.0, CURVES, _YIELD, lambda c: c.gives_in),
    # A way at no force before all of it: what is not there yet has no curve.
    Rarer(-20.0, _ANY, _TOUCHES, lambda c: c.approaches),
    # Loaded from one side and let go again and again: friction that is seen the first time only.
    Rarer(-30.0, _HYSTERESIS, _NO_WORD, lambda c: c.comes_back_as_it_went),
    # What slips or flows on its way through no load, and yet is at its zero there.
    Rarer(-30.0, _HYSTERESIS | _YIELD, _NO_WORD, lambda c: c.crosses_its_zero),
    # Metal that flows back under a pull.
    Rarer(-20.0, _YIELD, _HYSTERESIS, lambda c: c.rubs),
)


def prior_of(words: frozenset[str], bench: Bench | None = None) -> float:
    """log prior of one set of words; bench: data that make some of them rarer."""
    if not words:
        return LOG_NONE
    rare = sum(LOG_RARE.get(w, 0.0) for w in words)
    if bench is not None:
        rare += _of_course(words, bench.load_history) + _by_calibration(words, bench)
    named = words - frozenset(UNMODELLED)
    first = LOG_ONE if named == words else LOG_UNKNOWN + LOG_SHAPED - log(len(UNMODELLED))
    return first + (len(words) - 1) * LOG_MORE - log(comb(len(WORDS), len(named))) + rare


def before_data(words: Collection[str]) -> dict[str, float]:
    """Probability of every word to be the main cause, of `none` and `unknown`, where data taught
    nothing; 0 of what is not among these words."""
    logs = {w: prior_of(frozenset({w})) for w in WORDS if w in words}
    logs |= {"none": LOG_NONE, "unknown": LOG_UNKNOWN}
    total = sum(exp(v) for v in logs.values())
    return {w: exp(logs[w]) / total if w in logs else 0.0 for w in [*WORDS, "none", "unknown"]}


def _of_course(words: frozenset[str], course: LoadHistory) -> float:
    return sum(
        r.nats for r in RARER if words & r.words and not words & r.without and r.where(course)
    )


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
    return sum(log(max(3 * stated[w] / total, 1e-3)) for w in stated if w in words)
