"""The load does not act along the nominal direction: a share t of it acts across.

The target then moves along the direction by `F n' C t`; recorded force components grow with the
load by t F. Screws on floors and stands are set up within 1 to 15 degrees, and in every pose anew;
what is askew may be the tool, which turns with the pose. A tip that drags on its
pad pulls the other way when the load goes back; one that is let go between runs finds another seat;
an eccentric one pulls another way with every part of a turn. Where the force across was recorded,
it needs no law on an arm: it is taken as it was read, at the price of so many free loads.
Nothing is known of how a rig without an arm gives way across: it is spoken of only where the force
across was recorded, and what was moves the target by about as much as the same force along.

Size: 1 to 15 degrees, tangents of 0.02 to 0.25.
Prior: tangents of either sign, sd out of SCALES, equally likely.
Source: how well screws are set up by eye on floors and stands; friction of steel on steel.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.evidence.compare import log_mean
from identification.gap.laws.across_law import (
    USUAL,
    Shape,
    across,
    columns_of,
    gives,
    law_of,
    pulled,
    pulled_as_read,
)
from identification.gap.laws.closer import best_about_springs
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, ComplianceChange, Parameter, normal
from identification.gap.laws.law import Laws
from identification.gap.model.base import CROSSTALK, MOST_CROSSTALK
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "load_misalignment"
SCALES = (0.03, 0.1, 0.25)
# Of the largest load: over so much of it a tip turns from one way to the other.
DRAGS = (0.05, 0.12, 0.25)
_BETWEEN_RUNS = 0.5  # of the sd of the mean: by how much tips of single runs differ
_ALL = 0.6  # prior of all directions
_DRAGS_SHARE = _EACH_RUN_SHARE = _EACH_POSE_SHARE = _AS_READ_SHARE = 0.2  # of the prior


def variants(bench: Bench) -> list[Variant]:
    """Two tangents per direction: constant, turning as the load grows, soon or late, or dragging;
    one direction, and all."""
    if not bench.data.arm and bench.rows.tangential is None:
        return []
    known: dict[str, list[_Known]] = {}
    slants: dict[str, float] = {}
    for name in dict.fromkeys(s.direction for s in bench.data.setups):
        mine = _pushed(bench, name)
        slants[name] = _slant(bench, mine)
        known[name] = [
            _Known(label, shapes, _in_pool(bench, shapes, mine), share, _read(bench, shapes, mine))
            for label, shapes, share in _kinds(bench, float(np.abs(bench.load[mine]).max()) or 1.0)
        ]
    groups = [([name], f"direction {name}", 0.3) for name in known]
    if len(groups) > 1:
        groups.append((list(known), "all directions", _ALL))
    out = [
        variant(
            WORD,
            label + each[0].label,
            [c for k in each for c in k.columns] + _given(bench, names, each),
            SCALES,
            positive=False,
            prior=prior * each[0].share,
            directions=names,
            shapes=[k.shapes for k in each],
            drags=any(shape.drags_N > 0 for shape in each[0].shapes),
            read=[k.read for k in each],
            shown=max(slants[name] for name in names) / MOST_CROSSTALK,
        )
        for names, label, prior in groups
        for each in zip(*(known[name] for name in names), strict=True)
    ]
    out += [*_each_pose(bench), *_as_it_was_read(bench)]
    return out + _each_run(bench, {name: kinds[0] for name, kinds in known.items()})


def _each_pose(bench: Bench) -> list[Variant]:
    """All directions, each in every pose by tangents of its own: the rig is set up anew there, or
    what is askew is fixed to the tool. Only where the force across was recorded, or joint readings
    show what it does: to the target alone anything does the same that differs between poses."""
    setups, rows = bench.data.setups, bench.rows
    shown = rows.tangential is not None or bench.has_q
    if not shown or len({s.direction for s in setups}) == len(setups):  # no direction comes again
        return []
    tops = [
        float(np.abs(bench.load[rows.setup == k]).max(initial=0.0)) or 1.0
        for k in range(len(setups))
    ]
    out = []
    for label, powers, share in (("", (1,), 1.0), (", turning", (1, 2, 3), 0.7)):
        shapes = [tuple(Shape(p, top) for p in powers) for top in tops]
        columns = [_in_pool(bench, each, rows.setup == k) for k, each in enumerate(shapes)]
        out.append(
            variant(
                WORD,
                f"each pose{label}",
                [c for mine in columns for c in mine],
                SCALES,
                positive=False,
                prior=_ALL * _EACH_POSE_SHARE * share,
                directions=[s.direction for s in setups],
                poses=[s.pose for s in setups],
                shapes=shapes,
                read=[()] * len(setups),
            )
        )
    return out


def _each_run(bench: Bench, straight: dict[str, _Known]) -> list[Variant]:
    """All directions, with what the tip of every run is off from their mean; only where the force
    across was recorded."""
    runs = np.unique(bench.rows.run)
    if bench.rows.tangential is None or len(runs) <= len(straight):
        return []
    common = [c for k in straight.values() for c in k.columns]
    shapes = [k.shapes for k in straight.values()]
    own = [c for r in runs for c in _in_pool(bench, shapes[0], bench.rows.run == r)]
    given = (
        [] if bench.data.arm else [bench.add(c) for name in straight for c in _as_read(bench, name)]
    )
    sd = [1.0] * len(common) + [_BETWEEN_RUNS] * len(own) + [1.0] * len(given)
    return [
        variant(
            WORD,
            "each run",
            [*common, *own, *given],
            SCALES,
            root=np.diag(sd),
            positive=False,
            prior=_ALL * _EACH_RUN_SHARE,
            directions=list(straight),
            shapes=shapes,
            read=[()] * len(shapes),
            tips=runs.tolist(),
        )
    ]


def _as_it_was_read(bench: Bench) -> list[Variant]:
    """The force across as the dynamometer read it, whatever law it may go by: on an arm, of which
    it is known how it gives way to that. That it took the readings for the loads costs what a load
    of its own for every hold and tangent would, as large as misalignments are."""
    read = bench.rows.tangential
    if not bench.data.arm or read is None:
        return []
    held = bench.rows.hold_means(read).T.reshape(-1)
    usual = np.tile(np.abs(bench.rows.hold_means(bench.load)), 2)
    noise = bench.sigma[bench.layout.tangential]
    spread = 1 + np.multiply.outer(np.array(SCALES), usual / noise) ** 2
    each = -(np.log(spread) + (held / noise) ** 2 / spread).sum(axis=1) / 2
    column = bench.add(pulled_as_read(bench))
    cost, share = -log_mean(each.tolist()), _ALL * _AS_READ_SHARE
    return [variant(WORD, "as it was read", [column], (1.0,), prior=share, cost=cost, as_read=True)]


def _as_read(bench: Bench, direction: str) -> list[Array]:
    """What a rig without an arm gives way under the force along either tangent, as it was read in a
    direction; where it is as stiff across as along, of a tangent of USUAL."""
    mine, read = _pushed(bench, direction), bench.rows.tangential
    loads = () if read is None else read.T
    return [gives(bench, np.where(mine, load, 0.0)) / USUAL for load in loads]


def _pushed(bench: Bench, direction: str) -> Flags:
    """(n,) rows of a direction."""
    mine = np.array([s.direction == direction for s in bench.data.setups])
    return np.asarray(mine[bench.rows.setup])


class _Known(NamedTuple):
    """A kind of misalignment of one direction, with its columns, its share of the prior, and about
    how large tangents the readings of a rig without an arm show of each shape."""

    label: str
    shapes: tuple[Shape, ...]
    columns: list[int]
    share: float
    read: tuple[float, ...]


def _kinds(bench: Bench, top: float) -> list[tuple[str, tuple[Shape, ...], float]]:
    """Label, shapes, share of the prior. Turning soon and dragging only where the force across was
    recorded: what they do to the target alone, any curve or friction does."""
    seen, straight = bench.rows.tangential is not None, Shape(1, top)
    powers = (1, 2, 3) if seen else (1, 2)
    out = [("", (straight,), 1.0), (", turning", tuple(Shape(p, top) for p in powers), 0.7)]
    for share in DRAGS if seen else ():
        reach = share * top
        drags = (straight, Shape(0, top, reach), Shape(1, top, reach))
        out.append((f", dragging {share:g}", drags, _DRAGS_SHARE))
    return out


def _in_pool(bench: Bench, shapes: tuple[Shape, ...], mine: Flags) -> list[int]:
    loads = [np.where(mine, across(bench, shape), 0.0) for shape in shapes]
    both = np.eye(2)[:, None, :].repeat(len(bench.data.setups), axis=1)  # along either tangent
    return [bench.add(pulled(bench, load, each)) for load in loads for each in both]


def _read(bench: Bench, shapes: tuple[Shape, ...], mine: Flags) -> tuple[float, ...]:
    across_it = bench.rows.tangential
    if bench.data.arm or across_it is None:
        return ()
    loads = np.column_stack([across(bench, shape)[mine] for shape in shapes])
    tangents = np.linalg.lstsq(loads, across_it[mine], rcond=_RCOND)[0]
    return tuple(np.linalg.norm(tangents, axis=1).tolist())


def _slant(bench: Bench, mine: Flags) -> float:
    """Tangent that the force across shows of a rig without an arm in rows mine (n,), beside what it
    reads at no load; 0 where it was not read."""
    across_it = bench.rows.tangential
    if bench.data.arm or across_it is None:
        return 0.0
    line = np.column_stack([bench.load[mine], np.ones(int(mine.sum()))])
    slopes = np.linalg.lstsq(line, across_it[mine], rcond=_RCOND)[0][0]
    return float(np.linalg.norm(slopes))


_RCOND = 1e-3  # shapes that are alike share what is read


def _given(bench: Bench, names: list[str], each: tuple[_Known, ...]) -> list[int]:
    """Columns of what a rig without an arm gives way; of a tangent of USUAL as read."""
    out = []
    for name, known in zip(names, each, strict=True):
        mine = _pushed(bench, name)
        for shape, tangent in zip(known.shapes, known.read, strict=False):
            load = np.where(mine, across(bench, shape), 0.0)
            out.append(bench.add(tangent / USUAL * gives(bench, load)))
    return out


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Tangents at the largest load, as it was come to; of single runs their mean; of the force
    across as it was read that of the readings themselves. What an arm gives way under them is known
    as well as the springs that they go through."""
    info = v.info
    if info.get("as_read"):
        return _tangents_read(bench)
    names, count = list(info["directions"]), len(info["shapes"][0])
    if "poses" in info:
        names = [f"{name}_{pose}" for name, pose in zip(names, info["poses"], strict=True)]
    common = np.eye(2 * len(names) * count, len(found.w))
    rows = common.reshape(len(names), count, 2, -1).sum(axis=1)
    out = {}
    for i, (name, direction) in enumerate(zip(names, info["directions"], strict=True)):
        for k in range(2):
            p = found.linear(rows[i, k], "1")
            square = p.value**2 * _unsure(bench, direction, k, found.softer)
            out[f"tangent_{name}_{k + 1}"] = normal(p.value, p.sd**2 + square, "1")
    return out


