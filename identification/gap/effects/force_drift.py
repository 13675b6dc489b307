"""The charge amplifier drifts: force at zero load moves with the session clock.

Measured = true + d(t): the joints feel d less than simulated, the zero plateaus show d itself.
With a taring before each run only what drifts within a run is left. Up to 0.4 to 4 N/min.

Size: up to 0.4 to 4 N/min; 0.1 to 10 % of the largest force.
Prior: either sign, sd out of SHARES, equally likely; half of it on a free smooth path.
Source: 0.05 pC/s and more in data sheets of charge amplifiers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.effects.drift import (
    free_path,
    free_paths,
    free_variant,
    paths,
    rates,
    shares,
)
from identification.gap.variants import Variant, variant

WORD = "force_drift"
SHARES = (0.001, 0.003, 0.01, 0.03, 0.1)  # of the largest force


def variants(bench: Bench) -> list[Variant]:
    """Warm-up paths, several rates at once, and a free smooth path: alike in all directions, of all
    amplifiers alike, or of every amplifier's own."""
    top = float(np.abs(bench.rows.measured_force).max())
    scales = tuple(s * top for s in shares(bench, SHARES))
    if not top > 0:
        return []
    axes = _axes(bench)

    def column(path: Array) -> int:
        return bench.add(drifting(bench, _tared(bench, path)))

    def own(given: Iterable[Array]) -> list[int]:
        return [bench.add(component(bench, a, path)) for a in axes.values() for path in given]

    out = []
    for label, path in paths(bench).items():
        out.append(variant(WORD, label, [column(path)], scales, positive=False, path=label,
                           names=("",)))  # fmt: skip
        if len(axes) > 1:
            out.append(variant(WORD, f"{label}, each component", own([path]), scales,
                               positive=False, path=label, names=tuple(axes)))  # fmt: skip
    out += _each_run(bench, scales)
    free = free_paths(bench)
    if not free:
        return out
    every = [column(path) for path in rates(bench)]
    out.append(variant(WORD, "rates", every, scales, positive=False, prior=2.0, path="rates",
                       names=("",)))  # fmt: skip
    if len(axes) > 1:
        out.append(variant(WORD, "rates, each component", own(rates(bench)), scales,
                           positive=False, path="rates", names=tuple(axes)))  # fmt: skip
    for label, way in free.items():
        hats = free_path(bench, way.pieces).T
        out.append(free_variant(WORD, label, way, [column(hat) for hat in hats], scales, ("",)))
        if len(axes) > 1:
            fewer = way._replace(pieces=min(way.pieces, EACH_PIECES))
            each = own(free_path(bench, fewer.pieces).T)
            named = f"{label}, each component"
            out.append(free_variant(WORD, named, fewer, each, scales, tuple(axes), prior=1.0))
            along = _alike(bench)
            same = [bench.add(component(bench, along, hat)) for hat in hats]
            together = free_variant(WORD, f"{label}, all components", way, same, scales, ("",),
                                    prior=1.0)  # fmt: skip
            out.append(replace(together, info={**together.info, "along": along}))
    return out


EACH_PIECES = 20  # at most, of one component's path


def _each_run(bench: Bench, scales: tuple[float, ...]) -> list[Variant]:
    """Amplifiers that are reset before every run drift on at another rate each time."""
    runs = np.unique(bench.rows.run)
    if bench.data.tare != "run" or len(runs) < 2:
        return []
    places = [(int(r), name) for r in runs for name in _axes(bench)]
    columns = [bench.add(component(bench, AXES[name], since(bench, r))) for r, name in places]
    names = tuple(f"{name}_run{r + 1}" for r, name in places)
    return [variant(WORD, "each run", columns, scales, positive=False, path="each run",
                    names=names, places=places)]  # fmt: skip


def since(bench: Bench, run: int) -> Array:
    """(n,): share of a run that is over, 0 in other runs."""
    mine = bench.rows.run == run
    if not mine.any():
        return np.zeros(bench.rows.n)
    t = np.where(mine, bench.rows.session - bench.rows.session[mine].min(), 0.0)
    return np.asarray(t / (float(t.max()) or 1.0))


AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def _axes(bench: Bench) -> dict[str, tuple[float, float, float]]:
    """Components of the force that are recorded, or that some direction loads."""
    if bench.rows.tangential is not None:
        return AXES
    units = np.stack([s.unit_vector for s in bench.data.setups])
    return {name: a for name, a in AXES.items() if np.any(np.abs(units @ np.array(a)) > 0.1)}


def _alike(bench: Bench) -> tuple[float, float, float]:
    """Amplifiers that drift alike, so that every direction that has no opposite reads the same: how
    they are connected is a matter of cables."""
    units = np.unique([s.unit_vector for s in bench.data.setups], axis=0)
    x, y, z = np.where(units.sum(axis=0) < -0.1, -1.0, 1.0).tolist()
    return x, y, z


def component(bench: Bench, axis: tuple[float, ...], path: Array) -> Array:
    """(size,): one component of the force drifts along a path (n,): every component has a charge
    amplifier of its own, and shows in what is recorded across as well."""
    setups = bench.data.setups
    unit = np.array([s.unit_vector @ np.array(axis) for s in setups])[bench.rows.setup]
    across = np.array([s.tangents @ np.array(axis) for s in setups])[bench.rows.setup]
    tared = _tared(bench, path)
    return drifting(bench, unit * tared) + bench.stacked(tangential=across * tared[:, None])


def drifting(bench: Bench, d: Array) -> Array:
    """(size,): what a drift (n,) N of the readings does. Where the displacement is imposed,
    force is the answer, and its drift adds to it."""
    if bench.imposed:
        return bench.stacked(bench.stated_slope * d)
    return bench.force_column(-d) + bench.stacked(zero_force=d)


def _tared(bench: Bench, path: Array) -> Array:
    if bench.data.tare == "session":
        return np.asarray(path - path[0])
    starts = np.flatnonzero(bench.rows.starts)
    return np.asarray(path - path[starts][np.cumsum(bench.rows.starts) - 1])
