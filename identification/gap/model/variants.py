"""A variant: one shape that an effect may take; columns of the pool with a prior."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from identification.gap.data import Array

UNDER_WEIGHT = " under weight"  # a memory that begins with the weight coming on
BACK_UNDER_WEIGHT = " under weight, taken back"  # one that is lost between runs, but for the weight
LASTING = " lasting"  # one that outlasts the arm's way to another pose
TAKEN_BACK = " taken back"  # one that is lost between runs
SET_UP_ANEW = " set up anew"  # one that is lost when the rig is turned to another direction


@dataclass(frozen=True, eq=False)
class Variant:
    """columns: k indices of the pool. root (k, k): prior covariance of the coefficients is
    `s^2 root root^T` for s out of `scales`, all equally likely. positive (k,): weights of a sum of
    coefficients that physics wants above `least` (None: either sign). each (k,): coefficients that
    may not be negative either. within (m, k): weights of further sums above zero. info: what the
    parameters are reported from.
    """

    word: str
    label: str
    columns: tuple[int, ...]
    scales: tuple[float, ...]
    root: Array
    positive: Array | None = None
    least: float = 0.0
    each: tuple[bool, ...] = ()
    within: Array = field(default_factory=lambda: np.zeros((0, 0)))
    info: Mapping[str, Any] = field(default_factory=dict)
    prior: float = 1.0

    @cached_property
    def shape(self) -> tuple[object, ...]:
        """What its evidence follows from, but for the prior: of a word, variants of the same shape
        are one under several names."""
        positive = None if self.positive is None else self.positive.tobytes()
        other_springs = bool(self.info.get("other_springs"))
        return (self.word, self.columns, self.scales, self.root.tobytes(), positive, self.least,
                self.each, self.within.tobytes(), other_springs)  # fmt: skip


def variant(
    word: str,
    label: str,
    columns: list[int],
    scales: tuple[float, ...],
    root: Array | None = None,
    positive: bool | Array = True,
    prior: float = 1.0,
    least: float = 0.0,
    each: bool | tuple[bool, ...] = False,
    within: Array | None = None,
    **info: Any,
) -> Variant:
    """A variant with independent unit priors unless `root` says otherwise. each: all coefficients,
    or the first ones that are named, the others free."""
    k = len(columns)
    return Variant(
        word,
        label,
        tuple(columns),
        scales,
        np.eye(k) if root is None else root,
        positive if isinstance(positive, np.ndarray) else (np.ones(k) if positive else None),
        least,
        _all(each, k),
        np.zeros((0, k)) if within is None else within,
        info,
        prior,
    )


def _all(each: bool | tuple[bool, ...], k: int) -> tuple[bool, ...]:
    if isinstance(each, bool):
        return (each and k > 1,) * k
    return (*each, *(False,) * (k - len(each)))


def place_of(variant: Variant) -> tuple[str, ...]:
    """Where a variant acts."""
    info = variant.info
    return tuple(str(info.get(key)) for key in ("joint", "joints", "axis", "axes"))


def smooth_root(k: int, alike: float = 0.7, common: float = 0.0) -> Array:
    """Root (k, k) of a covariance in which neighbours correlate by `alike`, all by `common`."""
    distance = np.abs(np.arange(k)[:, None] - np.arange(k))
    covariance = (1 - common) * alike**distance + common
    return np.linalg.cholesky(covariance + 1e-9 * np.eye(k))


def block(roots: list[Array]) -> Array:
    """The roots along the diagonal."""
    size = sum(r.shape[0] for r in roots)
    out = np.zeros((size, size))
    at = 0
    for r in roots:
        k = r.shape[0]
        out[at : at + k, at : at + k] = r
        at += k
    return out
