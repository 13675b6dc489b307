"""Metal specimens that are pulled to yield, by a machine that imposes the displacement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.laws import knees_closer
from identification.gap.laws.knees import is_sharp
from identification.gap.laws.specimens import PLATEAU, off, own_stiffness, plateaus
from identification.gap.model.bench import make_bench
from identification.gap.model.pool import Pool
from tests.explained import explained
from tests.unit.test_gap_model import survive
from tests.unit.test_gap_running import SPRING, running

KNEE_N = 50.0
U = np.linspace(0.0, 20e-3, 600)


def yielding(u: Array, stiffness: float, hardening: float = 0.02) -> Array:
    """Force (n,) of a spring that flows beyond KNEE_N (kinematic hardening)."""
    plastic, out = 0.0, np.zeros(len(u))
    for i, x in enumerate(u):
        back = hardening * stiffness * plastic
        force = stiffness * (x - plastic)
        over = abs(force - back) - KNEE_N
        if over > 0:
            plastic += np.sign(force - back) * over / (stiffness * (1 + hardening))
        out[i] = stiffness * (x - plastic)
    return out


def with_unloadings(stiffness: float) -> Array:
    """A stroke to ten times the knee that is let back twice."""
    ends, rows = np.array([0.0, 3.0, 2.2, 6.0, 5.2, 10.0]), (150, 40, 160, 40, 200)
    ways = [np.linspace(*w, n, endpoint=False) for *w, n in zip(ends, ends[1:], rows, strict=False)]
    return np.concatenate(ways) * KNEE_N / stiffness


def measured(u: Array, force: Array, seed: int = 5) -> GapData:
    rng = np.random.default_rng(seed)
    return running(
        force + rng.normal(0, 0.1, len(u)), u + rng.normal(0, 1e-6, len(u)), imposed="displacement"
    )


def yield_point() -> Array:
    """Force (n,) over U: an upper yield point, the plateau of Lueders to 6 mm, hardening."""
    up, flat = 1.1 * KNEE_N, 6e-3
    falls = np.clip((U - up / SPRING) / 2e-4, 0.0, 1.0)
    harder = np.maximum(U - flat, 0.0)
    return np.minimum(SPRING * U, up) - 0.1 * KNEE_N * falls + 40 * (1 - np.exp(-harder / 5e-3))


@pytest.mark.slow
@pytest.mark.parametrize("stiffer", [8.0, 0.3])
def test_a_knee_lies_where_the_specimens_own_spring_puts_it(stiffer: float) -> None:
    """Of one that is eight times as stiff as stated, and of one a third as stiff."""
    u = with_unloadings(stiffer * SPRING)
    data = measured(u, yielding(u, stiffer * SPRING))
    assert own_stiffness(make_bench(data)) == pytest.approx(stiffer, rel=0.1)
    found = explained(data)
    assert found.verdict in ("joint_yield", "joint_stiffness_error")
    effect = next(e for e in found.effects if e.name == "joint_yield")
    assert effect.parameters["threshold"].value == pytest.approx(KNEE_N, rel=0.1)


def test_a_spring_that_is_about_as_stated_has_no_thresholds_of_its_own() -> None:
    u = with_unloadings(1.2 * SPRING)
    bench = make_bench(measured(u, yielding(u, 1.2 * SPRING)))
    assert not off(own_stiffness(bench))
    assert not [v for v in library(bench, ["joint_yield"]) if v.info.get("other_springs")]
    assert off(3.0)
    assert off(0.3)
    assert not off(-3.0)  # a force that falls from the start tells of no spring


def test_a_yield_point_and_its_plateau_are_a_yield() -> None:
    found = explained(measured(U, yield_point()))
    assert found.verdict == "joint_yield"
    assert found.after < 4 * found.noise  # a knee that is only rounded leaves six times it


def test_plateaus_hold_what_they_are_made_of() -> None:
    """Beyond the knee no stiffness, beyond the plateau's end some again: exactly in their span."""
    u = np.linspace(0.0, 10e-3, 500)
    bench = make_bench(running(SPRING * u, u, imposed="displacement"))
    knees = [v for v in library(bench, ["joint_yield"]) if is_sharp(v)]
    v = plateaus(bench, knees[0])[10]
    assert PLATEAU in v.label
    knee, end = v.info["centre"], float(v.label.split()[-1])
    flat = np.maximum(bench.load - knee, 0.0) - 0.3 * np.maximum(bench.load - end, 0.0)
    columns = np.stack([bench.columns[c][: bench.rows.n] for c in v.columns], axis=1)
    w = np.linalg.lstsq(columns, flat, rcond=None)[0]
    # the label rounds the end to four digits
    np.testing.assert_allclose(columns @ w, flat, atol=1e-3 * flat.max())


def test_nothing_that_comes_back_has_a_plateau() -> None:
    u = np.concatenate([U, U[::-1]])
    bench = make_bench(measured(u, yielding(u, SPRING)))
    knees = [v for v in library(bench, ["joint_yield"]) if is_sharp(v)]
    assert knees
    assert all(plateaus(bench, v) == [] for v in knees)


def test_knees_of_their_own_spring_survive_the_file() -> None:
    u = with_unloadings(8 * SPRING)
    bench = replace(make_bench(measured(u, yielding(u, 8 * SPRING))), columns=Pool())
    own = [v for v in library(bench, ["joint_yield"]) if v.info.get("other_springs")]
    assert own
    sharp = next(v for v in own if is_sharp(v))
    survive(bench, [own[0], sharp, *knees_closer.refined(bench, sharp)[:2]])
    assert knees_closer.refined(bench, sharp)[0].info["other_springs"]
