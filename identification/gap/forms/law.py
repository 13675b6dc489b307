"""What a law is made of: constants, and terms whose coefficients add up. SI throughout."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array, Flags
from identification.gap.variants import Variant


@dataclass(frozen=True)
class Term:
    """One coefficient of a law: what it is called (its SI unit is fixed by that), and the numbers
    that its shape needs besides (thresholds, times, places)."""

    coefficient: str
    shape: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Law:
    """constants: what all terms share (joint from 0, axis, memory ...)."""

    constants: Mapping[str, Any]
    terms: tuple[Term, ...]


Describe = Callable[[Bench, Variant], tuple[Law, Array]]
"""A variant of the library on its bench -> its law, and (k,) what turns the variant's coefficients
into those of the law."""
Columns = Callable[[Bench, Law], list[Array]]
"""A law on any bench -> one stacked column per term, for a coefficient of one SI unit."""

KEPT, ACROSS, LOST, WORKED = "kept", "kept across poses", "lost between runs", "worked in"
HUNG, ANEW = "under weight", "lost between setups"
HUNG_LOST = "under weight, lost between runs"


def fresh_after(bench: Bench, memory: str) -> Flags:
    """(n,) rows before which the mechanism forgets, for one of the kinds of memory."""
    if memory == ACROSS:
        return np.zeros(bench.rows.n, dtype=bool)
    if memory == ANEW:
        return bench.rebuilt
    if memory in (LOST, HUNG_LOST):
        return np.asarray(bench.moved | bench.rest)
    return bench.moved


def along(bench: Bench, direction: tuple[float, ...]) -> Array:
    """(n,): 1 for rows along that direction, -1 for rows against it, 0 elsewhere."""
    cosine = np.array([float(s.unit_vector @ np.array(direction)) for s in bench.data.setups])
    return np.where(np.abs(cosine) > 0.999, np.sign(cosine), 0.0)[bench.rows.setup]


def in_pose(bench: Bench, pose: str | None) -> Flags:
    """(n,) rows of that pose; all of them where it is None."""
    of_it = np.array([pose in (None, s.pose) for s in bench.data.setups])
    return np.asarray(of_it[bench.rows.setup])
