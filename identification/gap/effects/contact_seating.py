"""The fixture between flange and laser target seats itself: soft start at low force.

The same function of the force in every direction and pose, ever flatter: `d (1 - exp(-F/F0))`,
`d F / (F + F0)`, `d log(1 + F/F0)` of rough faces whose asperities take up the load one after the
other, `d F^(2/3)` of a ball on a plate (Hertz 1881), or a gap that closes on a weak spring at F0;
or several faces one after the other, which friction may hold on the way (a bolt in its hole);
unseen by encoders, 2 to 100 um. What is bedded in for the first time may stay so, all of it or
some: then it goes by the largest force so far.

Size: 2 to 100 um; 0.3 to 10 % of the deflection.
Prior: depth positive, sd out of SHARES, equally likely; force scales and laws equally likely.
Source: flattening of asperities in clamped joints, Greenwood and Williamson 1966; slip of bolted
joints within their clearance, Ibrahim and Pettit 2005.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws.closer import RefinementTarget, closing_in
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter, factors
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "contact_seating"
FORCES = (0.02, 0.05, 0.1, 0.2, 0.4)  # of the largest force
# A bench has no second direction that would tell a seat from a curved spring: only low forces.
ARMLESS_FORCES = (0.002, 0.006, 0.02, 0.05, 0.1)
ARMLESS_SLACKS = (0.0007, 0.002, 0.006, 0.02)  # under which what hangs loose comes to bear
ARMLESS_SHARES = (0.01, 0.03, 0.1)
# At low force: a gap of an arm's fixture that closes at nearly half of the load is a knee.
LATEST = 0.35
STEPS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.27, LATEST)  # of it, between which several faces seat
RUBS = (0.02, 0.05)  # of it: friction that holds them there and back
HERTZ_AT = 0.1  # of the largest force: where its scale is put
SLACKS = (0.01, 0.02, 0.04, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8)  # of an imposed stroke
_WIDEST = 0.5  # of the stroke: what bends over more than that is a curve, no toe
TOES = tuple(s for s in SLACKS if s < _WIDEST)
SEATS = (0.08, 0.16, 0.25, 0.35, 0.5, 0.7)  # of the stroke beyond a slack
LOST = {"slack": 1.0, "toe": 0.5}  # share of a slack's stroke by which the rest comes late
FINER = np.linspace(-0.32, 0.32, 9)  # of a slack that was found
SHARES = (0.003, 0.01, 0.03, 0.1)  # of the deflection

SEATED = ("exponential", "hyperbolic")
# Of an arm, whose other directions tell a seat that goes on and on from a curved spring, and a gap
# that closes on a weak spring from a knee.
BESIDES = ("logarithmic", "slack")
SCALED = (*SEATED, "logarithmic")
GOES_ON = ("logarithmic", "Hertz")  # over all of the load, like a spring
# How much of the depth is gone at x times the force scale, or at x times the stroke of a slack: of
# one that is taken up bit by bit the stiffness grows in proportion to the stroke.
LAWS: dict[str, Callable[[Array], Array]] = {
    "exponential": lambda x: np.asarray(-np.expm1(-x)),
    "hyperbolic": lambda x: np.asarray(x / (x + 1)),
    "logarithmic": lambda x: np.asarray(np.log1p(x)),
    "Hertz": lambda x: np.asarray(np.abs(x) ** (2 / 3)),
    "slack": lambda x: np.minimum(x, 1.0),
    "toe": lambda x: np.asarray(1 - np.maximum(1 - x, 0.0) ** 2),
}


# What stays as it was pressed: for good, or until the next run.
STAYS, IN_A_RUN = " that stays", " that stays until the next run"
LAWS |= {law + kept: LAWS[law] for law in SEATED for kept in (STAYS, IN_A_RUN)}
_STAYING, _BACK = 0.25, 0.3  # prior; of the largest force, by which it comes back
_RUBBING = 0.5  # prior


def variants(bench: Bench) -> list[Variant]:
    """Per force scale and law, also with some that stays, and a mixture of scales. What bears both
    ways is no seat: what is slack there is a play."""
    top = float(np.abs(bench.load).max())
    if not top > 0 or not (bench.data.arm or bench.load_history.force_keeps_its_sign):
        return []
    scales = tuple(s * bench.reach for s in (SHARES if bench.data.arm else ARMLESS_SHARES))
    out: list[Variant] = []
    columns: list[int] = []
    forces = FORCES if bench.data.arm else ARMLESS_FORCES
    for share in forces:
        for law in (*SEATED, *(BESIDES if bench.data.arm else ())):
            if law == "slack" and share > LATEST:
                continue
            out.append(_seated(bench, law, share * top, scales))
            if law == "exponential":
                columns += out[-1].columns
    if not bench.data.arm and not bench.imposed:
        out += [_seated(bench, "slack", share * top, scales) for share in ARMLESS_SLACKS]
    # a ball on a plate has no force of its own
    out.append(_seated(bench, "Hertz", HERTZ_AT * top, scales))
    out.append(
        variant(
            WORD,
            "mixture",
            columns,
            scales,
            prior=2.0,
            # in a running pull, a seat that stiffens and gives way again is the foot of a knee
            each=bench.rows.continuous and not bench.data.arm,
            within=_ever_flatter(np.array(forces)),
            force_N=0.1 * top,
            laws=tuple(("exponential", s * top) for s in forces),
        )
    )
    if bench.data.arm:
        rubs = RUBS if bench.load_history.unloads else ()
        out += [
            _one_after_the_other(bench, [s * top for s in STEPS], scales, friction * top)
            for friction in (0.0, *rubs)
        ]
    if _comes_back(bench):
        kept = [STAYS, IN_A_RUN] if np.any(bench.rest & ~bench.rebuilt) else [STAYS]
        out += [
            _some_stays(bench, law, share * top, scales, kind)
            for kind in kept
            for share in forces
            for law in SEATED
        ]
    return [*out, *_slacks(bench)]


def _ever_flatter(shares: Array) -> Array:
    """(m, k) sums of the depths of exponential seats, of shares (k,) of the largest force, that are
    not negative where the compliance of all of them never grows with the force, nor is below none:
    what gives way under more force seats nothing."""
    slope = np.exp(-_AT[:, None] / shares) / shares  # (m, k) over the largest force
    return np.vstack([slope[:-1] - slope[1:], slope[-1:]])


_AT = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0])  # of the largest force


def _comes_back(bench: Bench) -> bool:
    """Whether the force does, to show what stays."""
    size, sign = pressed(bench)
    most, _ = _so_far(size, sign, bench.rebuilt)
    return bool(np.any(most - size > _BACK * size.max()))


def _some_stays(bench: Bench, law: str, f0: float, scales: tuple[float, ...], kept: str) -> Variant:
    """A seat of which a part stays as it was pressed (kept: STAYS or IN_A_RUN)."""
    laws = ((law, f0), (law + kept, f0))
    columns = [_late(bench, *each) for each in laws]
    label = f"{law} {f0 / float(np.abs(bench.load).max()):.3g}, some{kept.removeprefix(' that')}"
    return variant(WORD, label, columns, scales, each=True, prior=_STAYING, force_N=f0, laws=laws)


def _one_after_the_other(
    bench: Bench, forces: list[float], scales: tuple[float, ...], rubs: float
) -> Variant:
    """Faces that seat between one force (N) and the next, each by a depth of its own: any depth
    that only grows. In terms of slacks, of which a step is one less a share of the one before.
    rubs: friction N that holds them."""
    columns = [_late(bench, "slack", f, rubs) for f in forces]
    edges = np.array([0.0, *forces])
    wide = np.diff(edges)
    root = np.diag(edges[1:] / wide) - np.diag(edges[1:-1] / wide[1:], 1)
    grows = np.asarray(np.linalg.inv(root))
    plain = variant(
        WORD,
        "one after the other",
        columns,
        scales,
        root=root,
        within=np.vstack([grows, _soft_first(grows, edges[1:], forces[-1] / STEPS[-1])]),
        force_N=forces[0],
        laws=tuple(("slack", f) for f in forces),
    )
    if not rubs:
        return plain
    share = rubs / forces[-1] * STEPS[-1]
    return replace(plain, prior=_RUBBING).known_by(f", rubbing {share:.2g}", rubs=rubs)


_SOFT_BY = 0.1  # of the largest force: of so much a fixture may be preloaded


def _soft_first(grows: Array, forces: Array, top: float) -> Array:
    """(m, k) sums that are not negative where what it gives per force, from a little load on, only
    falls from one force (k,) N to the next: what is stiff, then soft, then stiff again snaps."""
    depth, first = np.cumsum(grows, axis=0), int(np.argmin(np.abs(forces - _SOFT_BY * top)))
    mean = (depth[first + 1 :] - depth[first]) / (forces[first + 1 :, None] - forces[first])
    return np.asarray((mean[:-1] - mean[1:]) * forces[0])


def _seated(
    bench: Bench, law: str, f0: float, scales: tuple[float, ...], prior: float = 1.0
) -> Variant:
    """One law with a force scale N."""
    share = f0 / float(np.abs(bench.load).max())
    return variant(
        WORD,
        f"{law} {share:.3g}",
        [_late(bench, law, f0)],
        scales,
        force_N=f0,
        laws=((law, f0),),
        goes_on=law in GOES_ON,
        prior=prior,
    )


def pressed(bench: Bench) -> tuple[Array, Array]:
    """Force (n,) N on the seat and its sense. A bench that is loaded from one side presses on it
    from where its load begins, wherever the zero of its force is; an imposed stroke may begin on
    the way there."""
    if bench.data.arm or not bench.load_history.force_keeps_its_sign:
        return np.abs(bench.load), np.sign(bench.load)
    force = bench.rows.measured_force
    sense = 1.0 if force.max() >= -force.min() else -1.0
    pushed = sense * bench.load
    return np.asarray(pushed - pushed.min()), np.full(bench.rows.n, sense)


def _slacks(bench: Bench) -> list[Variant]:
    """Where the stroke is imposed, from one side: slack that is taken up before force rises, at
    once or bit by bit, told by the stroke: the force that is simulated for it knows of no slack;
    and a toe of several. After an approach what is met may seat itself."""
    if bench.data.arm or not bench.imposed:
        return []
    stroke = _stroke(bench)
    shares = {"slack": SLACKS, "toe": TOES}
    single = {law: [_slack(bench, law, s * stroke) for s in shares[law]] for law in LOST}
    toes = [v.columns[0] for v in single["toe"]]
    root = np.diag([LOST["toe"] * _given(bench, s * stroke) for s in TOES])
    laws = tuple(("toe", s * stroke) for s in TOES)
    several = variant(
        WORD,
        "toes",
        toes,
        (0.1, 0.3, 1.0),
        root=root,
        each=True,
        prior=2.0,
        force_N=TOES[-1] * stroke,
        laws=laws,
    )
    out = [v for vs in single.values() for v in vs]
    if bench.load_history.approaches:
        out += [_then_seats(bench, s * stroke, 1 / len(SLACKS)) for s in SLACKS]
    return [*out, several]


def _slack(bench: Bench, law: str, force: float, prior: float = 1.0) -> Variant:
    """One slack, as wide as the simulated spring gives under a force N."""
    d = LOST[law] * _given(bench, force)
    share = force / _stroke(bench)
    return variant(
        WORD,
        f"{law} {share:.3g}",
        [_late(bench, law, force)],
        (0.5 * d, d),
        force_N=force,
        laws=((law, force),),
        prior=prior,
    )


def _then_seats(bench: Bench, force: float, prior: float) -> Variant:
    """A slack, as wide as the simulated spring gives under a force N; what it meets there seats
    itself, and gets stiffer by steps."""
    stroke = _stroke(bench)
    wide = [force, *(force + s * (stroke - force) for s in SEATS)]
    root = np.diag([_given(bench, w) for w in wide])
    return variant(
        WORD,
        f"slack {force / stroke:.3g}, then seats",
        [_late(bench, "slack", w) for w in wide],
        (0.1, 0.3, 1.0),
        root=root,
        each=True,
        prior=prior,
        force_N=force,
        laws=tuple(("slack", w) for w in wide),
    )


def _late(bench: Bench, law: str, force: float, rubs: float = 0.0) -> int:
    """Column of what is lost to one law of a force, or of a slack's stroke, N."""
    return bench.add(bench.outside_column(lost(bench, law, force, rubs)))


