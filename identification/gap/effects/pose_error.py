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

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.compare import by_word, closest, marginal, score
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import conditioned
from identification.gap.laws.closer import Estimate, Word, estimate, evidence
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term, triple
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant
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
_STEPS = 5


def refined(bench: Bench, found: Variant, estimate: Callable[[Variant], Estimate]) -> list[Variant]:
    """The same with secants through where arm and tool are found to be, and with the springs and
    the gain of the displacement that go with it, in a few steps. estimate: what is most probable
    with a variant."""
    kind, out = str(found.info["kind"]), found
    offset, angles, turn = np.zeros(3), np.zeros(bench.data.joints), np.zeros(3)
    for _ in range(_STEPS):
        w, softer, reads = estimate(out)
        offset = w[:3] if kind in ("tool", "both") else offset
        angles = w[-len(angles) :] if kind in ("joints", "both") else angles
        turn = w if kind == "base" else turn
        compliance = bench.compliance * np.maximum(1 + softer, 0.1)
        if kind == "base":
            used = turned(bench, turn, compliance, reads)
        else:
            pose, read = str(found.info["pose"]), bool(found.info["read"])
            columns = secants(bench, offset, angles, compliance, reads, pose, read)
            used = {"tool": columns[:3], "joints": columns[3:], "both": columns}[kind]
        out = replace(
            found,
            label=f"{found.label}, as they are",
            prior=3.0,
            columns=tuple(bench.add(c) for c in used),
            info={
                **found.info,
                "offset_m": offset,
                "angles_rad": angles,
                "turn_rad": turn,
                "compliance": compliance,
                "reads": reads,
            },
        )
    return [out]


def secants(
    bench: Bench,
    offset: Array,
    angles: Array,
    compliance: Array,
    reads: float = 1.0,
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
    shifts, turns = [], []  # per setup: change of the levers per metre (m, 3) and radian (m, m)
    for s in setups:
        across = np.broadcast_to(s.turned_offset, (m, m, 3))
        bent = np.broadcast_to(s.bent_lever, (m, m, m))
        shifts.append(s.offset_lever + 0.5 * np.einsum("ijk,j->ik", across, angles))
        turns.append(s.turned_lever + 0.5 * (bent @ angles + across @ offset))
    there = np.array([pose in ("", s.pose) for s in setups], dtype=float)[bench.rows.setup]
    moved, swung = (
        np.stack(each)[bench.rows.setup] * there[:, None, None] for each in (shifts, turns)
    )
    middle = reads * (bench.lever + 0.5 * (moved @ offset + swung @ angles))
    out = _through(bench, np.concatenate([moved, swung], axis=2), middle, compliance)
    for j in range(m):
        q = np.zeros((bench.rows.n, m))
        q[:, j] = there * read
        out[3 + j] = out[3 + j] + bench.stacked(q=q)
    return out


def turned(bench: Bench, turn: Array, compliance: Array, reads: float = 1.0) -> list[Array]:
    """Stacked columns per radian by which the base stands turned about x, y, z (3), exact where it
    is: turn (3,) rad, `exp(-E) - 1 = -(1 - a E + b E^2) E` (Rodrigues); compliance, reads: as
    there."""
    E = np.cross(turn, np.eye(3)).T  # E v = turn x v
    angle = max(float(np.linalg.norm(turn)), 1e-4)
    a, b = (1 - np.cos(angle)) / angle**2, (1 - np.sin(angle) / angle) / angle**2
    series = np.eye(3) - a * E + b * E @ E
    changes = []
    for s in bench.data.setups:
        axes = np.vstack([s.unit_vector, s.tangents])
        seen = -axes @ series @ np.cross(np.eye(3), s.unit_vector).T
        changes.append(np.vstack([s.lever, s.tangent_lever]).T @ seen)  # (m, 3)
    swung = np.stack(changes)[bench.rows.setup]
    middle = reads * (bench.lever + 0.5 * swung @ turn)
    return _through(bench, swung, middle, compliance)


def _through(bench: Bench, change: Array, middle: Array, compliance: Array) -> list[Array]:
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
        offset_m=np.zeros(3),
        angles_rad=np.zeros(6),
        turn_rad=np.zeros(3),
        reads=1.0,
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
        "reads": float(v.info["reads"]),
    }
    if v.info["pose"]:
        about["only_in"] = str(v.info["pose"])
    if not v.info["read"]:
        about["unread"] = True
    return Law(about, tuple(terms)), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Change of the levers, by the secants of the library."""
    at = np.array(law.constants["about_offset"]), np.array(law.constants["about_angles"])
    reads = float(law.constants["reads"])
    pose = str(law.constants.get("only_in", ""))
    read = not law.constants.get("unread", False)
    moved = secants(bench, *at, bench.compliance, reads, pose, read)
    about = np.array(law.constants.get("about_turn", (0.0, 0.0, 0.0)))
    turns = turned(bench, about, bench.compliance, reads)
    columns = {"offset": moved[:3], "angle": moved[3:], "turn": turns}
    return [
        columns[t.coefficient][
            t.shape["joint"] if "joint" in t.shape else "xyz".index(t.shape["axis"])
        ]
        for t in law.terms
    ]


def _look_closer(word: Word) -> list[Variant]:
    """Where arm and tool are, by what is found alone and beside the words that explain most of
    what that leaves: a second effect must not decide it."""
    engine, kinds = word.engine, {_kind(s.variant): s for s in reversed(word.alone)}
    finer = [
        f
        for s in kinds.values()
        for f in refined(engine.bench, s.variant, partial(estimate, engine))
    ]
    best = max(score(engine, engine.levels, finer), key=evidence)
    levels, energy = conditioned(engine, (Part(best.variant, best.scale),))
    names = ({*word.ranked} | LINEAR) & word.families.keys() - {best.variant.word}
    others = [s.variant for w in sorted(names) for s in word.families[w]]
    found = by_word(score(engine, levels, others, energy))
    for name in sorted(found, key=lambda w: -marginal(found[w]))[:_BESIDE]:
        other = closest(found[name])
        there = partial(estimate, engine, beside=(Part(other.variant, other.scale),))
        again = refined(engine.bench, kinds[_kind(best.variant)].variant, there)
        finer += [v.known_by(f" beside {name}", beside=name) for v in again]
    same = [v for v in finer if _kind(v) == _kind(best.variant)]
    share = best.variant.prior / len(same)  # they are one place, looked at more than once
    return [replace(v, prior=share) if v in same else v for v in finer]


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