def _unsure(bench: Bench, direction: str, k: int, softer: ComplianceChange) -> float:
    """Relative variance of what a force along tangent k of a direction does, by the springs that it
    goes through, as far as displacement and joint readings tell of each."""
    noise = bench.noise
    reads = 1 / float(np.hypot(np.median(noise.q), noise.q_run)) if bench.has_q else 0.0
    tells = np.zeros(bench.data.joints)
    for s in bench.data.setups:
        if s.direction == direction:
            turns = s.tangent_lever[k] * bench.compliance  # rad/N
            tells += turns**2 * ((s.lever / noise.stated) ** 2 + reads**2)
    share = tells / max(float(tells.sum()), _TINY)
    return sum(float(share[j]) ** 2 * v for j, v in softer.variance.items())


_TINY = 1e-300


def _tangents_read(bench: Bench) -> dict[str, Parameter]:
    """Of every direction, in the mean over the holds of its largest load; with the noise of these,
    and what the sensors pass from one axis to another."""
    out, rows = {}, bench.rows
    for name in dict.fromkeys(s.direction for s in bench.data.setups):
        mine = _pushed(bench, name)
        top = mine & (np.abs(bench.load) > _NEAR_TOP * np.abs(bench.load[mine]).max())
        if rows.tangential is None or not top.any():
            continue
        shares = rows.tangential[top] / bench.load[top, None]
        noise = bench.noise.force / float(np.abs(bench.load[top]).mean())
        square = noise**2 / float(rows.weight[top].sum()) + CROSSTALK**2
        for k, tangent in enumerate(np.average(shares, axis=0, weights=rows.weight[top])):
            out[f"tangent_{name}_{k + 1}"] = normal(float(tangent), square, "1")
    return out


_NEAR_TOP = 0.9  # of the largest load


_LAWS = Laws(law_of, columns_of, through_springs=True, of_session=("as_read",))
EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=_LAWS,
    lengths=(),
    finer=partial(best_about_springs, _LAWS),
)