def lost(bench: Bench, law: str, force: float, rubs: float = 0.0) -> Array:
    """(n,) what one law of a force scale N takes of its depth. rubs: friction N that takes its part
    of the force first, there and back."""
    size, sign = pressed(bench)
    if rubs:
        carried = bench.plays(sign * size, np.array([rubs]), bench.rebuilt)[:, 0]
        size, sign = np.abs(carried), np.sign(carried)
    for kept, fresh in ((STAYS, bench.rebuilt), (IN_A_RUN, bench.rebuilt | bench.rest)):
        if law.endswith(kept):
            size, sign = _so_far(size, sign, fresh)
    return np.asarray(sign * LAWS[law](size / force))


def _so_far(size: Array, sign: Array, fresh: Flags) -> tuple[Array, Array]:
    """The largest of sizes (n,) since what was pressed was fresh (n,), and its sign."""
    most, way = size.copy(), sign.copy()
    for part in np.split(np.arange(len(size)), np.flatnonzero(fresh)[1:]):
        most[part] = np.maximum.accumulate(size[part])
        first = np.where(size[part] == most[part], np.arange(len(part)), 0)
        way[part] = sign[part][np.maximum.accumulate(first)]
    return most, way


def _stroke(bench: Bench) -> float:
    """N that the simulated spring takes for all of the stroke."""
    return float(pressed(bench)[0].max())


