"""Evidence of all variants over all levels, and what follows for the words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import log
from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.evidence.engine import Engine, NoiseLevel
from identification.gap.evidence.factor import factor_of
from identification.gap.evidence.imperfection import IMPERFECTION, LAW_IMPERFECTION
from identification.gap.evidence.products import squares_of
from identification.gap.evidence.signs import Limits
from identification.gap.evidence.table import EvidenceTable, Stack
from identification.gap.model.variants import Variant
from identification.gap.words import LINEAR, MECHANISMS


class Scored(NamedTuple):
    """A variant with the scale and level that contribute most. log_evidence: its evidence times its
    prior, so that shapes compare as they are likely; `marginal`, and who wants the evidence alone,
    takes the prior off again. A plain tuple: a diagnosis makes 100 000 of them."""

    variant: Variant
    log_evidence: float
    scale: float
    level: int


def score(
    engine: Engine, levels: list[NoiseLevel], variants: Sequence[Variant], already: float = 0.0
) -> list[Scored]:
    """Evidence of every variant on top of `levels` (base, or base and an effect already chosen).

    already: mean square (m^2) of that effect: it brings imperfection of its own.
    """
    some = _arranged(engine, tuple(variants))
    count = len(some.log_scales)
    total, scale, level = np.empty(count), np.empty(count), np.empty(count, dtype=np.intp)
    for places, stacks in some.batches:
        total[places], scale[places], level[places] = _evidence(engine, levels, stacks, already)
    total -= some.log_scales
    made = total[some.shape] + some.log_prior
    found = (values[some.shape].tolist() for values in (scale, level))
    return list(map(Scored, variants, made.tolist(), *found))


@dataclass(frozen=True, eq=False)
class _Arranged:
    """Variants (n,) by the different shapes (m,) that they take: shape (n,), log_prior (n,),
    log_scales (m,) of the number of scales. batches: stacks of about one size, word by word, and
    the shapes (b,) in them."""

    shape: Ints
    log_prior: Array
    log_scales: Array
    batches: list[tuple[Ints, list[Stack]]]


def _arranged(engine: Engine, variants: tuple[Variant, ...]) -> _Arranged:
    """Made once: the same ones are compared again with every effect that is added."""
    if variants not in engine.arranged:
        first: dict[object, Variant] = {}
        like = [first.setdefault(v.shape, v) for v in variants]
        number = {v: i for i, v in enumerate(first.values())}
        by_size: dict[int, dict[str, list[Variant]]] = {}
        for v in number:
            by_size.setdefault(_size(len(v.columns)), {}).setdefault(v.word, []).append(v)
        batches = []
        for k, words in by_size.items():
            places = np.array([number[v] for family in words.values() for v in family])
            batches.append((places, [_stack(engine, tuple(f), k) for f in words.values()]))
        engine.arranged[variants] = _Arranged(
            np.array([number[v] for v in like], dtype=np.intp),
            np.array([v.log_prior + log_prior_of_joint(engine, v) for v in variants]),
            np.log([len(v.scales) for v in number]),
            batches,
        )
    found: _Arranged = engine.arranged[variants]
    return found


def log_prior_of_joint(engine: Engine, v: Variant) -> float:
    """Log prior (nats) of the joint that a mechanism sits in (`Bench.joint_log_priors`); 0 for what
    is no mechanism of one joint, and without an arm."""
    if not engine.bench.data.arm or v.joint is None or v.word not in MECHANISMS:
        return 0.0
    return float(engine.bench.joint_log_priors[v.joint])


# Variants of nearby sizes are padded to the same: a few large batches take less time than many.
_SIZES = (1, 2, 3, 5, 7, 8, 11, 13)


@cache
def _size(k: int) -> int:
    return next((s for s in _SIZES if s >= k), k)


def _evidence(
    engine: Engine, levels: list[NoiseLevel], stacks: list[Stack], already: float
) -> tuple[Array, Array, Ints]:
    """Of all variants (v,) in stacks of one size: log of the sum of the evidence over scales and
    levels; the scale, and the number of the level, that contribute most."""
    table = EvidenceTable(engine, levels, stacks, already)
    table.look()
    table.limit()
    flat = table.logs.transpose(1, 0, 2).reshape(table.logs.shape[1], -1)
    level, number = np.divmod(flat.argmax(axis=1), table.logs.shape[2])
    return logsumexp(flat), table.scales[np.arange(len(number)), number], level


def _stack(engine: Engine, family: tuple[Variant, ...], k: int) -> Stack:
    """Of a word's variants, padded to k coefficients. Made once: families come again with every
    effect that is added."""
    if family not in engine.stacks:
        columns = np.array([v.columns + v.columns[:1] * (k - len(v.columns)) for v in family])
        joints = np.array([_slips_on(v) for v in family])
        root, share = np.zeros((*columns.shape, k)), np.zeros(columns.shape)
        scales = np.zeros((len(family), max(len(v.scales) for v in family)))
        for i, v in enumerate(family):
            own = len(v.columns)
            root[i, :own, :own], share[i, :own] = v.root, imperfect(v)
            scales[i, : len(v.scales)] = v.scales
        plain = np.swapaxes(root, 1, 2) @ mean_squares(engine, columns, joints, share) @ root
        limits = Limits.of(family, k)
        engine.stacks[family] = Stack(
            columns, root, scales, plain, limits, engine.unweighed(columns)
        )
    found: Stack = engine.stacks[family]
    return found


def mean_squares(engine: Engine, columns: Ints, joints: Ints, share: Array) -> Array:
    """(v, k, k): mean square response (m^2) of the coefficients of variants with the columns
    (v, k), without the datum of each setup; without what of it is exact: of what is linear the
    part that share (v, k) leaves, of what slips the lines of the springs (v,) that it slips on."""
    weight = engine.bench.rows.weight
    used, place = np.unique(columns * _JOINTS + joints[:, None], return_inverse=True)
    number, joint = np.divmod(used, _JOINTS)
    moved = engine.responses(number)
    for j in set(joint.tolist()) - {_NONE}:
        moved[:, joint == j] -= _line(engine, j)[:, None]
    moved = engine.bench.rows.about_means(moved)
    moved *= np.sqrt(weight / weight.sum())[:, None]
    squares = squares_of(moved.T, place.reshape(columns.shape))
    return np.asarray(squares * share[:, :, None] * share[:, None, :])


_JOINTS = 64  # more than any arm has
_NONE = _JOINTS - 1


def _slips_on(variant: Variant) -> int:
    return _NONE if variant.slips_on is None else variant.slips_on


def _line(engine: Engine, joint: int) -> Array:
    """(n,) response of a joint's stated spring."""
    bench = engine.bench
    deflects = bench.sense * bench.compliance[joint] * bench.true_torque[:, joint]
    return np.asarray(bench.lever[:, joint] * deflects)


