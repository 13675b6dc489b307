"""Evidence of all variants over all levels, and what follows for the words."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.gap.data import Array
from identification.gap.evidence import Engine, Level
from identification.gap.imperfection import IMPERFECTION, LAW_IMPERFECTION, LINEAR, log_level
from identification.gap.signs import Limits, log_odds
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
    by_size: dict[tuple[int, int], list[int]] = {}
    for i, v in enumerate(variants):
        by_size.setdefault((len(v.columns), len(v.scales)), []).append(i)
    for members in by_size.values():
        batch = [variants[i] for i in members]
        for i, s in zip(members, _score_batch(engine, levels, batch, already), strict=True):
            out[i] = s
    return [s for s in out if s is not None]


def _score_batch(
    engine: Engine, levels: list[Level], batch: list[Variant], already: float
) -> list[Scored]:
    columns, root, scales, plain, limits, squares = _stacks(engine, batch)

    def of_level(i: int) -> tuple[Array, Array, Array, Array]:
        level = levels[i]
        gram = _rotate(level, squares[i], columns, root)
        moment = np.einsum("vji,vj->vi", root, level.moment[columns])
        values, vectors = np.linalg.eigh(gram)
        values = np.maximum(values, 0.0)
        beta = np.einsum("vji,vj->vi", vectors, moment)
        s2 = scales[:, :, None] ** 2  # (v, s, 1)
        gain = 1 + s2 * values[:, None, :]
        mean = s2 * beta[:, None, :] / gain
        fit = 0.5 * np.sum(mean * beta[:, None, :], axis=2) - 0.5 * np.log(gain).sum(axis=2)
        turned = mean @ np.swapaxes(vectors, 1, 2)
        energy = np.sum((turned @ plain) * turned, axis=2)
        log = level.log_base + fit + log_level(engine.etas, i, energy + already)
        return log, vectors, mean, s2 / gain

    made = [of_level(i) for i in range(len(levels))]
    logs = np.stack([m[0] for m in made])
    if limits is not None:
        _limit(logs, limits, [v.word for v in batch], root, scales, [m[1:] for m in made])
    flat = logs.transpose(1, 0, 2).reshape(len(batch), -1)
    best = flat.argmax(axis=1)
    total = logsumexp(flat) - np.log(scales.shape[1])
    number = scales.shape[1]
    return [
        Scored(v, float(t) + float(np.log(v.prior)), v.scales[b % number], int(b // number))
        for v, t, b in zip(batch, total, best, strict=True)
    ]


def _limit(
    logs: Array, limits: Limits, words: list[str], root: Array, scales: Array,
    fits: list[tuple[Array, Array, Array]],
) -> None:  # fmt: skip
    """Takes from the log evidence (l, v, s) what the limits cost that physics sets, where it counts
    among the shapes of its word. fits: per level, eigenvectors (v, k, k), mean and variance
    (v, s, k) of the coefficients along them."""
    word = np.unique(words, return_inverse=True)[1]
    before = np.linalg.norm((limits.rows[:, :1] @ root)[:, 0], axis=1)
    todo, done = np.zeros(logs.shape, dtype=bool), np.zeros(logs.shape, dtype=bool)

    def take(i: int) -> None:
        which, scale = np.nonzero(todo[i])
        vectors, mean, variance = fits[i]
        spread = np.swapaxes(root[which] @ vectors[which], 1, 2)  # to the coefficients
        at = which, scale
        sd = before[which] * scales[at]
        centre = (mean[at][:, None] @ spread)[:, 0]
        roots = np.sqrt(variance[at])[:, :, None] * spread
        logs[i][at] += log_odds(limits, which, sd, centre, roots)

    while True:
        top = np.full(word.max() + 1, -np.inf)
        np.maximum.at(top, word, logs.max(axis=(0, 2)))
        todo = (logs > top[word][:, None] - _COUNTS) & ~done
        if not todo.any():
            return
        for i in np.flatnonzero(todo.any(axis=(1, 2))):
            take(int(i))
        done |= todo


_COUNTS = 40.0  # nats below the best of its word: what lies further down adds nothing


_Stacks = tuple[Array, Array, Array, Array, Limits | None, list[Array]]


def _stacks(engine: Engine, batch: list[Variant]) -> _Stacks:
    """Columns (v, k), roots (v, k, k), scales (v, s), mean squares (v, k, k) and limits of a batch,
    and per level its products (v, k, k), made once: batches come again with every effect that is
    added."""
    key = tuple(batch)  # the variants themselves: the id of one that is gone may come again
    if key not in engine.stacks:
        columns = np.array([v.columns for v in batch])
        engine.stacks[key] = (
            columns,
            np.stack([v.root for v in batch]),
            np.array([v.scales for v in batch]),
            np.stack([raw_gram(engine, v) for v in batch]),
            Limits.of(batch),
            engine.squares(columns),
        )
    found: _Stacks = engine.stacks[key]
    return found


def _rotate(level: Level, part: Array, columns: Array, root: Array) -> Array:
    if len(level.taken):
        gone = level.taken[:, columns].transpose(1, 0, 2)  # (v, r, k)
        part = part - np.swapaxes(gone, 1, 2) @ gone
    if np.array_equal(root, np.broadcast_to(np.eye(root.shape[1]), root.shape)):
        return np.asarray(part)
    return np.asarray(np.swapaxes(root, 1, 2) @ part @ root)


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
