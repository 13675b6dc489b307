"""What gives way anew in every pass of its load: how far, where it is looked for, and as a law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.forms import law_of, rows_of
from identification.gap.effects import base_slip, joint_yield
from identification.gap.laws.cyclic_accumulation import FADING, WALKS, walked
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.pool import Pool
from identification.gap.model.variants import Variant
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import DESIGNS, imported, meta, noisy
from tests.unit.test_gap_model import survive

LOAD = np.array([0.0, 3, 10, 10, 5, 0, 0, 8, 3, 12, 0, -7, 0])
FRESH = np.zeros(len(LOAD), dtype=bool)


def way(fading: float, radius: float = 4.0, fresh: Array = FRESH) -> list[float]:
    state = walked(LOAD, np.array([radius]), np.array([fading]), fresh)
    return [round(float(v), 6) for v in state[:, 0]]


def test_every_pass_adds_how_far_its_load_goes_beyond_the_threshold_and_stays() -> None:
    # 3 is more than half of the threshold, so that 12 belongs to the pass of 8
    assert way(0.0) == [0, 0, 6, 6, 6, 6, 6, 10, 10, 14, 14, 11, 11]


def test_later_passes_add_less_as_they_fade() -> None:
    assert way(1.0) == [0, 0, 6, 6, 6, 6, 6, 8, 8, 10, 10, 9, 9]
    assert way(2.0)[-1] == round(6 + 8 / 4 - 3 / 9, 6)


def test_where_the_memory_is_fresh_it_counts_anew() -> None:
    fresh = FRESH.copy()
    fresh[6] = True
    assert way(1.0, fresh=fresh) == [0, 0, 6, 6, 6, 6, 0, 4, 4, 8, 8, 6.5, 6.5]


def test_thresholds_and_fadings_are_made_together() -> None:
    radius, fading = np.array([4.0, 9.0, 4.0]), np.array([0.0, 0.0, 1.0])
    together = walked(LOAD, radius, fading, FRESH)
    for k in range(3):
        np.testing.assert_array_equal(
            together[:, [k]], walked(LOAD, radius[[k]], fading[[k]], FRESH)
        )


def of_jumps(size_mm: float, design: str = "medium") -> Bench:
    """An arm, or a bench, whose target is so much further off from one run to the next."""
    table = noisy(DESIGNS[design])
    table["displacement_mm"] += size_mm * table["repetition"]
    return replace(make_bench(gap_data(imported(table, meta(DESIGNS[design])))), columns=Pool())


def walking(bench: Bench) -> list[Variant]:
    found = [*joint_yield.variants(bench), *base_slip.variants(bench)]
    return [v for v in found if v.info["knee"] == WALKS]


@pytest.mark.parametrize(
    ("size_mm", "design", "looked_for"),
    [(0.05, "medium", True), (0.0, "medium", False), (0.05, "bench", False)],
)
def test_it_is_looked_for_where_an_arm_s_response_goes_on_from_run_to_run(
    size_mm: float, design: str, looked_for: bool
) -> None:
    assert bool(walking(of_jumps(size_mm, design))) is looked_for


def test_what_walks_is_its_law() -> None:
    bench = of_jumps(0.05)
    found = walking(bench)
    assert {v.word for v in found} == {"joint_yield", "base_slip"}
    pool = np.column_stack(bench.columns)
    for v in found[:: len(FADING)]:
        law, scale = law_of(bench, v)
        np.testing.assert_allclose(
            rows_of(bench, v.word, law) * scale, pool[:, list(v.columns)], rtol=1e-12, atol=1e-18
        )


def test_what_walks_survives_the_file() -> None:
    bench = of_jumps(0.05)
    survive(bench, walking(bench)[:: len(FADING)])
