"""The arm stands, or the tool is, elsewhere than simulated: wrong leverage.

Tool offset d in the flange frame changes every lever by `R d . (n x z)`; a joint that stands off
by e changes them by `dJ/dq e`, and its reading at zero load shows e, unless it is the zero of its
encoder that is off. A base that stands turned by e
against the directions of the push sees these turned back: levers `J' exp(-e x) n`, and no reading
shows it. The target moves with the square of the levers. Offsets of 5 to 300 mm, angles of 0.2 to 5
degrees, of the base 1 to 15.

Size: tools 5 to 300 mm off, joints 0.2 to 5 degrees, the base 1 to 15 degrees.
Prior: either sign, sd out of OFFSETS_M, ANGLES_RAD or TURNS_RAD, equally likely; half as much on
a base that is turned, or joints that stand elsewhere in one pose only or without being read so, as
on a tool, or joints, elsewhere.
Source: wrong tool frames, zero positions of joints, bases and rigs lined up by eye.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.compare import Scored, by_word, closest, marginal, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import conditioned
from identification.gap.laws.closer import RefinementTarget, estimate, evidence
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term, triple
from identification.gap.laws.leverage import SOFTEST, Leverage, Place, changes, changes_turned
from identification.gap.model.bench import Bench
from identification.gap.model.variants import CALLED, Variant, variant
from identification.gap.words import LINEAR

WORD = "pose_error"
OFFSETS_M = (0.01, 0.04, 0.15)
ANGLES_RAD = (0.005, 0.02, 0.06)
TURNS_RAD = (0.02, 0.06, 0.17)


def variants(bench: Bench) -> list[Variant]:
    """Tool offset, joints standing elsewhere, both, and a base that is turned; to first order."""
    at = np.zeros(3), np.zeros(bench.data.joints)
    columns = [bench.add(c) for c in secants(bench, *at, bench.compliance)]
    out = []
    for size in OFFSETS_M:
        out.append(_variant(f"tool {size * 1e3:g} mm", columns[:3], [size] * 3, 1.0, "tool"))
    joints = bench.data.joints
    for size in ANGLES_RAD:
        out.append(_variant(f"joints {size:g} rad", columns[3:], [size] * joints, 1.0, "joints"))
    for offset, angle in BOTH:
        label = f"tool {offset * 1e3:g} mm, joints {angle:g} rad"
        sizes = [offset] * 3 + [angle] * joints
        out.append(_variant(label, columns, sizes, 0.5, "both"))
    columns = [bench.add(c) for c in turned(bench, np.zeros(3), bench.compliance)]
    for size in TURNS_RAD:
        out.append(_variant(f"base {size:g} rad", columns, [size] * 3, 0.5, "base"))
    return out + _in_one_pose(bench) + _unread(bench)


def _unread(bench: Bench) -> list[Variant]:
    """Joints that stand elsewhere than their readings say: zeros of encoders that were lost."""
    if not bench.has_q:
        return []
    at, joints = (np.zeros(3), np.zeros(bench.data.joints)), bench.data.joints
    columns = [bench.add(c) for c in secants(bench, *at, bench.compliance, read=False)[3:]]
    return [
        _variant(
            f"joints {size:g} rad, unread", columns, [size] * joints, 0.5, "joints", read=False
        )
        for size in ANGLES_RAD
    ]


def _in_one_pose(bench: Bench) -> list[Variant]:
    """Joints that stand elsewhere in one of several poses only: one that was taken wrongly."""
    poses = list(dict.fromkeys(s.pose for s in bench.data.setups))
    at, joints, out = (np.zeros(3), np.zeros(bench.data.joints)), bench.data.joints, []
    for pose in poses if len(poses) > 1 else []:
        there = secants(bench, *at, bench.compliance, pose=pose)[3:]
        columns = [bench.add(c) for c in there]
        for size in ANGLES_RAD:
            label, prior = f"joints {size:g} rad in {pose}", 0.5 / len(poses)
            out.append(_variant(label, columns, [size] * joints, prior, "joints", pose))
    return out


BOTH = ((0.04, 0.02), (0.15, 0.05))
_PLACED = 3.0  # prior of what is where it was found
_LEVELS = 3  # of imperfection, at most, that a place is fitted with


def refined(engine: Engine, found: Variant, beside: tuple[Part, ...] = ()) -> Variant:
    """The same with secants through where arm and tool are found to be beside other parts, and with
    the springs that go with it."""
    kind, pose, read = _kind(found)
    leverage, out, done = Leverage(engine, kind, found.root, pose, read), found, list[float]()
    for _ in range(_LEVELS):
        at = estimate(engine, out, beside)
        if at.eta in done:
            break
        done.append(at.eta)
        place = leverage.place(at.eta, beside, at.coefficients)
        out = _through(engine.bench, found, place)
    return out


def _through(bench: Bench, found: Variant, at: Place) -> Variant:
    """The variant with secants through a place."""
    kind, pose, read = _kind(found)
    compliance = bench.compliance * np.maximum(1 + at.softer, SOFTEST)
    if kind == "base":
        used = turned(bench, at.turn, compliance)
    else:
        columns = secants(bench, at.offset, at.angles, compliance, pose, read)
        used = {"tool": columns[:3], "joints": columns[3:], "both": columns}[kind]
    return replace(
        found,
        label=f"{found.info[CALLED]}, as they are",
        prior=_PLACED if found.label == found.info[CALLED] else found.prior,
        columns=tuple(bench.add(c) for c in used),
        info={
            **found.info,
            "offset_m": at.offset,
            "angles_rad": at.angles,
            "turn_rad": at.turn,
            "compliance": compliance,
        },
    )


def elsewhere(before: Variant, now: Variant) -> bool:
    """Whether two variants of this word stand at different places."""
    return any(
        np.abs(np.subtract(before.info[key], now.info[key])).max() > _ELSEWHERE
        for key in ("offset_m", "angles_rad", "turn_rad")
    )


_ELSEWHERE = 1e-4  # m or rad


def secants(
    bench: Bench,
    offset: Array,
    angles: Array,
    compliance: Array,
    pose: str = "",
    read: bool = True,
) -> list[Array]:
    """Stacked columns per metre of tool offset (3) and radian of each joint that stands elsewhere.

    With levers l + dl the target moves by `c ((l + dl)^2 - l^2) F = 2 c (l + dl/2) dl F`: linear in
    the change with dl/2 held at where it is (offset (3,) m, angles (m,) rad), exact there. So is
    dl, to second order in both; compliance (m,) is that of the springs as they are. The
    readings see c dl F, and, if they are read so, where the joints stand.
    """
    setups, m = bench.data.setups, bench.data.joints
    shifts, turns = zip(*(changes(s, offset, angles) for s in setups), strict=True)
    there = np.array([pose in ("", s.pose) for s in setups], dtype=float)[bench.rows.setup]
    moved, swung = (
        np.stack(each)[bench.rows.setup] * there[:, None, None] for each in (shifts, turns)
    )
    middle = bench.lever + 0.5 * (moved @ offset + swung @ angles)
    out = _moved(bench, np.concatenate([moved, swung], axis=2), middle, compliance)
    for j in range(m):
        q = np.zeros((bench.rows.n, m))
        q[:, j] = there * read
        out[3 + j] = out[3 + j] + bench.stacked(q=q)
    return out


def turned(bench: Bench, turn: Array, compliance: Array) -> list[Array]:
    """Stacked columns per radian by which the base stands turned about x, y, z (3), exact where it
    is: turn (3,) rad; compliance: as there."""
    swung = np.stack([changes_turned(s, turn) for s in bench.data.setups])[bench.rows.setup]
    middle = bench.lever + 0.5 * swung @ turn
    return _moved(bench, swung, middle, compliance)


def _moved(bench: Bench, change: Array, middle: Array, compliance: Array) -> list[Array]:
    """Stacked columns of changes (n, m, k) of the levers, about levers (n, m) in the middle."""
    elastic = compliance * bench.load[:, None]
    return [
        bench.stacked(2 * np.sum(middle * each * elastic, axis=1), each * elastic)
        for each in np.moveaxis(change, 2, 0)
    ]


def _variant(
    label: str,
    columns: list[int],
    sizes: list[float],
    prior: float,
    kind: str,
    pose: str = "",
    read: bool = True,
) -> Variant:
    """pose: the only one in which it is so; "" all. read: whether readings show where joints
    stand."""
    return variant(
        WORD,
        label,
        columns,
        (1.0,),
        root=np.diag(sizes),
        positive=False,
        prior=prior,
        kind=kind,
        called=label,
        offset_m=np.zeros(3),
        angles_rad=np.zeros(6),
        turn_rad=np.zeros(3),
        pose=pose,
        read=read,
    )


def _parameters(_: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Tool offset, angles of the joints, turn of the base."""
    kind = v.info["kind"]
    out: dict[str, Parameter] = {}
    if kind == "base":
        return {f"base_turned_about_{a}": found.one(i, "rad") for i, a in enumerate("xyz")}
    if kind in ("tool", "both"):
        out |= {f"offset_{a}": found.one(i, "mm", 1e3) for i, a in enumerate("xyz")}
    if kind in ("joints", "both"):
        first = 3 if kind == "both" else 0
        out |= {
            f"angle_joint{i - first + 1}": found.one(i, "rad") for i in range(first, len(found.w))
        }
    return out


