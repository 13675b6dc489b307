"""Evidence of all variants over all levels, and what follows for the words."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.gap.data import Array
from identification.gap.evidence import Engine, Level
from identification.gap.imperfection import IMPERFECTION, LAW_IMPERFECTION, LINEAR
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
    out: list[Scored | None] = [None] * len(variants)
    by_size: dict[tuple[str, int, int], list[int]] = {}
    for i, v in enumerate(variants):
        by_size.setdefault((v.word, len(v.columns), len(v.scales)), []).append(i)
    for members in by_size.values():
        batch = [variants[i] for i in members]
        for i, s in zip(members, _score_batch(engine, levels, batch, already), strict=True):
            out[i] = s
    return [s for s in out if s is not None]


def _score_batch(
    engine: Engine, levels: list[Level], batch: list[Variant], already: float
) -> list[Scored]:
    """Of variants of one word, with as many coefficients and scales each."""
    key = tuple(batch)  # batches come again with every effect that is added
    if key not in engine.stacks:
        engine.stacks[key] = _stack(engine, batch)
    table = Table(engine, levels, engine.stacks[key], already)
    table.look()
    table.limit()
    flat = table.logs.transpose(1, 0, 2).reshape(len(batch), -1)
    best = flat.argmax(axis=1)
    number = len(batch[0].scales)
    total = logsumexp(flat) - np.log(number)
    return [
        Scored(v, float(t) + float(np.log(v.prior)), v.scales[b % number], int(b // number))
        for v, t, b in zip(batch, total, best, strict=True)
    ]


def _stack(engine: Engine, batch: list[Variant]) -> Stack:
    return Stack(
        np.array([v.columns for v in batch]),
        np.stack([v.root for v in batch]),
        np.array([v.scales for v in batch]),
        np.stack([raw_gram(engine, v) for v in batch]),
        Limits.of(batch),
    )


def raw_gram(engine: Engine, variant: Variant) -> Array:
    """(k, k): mean square response (m^2) of coefficients, without the datum of each setup; of a
    linear law only the part that counts as imperfect."""
    key = (variant.columns, variant.root.tobytes())
    if key not in engine.cache:
        u = moved_response(engine, engine.columns(variant.columns)[: engine.bench.rows.n])
        weight = engine.bench.rows.weight
        part = (u * weight[:, None]).T @ u / weight.sum()
        if variant.word in LINEAR:
            part = part * (LAW_IMPERFECTION / IMPERFECTION) ** 2
        engine.cache[key] = variant.root.T @ part @ variant.root
    return engine.cache[key]


def moved_response(engine: Engine, response: Array) -> Array:
    """Responses (n, k) less their mean per setup: the datum says nothing."""
    rows = engine.bench.rows
    if "setups" not in engine.cache:
        share = (rows.setup[:, None] == np.arange(len(engine.bench.data.setups))) * rows.weight[
            :, None
        ]
        engine.cache["setups"] = share / np.maximum(share.sum(axis=0), 1e-300)
    return np.asarray(response - (engine.cache["setups"].T @ response)[rows.setup])


def condition(level: Level, columns: tuple[int, ...], root: Array, scale: float) -> Level:
    """The level with an effect of fixed scale integrated out as well."""
    c = np.array(columns)
    T = scale * root
    gone = level.taken[:, c]
    beside = T.T @ (level.beside(columns) - gone.T @ level.taken)
    inner = np.eye(len(c)) + beside[:, c] @ T
    factor = np.linalg.cholesky(inner)
    cross = np.linalg.solve(factor, beside)
    left = np.linalg.solve(factor, T.T @ level.moment[c])
    return replace(
        level,
        moment=level.moment - cross.T @ left,
        log_base=level.log_base + 0.5 * float(left @ left) - float(np.log(np.diag(factor)).sum()),
        misfit=level.misfit - float(left @ left),
        taken=np.vstack([level.taken, cross]),
    )


def logsumexp(values: Array) -> Array:
    """log of the sum of exp(values) along the last axis."""
    top = values.max(axis=-1, keepdims=True)
    return np.asarray(top[..., 0] + np.log(np.exp(values - top).sum(axis=-1)))


def log_mean(values: list[float], weights: list[float] | None = None) -> float:
    """log of the (weighted) mean of exp(values)."""
    v = np.array(values)
    w = np.ones(len(v)) if weights is None else np.array(weights)
    top = v[w > 0].max()
    v = np.minimum(v, top)  # what weighs nothing decides nothing
    return float(top + np.log(np.sum(w * np.exp(v - top)) / w.sum()))
