"""Effects that a simulation already has: what they do is part of what it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identification.arrays import Array
from identification.gap.answer.forms import Form, lawful, realise
from identification.gap.explanations.explanation import LAW_REMAINDER
from identification.gap.model.bench import Bench, KnownEffects

# What is known of a law that was found in other data: its size, and at which loads it happens.
SIZE_SD, LOAD_SD = 0.1, 0.03
_TINY = 1e-300


class NotKnown(ValueError):
    """Effects whose displacements say nothing of what is measured here."""


def knowing(bench: Bench, forms: Sequence[Form]) -> Bench:
    """The bench of a simulation with these effects, each of a size, and at loads, as well as such a
    law is known; a few percent of what they do may stay. Its noise is what was measured with them:
    where a joint gives way, that of the force moves far. Raises NotKnown where the displacement is
    imposed: the effects are known as displacements."""
    if not forms:
        return bench
    if bench.imposed:
        raise NotKnown(
            "effects of a model are known as displacements, and here the displacement is imposed"
        )
    less, does, more = (
        np.column_stack([_stacked(_pushed(bench, by), lawful(f)) for f in forms])
        for by in (1 - LOAD_SD, 1.0, 1 + LOAD_SD)
    )
    later, whole = (more - less) / 2, np.linalg.norm(does, axis=0)
    later *= np.minimum(whole / np.maximum(np.linalg.norm(later, axis=0), _TINY), 1.0)
    free = np.hstack([SIZE_SD * does, later])
    names = tuple(f"known {what} {f.word}" for what in ("size", "load") for f in forms)
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


def _stacked(bench: Bench, form: Form) -> Array:
    """(size,) what an effect does, the response counted from where the laser was zeroed."""
    rows, total = bench.rows, realise(bench, form)
    group = rows.run if bench.data.datum == "repetition" else rows.setup
    for g in np.unique(group):
        mine = np.flatnonzero(group == g)
        total[mine] -= total[mine[0]]
    return total