def _describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms: offset of the tool in the flange frame, angles of the joints, turn of the base; about
    where they are."""
    terms = []
    if v.info["kind"] in ("tool", "both"):
        terms += [Term("offset", {"axis": a}) for a in "xyz"]
    if v.info["kind"] in ("joints", "both"):
        terms += [Term("angle", {"joint": j}) for j in range(bench.data.joints)]
    if v.info["kind"] == "base":
        terms = [Term("turn", {"axis": a}) for a in "xyz"]
    about: dict[str, Any] = {
        "about_offset": triple(v.info["offset_m"]),
        "about_angles": tuple(float(a) for a in v.info["angles_rad"]),
        "about_turn": triple(v.info["turn_rad"]),
    }
    if v.info["pose"]:
        about["only_in"] = str(v.info["pose"])
    if not v.info["read"]:
        about["unread"] = True
    return Law(about, tuple(terms)), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Change of the levers, by the secants of the library."""
    at = np.array(law.constants["about_offset"]), np.array(law.constants["about_angles"])
    pose = str(law.constants.get("only_in", ""))
    read = not law.constants.get("unread", False)
    moved = secants(bench, *at, bench.compliance, pose, read)
    about = np.array(law.constants.get("about_turn", (0.0, 0.0, 0.0)))
    turns = turned(bench, about, bench.compliance)
    columns = {"offset": moved[:3], "angle": moved[3:], "turn": turns}
    return [
        columns[t.coefficient][
            t.shape["joint"] if "joint" in t.shape else "xyz".index(t.shape["axis"])
        ]
        for t in law.terms
    ]


