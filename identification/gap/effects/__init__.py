"""The library: one file an effect, each a family of shapes. `variants(bench)` fills the pool."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from identification.gap.bench import Bench
from identification.gap.variants import Variant
from identification.gap.words import NEED_ARM, STANDING, WORDS


def library(bench: Bench, words: Iterable[str] = WORDS) -> list[Variant]:
    """All variants of the words; the pool of the bench holds their columns afterwards."""
    out: list[Variant] = []
    idle = bench.rows.continuous and bench.course.stands
    for word in words:
        if idle and word not in STANDING:
            continue
        if word in NEED_ARM and not bench.data.arm:
            continue
        out += import_module(f"identification.gap.effects.{word}").variants(bench)
    return out
