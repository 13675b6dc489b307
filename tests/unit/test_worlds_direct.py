"""Second values straight from a world: the columns, the procedure, and what they say."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.protocol import load_protocol
from rig.worlds import make_world
from rig.worlds.direct import Sensors, sample_protocol
from rig.worlds.linear import REFERENCE_Q_RAD
from tests.true_curves import true_curve

Table = dict[str, np.ndarray[Any, Any]]
PAPER_XY = Path(__file__).parents[2] / "protocols" / "paper_xy.yaml"
QUIET = Sensors(0.0, 0.0, 0.0, (0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Named:
    """Anything with attributes."""

    number: int = 0
    branch: str = "loading"
    target_N: float = 0.0
    q_rad: tuple[float, ...] = REFERENCE_Q_RAD
    tcp_xyz_mm: tuple[float, ...] = (0.0, 0.0, 0.0)
    pose: str = "P1"
    direction: str = "y"
    rate_Hz: float = 1.0
    samples_per_step: int = 3
    before_s: float = 4.0
    after_s: float = 5.0
    stop_at_displacement_mm: float | None = None


@dataclass(frozen=True)
class Procedure:
    """Up to 80 N and back along y, twice."""

    run: Named = field(default_factory=Named)
    levels: tuple[float, ...] = (40.0, 70.0, 80.0)
    hold_s: float = 0.0
    rest_s: float = 10.0
    sampling: Named = field(default_factory=Named)
    zero: Named = field(default_factory=Named)
    poses = {"P1": Named(), "P2": Named(q_rad=(0.0, -1.5, -1.9, -1.3, 1.57, -1.3))}  # noqa: RUF012
    directions = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}  # noqa: RUF012

    others: tuple[Named, ...] = ()

    def sequence(self) -> list[tuple[int, Named, int]]:
        return [(i, r, n) for i, r in enumerate((self.run, *self.others)) for n in (1, 2)]

    def steps(self, run: Named) -> list[Named]:
        up = [Named(n, "loading", f) for n, f in enumerate(self.levels, 1)]
        return up + [replace(step, branch="unloading") for step in up[-2::-1]]


def exact(world: str = "paper") -> Any:
    return make_world(world, 1, 0.0, 0.0)


def test_columns_are_the_contracted_ones() -> None:
    table = sample_protocol(exact(), Procedure(), 1)
    names = ["time_s", "session_s", "pose", "direction", "repetition", "branch", "step", "force_N"]
    names += [f"force_{axis}_N" for axis in "xyz"] + ["displacement_mm"]
    names += [f"q{joint}_rad" for joint in range(1, 7)]
    names += [f"temperature{joint}_C" for joint in range(1, 7)]
    assert list(table) == names
    # 4 zero, 5 levels of 3, 5 zero; twice
    assert {len(column) for column in table.values()} == {2 * (4 + 15 + 5)}
    assert table["branch"].tolist()[:24] == (
        ["zero"] * 4 + ["loading"] * 9 + ["unloading"] * 6 + ["zero"] * 5
    )
    assert table["step"].tolist()[4:19] == [1] * 3 + [2] * 3 + [3] * 3 + [2] * 3 + [1] * 3
    assert table["repetition"].tolist() == [1] * 24 + [2] * 24


def test_clocks() -> None:
    table = sample_protocol(exact(), Procedure(), 1)
    assert np.all(np.diff(table["session_s"]) >= 1.0 - 1e-9)
    starts = table["session_s"] - table["time_s"]
    for repetition in (1, 2):
        of_run = starts[table["repetition"] == repetition]
        np.testing.assert_allclose(of_run, of_run[0], atol=1e-9)
    assert table["time_s"][24] == pytest.approx(1.0)


def test_the_run_follows_the_worlds_curve() -> None:
    table = sample_protocol(exact("linear"), Procedure(), 3, QUIET)
    world = exact("linear")
    use = (table["repetition"] == 1) & (table["branch"] == "loading")
    force, moved = table["force_N"][use], table["displacement_mm"][use]
    true = 1e3 * true_curve(world, [0, 1, 0], force)
    np.testing.assert_allclose(moved, true, rtol=0.02)  # scatter of one loading
    np.testing.assert_allclose(force[::3], [40, 70, 80], rtol=0.015)


@pytest.mark.parametrize("seed", range(5))
def test_the_hand_goes_past_no_force(seed: int) -> None:
    table = sample_protocol(exact("linear"), Procedure(), seed, QUIET)
    targets = np.array([0.0, 40.0, 70.0, 80.0])[table["step"]]
    past = table["force_N"] - targets
    assert np.all(past[table["branch"] == "loading"] < 0)
    # held by the screw, the force falls a little while the arm settles
    assert np.all(past[table["branch"] == "unloading"] > -1e-3)


def test_what_gave_way_stays_till_the_end_of_the_run_and_is_gone_in_the_next() -> None:
    table = sample_protocol(exact(), Procedure(), 3, QUIET)
    zero = table["branch"] == "zero"
    moved = table["displacement_mm"]
    of = {r: moved[zero & (table["repetition"] == r)] for r in (1, 2)}
    # 80 N, or a little less, is up to 5 N beyond the knee, with 0.8 mm/N
    assert 3.0 < of[1][-1] < 4.2
    np.testing.assert_allclose(of[1][4:], of[1][-1], atol=0.002)
    assert abs(of[2][0]) < 0.01
    q1 = table["q1_rad"][zero & (table["repetition"] == 1)]
    assert (q1[-1] - q1[0]) * 750 == pytest.approx(of[1][-1], rel=0.01)


def test_datum_is_the_first_sample_of_each_setup() -> None:
    table = sample_protocol(exact(), Procedure(), 3)
    assert table["displacement_mm"][0] == 0.0
    assert table["displacement_mm"][24] != 0.0  # second repetition: not zeroed again
    others = (Named(direction="x"), Named(pose="P2", direction="x"))
    table = sample_protocol(exact(), Procedure(others=others), 3)
    zeroed = np.flatnonzero(table["displacement_mm"] == 0.0)
    assert zeroed.tolist() == [0, 48, 96]


def test_poses_and_directions_are_set_up() -> None:
    others = (Named(direction="x"), Named(pose="P2", direction="x"))
    table = sample_protocol(exact("linear"), Procedure(others=others), 3, QUIET)
    q = np.stack([table[f"q{joint}_rad"] for joint in range(1, 7)], axis=1)
    np.testing.assert_allclose(q[0], REFERENCE_Q_RAD, atol=1e-9)
    np.testing.assert_allclose(q[96], Procedure.poses["P2"].q_rad, atol=1e-9)
    loaded = np.flatnonzero((table["step"] == 3) & (table["repetition"] == 1))[::3]
    forces = np.stack([table[f"force_{axis}_N"][loaded] for axis in "xyz"], axis=1)
    np.testing.assert_allclose(forces, [[0, 80, 0], [80, 0, 0], [80, 0, 0]], atol=1.2)
    np.testing.assert_allclose(table["force_N"][loaded], 80.0, atol=1.2)
    # k in x is 95.96 N/mm in the reference pose
    moved = table["displacement_mm"][loaded]
    assert moved[1] == pytest.approx(forces[1, 0] / 95.96, rel=0.02)
    assert abs(moved[2] / moved[1] - 1) > 0.05


def test_loading_ends_early_where_the_displacement_is_reached() -> None:
    run = Named(stop_at_displacement_mm=1.1)
    table = sample_protocol(exact(), Procedure(run=run), 3, QUIET)
    loading = table["branch"] == "loading"
    assert set(table["step"][loading].tolist()) == {1, 2}
    assert set(table["step"][table["branch"] == "unloading"].tolist()) == {1, 2}


def test_holds_are_sampled_whole() -> None:
    table = sample_protocol(exact(), Procedure(hold_s=7.0), 3)
    loading = (table["branch"] == "loading") & (table["repetition"] == 1)
    assert loading.sum() == 3 * 7


def test_noise_is_as_stated() -> None:
    sensors = Sensors(0.2, 0.004, 2e-5, (0.0, 0.0, 0.0))
    table = sample_protocol(
        make_world("linear", 5), Procedure(hold_s=200.0, rest_s=60.0), 5, sensors
    )
    quiet = sample_protocol(make_world("linear", 5), Procedure(hold_s=200.0, rest_s=60.0), 5, QUIET)
    assert (table["force_x_N"] - quiet["force_x_N"]).std() == pytest.approx(0.2, rel=0.1)
    hold = (table["step"] == 1) & (table["branch"] == "loading") & (table["repetition"] == 1)
    assert table["displacement_mm"][hold][50:].std() == pytest.approx(0.004, rel=0.2)
    assert table["q6_rad"].std() == pytest.approx(2e-5, rel=0.1)


def test_gains_of_the_world_act_on_the_readings() -> None:
    true = sample_protocol(exact("linear"), Procedure(), 5, QUIET)
    world = make_world("linear", 1)
    felt = sample_protocol(world, Procedure(), 5, QUIET)
    np.testing.assert_allclose(felt["force_N"], world.force_gain * true["force_N"], rtol=1e-9)
    seen = world.displacement_gain * true["displacement_mm"]
    np.testing.assert_allclose(felt["displacement_mm"], seen, rtol=1e-9)
    assert min(abs(world.force_gain - 1), abs(world.displacement_gain - 1)) > 1e-4


def test_drift_is_a_straight_line_from_each_reset_on() -> None:
    sensors = Sensors(0.0, 0.0, 0.0, (0.0133, 0.0133, 0.054))
    table = sample_protocol(exact("linear"), Procedure(), 8, sensors)
    slopes = []
    for repetition in (1, 2):
        use = (table["repetition"] == repetition) & (table["branch"] == "zero")
        time, force = table["time_s"][use], table["force_N"][use]
        slopes.append(force[0] / time[0])
        np.testing.assert_allclose(force, slopes[-1] * time, atol=1e-9)
    assert slopes[0] != pytest.approx(slopes[1])
    assert max(map(abs, slopes)) <= 0.0133


def test_seeds() -> None:
    def sampled(seed: int) -> Table:
        return sample_protocol(make_world("paper", seed), Procedure(), seed)

    first, again, other = sampled(1), sampled(1), sampled(2)
    for name, column in first.items():
        np.testing.assert_array_equal(column, again[name])
    assert np.abs(first["force_N"] - other["force_N"]).max() > 1e-3


def test_the_papers_procedure_gives_the_papers_stiffness() -> None:
    """Mean over 20 seeds, gains off: what remains is scatter, noise and drift."""
    protocol = load_protocol(PAPER_XY)
    k = {"x": [], "y": []}
    for seed in range(20):
        table = sample_protocol(make_world("paper", seed, 0.0, 0.0), protocol, seed)
        for direction, values in k.items():
            values.append(_stiffness(table, direction))
    # scatter 0.5 % a loading, 60 loadings: 0.07 %; and the seating's 3 um
    assert np.mean(k["x"]) == pytest.approx(95.94, rel=0.005)
    assert np.mean(k["y"]) == pytest.approx(57.42, rel=0.005)


def _stiffness(table: Table, direction: str) -> float:
    """Mean over repetitions of k through the origin, deviations growing with u, up to 75 N in y."""
    found = []
    for repetition in (1, 2, 3):
        run = (table["direction"] == direction) & (table["repetition"] == repetition)
        zero, loading = run & (table["branch"] == "zero"), run & (table["branch"] == "loading")
        drift = np.polyfit(table["time_s"][zero], table["force_N"][zero], 1)
        force = table["force_N"] - np.polyval(drift, table["time_s"])
        datum = table["displacement_mm"][np.flatnonzero(zero)[:6]].mean()
        steps = range(1, 12 if direction == "x" else 11)
        rows = [loading & (table["step"] == step) for step in steps]
        ratio = np.array(
            [force[r].mean() / (table["displacement_mm"][r].mean() - datum) for r in rows]
        )
        found.append(float(np.sum(ratio**2) / np.sum(ratio)))
    return float(np.mean(found))