def mean_square(engine: Engine, v: Variant) -> Array:
    """(k, k): the same of one variant, kept for the next explanation that has it."""
    if v not in engine.cache:
        columns, joints = np.array([v.columns]), np.array([_slips_on(v)])
        engine.cache[v] = mean_squares(engine, columns, joints, imperfect(v)[None])[0]
    found: Array = engine.cache[v]
    return found


def imperfect(variant: Variant) -> Array:
    """(k,) imperfection of what each coefficient does, in that of a mechanism: LAW_IMPERFECTION /
    IMPERFECTION for linear effects and for the spring beside a mechanism (last column), else 1."""
    exact = LAW_IMPERFECTION / IMPERFECTION
    share = np.full(len(variant.columns), exact if variant.word in LINEAR else 1.0)
    if variant.other_springs:
        share[-1] = exact
    return share


def condition(level: NoiseLevel, columns: tuple[int, ...], root: Array, scale: float) -> NoiseLevel:
    """The level with an effect of fixed scale integrated out as well."""
    c = np.array(columns)
    T = scale * root
    beside, before = level.beside(columns), level.taken
    if len(before):  # of the whole pool, which is not copied where there is nothing to take
        beside = beside - before[:, c].T @ before
    factor = factor_of(np.eye(len(c)) + T.T @ beside[:, c] @ T)
    turn = np.linalg.solve(factor, T.T)
    cross, left = turn @ beside, turn @ level.moment[c]
    return replace(
        level,
        moment=level.moment - cross.T @ left,
        log_base=level.log_base + 0.5 * float(left @ left) - float(np.log(np.diag(factor)).sum()),
        misfit=level.misfit - float(left @ left),
        taken=np.vstack([before, cross]) if len(before) else cross,
    )


def logsumexp(values: Array) -> Array:
    """log of the sum of exp(values) along the last axis. That of scipy.special (1.17) takes four
    times as long for tables as small as these, and a diagnosis asks 500 times."""
    top = values.max(axis=-1, keepdims=True)
    return np.asarray(top[..., 0] + np.log(np.exp(values - top).sum(axis=-1)))


def log_mean(values: list[float], weights: list[float] | None = None) -> float:
    """log of the (weighted) mean of exp(values)."""
    v = np.array(values)
    w = np.ones(len(v)) if weights is None else np.array(weights)
    top = v[w > 0].max()
    v = np.minimum(v, top)  # what weighs nothing decides nothing
    return float(top + np.log(np.sum(w * np.exp(v - top)) / w.sum()))


def by_word(scored: Sequence[Scored]) -> dict[str, list[Scored]]:
    """Word -> its variants."""
    out: dict[str, list[Scored]] = {}
    for s in scored:
        out.setdefault(s.variant.word, []).append(s)
    return out


def marginal(scored: Sequence[Scored]) -> float:
    """log evidence of a word: mean over its variants, weighted by their prior."""
    weights = [s.variant.prior for s in scored]
    values = [s.log_evidence - log(s.variant.prior) for s in scored]
    return log_mean(values, weights)


def closest(scored: Sequence[Scored]) -> Scored:
    """Of the shapes of a word that are about equally likely, the one that needs least
    imperfection: a word is judged by how well it can explain, not by its crudest shape."""
    best = max(s.log_evidence for s in scored)
    near = [s for s in scored if s.log_evidence > best - _ABOUT_EQUAL]
    return min(near, key=lambda s: (s.level, -s.log_evidence))


_ABOUT_EQUAL = 3.0  # nats
