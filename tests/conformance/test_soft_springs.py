"""An arm whose springs are far softer than simulated: what gains and turning levers do then."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import Fit, fit
from identification.gap.model.base import HALF
from identification.gap.model.bench import make_bench
from rig.diagnosis.gap_data import gap_data
from rig.worlds.arm import place
from tests.conformance.effect_benches import quick_engine
from tests.conformance.gap_designs import DESIGNS, TCP_MM, TRUE, Array, Q, imported, meta, noisy
from tests.explained import explained

SOFTER = np.array([1.9, 2.1, 1.8, 2.2, 1.7, 1.0])  # times as simulated
GAIN = 0.012  # four standard deviations
DIRECTIONS = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0])}


def turning(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """What hinges that turn by finite angles under a load of fixed direction do beyond the linear
    rig, in a kinematics that the identification does not share."""
    moved, angles = np.zeros(len(rows)), np.zeros((len(rows), 6))
    tcp = np.array(TCP_MM) * 1e-3
    for (pose, direction, force), at in rows.groupby(
        ["pose", "direction", "force_N"]
    ).groups.items():
        q0, unit = np.array(Q[str(pose)]), DIRECTIONS[str(direction)]
        q = q0
        for _ in range(20):
            there = place(q)
            torque = there.levers(there.tool(tcp)) @ unit * float(force)
            q = q0 + torque * SOFTER / TRUE
        index = np.asarray(at, dtype=int)
        moved[index] = unit @ (place(q).tool(tcp) - place(q0).tool(tcp))
        angles[index] = q - q0
    linear = lever * rows["force_N"].to_numpy()[:, None] / TRUE
    beyond = angles - linear
    return moved - np.sum(lever * linear, axis=1) - np.sum(lever * beyond, axis=1), beyond


def soft(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """Linear, and read by a laser whose gain is off."""
    force = rows["force_N"].to_numpy()[:, None]
    moved = np.sum(lever**2 * force * SOFTER / TRUE, axis=1)
    return GAIN * moved, lever * force * (SOFTER - 1) / TRUE


@cache
def data(law: str) -> GapData:
    design = DESIGNS["rich"]
    rows = noisy(design, {"turning": turning, "soft": soft}[law], noise=0.2)
    return gap_data(imported(rows, meta(design)))


def with_springs(law: str) -> tuple[Engine, Fit]:
    """The springs are said to be off, nothing else."""
    bench = make_bench(data(law))
    variants = library(bench, ["joint_stiffness_error"])
    v = next(v for v in variants if v.label == "all joints")
    engine = quick_engine(bench)
    return engine, fit(engine, Explanation((Part(v, v.scales[-1]),), 0.0, 0.0, (0.0,), 0.0))


def test_levers_turn_by_what_the_joints_really_give() -> None:
    engine, found = with_springs("turning")
    geometry = HALF + found.base[engine.base.index("geometry")[0]]
    assert geometry == pytest.approx(1.0, abs=0.1)


def test_the_gain_of_the_laser_acts_on_what_it_read() -> None:
    engine, found = with_springs("soft")
    assert found.base[engine.base.index("gain displacement")[0]] == pytest.approx(GAIN, abs=0.001)


@pytest.mark.parametrize("law", ["turning", "soft"])
def test_wrong_springs_alone_are_named(law: str) -> None:
    result = explained(data(law))
    assert result.verdict == "joint_stiffness_error"
    assert [e.name for e in result.effects] == ["joint_stiffness_error"]
    assert result.remainder < result.bench.noise.stated  # springs are laws: exact


OFF = np.array([1.0, 1.0, 2.0, 0.7, 1.0, 1.0])  # compliance of two springs, times as simulated
LAG_S = 1.5


def two_off(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    return np.zeros(len(rows)), lever * rows["force_N"].to_numpy()[:, None] * (OFF - 1) / TRUE


def shown_late(rows: pd.DataFrame) -> pd.DataFrame:
    """The force as a first-order filter shows it, which follows a hand that turns evenly and lets
    go a second before the first sample."""
    out, dt = rows.copy(), 0.05
    for _, run in rows.groupby(["pose", "direction", "repetition"], sort=False):
        force, shown = run["force_N"].to_numpy(), float(run["force_N"].iloc[0])
        for k, gap in enumerate(np.diff(run["time_s"]), start=1):
            way = np.clip(np.arange(dt, gap + dt / 2, dt) / max(gap - 1.0, dt), 0.0, 1.0)
            for there in way:
                load = force[k - 1] + there * (force[k] - force[k - 1])
                shown += (load - shown) * dt / LAG_S
            out.loc[run.index[k], "force_N"] = shown
    return out


@pytest.mark.slow
def test_a_force_that_lags_on_springs_that_are_off_has_one_lag_in_all_directions() -> None:
    """Each direction shows as much of it as its own springs give way."""
    design = DESIGNS["medium"]
    found = explained(gap_data(imported(shown_late(noisy(design, two_off)), meta(design))))
    assert set(found.names) == {"joint_stiffness_error", "time_lag"}
    assert found.after < 1.2 * found.noise
    lag = next(e for e in found.effects if e.name == "time_lag").parameters["lag"]
    assert lag.value == pytest.approx(LAG_S, rel=0.1)
