"""The charge amplifier drifts: force at zero load moves with the session clock.

Measured = true + d(t): the joints feel d less than simulated, the zero plateaus show d itself.
With a taring before each run only what drifts within a run is left. Up to 0.4 to 4 N/min.

Size: up to 0.4 to 4 N/min; 0.1 to 10 % of the largest force.
Prior: either sign, sd out of SHARES, equally likely; a quarter to a third of it on
free smooth paths.
Source: 0.05 pC/s and more in data sheets of charge amplifiers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.closer import best_about_springs
from identification.gap.laws.drift import (
    WINDING,
    FreePath,
    changes,
    free_path,
    free_paths,
    free_variant,
    hangs,
    paths,
    rates,
    shares,
    waited,
)
from identification.gap.laws.drift_law import OF_SESSION, law_of_path, path_of
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant

WORD = "force_drift"
SHARES = (0.001, 0.003, 0.01, 0.03, 0.1)  # of the largest force


def variants(bench: Bench) -> list[Variant]:
    """Warm-up paths, several rates at once, and a free smooth path: alike in all directions, of
    every amplifier's own, or of all amplifiers alike. A weight that hangs all the time weighs the
    same, and nobody turns a screw while a load stands: none where its reading hardly moves. None
    of weights, which nobody reads."""
    top = float(np.abs(bench.rows.measured_force).max())
    shown = bool(np.any(bench.zero_line))  # without load, before and after
    scales = tuple(s * top for s in (SHARES if shown else shares(bench, SHARES)))
    if not top > 0 or (not bench.imposed and _cannot_drift(bench)):
        return []
    amplifiers = _Amplifiers(bench, _axes(bench))
    named = {k: [p] for k, p in paths(bench, shown=shown).items()}
    free = {k: _quick(bench, k, way) for k, way in free_paths(bench).items()}
    if free:
        named["rates"] = rates(bench)
    out = []
    for label, given in named.items():
        same: dict[str, Any] = {"positive": False, "path": label}
        often = 2.0 if label == "rates" else 1.0
        out.append(
            variant(WORD, label, amplifiers.alike(given), scales, prior=often, names=("",), **same)
        )
        if len(amplifiers.axes) > 1:
            out.append(
                variant(
                    WORD,
                    f"{label}, each component",
                    amplifiers.own(given),
                    scales,
                    names=tuple(amplifiers.axes),
                    **same,
                )
            )
    out += _each_run(bench, scales)
    return out + [v for k, way in free.items() for v in _free(amplifiers, k, way, scales)]


def _quick(bench: Bench, label: str, way: FreePath) -> FreePath:
    """The free path; a winding one with as many pieces as a bias current may turn in, which has no
    inertia, and which the zero plateaus show."""
    if label != WINDING:
        return way
    pieces = min(int(bench.load_history.session_span / _BIAS_S), _MOST_BIAS)
    return way._replace(pieces=max(way.pieces, pieces))


_BIAS_S, _MOST_BIAS = 90.0, 64  # s of each piece; pieces


def _cannot_drift(bench: Bench) -> bool:
    return hangs(bench) or _reads_alike(bench) or _are_weights(bench)


def _reads_alike(bench: Bench) -> bool:
    """Whether the reading of a load that stands for most of the session stays within its noise."""
    standing = waited(bench) & ~bench.rows.zero
    return bool(standing.any() and bench.rows.steady[standing].all())


def _are_weights(bench: Bench) -> bool:
    """Whether few forces come again and again, to the last digit, and lie much farther apart than
    readings would scatter: written down, not read. Of levels of a rig without an arm."""
    if bench.data.arm or bench.rows.continuous:
        return False
    values, count = np.unique(bench.data.force, return_counts=True)
    if len(values) < _FEW:
        return False
    apart = float(np.diff(values).min()) > _APART * bench.data.instruments.force
    return bool(apart and np.mean(count > 1) > _MOSTLY)


_FEW, _APART, _MOSTLY = 3, 10.0, 0.5  # values; standard uncertainties; of the values come again


def _free(
    amplifiers: _Amplifiers, label: str, way: FreePath, scales: tuple[float, ...]
) -> list[Variant]:
    """A free path, of every kind that differs here."""
    bench, axes = amplifiers.bench, amplifiers.axes
    hats = free_path(bench, way.pieces).T
    plain = amplifiers.alike(hats)
    out = [free_variant(WORD, label, way, plain, scales, ("",))]
    if len(axes) == 1:
        return out
    fewer = way._replace(pieces=min(way.pieces, EACH_PIECES))
    own = amplifiers.own(free_path(bench, fewer.pieces).T)
    out.append(
        free_variant(WORD, f"{label}, each component", fewer, own, scales, tuple(axes), prior=1.0)
    )
    for name, along in (("all components", _alike(bench)), ("as read at rest", _at_rest(bench))):
        together = amplifiers.together(hats, along) if along else plain
        if together != plain:
            v = free_variant(WORD, f"{label}, {name}", way, together, scales, ("",), prior=1.0)
            out.append(replace(v, info={**v.info, "along": along}))
    return out


@dataclass(frozen=True, eq=False)
class _Amplifiers:
    """Columns of drifts along paths (n,): alike in all directions, of every amplifier's own (axes:
    name -> axis), of all amplifiers alike."""

    bench: Bench
    axes: dict[str, tuple[float, float, float]]

    def alike(self, given: Iterable[Array]) -> list[int]:
        """A column a path."""
        return [self.bench.add(drifting(self.bench, _tared(self.bench, p))) for p in given]

    def own(self, given: Iterable[Array]) -> list[int]:
        """A column a path, axis by axis."""
        every = [component(self.bench, a, p) for a in self.axes.values() for p in given]
        return [self.bench.add(c) for c in every]

    def together(self, given: Iterable[Array], along: tuple[float, float, float]) -> list[int]:
        """A column a path; along: of which all read the same."""
        return [self.bench.add(component(self.bench, along, p)) for p in given]


EACH_PIECES = 20  # at most, of one component's path


def _each_run(bench: Bench, scales: tuple[float, ...]) -> list[Variant]:
    """Amplifiers that are reset before every run drift on at another rate each time."""
    runs = np.unique(bench.rows.run)
    if bench.data.tare != "run" or len(runs) < 2:
        return []
    places = [(int(r), name) for r in runs for name in _axes(bench)]
    columns = [bench.add(component(bench, AXES[name], since(bench, r))) for r, name in places]
    names = tuple(f"{name}_run{r + 1}" for r, name in places)
    return [
        variant(
            WORD,
            "each run",
            columns,
            scales,
            positive=False,
            path="each run",
            names=names,
            places=places,
        )
    ]


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
    loaded = np.any([s.loads for s in bench.data.setups], axis=0)
    return {name: a for (name, a), there in zip(AXES.items(), loaded, strict=True) if there}


def _alike(bench: Bench) -> tuple[float, float, float]:
    """Amplifiers that drift alike, so that every axis that is pushed in one sense only reads the
    same: how they are connected is a matter of cables."""
    units = np.unique([s.unit_vector for s in bench.data.setups], axis=0)
    x, y, z = np.where(units.sum(axis=0) < -0.1, -1.0, 1.0).tolist()
    return x, y, z


def _at_rest(bench: Bench) -> tuple[float, float, float] | None:
    """Along what the components that are read without load go to and fro together (the principal
    axis of these readings), as amplifiers do that one cause drives; none where they don't, or all
    do so alike."""
    rows = bench.rows
    if rows.tangential is None or np.sum(rows.zero) < _FEWEST:
        return None
    along = np.array([s.unit_vector for s in bench.data.setups])[rows.setup]
    across = np.array([s.tangents for s in bench.data.setups])[rows.setup]
    read = along * rows.measured_force[:, None] + np.einsum("nk,nkc->nc", rows.tangential, across)
    rest = read[rows.zero]
    _, size, axes = np.linalg.svd(rest - rest.mean(axis=0), full_matrices=False)
    plain = size[0] > _PLAINLY * bench.data.instruments.force * len(rest) ** 0.5
    together = size[0] ** 2 > _TOGETHER * float(size @ size)
    alike = abs(float(axes[0] @ np.array(_alike(bench)))) / 3**0.5 > _ALIKE
    if not plain or not together or alike:
        return None
    axis = axes[0] / np.abs(axes[0]).max()
    x, y, z = axis.tolist()
    return x, y, z


_FEWEST, _TOGETHER = 6, 0.95  # readings; of their square
_PLAINLY = 3.0  # times the noise of a reading, rms
_ALIKE = 0.99  # cosine


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


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    return changes(bench, v, found, "N")


def _describe(bench: Bench, v: Variant) -> tuple[Law, Array]:
    """Terms of the path."""
    if v.info["path"] == "each run":
        each_run = tuple(
            Term("drift", {"run": r, "along": AXES[name]}) for r, name in v.info["places"]
        )
        return Law({"path": "each run", "quantity": "force"}, each_run), np.ones(len(each_run))
    constants, terms, scale = law_of_path(bench, v)
    law = constants | {"quantity": "force"}
    if v.info["names"] == ("",):
        along = {k: v.info[k] for k in ("along",) if k in v.info}
        return Law(law, tuple(replace(t, shape={**t.shape, **along}) for t in terms)), scale
    named = tuple(
        replace(t, shape={**t.shape, "along": AXES[name]})
        for name in v.info["names"]
        for t in terms
    )
    return Law(law, named), np.tile(scale, len(v.info["names"]))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """Measured = true + d(t), less what was tared away; zero plateaus show d itself."""
    out = []
    for t in law.terms:
        if "run" in t.shape:
            path = since(bench, t.shape["run"])
            out.append(component(bench, t.shape["along"], path))
            continue
        if "along" in t.shape:
            out.append(component(bench, t.shape["along"], path_of(bench, law, t)))
            continue
        d = _tared(bench, path_of(bench, law, t))
        out.append(drifting(bench, d))
    return out


_LAWS = Laws(_describe, _columns, through_springs=True, of_session=OF_SESSION, lasts=False)
EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=_LAWS,
    lengths=(),
    finer=partial(best_about_springs, _LAWS),
)
