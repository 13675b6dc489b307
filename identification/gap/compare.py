"""Evidence of all variants over all levels, and what follows for the words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from identification.gap.data import Array
from identification.gap.evidence import Engine, Level
from identification.gap.imperfection import IMPERFECTION, LAW_IMPERFECTION, LINEAR
from identification.gap.products import squares_of
from identification.gap.signs import Limits
from identification.gap.table import Stack, Table
from identification.gap.variants import Variant


@dataclass(frozen=True, eq=False)
class Scored:
    """log evidence of a variant, with the scale and level that contribute most."""

    variant: Variant
    log_evidence: float
    scale: float
    level: int


def score(
    engine: Engine, levels: list[Level], variants: list[Variant], already: float = 0.0
) -> list[Scored]:
    """Evidence of every variant on top of `levels` (base, or base and an effect already chosen).

    already: mean square (m^2) of that effect: it brings imperfection of its own.
    """
    out: dict[Variant, Scored] = {}
    by_size: dict[tuple[int, int], dict[str, list[Variant]]] = {}
    for v in variants:
        words = by_size.setdefault((len(v.columns), len(v.scales)), {})
        words.setdefault(v.word, []).append(v)
    for words in by_size.values():
        out |= _score_batch(engine, levels, list(words.values()), already)
    return [out[v] for v in variants]


def _score_batch(
    engine: Engine, levels: list[Level], families: list[list[Variant]], already: float
) -> dict[Variant, Scored]:
    """Of variants with as many coefficients and scales each, word by word."""
    table = Table(engine, levels, [_stack(engine, tuple(f)) for f in families], already)
    table.look()
    table.limit()
    batch = [v for family in families for v in family]
    flat = table.logs.transpose(1, 0, 2).reshape(len(batch), -1)
    number = len(batch[0].scales)
    total = (logsumexp(flat) - log(number)).tolist()
    return {
        v: Scored(v, t + log(v.prior), v.scales[b % number], b // number)
        for v, t, b in zip(batch, total, flat.argmax(axis=1).tolist(), strict=True)
    }


def _stack(engine: Engine, family: tuple[Variant, ...]) -> Stack:
    """Made once: families come again with every effect that is added."""
    if family not in engine.stacks:
        columns = np.array([v.columns for v in family])
        root = np.stack([v.root for v in family])
        engine.stacks[family] = Stack(
            columns,
            root,
            np.array([v.scales for v in family]),
            np.swapaxes(root, 1, 2) @ mean_squares(engine, family) @ root,
            Limits.of(family),
            engine.alike(columns),
        )
    found: Stack = engine.stacks[family]
    return found


def mean_squares(engine: Engine, variants: Sequence[Variant]) -> Array:
    """(v, k, k): mean square response (m^2) of the coefficients of variants with k columns each,
    without the datum of each setup; of what is linear only the part that counts as imperfect."""
    weight, columns = engine.bench.rows.weight, np.array([v.columns for v in variants])
    used, place = np.unique(columns, return_inverse=True)
    moved = moved_response(engine, engine.responses(used))
    moved *= np.sqrt(weight / weight.sum())[:, None]
    share = np.array([imperfect(v) for v in variants])
    squares = squares_of(moved.T, place.reshape(columns.shape))
    return np.asarray(squares * share[:, :, None] * share[:, None, :])


def imperfect(variant: Variant) -> Array:
    """(k,) how imperfect what each coefficient does is, against the laws of mechanisms: what is
    linear is exact, a spring beside friction as well."""
    exact = LAW_IMPERFECTION / IMPERFECTION
    share = np.full(len(variant.columns), exact if variant.word in LINEAR else 1.0)
    if variant.info.get("other_springs"):
        share[-1] = exact
    return share


def moved_response(engine: Engine, response: Array) -> Array:
    """Responses (n, k) less their mean per setup: the datum says nothing."""
    rows = engine.bench.rows
    if "setups" not in engine.cache:
        share = (rows.setup[:, None] == np.arange(len(engine.bench.data.setups))) * rows.weight[
            :, None
        ]
        engine.cache["setups"] = share / np.maximum(share.sum(axis=0), 1e-300)
    means = response.T @ engine.cache["setups"]
    return np.asarray(response - means[:, rows.setup].T)


def condition(level: Level, columns: tuple[int, ...], root: Array, scale: float) -> Level:
    """The level with an effect of fixed scale integrated out as well."""
    c = np.array(columns)
    T = scale * root
    beside = level.beside(columns) - level.taken[:, c].T @ level.taken
    factor = np.linalg.cholesky(np.eye(len(c)) + T.T @ beside[:, c] @ T)
    turn = np.linalg.solve(factor, T.T)
    cross, left = turn @ beside, turn @ level.moment[c]
    return replace(
        level,
        moment=level.moment - cross.T @ left,
        log_base=level.log_base + 0.5 * float(left @ left) - float(np.log(np.diag(factor)).sum()),
        misfit=level.misfit - float(left @ left),
        taken=np.vstack([level.taken, cross]),
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


def by_word(scored: list[Scored]) -> dict[str, list[Scored]]:
    """Word -> its variants."""
    out: dict[str, list[Scored]] = {}
    for s in scored:
        out.setdefault(s.variant.word, []).append(s)
    return out


def marginal(scored: list[Scored]) -> float:
    """log evidence of a word: mean over its variants, weighted by their prior."""
    weights = [s.variant.prior for s in scored]
    values = [s.log_evidence - log(s.variant.prior) for s in scored]
    return log_mean(values, weights)


def closest(scored: list[Scored]) -> Scored:
    """Of the shapes of a word that are about equally likely, the one that needs least
    imperfection: a word is judged by how well it can explain, not by its crudest shape."""
    best = max(s.log_evidence for s in scored)
    near = [s for s in scored if s.log_evidence > best - _ABOUT_EQUAL]
    return min(near, key=lambda s: (s.level, -s.log_evidence))


_ABOUT_EQUAL = 3.0  # nats
