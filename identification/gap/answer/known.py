"""Effects that a simulation already has: what they do is part of what it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf

import numpy as np

from identification.arrays import Array
from identification.gap.answer.forms import Form, lawful, realise
from identification.gap.explanations.explanation import LAW_REMAINDER, SearchResult
from identification.gap.explanations.fit import fit
from identification.gap.laws.law import ACROSS, KEPT
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, KnownEffects

# What is known of a law that was found in other data: its size, and at which loads it happens.
SIZE_SD, LOAD_SD = 0.1, 0.03
_TINY = 1e-300


class NotKnown(ValueError):
    """Effects whose displacements say nothing of what is measured here."""


def knowing(bench: Bench, forms: Sequence[Form]) -> Bench:
    """The bench of a simulation with these effects, each of a size, and at loads, as well as such a
    law is known; a few percent of what they do may stay. Its noise is what was measured with them:
    where a joint gives way, that of the force moves far. What yielded in one pose may have stayed
    when the arm left it: which of the two it is these data tell, where they are of several. Raises
    NotKnown where the displacement is imposed: the effects are known as displacements."""
    if not forms:
        return bench
    if bench.imposed:
        raise NotKnown(
            "effects of a model are known as displacements, and here the displacement is imposed"
        )
    found, poses = _with_known(bench, forms), {s.pose for s in bench.data.setups}
    across = [_across(f) for f in forms]
    if len(poses) < _SEVERAL or all(a is f for a, f in zip(across, forms, strict=True)):
        return found
    stays = _with_known(bench, across)
    if _misfit(stays) > _misfit(found) - _PLAINLY or stays.known is None:
        return found
    return replace(stays, known=replace(stays.known, across=True))


_SEVERAL, _PLAINLY = 2, 20.0  # poses; nats


def _across(form: Form) -> Form:
    """The effect with a memory that outlasts the way to another pose, if it has one of the pose."""
    constants = form.law.constants
    if constants.get("memory") != KEPT:
        return form
    return replace(form, law=replace(form.law, constants={**constants, "memory": ACROSS}))


def _misfit(bench: Bench) -> float:
    """Half of the sum of squares, in standard deviations, that the base leaves of what is measured:
    nats, but for what both ways have alike."""
    base = base_columns(bench)
    white = base.columns * (base.sd / bench.sigma[:, None])
    target = (bench.observed - prediction(bench)) / bench.sigma
    inner = np.linalg.solve(white.T @ white + np.eye(white.shape[1]), white.T @ target)
    return float((target @ target - inner @ (white.T @ target)) / 2)


def in_question(found: SearchResult) -> list[str]:
    """Words of the simulation's effects that may not be in the data as it has them, the likeliest
    first: those whose size or loads the best explanation has far off, or beside which it needs the
    same word once more. None where all are about as the model has them."""
    engine, best = found.engine, found.explanations[0]
    if engine.bench.known is None:
        return []
    base = fit(engine, best).base / engine.base.sd
    off: dict[str, float] = {}
    for name, z in zip(engine.base.names, base, strict=True):
        if name.startswith(_SAID):
            word = name.split()[-1]
            twice = inf if word in best.words else 0.0
            off[word] = max(off.get(word, 0.0), abs(float(z)), twice)
    return sorted((w for w in off if off[w] > _OFF), key=lambda word: -off[word])


def is_gone(found: SearchResult, without: SearchResult) -> bool:
    """Whether the same is explained as well, or far better, by a simulation without an effect that
    is in question: then it is not there as the model has it. Where a gap that no law explains is
    likelier without it, nothing is said of it."""
    best, again = found.explanations[0], without.explanations[0]
    as_well = again.eta <= _CLOSELY * without.engine.bench.noise.stated
    better = again.log_weight > best.log_weight + _GONE
    return (as_well or better) and again.log_weight > without.unknown


_SAID = "known "  # so begin the names of what is not known of the simulation's effects
_OFF, _GONE = 2.5, 20.0  # standard deviations; nats
_CLOSELY = 1.5  # of the noise: sizes of imperfection are as coarse


def _with_known(bench: Bench, forms: Sequence[Form]) -> Bench:
    """The bench with these effects known, whatever they remember."""
    every = [lawful(f) for f in forms]
    less, does, more = (
        np.column_stack([_stacked(_pushed(bench, by), f, every) for f in every])
        for by in (1 - LOAD_SD, 1.0, 1 + LOAD_SD)
    )
    later, whole = (more - less) / 2, np.linalg.norm(does, axis=0)
    later *= np.minimum(whole / np.maximum(np.linalg.norm(later, axis=0), _TINY), 1.0)
    free = np.hstack([SIZE_SD * does, later])
    names = tuple(f"{_SAID}{what} {f.word}" for what in ("size", "load") for f in forms)
    rows, noise, total = bench.rows, bench.noise, does.sum(axis=1)
    left = LAW_REMAINDER * rows.rms_about_means(total[: rows.n])
    return replace(
        bench,
        known=KnownEffects(total, free, names, left),
        noise=replace(noise, stated=max(noise.stated, left)),
    )


def _pushed(bench: Bench, by: float) -> Bench:
    """The bench under so many times its load."""
    return bench if by == 1 else replace(bench, load=by * bench.load, torque=by * bench.torque)


def _stacked(bench: Bench, form: Form, every: Sequence[Form]) -> Array:
    """(size,) what an effect does beside all others, the response counted from where the laser was
    zeroed."""
    rows, total = bench.rows, realise(bench, form, every)
    group = rows.run if bench.data.datum == "repetition" else rows.setup
    for g in np.unique(group):
        mine = np.flatnonzero(group == g)
        total[mine] -= total[mine[0]]
    return total
