"""Lost motion where a joint's net torque passes zero.

Net torque = load and, in an upright arm, its own weight. The joint lies at one side of its play w
or at the other: `w/2 tanh((tau - tau_0) / zone)`; with friction it stays where it was pushed until
the torque has turned: a play of radius `zone`, or half of it, on the torque, cut at the ends of
the play, or of 0.7 zones with soft ends; a spring in the play gives way in proportion, over two
zones to either side; flanks that approach slowly leave `zone / |tau|` of the play to be taken up,
of all of it or after an arc tangent. Gears with play rub too: a stop operator of the zone's
strength rides along.
Without torque the joint lies anywhere in its play, a free place per setup at its first zero load
and at later ones, or where the rubbing, or the push before, left it: it is sent to where its
reading is as commanded, another zero of that reading in every pose. The tool's mass is not known:
the torque at which the weights are balanced is sought among masses of 0 to 3 kg. Hoses and cables
may preload a joint besides, by any torque that a load overcomes.
Without an arm the crossing lies anywhere too, and an imposed displacement passes the play without
force, or with the force that friction holds: such plays are placed by the data (flanks.py), with
the springs that they bring.

Size: about 1 arcmin (3e-4 rad) with gears of ratio >= 80, ten times less and more allowed.
Prior: width positive, sd out of SCALES, equally likely; zones and crossings equally likely.
Source: lost motion in catalogues of strain wave gears.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import exp
from typing import Any

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws import lost_motion_law
from identification.gap.laws.closer import RefinementTarget, closing_in, nearly_leads, places, seen
from identification.gap.laws.effect import Effect
from identification.gap.laws.flanks import Flanks, placed, shapes
from identification.gap.laws.interval import Coefficients, Parameter, normal
from identification.gap.laws.law import Laws
from identification.gap.laws.lost_motion import (
    HELD,
    KEPT,
    KINDS,
    PLACED,
    SOFTER,
    UNEVEN,
    Play,
    crosses,
    free_places,
    less_rub,
    net,
    resting_columns,
    within_play,
    work_taken,
)
from identification.gap.model.bench import TOOL_KG, Bench
from identification.gap.model.variants import Variant, variant

WORD = "joint_backlash"
# Of those that are refined beside what was found; on a bench as far as anything was won by it.
_REFINED, _ARMLESS_REFINED = ("free", "soft", "slow", "arctan", *KEPT), ("soft", "slow", "sprung")
SMOOTH = ("soft", "slow", "arctan", "sprung")
TOOLS_KG = (0.0, 1.5, 3.0)
_PRELOADS = 8  # over the range of the net torque
_PRELOAD_PRIOR = 0.25
_SELDOM = (0.05, exp(-20.0))  # of levels; of what runs on, whose evidence is tempered
CLOSE = (0.2, 0.1, 0.04, 0.02)  # shares of the steps between masses, one look after the other
_FINE_PRIOR = 8.0  # of all finer shapes together, however often it is looked closer
_CLOSER = 0.6  # power of the share: zones need not be known as well as masses
_TOOL_STEPS_KG = np.linspace(-0.7, 0.7, 9)
_PRELOAD_STEPS = np.linspace(-0.6, 0.6, 9)  # of the steps between preloads
ZONES = (0.004, 0.012, 0.03, 0.07)  # of the joint's range of torque
_PRELOADED = (("free", "friction"), (0.03,))  # kinds and zones at first
SCALES = (1e-5, 5e-5, 2e-4, 1e-3)  # rad
_VISITED = 0.45  # of the play from an end: nearer than the middle
FRICTION = 0.3  # deflection of the friction beside the play, against the play
_SHARES = (0.003, 0.02, 0.1, 0.3)  # of the deflection, on a bench without an arm
_PLACED_PRIOR = 2.0  # as much together as four kinds of one zone


def variants(bench: Bench) -> list[Variant]:
    """Per joint: zone, with and without friction, crossing where weight and load balance, or a
    preload; in a recording that runs on from one side nowhere else: what is slack at its ends is a
    seat."""
    running = not bench.data.arm and bench.rows.continuous
    inside = running and _pressed(bench)
    # a bench is pushed along one direction after another, each on a part of its own
    kinds, out = tuple(k for k in KINDS if bench.data.arm or k not in KEPT), []
    if _pressed(bench):
        kinds = tuple(k for k in kinds if k not in SMOOTH)
    for j in bench.moving_joints():
        torque = bench.true_torque[:, j]
        span = bench.reach_of(torque)
        if not span > 0:
            continue
        places: dict[bytes, list[int]] = {}
        for name, kg, x, share in () if inside else _crossings(bench, j, span):
            for zone in ZONES:
                info: dict[str, Any] = {
                    "joint": j,
                    "zone_Nm": zone * span,
                    "crossing": name,
                    "tool_kg": kg,
                    "preload_Nm": 0.0,
                }
                label = f"joint {j + 1} {name}" + (f" tool {kg:g} kg" if share < 1 else "")
                out += _zone(bench, x, kinds, label, f"{zone:g}", share, info, places)
        out += _preloaded(bench, j, span, places)
        if running and not inside:
            flanks = placed(bench, torque)
            out += [] if flanks is None else _placed(bench, j, flanks)
    return out


def _pressed(bench: Bench) -> bool:
    """A rig without an arm that is loaded from one side: a play within its load is seldom, and as
    sharp as it was found; what is smooth there is a seat, or a curve."""
    return not bench.data.arm and bench.load_history.one_sided


def _by_preload(bench: Bench) -> float:
    """Prior of all preloads together, against the weights alone."""
    return _PRELOAD_PRIOR * (_SELDOM[bench.rows.continuous] if _pressed(bench) else 1.0)


def _crossings(bench: Bench, j: int, span: float) -> list[tuple[str, float, Array, float]]:
    """What may cross zero: name, mass of the tool, torque (n,), prior."""
    torque, plain, per_kg = bench.true_torque[:, j], bench.weight(j, 0.0), bench.weight_per_kg(j)
    masses = TOOLS_KG if np.abs(per_kg).max() * max(TOOLS_KG) > ZONES[0] * span else (TOOL_KG,)
    net = [(kg, torque + plain + kg * per_kg) for kg in masses]
    out = [
        ("weight", kg, x, 1.0 / len(masses))
        for kg, x in net
        if crosses(x, torque)  # one that its weight preloads beyond the load never does
    ]
    if np.abs(plain).max() < 0.5 * span:
        out.append(("load", TOOL_KG, torque, 1.0))
    return out


def _preloaded(bench: Bench, j: int, span: float, places: dict[bytes, list[int]]) -> list[Variant]:
    """Crossings wherever a preload may put them, and no tool does."""
    if bench.imposed:
        return []  # those are placed by the data
    plain, kinds, zones = net(bench, j, "weight", TOOL_KG), *_PRELOADED
    by_tool = float(np.abs(bench.weight_per_kg(j)).min()) * (max(TOOLS_KG) - TOOL_KG)
    low, high = float(plain.min()), float(plain.max())
    start, way = (low, 1.0) if high > -low else (high, -1.0)  # pushed as pulled
    step, out = (high - low) / _PRELOADS, list[Variant]()
    if not step > 0:
        return []
    for preload in -(start + way * (np.arange(_PRELOADS) + 0.5) * step):
        if abs(preload) < by_tool:
            continue
        for zone in zones:
            info = {
                "joint": j,
                "zone_Nm": zone * span,
                "crossing": "weight",
                "tool_kg": TOOL_KG,
                "preload_Nm": float(preload),
                "against": bool(way * preload < 0),
                "step_Nm": step,
            }
            label = f"joint {j + 1} preload {way * preload / (high - low):.2g}"
            share = _by_preload(bench) / _PRELOADS
            out += _zone(bench, plain + preload, kinds, label, f"{zone:g}", share, info, places)
    return out


def unreached(bench: Bench, variant: Variant) -> float:
    """Share of the play, 0 to 1, that no load took up: ends that flanks come near to, and, where
    the joint is taken to rest in the middle, the side to which nobody pushed it."""
    info = variant.info
    if info["kind"] in PLACED:
        return 0.0
    x = net(
        bench,
        int(info["joint"]),
        str(info["crossing"]),
        float(info["tool_kg"]),
        float(info["preload_Nm"]),
    )
    place = Play(bench, x, float(info["zone_Nm"])).place(info["kind"])
    left = [0.5 - float(place.max()), 0.5 + float(place.min())]
    return sum(v for v in left if v < _VISITED or info["kind"] in HELD)


def refined(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Zones about one that was found; where weights decide about the crossing, at masses of the
    tool in between: the zone is small beside what they do. close: share of the steps; the last ones
    are of the same kind."""
    kind = found.info["kind"]
    if kind in PLACED:
        return []
    beside: tuple[str, ...] = _REFINED if bench.data.arm else _ARMLESS_REFINED
    beside = () if _pressed(bench) else beside
    if found.info["preload_Nm"]:  # straight and soft anywhere else, it is a curve
        beside = tuple(k for k in beside if k != "sprung")
    kinds = tuple(dict.fromkeys([kind, *(beside if close >= CLOSE[0] else ())]))
    return _finer(bench, found, kinds, close)


