"""Stiffness of one pose and direction: k with its budget, pointwise k, knee, and ratios of two k.

What is estimated. The default is the line u = F / k through the origin, deviations of u taken in
proportion to u (`estimate.line`), over the loading levels before a knee: the convention that gives
the published 95.94 and 57.42 N/mm from the published curves. For a curved line such a k is an
average over the levels, and depends on weights and levels; so the choice is part of the result,
and k under the other choices stands beside it. The intervals are about the same functional of the
noise-free curve at the same levels.

What is uncertain. Points of one run share their errors (mounting, zero line, friction), so the
covariance of the fit is far too small, and is not used: type A is the scatter of k between
repetitions (Student's t with n - 1 degrees of freedom), type B the two gains, which all
repetitions share; the force's gain also moves the levels at which a curved line is averaged. With
a single repetition the stated uncertainties of its levels stand in for the scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from identification.curve import Curve, Point
from identification.cut_short import cut_short
from identification.estimate import (
    MANY,
    WEIGHTINGS,
    Choice,
    Weighting,
    gain_effect,
    line,
    stated_uncertainty,
    stiffness,
)
from identification.knee import MIN_BEFORE, SLOPE_RATIO, Kink, find_knee, locate
from identification.levels import (
    Grid,
    Hysteresis,
    Level,
    LevelTable,
    PointwiseStiffness,
    grid_of,
    hysteresis,
    pointwise,
)
from identification.straight import Status, bend, judge, leaves_line, levels_move, undefined
from identification.uncertainty import Contribution, Quantity, combined


@dataclass(frozen=True)
class Options:
    """weighting, intercept None: the default, which depends on the data (see `default_choice`).

    keep_after_knee: steps after a knee, or where the displacement ended loading, count towards k.
    """

    weighting: Weighting | None = None
    intercept: bool | None = None
    keep_after_knee: bool = False


@dataclass(frozen=True)
class Exclusion:
    """A loading step that does not count towards k, and why; repetition None: in all of them."""

    step: int
    reason: str
    repetition: int | None = None


@dataclass(frozen=True)
class Knee:
    """Where the arm gives way: force N and displacement m (means over the repetitions, the gains
    in their uncertainty), slopes N/m just before and behind, evidence as difference of BIC."""

    force: Quantity
    displacement: Quantity
    k_before: float
    k_after: float
    evidence: float


@dataclass(frozen=True)
class Alternative:
    """k under another choice, with its combined standard uncertainty (N/m)."""

    choice: Choice
    after_knee: bool
    value: float
    u: float


@dataclass(frozen=True)
class Stiffness:
    """Everything that one curve says. status "undefined": `k` is None and `sentence` says why.

    k N/m; by_repetition: k of every repetition, (R,); intercept m: u0 of the line. bent: the curve
    is not straight within its noise, steps after a knee included.
    """

    status: Status
    sentence: str
    choice: Choice
    choice_reason: str
    k: Quantity | None = None
    intercept: float = 0.0
    budget: tuple[Contribution, ...] = ()
    by_repetition: tuple[float, ...] = ()
    levels: tuple[Level, ...] = ()
    pointwise: tuple[PointwiseStiffness, ...] = ()
    excluded: tuple[Exclusion, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    knee: Knee | None = None
    hysteresis: Hysteresis | None = None
    bent: bool = False
    notes: tuple[str, ...] = field(default=())

    @property
    def steps_out(self) -> frozenset[int]:
        """Steps that count in no repetition."""
        return frozenset(e.step for e in self.excluded if e.repetition is None)

    def counts(self, repetition: int, step: int) -> bool:
        """Whether a loading step of a repetition counts towards k."""
        both = (None, repetition)
        return not any(e.step == step and e.repetition in both for e in self.excluded)


def analyze_curve(curve: Curve, options: Options | None = None) -> Stiffness:
    """Stiffness of a curve. Whatever the data are, the answer is a status, not an exception."""
    options = options or Options()
    choice, reason = default_choice(curve, options)
    points, excluded = _usable(curve)
    curve = replace(curve, points=points)
    loading, unloading = grid_of(points, "loading"), grid_of(points, "unloading")
    bare = Stiffness(
        "undefined",
        "",
        choice,
        reason,
        levels=(*loading.levels(), *unloading.levels()),
        excluded=excluded,
        notes=curve.notes,
    )
    problem = undefined(loading.mean(), curve.origin and not choice.intercept)
    if problem:
        return replace(bare, sentence=problem)
    knee, behind = _knee(curve, loading)
    used = loading
    if not options.keep_after_knee:
        past = {} if knee is None else dict.fromkeys(behind, _why(knee))
        out = dict.fromkeys(curve.ends, ENDED) | past
        used = loading.keep(s for s in loading.steps if s not in out)
        excluded = (*excluded, *(Exclusion(s, out[s]) for s in loading.steps if s in out))
    loop = hysteresis(curve, loading, unloading)
    described = replace(
        bare,
        excluded=excluded,
        notes=(*bare.notes, WRONG_WAY) if loop is not None and loop.gives_back else bare.notes,
        knee=knee,
        pointwise=pointwise(loading, origin=curve.origin),
        hysteresis=loop,
        bent=leaves_line(loading, origin=curve.origin),
    )
    return _with_k(described, curve, loading, used)


ENDED = (
    "the displacement ended loading there, ahead of the force: a level by itself may be where the "
    "arm gives way"
)
WRONG_WAY = (
    "The loop runs the wrong way: more work came back than was put in, which no rig does. See to "
    "the names of the branches, the order of the rows, the signs, and to what lags or drifts."
)


def default_choice(curve: Curve, options: Options) -> tuple[Choice, str]:
    """The choice that holds, and why.

    Unless asked otherwise: the published convention where an unloaded state was measured and levels
    were held; else an intercept and equal weights, since nothing says where the origin lies, and
    bins of a cycle through zero must not weigh more the smaller their displacement.
    """
    natural = curve.origin and curve.held
    weighting = options.weighting or ("proportional" if natural else "none")
    intercept = not natural if options.intercept is None else options.intercept
    if options.weighting is not None or options.intercept is not None:
        return Choice(weighting, intercept), "as asked for"
    if natural:
        return Choice(weighting, intercept), "the convention of the published values"
    missing = "no unloaded state was measured" if not curve.origin else "no levels were held"
    return Choice(weighting, intercept), f"{missing}, so the line is free to miss the origin"


def ratio(a: Stiffness, b: Stiffness) -> Quantity | None:
    """k_a / k_b. The scatter of the repetitions adds up; what both have in common cancels: a gain
    counts with the difference of its relative effects, which is zero for straight curves.

    None where one of the two is undefined.
    """
    if a.k is None or b.k is None:
        return None
    value = a.k.value / b.k.value
    relative = [
        {p.name: replace(p, u=p.u / abs(k.value)) for p in parts if p.counted}
        for k, parts in ((a.k, a.budget), (b.k, b.budget))
    ]
    budget = [p for side in relative for p in side.values() if not p.common]
    for name, p in relative[0].items():
        if p.common and name in relative[1]:
            budget.append(replace(p, u=abs(p.u - relative[1][name].u)))
    return combined(value, [replace(p, u=abs(value) * p.u) for p in budget])


def _with_k(described: Stiffness, curve: Curve, loading: Grid, used: Grid) -> Stiffness:
    """Adds k, its budget and its rivals."""
    choice = described.choice
    try:
        table = used.mean()
        fit = line(table, choice)
        k = stiffness(table, choice)
        each = _by_repetition(used, choice)
        budget = _budget(curve, table, choice, k, each)
        if len(each) >= 2:
            stated = stated_uncertainty(table, choice) / math.sqrt(len(each))
            name = "stated noise and zero lines, within the scatter"
            budget += (Contribution(name, "B", stated, counted=False),)
    except ValueError as error:
        return replace(described, sentence=f"The stiffness is undefined: {error}.")
    status, sentence = judge(table, fit.residuals, k)
    rivals = _alternatives(curve, loading, used, choice)
    highest = float(np.abs(table.force).max())
    before = [p for p in described.pointwise if abs(p.force) <= highest]
    bends = bend(before, [a.value for a in rivals if not a.after_knee])
    alone = () if described.knee is not None else _last_alone(curve, used, choice)
    moves = levels_move(k, curve.gain_sd_force, gain_effect(table, choice, curve.gain_sd_force))
    return replace(
        described,
        status=status,
        sentence=sentence,
        notes=(*described.notes, *bends, *moves, *alone),
        k=combined(k, budget),
        intercept=fit.intercept,
        budget=budget,
        by_repetition=each,
        alternatives=rivals,
    )


def _last_alone(curve: Curve, used: Grid, choice: Choice) -> tuple[str, ...]:
    """A note where the arm may have given way behind the last level but one: a single level behind
    a knee tells none, and counts."""
    slopes = pointwise(used, origin=curve.origin)
    if not curve.held or len(slopes) < MIN_BEFORE:
        return ()
    before, last = (p.stiffness for p in slopes[-2:])
    if not last < SLOPE_RATIO * before:
        return ()
    without = stiffness(used.keep(used.steps[:-1]).mean(), choice)
    return (
        f"At the last level, step {used.steps[-1]}, the slope falls from {before * 1e-3:.3g} to "
        f"{last * 1e-3:.3g} N/mm. If the arm gives way there, k describes it no more; without that "
        f"level k is {without * 1e-3:.4g} N/mm. More levels beyond it would tell.",
    )


def _usable(curve: Curve) -> tuple[tuple[Point, ...], tuple[Exclusion, ...]]:
    """Points with a force and a displacement, of repetitions that were not cut short; the steps
    that lost one are named."""
    reasons = cut_short(curve)
    good, lost = [], []
    for p in curve.points:
        reason = reasons.get(p.repetition, "")
        if not (math.isfinite(p.force) and math.isfinite(p.displacement)):
            reason = f"repetition {p.repetition}: no valid value of force or displacement"
        if not reason:
            good.append(p)
        elif p.branch == "loading":
            lost.append(Exclusion(p.step, reason, p.repetition))
    return tuple(good), tuple(lost)


def _by_repetition(used: Grid, choice: Choice) -> tuple[float, ...]:
    """k of every repetition that determines one."""
    values = []
    for row in range(len(used.repetitions)):
        try:
            values.append(stiffness(used.run(row), choice))
        except ValueError:
            continue
    return tuple(values)


def _budget(
    curve: Curve, table: LevelTable, choice: Choice, k: float, each: tuple[float, ...]
) -> tuple[Contribution, ...]:
    """Type A and type B contributions to u(k), N/m."""
    n = len(each)
    if n >= 2:
        scatter = float(np.std(each, ddof=1)) / math.sqrt(n)
        own = Contribution(f"scatter between {n} repetitions", "A", scatter, n - 1.0)
    else:
        stated = stated_uncertainty(table, choice)
        own = Contribution("stated noise and zero line; scatter between runs unseen", "B", stated)
    force = gain_effect(table, choice, curve.gain_sd_force)
    displacement = abs(k) * curve.gain_sd_displacement
    return (
        own,
        Contribution("gain of the force", "B", force, common=True),
        Contribution("gain of the displacement", "B", displacement, common=True),
    )


def _alternatives(
    curve: Curve, loading: Grid, used: Grid, chosen: Choice
) -> tuple[Alternative, ...]:
    """k under every weighting, with and without intercept, before the knee and over all steps."""
    rivals = []
    grids = [(used, False)] + ([(loading, True)] if used.steps != loading.steps else [])
    for grid, after_knee in grids:
        table = grid.mean()
        for weighting in WEIGHTINGS:
            for intercept in (False, True):
                choice = Choice(weighting, intercept)
                if choice == chosen and not after_knee:
                    continue
                try:
                    k = stiffness(table, choice)
                    budget = _budget(curve, table, choice, k, _by_repetition(grid, choice))
                except ValueError:
                    continue
                rivals.append(Alternative(choice, after_knee, k, combined(k, budget).u))
    return tuple(rivals)


def _knee(curve: Curve, loading: Grid) -> tuple[Knee | None, tuple[int, ...]]:
    """The knee of the mean curve, placed in every repetition, and the steps behind it.

    Not looked for in a continuous recording, nor among more than `MANY` levels: a knee is told
    from a bend by what held levels leave open.
    """
    if not curve.held or len(loading.steps) > MANY:
        return None, ()
    kink = find_knee(loading.mean().samples(curve.origin))
    if kink is None:
        return None, ()
    found: list[Kink] = []
    behind: set[int] = set()
    for row in range(len(loading.repetitions)):
        samples = loading.run(row).samples(curve.origin)
        own = locate(samples, kink)
        if own is not None:
            found.append(own)
        edge = own or kink
        there = np.isfinite(loading.displacement[row])
        steps = np.array(loading.steps)[there]
        over = samples.displacement > edge.displacement + 2.0 * edge.u_displacement
        behind.update(int(s) for s in steps[over])
    found = found or [kink]
    knee = Knee(
        _over_repetitions([f.force for f in found], kink.u_force, curve.gain_sd_force),
        _over_repetitions(
            [f.displacement for f in found], kink.u_displacement, curve.gain_sd_displacement
        ),
        float(np.mean([f.k_before for f in found])),
        float(np.mean([f.k_after for f in found])),
        kink.evidence,
    )
    return knee, tuple(s for s in loading.steps if s in behind)


def _over_repetitions(values: list[float], u_single: float, gain_sd: float) -> Quantity:
    """Mean over the repetitions; scatter as type A, or the stated uncertainty of a single one."""
    mean, n = float(np.mean(values)), len(values)
    if n >= 2:
        scatter = float(np.std(values, ddof=1)) / math.sqrt(n)
        first = Contribution("scatter between repetitions", "A", scatter, n - 1.0)
    else:
        first = Contribution("stated uncertainty of the levels", "B", u_single)
    return combined(mean, [first, Contribution("gain", "B", abs(mean) * gain_sd)])


def _why(knee: Knee) -> str:
    return (
        f"after the knee at {knee.force.value:.1f} N, where the slope falls from "
        f"{knee.k_before * 1e-3:.3g} to {knee.k_after * 1e-3:.3g} N/mm: "
        "k describes the arm before it gives way"
    )