def _look_closer(word: RefinementTarget) -> list[Variant]:
    """Where arm and tool are, by what is found alone and beside the words that explain most of
    what that leaves: a second effect must not decide it."""
    engine, kinds = word.engine, {_kind(s.variant): s for s in reversed(word.alone)}
    finer = [refined(engine, s.variant) for s in kinds.values()]
    best = max(score(engine, engine.levels, finer), key=evidence)
    levels, energy = conditioned(engine, (Part(best.variant, best.scale),))
    names = ({*word.ranked} | LINEAR) & word.families.keys() - {best.variant.word}
    others = [s.variant for w in sorted(names) for s in word.families[w]]
    found = by_word(score(engine, levels, others, energy))
    start = kinds[_kind(best.variant)].variant
    for name in sorted(found, key=lambda w: -marginal(found[w]))[:_BESIDE]:
        again = _beside(engine, start, word.families[name], found[name])
        finer.append(again.found_beside([name]))
    same = [v for v in finer if _kind(v) == _kind(best.variant)]
    share = best.variant.prior / len(same)  # they are one place, looked at more than once
    return [replace(v, prior=share) if v in same else v for v in finer]


def _beside(engine: Engine, start: Variant, family: list[Scored], first: list[Scored]) -> Variant:
    """Where it is beside the shapes of a word, the closest of which is another one beside that
    than beside the place (first) that was found alone."""
    out, last, scored = start, None, first
    for _ in range(_TURNS):
        top = closest(scored)
        if top.variant is last:
            break
        last = top.variant
        out = refined(engine, start, (Part(top.variant, top.scale),))
        levels, energy = conditioned(engine, (Part(out, out.scales[0]),))
        scored = score(engine, levels, [s.variant for s in family], energy)
    return out


_TURNS = 3


def _kind(variant: Variant) -> tuple[str, str, bool]:
    """What stands elsewhere, in which pose only, and whether readings show it."""
    return str(variant.info["kind"]), str(variant.info["pose"]), bool(variant.info["read"])


_BESIDE = 2  # words


EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=Laws(_describe, _columns, through_springs=True),
    lengths=(),
    finer=_look_closer,
)