def uneven(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """The same for ends of which one is softer: at first from scratch, for nobody looked yet."""
    kind = found.info["kind"]
    if kind in PLACED or not bench.data.arm:
        return []
    if kind in UNEVEN:
        return _finer(bench, found, tuple(UNEVEN) if close >= CLOSE[0] else (kind,), close)
    span = bench.reach_of(bench.true_torque[:, int(found.info["joint"])])
    return _finer(bench, found, tuple(UNEVEN), close, np.array(ZONES) / SOFTER * span)


def _finer(
    bench: Bench, found: Variant, kinds: tuple[str, ...], close: float, zones: Array | None = None
) -> list[Variant]:
    """Variants of these kinds about one that was found; zones (k,) Nm: others than about it."""
    info, j = dict(found.info), int(found.info["joint"])
    torque, preload = bench.true_torque[:, j], float(info["preload_Nm"])
    by_kg = info["crossing"] == "weight" and not preload and np.any(bench.weight_per_kg(j))
    weighty = bool(by_kg or preload)
    kg = float(info["tool_kg"]) + close * (_TOOL_STEPS_KG if by_kg else np.zeros(1))
    Nm = preload + close * (_PRELOAD_STEPS * info["step_Nm"] if preload else np.zeros(1))
    if zones is None:
        ratios = np.array([1 / 1.5, 1.0, 1.5]) if weighty else np.geomspace(1 / 1.5, 1.5, 7)
        zones = float(info["zone_Nm"]) * ratios**close**_CLOSER
        # what changes over more of the range is a curved spring
        widest = ZONES[-1] / (SOFTER if kinds[0] in UNEVEN else 1.0) * bench.reach_of(torque)
        zones = np.unique(np.minimum(zones, widest))
    out: list[Variant] = []
    share = _FINE_PRIOR / (1 + len(CLOSE)) / (len(kg) * len(Nm) * len(zones) * len(kinds))
    share *= _by_preload(bench) if preload else 1.0
    places: dict[bytes, list[int]] = {}
    for mass, more, zone in product(kg.tolist(), Nm.tolist(), zones.tolist()):
        x = net(bench, j, info["crossing"], mass, more)
        exact = info | {"zone_Nm": zone, "tool_kg": mass, "preload_Nm": more, "closely": True}
        where = f"preload {more:.3g} Nm" if preload else str(info["crossing"])
        where += "" if preload or not bench.data.arm else f" tool {mass:.2f} kg"
        label, size = f"joint {j + 1} {where}", f"{zone:.3g} Nm fine"
        out += _zone(bench, x, kinds, label, size, share, exact, places)
    return out


def _placed(bench: Bench, j: int, flanks: Flanks) -> list[Variant]:
    """With the springs as they are, and with others beside the play."""
    torque = bench.true_torque[:, j]
    parts = [bench.sense * part for part in shapes(bench, torque, flanks)]
    columns = [bench.add_joint(j, part) for part in (*parts, torque / float(np.ptp(torque)))]
    scales = tuple(s * bench.reach for s in _SHARES)
    info: dict[str, Any] = {
        "joint": j,
        "zone_Nm": flanks.zone,
        "crossing": "load",
        "tool_kg": TOOL_KG,
        "preload_Nm": 0.0,
        "kind": flanks.kind,
        "flanks": flanks,
        "span": float(np.ptp(torque)),
    }
    root = np.diag([1.0, FRICTION, 1.0])
    return [
        variant(
            WORD,
            f"joint {j + 1} {flanks.kind}{name}",
            columns[:k],
            scales,
            root=root[:k, :k],
            positive=np.eye(k)[0] if flanks.kind in ("gap", "carried") else less_rub(k),
            prior=_PLACED_PRIOR,
            least=_least(bench, j, flanks.zone),
            each=(True, True),
            form=name,
            **info,
        )
        for k, name in ((2, ""), (3, ", other springs"))
    ]


def _zone(
    bench: Bench,
    x: Array,
    kinds: tuple[str, ...],
    label: str,
    zone: str,
    prior: float,
    info: dict[str, Any],
    places: dict[bytes, list[int]],
) -> list[Variant]:
    """Variants of one zone, per kind, on the net torque x (n,). Of a rig that is loaded from one
    side, none within the load of which a flank was not seen: that is a seat."""
    scales = SCALES if bench.data.arm else tuple(s * bench.reach for s in _SHARES)
    j, width, out = int(info["joint"]), float(info["zone_Nm"]), list[Variant]()
    inside = bool(info["preload_Nm"]) and _pressed(bench)
    if inside and min(-float(x.min()), float(x.max())) < _FLANK * width:
        return out
    floating = _floating(bench, j, np.abs(x) < width, places)
    resting = _resting(bench, j, places)
    play = Play(bench, x, width)
    rubs: dict[bool, int] = {}
    for kind in kinds:
        place, rub, kept = play.place(kind), play.rub(kind), kind in KEPT
        columns = [bench.add_joint(j, bench.sense * place)]
        if kept not in rubs:
            rubs[kept] = bench.add_joint(j, bench.sense * rub)
        columns.append(rubs[kept])
        rests = kind in HELD or bool(info.get("closely"))
        columns += floating if kind not in HELD else []
        columns += resting if rests else []
        root = np.diag([1.0, FRICTION, *[0.3] * (len(columns) - 2)])
        out.append(
            variant(
                WORD,
                f"{label} {kind} zone {zone}",
                columns,
                scales,
                root=root,
                positive=less_rub(len(columns)),
                prior=prior,
                least=_least(bench, j, width),
                each=(True,),
                within=within_play(
                    len(columns), work_taken(bench, x, np.column_stack([place, rub]))
                ),
                **(info | {"kind": kind, "rests": rests}),
            )
        )
    return out


def _least(bench: Bench, joint: int, zone: float) -> float:
    """m, of a bench: the play by which its zone is so much softer than the springs as stages of a
    gear's stiffness are not: K3/K1 is 1.5 to 1.85 in catalogues."""
    if bench.data.arm:
        return 0.0
    share = 1 - 1 / _SOFTER if bench.imposed else _SOFTER - 1
    mine = bench.lever[:, joint] != 0
    return share * 2 * zone * float(bench.line_slope[mine].mean())


_FLANK = 2.0  # zones from the middle: there the play is over
_SOFTER = 2.5  # times


def _floating(bench: Bench, joint: int, loose: Flags, places: dict[bytes, list[int]]) -> list[int]:
    """Columns per setup: unloaded rows of its first run, and of later ones, in which the joint is
    loose. Zones that agree on these rows share their columns."""
    key = loose.tobytes()
    if key not in places:
        free = free_places(bench, loose)
        places[key] = [bench.add_joint(joint, place.astype(float)) for *_, place in free]
    return places[key]


def _resting(bench: Bench, joint: int, places: dict[bytes, list[int]]) -> list[int]:
    if b"rest" not in places:
        places[b"rest"] = [bench.add(c) for c in resting_columns(bench, joint).values()]
    return places[b"rest"]


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """What nobody reached of a play was taken to be as the shape has it: a rectangular
    distribution, from nothing to twice that (GUM 4.3.7)."""
    arm = bench.data.arm
    seen = found.one(0, "rad" if arm else "mm", 1.0 if arm else 1e3)
    sd = float(np.hypot(seen.sd, unreached(bench, v) * seen.value / 3**0.5))
    return {"width": normal(seen.value, sd**2, seen.unit)}


def _look_closer(word: RefinementTarget) -> list[Variant]:
    """Beside the leading word; and alone, where it explains nearly as much: that may be a curve
    which does what the play does. Ends of which one is softer where a play is there to see."""
    shown = seen(word)
    found = places(word.alone, word.beside)
    looks = [(word, found, shown)]
    if not word.engine.bench.has_q:  # each by itself: the best of all may be another joint's
        others = places(word.alone, word.beside, _is_hung, 1)
        looks += [(word, [s], shown) for s in others if s.variant not in {f.variant for f in found}]
    if word.beside and nearly_leads(word):
        looks.append((replace(word, ranked=[WORD]), word.alone[:1], True))
    out: list[Variant] = []
    for of, starts, closely in looks:
        closer = CLOSE if closely else CLOSE[:1]
        out += closing_in(of, refined, starts, closer)
        if closely:
            out += closing_in(of, uneven, starts, CLOSE)
    return out


def _is_hung(v: Variant) -> bool:
    """Whether weights alone say where it is crossed: of a tool's mass that nobody states, on a grid
    that is coarser than the zone. What is preloaded at will may look better there."""
    return v.info["crossing"] == "weight" and not v.info["preload_Nm"]


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(lost_motion_law.describe, lost_motion_law.columns, of_session=("place", "rest")),
    lengths=("width",),
    finer=_look_closer,
    beside=True,
    not_negative=("width",),
)
