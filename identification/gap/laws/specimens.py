"""What metal specimens do that are pulled to yield (ISO 6892-1): thresholds where their own spring
puts them, and the plateau of yield points.

A machine that imposes the displacement reaches the knee where the specimen's own stiffness puts it.
Where what was simulated is far off (the machine's own compliance, grips, a gauge length) that is
elsewhere: thresholds are looked for where the measured spring carries its share of the largest
force.
Mild steel falls from an upper to a lower yield point, flows at that over the plateau of Lueders,
and hardens only then: beyond the knee nearly no stiffness, beyond the plateau's end some again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, block, variant

OWN = 1.5  # a spring of its own, in the scales of what gives way: stiffer by as much as it loses
# Of the largest force: the first way from here to these, the steepest, as some have yielded before;
_FROM, _TO, _FEWEST = 0.1, (0.2, 0.3, 0.45), 4  # and rows there
_OFF = 1.5  # times: as much as a simulated stiffness is off before thresholds miss the knee

_OTHER = ", other springs"
PLATEAU = " plateau to"
_ENDS, _NEAREST, _FARTHEST = 24, 1.3, 0.9  # of plateaus: of the knee, and of the range
_ABOUT = (0.87, 1.0, 1.2, 1.6)  # the knee: up, and down to the lower yield point
_BEYOND = (0.93, 1.0, 1.1, 1.3, 1.7, 2.4, 3.6, 5.5, 9.0)  # the plateau's end: how it hardens there
_SCALES = (0.25, 0.9, 3.5, 14.0)  # of all these


def own_stiffness(bench: Bench) -> float:
    """Of a rig without an arm whose displacement is imposed: stiffness with which its force first
    rises, in that simulated; 1 where rows don't tell."""
    if bench.data.arm or not bench.imposed:
        return 1.0
    first = bench.rows.run == bench.rows.run[0]
    load, force = (np.abs(v[first] - v[0]) for v in (bench.load, bench.rows.measured_force))
    rises = []
    for most in _TO:
        end = int((force > most * force.max()).argmax())
        way = np.flatnonzero(force[: end + 1] > _FROM * force.max())
        if len(way) >= _FEWEST and np.ptp(load[way]) > 0:
            rises.append(float(np.polyfit(load[way], force[way], 1)[0]))
    return max(rises, default=1.0)


def off(stiffness: float) -> bool:
    """Whether a stiffness, in that simulated, is so far off that thresholds lie elsewhere."""
    return stiffness > 0 and not 1 / _OFF < stiffness < _OFF


def with_other_springs(
    bench: Bench, joint: int, found: list[Variant], scales: tuple[float, ...], more: float
) -> list[Variant]:
    """The variants, each with a line of its own spring: what was simulated may be its first slope,
    or the mean one, or far off. more: how far, in the variants' scales, which are new."""
    line = bench.add_joint(joint, bench.elastic[:, joint])
    out = []
    for v in found:
        assert v.positive is not None
        info = {**v.info, "other_springs": True}
        out.append(
            replace(
                v,
                label=f"{v.label}{_OTHER}",
                columns=(*v.columns, line),
                scales=scales,
                root=block([v.root, more * np.eye(1)]),
                positive=np.append(v.positive, 0.0),
                each=(*v.each, False),
                within=np.pad(v.within, ((0, 0), (0, 1))),
                prior=0.5 * v.prior,
                info=info,
            )
        )
    return out


def without_springs(found: Variant) -> Variant:
    """Such a variant without the line of its own spring: what another effect says of that."""
    v, own = found, len(found.columns) - 1
    return replace(
        v,
        label=v.label.removesuffix(_OTHER),
        columns=v.columns[:own],
        root=v.root[:own, :own],
        positive=None if v.positive is None else v.positive[:own],
        each=v.each[:own],
        within=v.within[:, :own],
        info={**v.info, "other_springs": False},
    )


def plateaus(bench: Bench, found: Variant) -> list[Variant]:
    """Plateaus of yield points behind a knee that was found in a single pull, to where they may
    end."""
    info, span = found.info, float(np.ptp(np.append(bench.load, 0.0)))
    knee = float(info["centre"])
    if not (bench.imposed and info.get("softens") and _NEAREST * knee < _FARTHEST * span):
        return []
    out = []
    for end in np.geomspace(_NEAREST * knee, _FARTHEST * span, _ENDS):
        about, beyond = knee * np.array(_ABOUT), end * np.array(_BEYOND)
        radius = np.concatenate([about[about < beyond[0]], beyond[beyond < span]])
        columns = [info["column"](s) for s in bench.plays(info["load"], radius, bench.moved).T]
        each, within = softening(radius, len(radius))
        exact = {**info, "radius": radius, "back": {}, "knee": "plateau"}
        out.append(
            variant(
                found.word,
                f"joint {info['joint'] + 1} at {knee:.4g}{PLATEAU} {end:.4g}",
                columns,
                _SCALES,
                root=None,
                positive=True,
                prior=0.25 / _ENDS,
                least=found.least,
                each=each,
                within=within,
                **exact,
            )
        )
    if info.get("other_springs"):
        return with_other_springs(bench, int(info["joint"]), out, _SCALES, OWN)
    return out


def softening(radius: Array, n: int) -> tuple[tuple[bool, ...], Array]:
    """Signs of what softens beyond its knee: of n coefficients those of the radii (k,) are positive
    in sum up to any radius, the further ones each."""
    k = len(radius)
    each = (*(False,) * k, *(True,) * (n - k))
    sums = np.zeros((k, n))
    sums[:, :k] = radius <= radius[:, None]
    return each, sums[radius < radius.max()]  # that of all is asked anyway
