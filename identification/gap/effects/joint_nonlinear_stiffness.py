"""Elastic, reversible, curved: gears harden with torque (K1 < K2 < K3), other parts soften.

The deflection beyond the linear spring is a smooth curve of the torque: hinges
`max(|tau| - b, 0) sgn(tau)` over the range and a cubic; coefficients in units of the joint's
compliance. A joint that carries the arm's weight has its curve over the net torque, which is the
same only while it is pushed to one side in one pose. Gear catalogues: K3/K1 = 1.5 to 1.85.

Size: K3/K1 = 1.5 to 1.85 in gears; 5 to 100 % of the compliance allowed, either sign. A load that
grows moves it further: of the compliance a twentieth is left at least.
Prior: curve smooth, either sign, sd out of SCALES, equally likely; half to three quarters of it
on free curves.
Source: three-part stiffness in catalogues of strain wave gears.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws import elastic_law
from identification.gap.laws.closer import RefinementTarget, closing_in
from identification.gap.laws.curves import above, beyond, hinge
from identification.gap.laws.effect import Effect
from identification.gap.laws.elastic_forms import (
    FINE_SCALES,
    SCALES,
    WORD,
    curve,
    fine,
    further,
    level_by_level,
    locks,
)
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Laws
from identification.gap.model.bench import TOOL_KG, Bench
from identification.gap.model.variants import Variant, variant

BEND = "bend"  # a form: one bend, between neighbouring places
# Closer at the start: contacts are soft where they begin to bear, as `|tau|^(2/3)` (Hertz 1882).
HINGES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
PLACES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of corners; of all of the net torque
ALONG = tuple(k / 24 for k in range(1, 24))  # of all of the range, where it goes both ways


def variants(bench: Bench) -> list[Variant]:
    """Per joint: a smooth curve of several hinges, one quadratic, one cubic, one corner; where a
    rig without an arm came back along its curve, a finer one, and one uneven where it was loaded
    both ways."""
    out = []
    for j in bench.moving_joints():
        torque = bench.true_torque[:, j]
        top = float(np.abs(torque).max())
        if not top > 0:
            continue
        line = bench.add_joint(j, bench.compliance[j] * top * (torque / top))
        out += _alike_both_ways(bench, j, line, top)
        if not bench.data.arm and bench.load_history.monotonic and not bench.load_history.rests:
            out += locks(bench, j, line, top) + level_by_level(bench, j, line, top)
        elif not bench.data.arm and bench.rows.continuous and _came_back(bench):
            out.append(fine(bench, j, line, top))
        if _both_ways(bench, j):
            out.append(_uneven(bench, j, line))
        if bench.feels_weight(j):
            out += _net(bench, j, line)
    return out


def _alike_both_ways(bench: Bench, j: int, line: int, top: float) -> list[Variant]:
    """A free curve of hinges over the size of the torque, powers of it, and single bends between
    neighbouring hinges."""
    x, c = bench.true_torque[:, j] / top, bench.compliance[j] * top
    # a specimen that settles in its clamps has no contact inside
    hinges = HINGES if bench.data.arm else PLACES
    columns = [bench.add_joint(j, c * hinge(x, b)) for b in hinges]
    exact: dict[str, Any] = {"torque": top, "hinges": hinges}
    out = [curve(bench, j, "curve", [line, *columns], hinges, prior=0.5, **exact)]
    for name, shape, ends in (  # what they have more for a slope at the ends of the range
        ("quadratic", x * np.abs(x), np.full((1, 1), 2.0)),
        ("cubic", x**3, np.full((1, 1), 3.0)),
        ("even", x**2, 2 * np.array([[x.min()], [x.max()]])),
    ):
        column, label = bench.add_joint(j, c * shape), f"joint {j + 1} {name}"
        facts = {"joint": j, "kinds": (name,), "positive": False, **exact, **further(bench, ends)}
        out.append(variant(WORD, label, [column], SCALES, prior=0.1, **facts))
    seen, prior = _seen_from(bench, j, x), 0.2 / (len(PLACES) - 1)
    for k in range(hinges.index(PLACES[0]), len(hinges) - 1):  # below that it is lost motion
        pair = hinges[k : k + 2]
        if np.mean(pair) >= seen:
            name, both = f"{BEND} {pair[0]}", [line, *columns[k : k + 2]]
            facts = {"root": np.eye(3), "form": BEND, "prior": prior, **exact}
            out.append(curve(bench, j, name, both, pair, **facts))
    return out


def _net(bench: Bench, j: int, line: int) -> list[Variant]:
    """Curves of the net torque: alike in both senses, which tells most where it passes zero, for
    several masses of the tool; and free over all of its range, so that nobody need know weights
    well (none where the joint is pushed to one side only, under one weight)."""
    torque, weight = bench.true_torque[:, j], bench.weight(j)
    out = [_odd(bench, j, line, kg, 0.3 / len(TOOLS_KG)) for kg in TOOLS_KG]
    if bench.meets_weight_unlike(j):
        net = torque + weight
        places = float(net.min()) + float(np.ptp(net)) * np.array(PLACES)
        out.append(_above(bench, j, line, "curve of the net torque", places, SCALES))
    return out


def _above(
    bench: Bench, j: int, line: int, name: str, places: Array, scales: tuple[float, ...]
) -> Variant:
    """A free curve of the net torque, with hinges at places (k,) Nm."""
    torque, weight, c = bench.true_torque[:, j], bench.weight(j), bench.compliance[j]
    columns = [line, *(bench.add_joint(j, c * above(torque, weight, b)) for b in places)]
    kinds = [("above", float(b)) for b in places]
    exact: dict[str, Any] = {"tool_kg": TOOL_KG, "torque": float(np.abs(torque).max())}
    return curve(bench, j, name, columns, kinds, scales=scales, prior=0.4, **exact)


def _odd(bench: Bench, j: int, line: int, kg: float, prior: float) -> Variant:
    torque, hung, c = bench.true_torque[:, j], bench.weight(j, kg), bench.compliance[j]
    places = [b * float(np.abs(torque + hung).max()) for b in HINGES]
    columns = [line, *(bench.add_joint(j, c * beyond(torque, hung, b)) for b in places)]
    kinds = [("beyond", b) for b in places]
    exact: dict[str, Any] = {"tool_kg": kg, "torque": float(np.abs(torque).max()), "line": line}
    name = f"odd curve, tool {kg:.3g} kg"
    return curve(bench, j, name, columns, kinds, prior=prior, **exact)


def refined(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Curves alike in both senses, about one that was found, for masses of the tool in between:
    where they are soft about no torque, it matters where that is. close: share of the steps."""
    if "line" not in found.info or not np.any(bench.weight_per_kg(found.info["joint"])):
        return []
    masses = float(found.info["tool_kg"]) + close * _TOOL_STEPS_KG
    share = 0.3 / len(masses)
    return [_odd(bench, found.info["joint"], found.info["line"], kg, share) for kg in masses]


