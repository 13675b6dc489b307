"""Numbers of friction that readings hardly resolve: it slips before the first one after a turn, or
bends over more than the load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.parameters import parameters
from identification.gap.data import CYCLE, GapData
from identification.gap.evidence.parts import Part
from identification.gap.laws.interval import NOMINAL
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.slow import slow_ones
from tests.unit.test_gap_forms import arm_data
from tests.unit.test_gap_operators import bench_data
from tests.unit.test_gap_parameters import no_spread, of

SPRING, STIFF, FRICTION = 95e3, 300e3, 8.0  # N/m until it slips, beside the spring; N
SHARE = STIFF / (SPRING + STIFF)  # of the compliance, what friction holds back until it slips


def rubbing(step_N: float) -> GapData:
    """A spring beside which friction slips at 8 N; up, down, back and once more, in levels."""
    up = np.arange(0.0, 200.1, step_N)
    once = np.concatenate([up[1:], up[-2::-1], -up[1:], -up[-2::-1]])
    load = np.tile(once, 2)
    x = held = before = 0.0
    moved = []
    for level in load:
        for f in np.linspace(before, level, 400)[1:]:
            stick = (f - before) / (SPRING + STIFF)
            if abs(held + STIFF * stick) < FRICTION:
                x, held = x + stick, held + STIFF * stick
            else:
                x += (f - before) / SPRING
                held = float(np.sign(f - before)) * FRICTION
            before = f
        moved.append(x)
    rng = np.random.default_rng(1)
    each = np.repeat([load, moved], 3, axis=1)
    force = each[0] + rng.normal(0, 0.1, len(each[0]))
    data = bench_data(force, each[1] + rng.normal(0, 2e-6, len(force)))
    meter = replace(data.instruments, force=0.1, displacement=2e-6)
    step = np.repeat(np.tile(np.arange(1, len(once) + 1), 2), 3)
    return replace(data, step=step, compliance=np.array([1 / SPRING]), instruments=meter)


@pytest.mark.slow
@pytest.mark.parametrize(("step_N", "widest"), [(20.0, 0.6), (4.0, 0.3)])
def test_how_far_friction_gives_way_is_known_as_far_as_readings_show_it(
    step_N: float, widest: float
) -> None:
    """In steps of 20 N it has slipped by the next reading: anything up to all is possible."""
    found = explained(rubbing(step_N))
    assert found.verdict == "joint_hysteresis"
    numbers = found.effects[0].parameters
    assert numbers["friction"].value == pytest.approx(FRICTION, rel=0.05)
    share = numbers["share_through_friction"]
    assert share.low < SHARE < share.high <= 1.0
    assert 0.005 < share.high - share.low < widest


@pytest.mark.parametrize("stiff", slow_ones((100e3, 400e3, 4000e3), (100e3, 4000e3)))
def test_friction_far_stiffer_than_the_spring_beside_it_is_friction(stiff: float) -> None:
    """A slider of 8 N beside a spring, on strokes to and fro: neither a lag nor a yield."""
    n, spring = 1600, 62e3  # N/m
    u = 1e-3 * np.sin(2 * np.pi * np.arange(n) / 200)
    held = np.zeros(n)
    for i in range(1, n):
        held[i] = np.clip(held[i - 1] + stiff * (u[i] - u[i - 1]), -FRICTION, FRICTION)
    rng = np.random.default_rng(1)
    force = spring * u + held + rng.normal(0, 0.3, n)
    read = u + rng.normal(0, 1e-6, n)
    data = bench_data(force, read, step=np.full(n, -1), branch=np.full(n, CYCLE))
    meter = replace(data.instruments, force=0.3, displacement=1e-6)
    data = replace(data, compliance=np.array([1 / 60e3]), instruments=meter)
    found = explained(replace(data, imposed="displacement", time=np.arange(n) / 20.0))
    assert found.verdict == "joint_hysteresis"
    assert found.effects[0].parameters["friction"].value == pytest.approx(FRICTION, rel=0.06)


@pytest.mark.parametrize("law", ["Dahl", "Bouc-Wen"])
def test_what_bends_from_the_first_load_on_rubs_however_far_it_reaches(law: str) -> None:
    """Dahl's friction is never all there; at a load of its reach it is by 0.63."""
    bench = make_bench(arm_data())
    rubs = of(bench, "joint_hysteresis", f"joint 1 {law} 0.5")
    joint = int(rubs.info["joint"])
    largest = float(np.abs(bench.torque[:, joint]).max())
    long = replace(rubs, info={**rubs.info, "radius": np.full(2, largest)})
    w = np.array([0.3, 0.0])
    found = parameters(bench, Part(long, 1.0), w, no_spread(w), NOMINAL)
    assert found["share_through_friction"].value == pytest.approx(0.3 * (1 - np.exp(-1)))
    assert found["friction"].value == pytest.approx(0.3 * (1 - np.exp(-1)) * largest)