def _given(bench: Bench, force: float) -> float:
    """m that the simulated spring gives under a force N."""
    return force * float(np.abs(bench.slope * bench.load).max() / np.abs(bench.load).max())


def met_closely(v: Variant, *, arm: bool) -> str | None:
    """The kind of slack of which the width has to be met well, or of an arm's seat of which the
    scale has to be; None of others."""
    kinds = [law for law, _ in v.info["laws"]]
    if kinds[0] == "slack" or kinds == ["toe"]:
        return " ".join(kinds[:2])
    return kinds[0] if arm and len(kinds) == 1 and kinds[0] in SCALED else None


def refined(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Slacks, or seats, about one that was found, close: of the steps of a first look."""
    law, force = found.info["laws"][0]
    wide = force * (1 + close * FINER)
    if not bench.imposed:
        latest = LATEST * float(np.abs(bench.load).max())
        wide = wide[wide <= latest] if bench.data.arm else wide
        return [_seated(bench, law, f, found.scales, 1 / len(FINER)) for f in wide.tolist()]
    most = _WIDEST if law == "toe" else 1.0
    wide = wide[wide < most * _stroke(bench)].tolist()
    if len(found.columns) > 1:
        return [_then_seats(bench, w, 1 / len(SLACKS) / len(FINER)) for w in wide]
    return [_slack(bench, law, w, 1 / len(FINER)) for w in wide]


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """A force above the largest that was read closes nothing that was seen."""
    f0, top = float(v.info["force_N"]), float(np.abs(bench.load).max())
    most = float(np.ptp(np.append(bench.rows.measured_force, 0.0))) if bench.imposed else top
    scales = v.info["laws"]
    at_top = np.array([LAWS[law](np.array(top / scale)) for law, scale in scales])
    return {
        "depth": found.linear(at_top, "mm", 1e3),
        "force_scale": replace(factors(f0, 2.0, "N"), most=most),
    }


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: saturating curves of the force."""
    rubs = {"rubs": float(v.info["rubs"])} if v.info.get("rubs") else {}
    terms = tuple(
        Term("depth", {"law": law, "force_scale": float(f0), **rubs}) for law, f0 in v.info["laws"]
    )
    return Law({}, terms), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """The saturating curves of `LAWS`, of the force on the seat."""
    each = [
        (str(t.shape["law"]), float(t.shape["force_scale"]), float(t.shape.get("rubs", 0.0)))
        for t in law.terms
    ]
    return [bench.outside_column(lost(bench, *one)) for one in each]


def _look_closer(word: RefinementTarget) -> list[Variant]:
    bench = word.engine.bench
    arm = bench.data.arm and not bench.imposed  # of an imposed stroke only slacks are told
    kinds = {met_closely(s.variant, arm=arm): s for s in reversed(word.alone)}
    return closing_in(word, refined, [s for kind, s in kinds.items() if kind])


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns),
    lengths=("depth",),
    finer=_look_closer,
    not_negative=("depth",),
)
