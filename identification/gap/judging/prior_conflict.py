"""Whether an explanation asks for what its own priors exclude.

The stated uncertainties of the rig (springs, tares, gains, cross-talk, scatter of runs) and the
pieces of a warming rig's path are standard normal in their own coordinates (`Fit.pulls`). One that
has to be many standard deviations off says that the data and what was stated contradict each other
under this explanation, however well it fits: cross-talk of forty of them is none (prior-data
conflict; Evans and Moshonov, Bayesian Analysis 1 (2006) 893-914). What mechanisms need of their own
coefficients is no such thing: their laws are families, and the larger the effect the plainer shows
how far off they are.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.engine import LEVER_M, Engine
from identification.gap.evidence.lognormal_springs import nats_of
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import REMAINDER
from identification.gap.explanations.fit import Fit
from identification.gap.explanations.verdict import ARM_AS_STATED
from identification.gap.words import FRICTION, MECHANISMS, SPRINGS

# Standard deviations. Of 360 known effects and mixtures of the blind check three were beyond 5 and
# two beyond 5.5; of 16 stand-ins that were strained at all 13 beyond 6, the others between 5 and 6.
LIMIT = 5.5
# Of one step of a path among a dozen: of 60 paths of air that wanders the largest was at 3.5.
JUMP = 4.2
_RESTS_ELSEWHERE = FRICTION | {"joint_backlash"}


def prior_conflict(engine: Engine, fitted: Fit, eta: float) -> float:
    """Prior-data conflict of an explanation in standard deviations: the largest single coordinate
    of base and thermal drift, or what the sum of all squares exceeds its expectation by, whichever
    is larger. eta m: the imperfection of the laws, which may pull everything by as much as moves
    that."""
    return _most(engine, _of_base(engine, fitted, eta), _of_heat(engine, fitted))


def _most(engine: Engine, base: Array, heat: Array) -> float:
    """By themselves all count; together all but what joints are read elsewhere by in each setup:
    there are many of these, and most say nothing."""
    largest = max(float(base.max(initial=0.0)), float(heat.max(initial=0.0)))
    told = np.concatenate([np.delete(base, engine.base.index("offset setup")), heat])
    count = len(told)  # a chi square of so many degrees of freedom, at most
    together = float(told @ told - count) / float(np.sqrt(2 * count))
    return max(largest, together)


_CALLED = {
    "spring": "the stiffness of a joint",  # with its number
    "gain": "the gain of an instrument",
    "tare": "the zero of the force",
    "crosstalk": "the cross-talk of the force",
    "offset": "a joint reading at rest",
    "scatter": "the datum of a run",
    "datum": "the datum of the displacement",
    "geometry": "the turn of the levers under load",
    "known": "an effect of the model",
}


def what_is_strained(engine: Engine, fitted: Fit, eta: float) -> str:
    """What an explanation asks most of, and how much, for people; empty where that is allowed."""
    base, heat = _of_base(engine, fitted, eta), _of_heat(engine, fitted)
    if _most(engine, base, heat) <= LIMIT:
        return "" if fitted.parts else _beyond_stated(engine, fitted)
    if heat.max(initial=0.0) > LIMIT and heat.max() > base.max(initial=0.0):
        return "heat that jumps"
    worst = int(base.argmax())
    if base[worst] <= LIMIT:
        return "many things a little off what META states"
    return _off(engine.base.names[worst], float(base[worst]))


def _beyond_stated(engine: Engine, fitted: Fit) -> str:
    """The spring or gain that is farthest off, where no fault at all is to be wrong."""
    each = _springs_and_gains(engine, fitted)
    worst = max(each, key=lambda name: each[name], default="")
    return _off(worst, each[worst]) if worst and each[worst] > ARM_AS_STATED else ""


def _off(name: str, deviations: float) -> str:
    called = next(v for k, v in _CALLED.items() if name.startswith(k))
    if name.startswith("spring"):
        called = f"the stiffness of joint {name.removeprefix('spring')}"
    who = "the model" if called == _CALLED["known"] else "META"
    return f"{called} {deviations:.0f} standard deviations off what {who} states"


def _of_base(engine: Engine, fitted: Fit, eta: float) -> Array:
    """(b,) Springs that are said to be off may be off, and so may that of a joint whose mechanism
    brings its own mean stiffness; a joint that plays, yielded or rubs may rest elsewhere without
    load, by as much as that moves it, and so may its reading be off; a force that drifts has done
    so since it was tared; a whole run may be off as far as META states of one sample, which
    repetitions scatter by; tares, and offsets of the joint readings, count as far as they move a
    share of the gap that an explanation may not leave.
    """
    base, n, weight = engine.base, engine.bench.rows.n, engine.bench.rows.weight
    columns = base.columns[:n]
    where = np.maximum(weight @ (columns != 0), 1e-300)
    moves = np.sqrt(weight @ columns**2 / where)  # rms per unit, where it acts
    moves[base.index("offset")] = LEVER_M
    loose = np.divide(eta, moves, out=np.zeros(len(moves)), where=moves > 0)
    springs = list(base.springs.values())
    stated = fitted.base.copy()
    stated[springs] = base.sd[springs] * [
        _of_springs(float(fitted.base[i]), float(base.sd[i])) for i in springs
    ]
    sd = base.sd.copy()
    sd[base.index("scatter")] = engine.bench.noise.stated
    pulls = np.abs(stated) / np.hypot(sd, loose)
    for j in _springs_that_may(engine, fitted):
        pulls[base.index(f"spring{j + 1}")] = 0.0
    left = _left_at_rest(engine, fitted)
    for i in base.index("offset"):
        off = float(np.abs(fitted.base[i]))
        pulls[i] *= max(1.0 - left[int(base.names[i].split()[-1]) - 1] / max(off, _TINY), 0.0)
    if any(p.word == "force_drift" for p in fitted.parts):
        pulls[base.index("tare")] = 0.0
    constant = base.index("tare") + base.index("offset")
    size = moves[constant] * np.abs(fitted.base[constant])
    pulls[constant] *= np.minimum(size / max(REMAINDER * engine.structural, 1e-300), 1.0)
    return np.asarray(pulls)


def most_off(engine: Engine, fitted: Fit) -> float:
    """By how many standard deviations springs and gains are off at most, but for those that may be.
    What is normal in a gain is not in the share of its readings that is too much, nor what is in
    the compliance of a rig without an arm in its stiffness: by both."""
    return max(_springs_and_gains(engine, fitted).values(), default=0.0)


def _springs_and_gains(engine: Engine, fitted: Fit) -> dict[str, float]:
    """Name -> standard deviations."""
    base, out = engine.base, {}
    free = {f"spring{j + 1}" for j in _springs_that_may(engine, fitted)}
    for name, change, sd in zip(base.names, fitted.base.tolist(), base.sd.tolist(), strict=True):
        spring = name.startswith("spring")
        if name in free or not (spring or name.startswith("gain")):
            continue
        if spring and engine.bench.data.arm:
            out[name] = abs(_of_springs(change, sd))
        else:
            whole = 1 + change if spring else 1 - change
            out[name] = max(abs(change), abs(change / max(whole, _NEARLY_NONE))) / sd
    return out


def _of_springs(change: float, sd: float) -> float:
    """Standard deviations that a relative change of a compliance is, of what is lognormal."""
    return float(np.log(max(1 + change, _NEARLY_NONE)) / nats_of(np.array(sd)))


_NEARLY_NONE = 1e-6


def _springs_that_may(engine: Engine, fitted: Fit) -> Iterable[int]:
    """Joints whose spring may be off: all where springs are said to be, else those whose mechanism
    brings its own mean stiffness."""
    if any(p.word == SPRINGS for p in fitted.parts):
        return range(engine.bench.data.joints)
    return {j for p in fitted.parts if p.word in MECHANISMS for j in p.variant.joints}


def _left_at_rest(engine: Engine, fitted: Fit) -> Array:
    """(m,) rad by which every joint may rest elsewhere: the most that its
    plays, yields and friction turn it by."""
    q, joints = engine.bench.layout.q, engine.bench.data.joints
    out = np.zeros(joints)
    for i, part in enumerate(fitted.parts):
        if part.word in _RESTS_ELSEWHERE and q.stop > q.start:
            turned = np.abs(fitted.contribution(engine, i)[q].reshape(joints, -1)).max(axis=1)
            mine = list(part.variant.joints)
            out[mine] += turned[mine]
    return out


_TINY = 1e-300


def _of_heat(engine: Engine, fitted: Fit) -> Array:
    """Heat has inertia: its path does not jump. What the force drifts is read at zero load."""
    out = [np.zeros(0)]
    for i, part in enumerate(fitted.parts):
        if part.word == "thermal_drift":
            pulls = fitted.pulls_of(i)
            out.append(np.abs(pulls))
            if part.variant.free_pieces:
                jumps = _jumps(engine, part, pulls) * LIMIT / JUMP
                out.append(jumps * _of_the_gap(engine, fitted.contribution(engine, i)))
    return np.concatenate(out)


def _of_the_gap(engine: Engine, contribution: Array) -> float:
    """1 for what moves at least a share of the gap that an explanation may not leave, less below:
    what a slip leaves, a little heat beside it may mop up."""
    size = engine.bench.rows.rms_about_means(contribution[: engine.bench.rows.n])
    return min(size / max(REMAINDER * engine.structural, 1e-300), 1.0) ** 2


def _jumps(engine: Engine, part: Part, pulls: Array) -> Array:
    """The largest step (paths,) of every free path against its other ones, and the next to it that
    goes the same way, by the normal deviate that is as seldom: where steps are of one size, however
    large, or get smaller one by one, none stands out. A steady path comes with a place and a rate;
    steps are what it turns by, and a jump turns it there and back. pulls: of all paths."""
    from scipy.special import ndtri, stdtr

    pieces, first = part.variant.free_pieces, 2 * part.variant.steady
    seen = np.any(engine.columns(part.variant.columns)[: engine.bench.rows.n] != 0, axis=0)
    out = []
    for steps, there in zip(pulls.reshape(-1, pieces), seen.reshape(-1, pieces), strict=True):
        taken = steps[first:][there[first:]]
        if len(taken) < _STEPS:
            continue
        i = int(np.abs(taken).argmax())
        rest = float(np.sqrt(np.mean(np.delete(taken, i) ** 2)))
        beside = (np.sign(taken[i]) * taken)[max(i - 1, 0) : i + 2]
        next_to = float(np.sort(beside)[-2])  # of itself and one or two neighbours
        ratio = abs(float(taken[i])) / max(rest, next_to, 1e-300)
        out.append(-ndtri(max(stdtr(len(taken) - 1, -ratio), 1e-300)))
    return np.array(out)


_STEPS = 4  # of a path, of which one may stand out
