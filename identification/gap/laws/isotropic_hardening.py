"""What yields on only beyond the largest load that it has borne: isotropic hardening."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws.lasting import HARDENS, SCALES, lasting
from identification.gap.laws.memories import LIKELY, memories
from identification.gap.laws.specimens import OWN, with_other_springs
from identification.gap.model.bench import Bench
from identification.gap.model.history import whiles
from identification.gap.model.variants import RESET_PER_RUN, Variant
from identification.gap.recording.turns import largest_reversal

HARDENED = "hardened"  # its knee
UNDER_A_TIP, _CAME_BACK = (0.01, 0.04, 0.1), 0.2  # of the range
_LEFT = 0.2  # of the largest response: as much as friction seldom holds
_FINE = np.linspace(-0.16, 0.2, 13)  # radii of a closer look, from that of the knee on
_PRIOR, _FINE_PRIOR = 0.7, 0.25
_EVERY = 2  # radius begins a shape of what is lost sooner: between them it is looked at closely


def hardened(
    bench: Bench,
    load: Array,
    radius: Array,
    column: Callable[[Array], int],
    word: str,
    name: str,
    info: dict[str, Any],
) -> list[Variant]:
    """What hardens alike in both senses (Voce 1948) and is loaded again and again: it yields on
    only beyond the largest load it has borne. Specimens from one side, under a tip from the first
    load on (said of loads that come back before they grow, and of what is not taken back by a long
    way: a single loop may be friction); joints of an arm, whichever way they are pushed next."""
    top = float(np.abs(load).max())
    course, arm = bench.load_history, bench.data.arm
    told = "joint" in info and course.unloads if arm else course.lets_go and course.one_sided
    if not told:
        return []
    size = np.abs(load)
    if not arm and (
        largest_reversal(size[: int(size.argmax()) + 1]) > _CAME_BACK * top
        or bench.load_history.left_behind > _LEFT
    ):
        radius = np.concatenate([top * np.array(UNDER_A_TIP), radius])
    out = []
    for memory, fresh in memories(bench).items():
        columns = [column(s) for s in grown(load, radius, fresh).T]
        facts = {**info, "memory": memory, "load": load, "column": column}
        places = range(0, len(radius), _EVERY if memory else 1)
        for k in places:
            label = f"{name}{memory} {HARDENED} beyond {radius[k] / top:.3g}"
            share = _PRIOR * LIKELY[memory] / len(places)
            # a clamp that is taken back lets go at one threshold, and is no metal that hardens
            last = k + _NEIGHBOURS if memory == RESET_PER_RUN else len(radius)
            out.append(_shape(word, label, columns[k:last], radius[k:last], share, facts))
    return out


def refined(bench: Bench, found: Variant, w: Array, close: float = 1.0) -> list[Variant]:
    """Thresholds about that of a knee that was found with coefficients w (k,): of the sharp one of
    the same end and work. It lies between two neighbours, and hardens on or softens, or not. close:
    share of the steps."""
    info, load = found.info, np.asarray(found.info["load"])
    top, radius = float(np.abs(load).max()), np.asarray(info["radius"])
    w = w[: len(radius)]  # what else there is is a spring beside it
    beyond = np.maximum(top - radius, 0.0)
    path = float(w @ beyond)
    knee = top - float(w @ beyond**2) / path if path > 0 else 0.0
    if not 0 < knee < top:
        return []
    radius = knee * (1 + close * _FINE)
    radius = radius[radius < top]
    columns = [info["column"](s) for s in grown(load, radius, memories(bench)[info["memory"]]).T]
    place = {key: info[key] for key in info if key not in _OWN}
    out, share = [], _FINE_PRIOR / len(radius) / 2
    for k, r in enumerate(radius[:-1]):
        on = k + _ROUND if info["memory"] == RESET_PER_RUN else len(radius)
        for last in dict.fromkeys((k + _NEIGHBOURS, on)):
            label = f"{found.label.partition(HARDENED)[0]}{HARDENED} beyond {r:.4g} fine"
            out.append(_shape(found.word, label, columns[k:last], radius[k:last], share, place))
    if found.other_springs:
        return with_other_springs(bench, int(info["joint"]), out, SCALES, OWN)
    return out


_NEIGHBOURS, _ROUND = 2, 4  # radii of a sharp knee between two, and of a rounded one
# facts of a shape rather than of its place
_OWN = ("radius", "centre", "flow_s", "back", "knee", "other_springs")


def _shape(
    word: str,
    label: str,
    columns: list[int],
    radius: Array,
    prior: float,
    info: dict[str, Any],
) -> Variant:
    """Columns and radii (k,) of the knee and of what hardens, or softens, on."""
    root = np.diag([1.0, *[HARDENS] * (len(radius) - 1)])
    if len(radius) == _NEIGHBOURS:
        root = np.eye(_NEIGHBOURS)
    return lasting(word, label, columns, root, prior, radius=radius, knee=HARDENED, info=info)


def grown(load: Array, radius: Array, fresh: Flags) -> Array:
    """(n, k): by how much the size of the load (n,) has ever been beyond the radii (k,) since the
    memory was fresh; each time with the sign that the load then had."""
    out = np.empty((len(load), len(radius)))
    for a, b in whiles(fresh):
        largest = np.maximum.accumulate(np.abs(load[a:b]))
        beyond = np.maximum(largest[:, None] - radius, 0.0)
        grows = np.diff(beyond, axis=0, prepend=0.0)
        out[a:b] = np.cumsum(np.sign(load[a:b])[:, None] * grows, axis=0)
    return out
