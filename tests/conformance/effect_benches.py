"""Every effect on the benches of the designs: pools, readings, engines."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from identification.gap.data import GapData
from identification.gap.evidence.engine import Engine
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from identification.gap.words import NEED_ARM, WORDS
from tests.conformance.gap_designs import (
    ARMS,
    DESIGNS,
    linear,
)

Array = NDArray[np.float64]
NOWHERE = {  # what bears both ways is no seat, and without an arm only components show a slant
    ("contact_seating", "bench imposed"),
    ("load_misalignment", "bench levels imposed"),
    ("load_misalignment", "bench imposed"),
}
PAIRS = [
    (w, d)
    for w in WORDS
    for d in DESIGNS
    if (d in ARMS or w not in NEED_ARM) and (w, d) not in NOWHERE
]
WITHOUT_ARM = [(w, d) for w, d in PAIRS if d not in ARMS]
IN_JOINTS = tuple(w for w in WORDS if w.startswith("joint_"))
# What the laser sees and no joint: readings stay as they are.
OUTSIDE = (
    "link_flexibility",
    "base_compliance",
    "base_slip",
    "contact_seating",
    "displacement_scale",
    "thermal_drift",
    "zero_shift",
)


def module(word: str) -> ModuleType:
    return import_module(f"identification.gap.effects.{word}")


def built(data: GapData, word: str) -> tuple[Bench, list[Variant]]:
    bench = make_bench(data)
    return bench, module(word).variants(bench)


@cache
def of(word: str, design: str) -> tuple[Bench, list[Variant], Array]:
    bench, variants = built(linear(design), word)
    return bench, variants, np.column_stack(bench.columns)


def readings(bench: Bench, columns: Array) -> Array:
    """(m, holds, k) of stacked columns (size, k)."""
    return columns[bench.layout.q].reshape(bench.data.joints, -1, columns.shape[1])


def quick_engine(bench: Bench) -> Engine:
    base = base_columns(bench)
    target = bench.observed - prediction(bench)
    return Engine(bench, base, target, np.array([0.0, bench.noise.stated]))
