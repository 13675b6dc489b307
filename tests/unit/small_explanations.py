"""Small explanations and engines for tests of what is made of them."""

from __future__ import annotations

from copy import copy

import numpy as np

from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import (
    Explanation,
)
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench
from identification.gap.model.variants import variant


def part(word: str, columns: list[int], **info: object) -> Part:
    return Part(variant(word, word, columns, (1.0,), **info), 1.0)


def said(
    parts: tuple[Part, ...], sizes: tuple[float, ...], weight: float = 0.0, eta: float = 0.0
) -> Explanation:
    return Explanation(parts, weight, eta, sizes, weight)


OFF = 1e-4  # m: laws that are off by far more than noise


def small_engine_of(bench: Bench) -> Engine:
    target = bench.observed - prediction(bench)
    return Engine(bench, base_columns(bench), target, np.array([0.0, 3e-6]))


def replace_bench(engine: Engine, bench: Bench) -> Engine:
    """The engine as it is, of another bench."""
    other = copy(engine)
    other.bench = bench
    return other
