"""Parts of an explanation: effects with a scale, their sizes, evidence and signs together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.compare import logsumexp, mean_square
from identification.gap.evidence.engine import Engine, NoiseLevel
from identification.gap.evidence.factor import factor_of
from identification.gap.evidence.imperfection import level_priors
from identification.gap.evidence.signs import Kept, Limits, all_kept, log_odds, log_shares
from identification.gap.model.variants import Variant, block
from identification.gap.words import BETWEEN_RUNS, LINEAR


@dataclass(frozen=True, eq=False)
class Part:
    """One effect of an explanation: variant and scale of its coefficients."""

    variant: Variant
    scale: float

    @property
    def word(self) -> str:
        """Its name."""
        return self.variant.word

    @property
    def root(self) -> Array:
        """Root of the prior covariance of its coefficients."""
        return np.asarray(self.scale * self.variant.root)


@dataclass(frozen=True, eq=False)
class Sizes:
    """rms (m) of each part's most probable contribution: to the gap, where what springs would take
    over is none, unless the effect is linear itself; and as it moves. energy: mean square (m^2) of
    all contributions, what is a law counted by its imperfection. linear: how far those that are
    linear move it together. signed: whether the most probable coefficients of each part have the
    sign that physics wants."""

    gap: Array
    moved: Array
    energy: float
    linear: float = 0.0
    signed: tuple[bool, ...] = ()


def part_sizes(engine: Engine, parts: tuple[Part, ...], level: int) -> Sizes:
    """How large the parts are together, at one level."""
    columns = [c for p in parts for c in p.variant.columns]
    root = block([p.root for p in parts])
    squares = engine.square(tuple(columns))
    lv, plain = engine.levels[level], squares[0]
    inner = np.eye(len(columns)) + root.T @ squares[level] @ root
    w = root @ np.linalg.solve(inner, root.T @ lv.moment[columns])
    rows = engine.bench.rows
    precision = float(np.sum(1 / engine.sigma[: rows.n] ** 2))
    sizes, moves, signed, energy, start = [], [], [], 0.0, 0
    linear = np.zeros(rows.n)
    between = sum(p.word in BETWEEN_RUNS for p in parts)  # of two, one may undo the other
    for p in parts:
        c, k = list(p.variant.columns), len(p.variant.columns)
        part = w[start : start + k]
        moved = rows.about_means(engine.responses(c) @ part)
        moves.append(rows.rms(moved))
        if p.word in LINEAR:
            linear += moved
            sizes.append(_beyond_springs(engine, moved))
        else:
            mine = slice(start, start + k)
            structural = float(part @ plain[mine, mine] @ part) / precision
            size = max(structural, 0.0) ** 0.5
            if p.word in BETWEEN_RUNS and between == 1:
                size = max(size, _beyond_scatter(engine, moved))
            sizes.append(min(size, moves[-1]))
        energy += float(part @ mean_square(engine, p.variant) @ part)
        start += k
        limit = p.variant.positive
        signed.append(limit is None or float(limit @ part) >= p.variant.least)
    return Sizes(
        np.array(sizes), np.array(moves), min(energy, engine.most), rows.rms(linear), tuple(signed)
    )


def needed(engine: Engine, parts: tuple[Part, ...], level: int) -> Array:
    """(p,) nats by which the others alone, fitted anew, explain less than all parts, at one
    level."""
    alone = [_gained(engine, parts[:i] + parts[i + 1 :], level) for i in range(len(parts))]
    return np.asarray(_gained(engine, parts, level) - np.array(alone))


def _gained(engine: Engine, parts: tuple[Part, ...], level: int) -> float:
    """Nats by which the most probable coefficients of all parts fit better than none."""
    columns = [c for p in parts for c in p.variant.columns]
    root = block([p.root for p in parts])
    inner = np.eye(root.shape[1]) + root.T @ engine.square(tuple(columns))[level] @ root
    moment = root.T @ engine.levels[level].moment[columns]
    return float(0.5 * moment @ np.linalg.solve(inner, moment))


def _beyond_springs(engine: Engine, moved: Array) -> float:
    """rms (m) of a linear effect beyond what the springs give within BOUND; beside an effect that
    hardly shows, some of what it moves counts whatever they give."""
    base, n = engine.base, engine.bench.rows.n
    root = np.sqrt(engine.bench.rows.weight / engine.bench.rows.weight.sum())
    if "springs" not in engine.cache:
        springs = base.index("spring")
        A = (
            engine.bench.rows.about_means(base.columns[:n, springs])
            * base.sd[springs]
            * root[:, None]
        )
        engine.cache["springs"], engine.cache["to springs"] = A, np.linalg.pinv(A, rcond=1e-6)
    t = engine.cache["to springs"] @ (moved * root)
    left = float(np.linalg.norm(moved * root - engine.cache["springs"] @ t))
    most = float(np.abs(t).max()) if t.size else 0.0
    beyond = max(0.0, 1 - BOUND / most) if most > 0 else 1.0
    return max(left, max(beyond, _COUNTS) * float(np.sqrt(np.sum((moved * root) ** 2))))


_COUNTS = 0.03
BOUND = 3.0  # standard deviations of what was stated that a spring may be off


def _beyond_scatter(engine: Engine, moved: Array) -> float:
    """rms (m) of what moves whole runs beyond three standard deviations of their scatter: however
    many samples say so, no scatter takes that over."""
    rows = engine.bench.rows
    runs = np.bincount(rows.run, rows.weight * moved) / np.bincount(rows.run, rows.weight)
    most = float(np.abs(runs).max()) / engine.bench.noise.run
    if engine.bench.data.datum == "repetition" or not most > _SCATTERS:
        return 0.0
    return (1 - _SCATTERS / most) * rows.rms(moved)


_SCATTERS = 3.0


def signs_kept(level: NoiseLevel, parts: tuple[Part, ...]) -> float:
    """log of the odds that every part keeps the sign physics wants, all fitted together."""
    columns = [c for p in parts for c in p.variant.columns]
    root = block([p.root for p in parts])
    precision = np.eye(len(columns)) + root.T @ level.square(columns) @ root
    factor = factor_of(precision)
    roots = np.linalg.solve(factor, root.T)  # of the covariance
    w = roots.T @ np.linalg.solve(factor, root.T @ level.moment[columns])
    out, start = 0.0, 0
    asked: list[Kept] = []
    for p in parts:
        s = slice(start, start + len(p.variant.columns))
        start = s.stop
        limits = limits_of(level.engine, p.variant)
        which = limits.asked[0]
        if which.any():
            rows = limits.rows
            before = np.linalg.norm(rows @ p.root, axis=2)
            sums, spread = rows @ w[s], rows @ roots[:, s].T
            out += min(0.0, float(log_odds(limits, _ONE, before, sums, spread)[0]))
            share = log_shares(limits, _ONE, before)[0, which]
            asked.append(Kept((sums[0] - limits.floor[0])[which], spread[0, which], share))
    return min(out, all_kept(asked)) if asked else out


_ONE = np.zeros(1, dtype=np.intp)


def limits_of(engine: Engine, v: Variant) -> Limits:
    """Of one variant; the same few come again in many explanations. Kept with the engine: a cache
    of the module would keep the benches of many diagnoses alive."""
    if v not in engine.limits:
        engine.limits[v] = Limits.of([v])
    found: Limits = engine.limits[v]
    return found


def log_joints(engine: Engine, parts: tuple[Part, ...]) -> Array:
    """log evidence (l,) of all parts together with fixed scales at every level."""
    bases = np.array([level.log_base for level in engine.levels])
    return _together(parts, *_asked(engine, parts), bases) if parts else bases


def log_joint_between(engine: Engine, parts: tuple[Part, ...], eta: float) -> float:
    """The same for a size of imperfection (m) that is none of the levels."""
    gram, moment, base = engine.between(eta, [c for p in parts for c in p.variant.columns])
    return float(_together(parts, gram, moment, np.array(base)))


def energies(engine: Engine, parts: tuple[Part, ...]) -> Array:
    """(l,) the `Sizes.energy` of the parts at every level."""
    return np.asarray(np.minimum(_energies_each(engine, parts).sum(axis=1), engine.most))


def _energies_each(engine: Engine, parts: tuple[Part, ...]) -> Array:
    """(l, p) mean square (m^2) of what of each part counts by its imperfection, all together."""
    root = block([p.root for p in parts])
    gram, moment = _asked(engine, parts)
    inner = np.eye(len(root)) + root.T @ gram @ root
    w = np.linalg.solve(inner, (moment @ root)[..., None])[..., 0] @ root.T
    squares = w @ block([mean_square(engine, p.variant) for p in parts]) * w
    starts = np.cumsum([0, *(len(p.variant.columns) for p in parts[:-1])])
    return np.asarray(np.add.reduceat(squares, starts, axis=1))


def evidence_correction(
    engine: Engine, parts: tuple[Part, ...], taken: float, joint: Array
) -> float:
    """Nats to add to the last part's evidence beside the others, which was computed as if these had
    a mean square of `taken` (m^2), as they have without it. How imperfect laws may be goes by what
    they do, and beside another law one does something else than alone. joint (l,): `log_joints` of
    all parts."""
    each = _energies_each(engine, parts)
    together, alone = each.sum(axis=1), each[:, -1] + taken
    now, before = (
        float(logsumexp(joint + level_priors(engine.etas, np.minimum(energy, engine.most))))
        for energy in (together, alone)
    )
    return now - before


def _asked(engine: Engine, parts: tuple[Part, ...]) -> tuple[Array, Array]:
    """Gram matrices (l, k, k) and moments (l, k) of the columns of all parts at every level."""
    columns = [c for p in parts for c in p.variant.columns]
    return engine.square(tuple(columns)), np.stack([lv.moment[columns] for lv in engine.levels])


def _together(parts: tuple[Part, ...], gram: Array, moment: Array, log_base: Array) -> Array:
    root = block([p.root for p in parts])
    factor = factor_of(np.eye(len(root)) + root.T @ gram @ root)
    left = np.linalg.solve(factor, (moment @ root)[..., None])[..., 0]
    lost = np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return np.asarray(log_base + 0.5 * np.sum(left**2, axis=-1) - lost)