def corners(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Sharp corners about a bend, or a corner, that was found, as where a second spring comes to
    bear. Of arms: a specimen's curve is fine as it is. close: share of the steps."""
    places = found.info["kinds"][1:]
    if not bench.data.arm or "hinges" not in found.info or len(places) > 2:
        return []
    j, top = int(found.info["joint"]), float(found.info["torque"])
    x, c = bench.true_torque[:, j] / top, bench.compliance[j] * top
    share, out = 0.2 / (len(PLACES) - 1) / len(_ABOUT), []
    seen = _first_seen(bench, x)
    for b in (np.mean(places) + close * _ABOUT).tolist():
        if b < seen:
            continue
        columns = [found.columns[0], bench.add_joint(j, c * hinge(x, b))]
        exact: dict[str, Any] = {"torque": top, "hinges": (b,), "prior": share}
        out.append(curve(bench, j, f"corner {b:.3g}", columns, (b,), root=np.eye(2), **exact))
    return out


def _seen_from(bench: Bench, j: int, x: Array) -> float:
    """Share of the range from which on a bend is no step at no load. Of levels to either side of a
    bench's the second tells: any line goes through zero and the first."""
    if bench.data.arm:
        return _first_seen(bench, x)
    if bench.rows.continuous or not _both_ways(bench, j):
        return 0.0
    first = _first_seen(bench, x)
    return float(np.abs(x)[np.abs(x) > first].min(initial=1.0)) if first < 1 else 1.0


def _first_seen(bench: Bench, x: Array) -> float:
    """Share of the range from which on a bend shows in x (n,). What bends before the first load
    that was read is a step where the load begins: lost motion. A direction sees the bends between
    its first load and its last."""
    load, setup, out = np.abs(x), bench.rows.setup, 1.0
    for s in range(len(bench.data.setups)):
        mine = load[(setup == s) & (load > _NO_LOAD)]
        first = _HARDLY * float(mine.min(initial=1.0))
        if mine.size and mine.max() > _WELL_BEYOND * first:
            out = min(out, first)
    return out


_NO_LOAD = 0.02  # of the range
_WELL_BEYOND = 2.0  # times the first load: it takes a few levels beyond a bend to see it
_HARDLY = 1.3  # times the first load: hands set it as exactly as that
_ABOUT = np.linspace(-0.08, 0.08, 9)  # of the range
_TOOL_STEPS_KG = np.array([-0.4, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4])


TOOLS_KG = (0.5, 1.5, 2.5)


def _came_back(bench: Bench) -> bool:
    return bench.load_history.unloads or bench.load_history.repeats


def _both_ways(bench: Bench, j: int) -> bool:
    """Pulled and pressed, from zero either way, or to and fro, or through a zero that both channels
    share: any other half of a loop could be anything. Joints of an arm that carry weights have
    curves of the net torque (`_net`)."""
    course = bench.load_history
    if bench.data.arm:
        return bench.pushed_both_ways(j) and not bench.feels_weight(j)
    if course.one_sided:
        return False
    if not bench.rows.continuous:
        return len(np.unique(bench.rows.run)) > 1
    return course.crosses_its_zero or (course.unloads and course.passes > 2)


def _uneven(bench: Bench, j: int, line: int) -> Variant:
    """A curve that pull and push have each its own, or that lies off the zero of either."""
    x, arm = bench.true_torque[:, j], bench.data.arm
    places = float(x.min()) + float(np.ptp(x)) * np.array(PLACES if arm else ALONG)
    return _above(bench, j, line, "uneven curve", places, SCALES if arm else FINE_SCALES)


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """What the compliance at the largest torque has more than at none, over that at none: a hinge
    adds itself, a power its exponent; a line is part of the spring that was found. No spring loses
    more compliance, or stiffness, than it has."""
    joint, kinds = int(v.info["joint"]), v.info["kinds"]
    grows = {"line": 0.0, "quadratic": 2.0, "even": 2.0, "cubic": 3.0}
    change = bench.sense * np.array([grows.get(kind, 1.0) for kind in kinds])
    line = np.array([float(kind == "line") for kind in kinds])
    found = found.on_spring(line, joint)
    p, of_stiffness = found.per_spring(change, joint), bench.sense < 0
    p = replace(p, most=1.0) if of_stiffness else replace(p, least=-1.0)
    return {"change_of_compliance_over_range": p}


def _look_closer(word: RefinementTarget) -> list[Variant]:
    odd = [s for s in word.alone if "line" in s.variant.info]
    bends = [s for s in word.alone if s.variant.form == BEND]
    return [*closing_in(word, corners, bends[:1]), *closing_in(word, refined, odd[:1])]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(elastic_law.describe, elastic_law.columns),
    lengths=("change_of_compliance_over_range",),
    finer=_look_closer,
)
