"""Where the gap lies: every sample counts, however many of them a row holds."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.answer.locate import NOWHERE, Where, locate
from identification.gap.model.bench import Bench, make_bench
from tests.unit.test_gap_forms import arm_data


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(arm_data())


def located(bench: Bench, gap: Array, word: str = "") -> Where:
    """Where a gap (n,) lies; word: of the effect that made it, none where empty."""
    part = SimpleNamespace(word=word, variant=SimpleNamespace(joint=None))
    fit = SimpleNamespace(parts=(part,) if word else (), contribution=lambda engine, i: gap)
    return locate(SimpleNamespace(bench=bench), word or "unknown", fit, [1.0], gap)


def balanced(bench: Bench, values: Array) -> Array:
    """Values (n,) without the mean of their setup."""
    return bench.rows.about_means(values)


def in_y(bench: Bench) -> Array:
    """(n,) whether a row was pushed along y."""
    return np.array([s.direction == "y" for s in bench.data.setups])[bench.rows.setup]


def with_long_holds(bench: Bench, samples: float) -> Bench:
    """Rows along y but the first of a hold are the mean of so many samples."""
    weight = np.where(bench.rows.hold_starts | ~in_y(bench), 1.0, samples)
    return replace(bench, rows=replace(bench.rows, weight=weight))


def test_share_of_the_gap_counts_samples(bench: Bench) -> None:
    rows = bench.rows
    long = np.where(rows.setup == 0, 20.0, 1.0) * rows.weight  # holds that took twenty times longer
    wave = np.where(np.arange(rows.n) % 2, 1e-6, -1e-6)
    gap = wave * np.where(rows.setup == 0, 1.0, 0.1)
    longer = replace(bench, rows=replace(rows, weight=long))
    of_samples = np.repeat(gap**2, long.astype(int))
    of_setup = np.repeat(rows.setup == 0, long.astype(int))
    found = located(longer, gap)
    assert len(found.directions) == 1
    assert found.share == pytest.approx(of_samples[of_setup].sum() / of_samples.sum())


def test_directions_in_which_a_gap_shows_count_samples(bench: Bench) -> None:
    """What stands in single samples of long holds is small, though in as many rows as others."""
    rows, y, longer = bench.rows, in_y(bench), with_long_holds(bench, 400.0)
    gap = np.where(np.arange(rows.n) % 2, 1e-6, -1e-6)
    gap[y & ~rows.hold_starts] = 0.0
    assert located(longer, gap).directions == ("x",)
    assert located(bench, gap).directions == ("x", "y")


def test_what_springs_take_over_is_fitted_to_samples(bench: Bench) -> None:
    """An effect that is straight over the load in all but a few samples is no more than these."""
    rows, y, longer = bench.rows, in_y(bench), with_long_holds(bench, 1e4)
    bent = np.where(np.arange(rows.n) % 2, 1e-6, -1e-6)
    straight = 2e-8 * bench.load * np.where(rows.hold_starts, 3.0, 1.0)
    gap = np.where(y, straight, bent)
    assert located(longer, balanced(longer, gap), "joint_yield").directions == ("x",)


def two_effects(bench: Bench, verdict: str, sizes: list[float]) -> Where:
    """Of a gain that moves x and a creep of joint 3 that moves y, with these sizes (m)."""
    wave, y = np.where(np.arange(bench.rows.n) % 2, 1e-6, -1e-6), in_y(bench)
    moved = [wave * ~y, wave * y]
    parts = tuple(
        SimpleNamespace(word=word, variant=SimpleNamespace(joint=joint))
        for word, joint in (("force_scale", None), ("joint_creep", 2))
    )
    fit = SimpleNamespace(parts=parts, contribution=lambda engine, i: moved[i])
    return locate(SimpleNamespace(bench=bench), verdict, fit, sizes, wave)


def test_where_speaks_of_the_verdict_though_it_is_not_the_largest(bench: Bench) -> None:
    """And of its joint, however small it is beside the other one."""
    for sizes in ([2e-5, 1e-5], [2e-5, 1e-6]):
        found = two_effects(bench, "joint_creep", sizes)
        assert (found.directions, found.joints) == (("y",), (3,))
    beside = two_effects(bench, "force_scale", [2e-5, 1e-5])
    assert (beside.directions, beside.joints) == (("x",), (3,))
    assert two_effects(bench, "force_scale", [2e-5, 1e-6]).joints == ()


def test_where_of_none_and_of_unknown_with_an_effect_that_was_asked_for(bench: Bench) -> None:
    assert two_effects(bench, "none", [2e-5, 1e-5]) == NOWHERE
    found = two_effects(bench, "unknown", [2e-5, 1e-5])
    assert (found.directions, found.joints) == (("x", "y"), ())
    assert found.seen_by_encoders is None
