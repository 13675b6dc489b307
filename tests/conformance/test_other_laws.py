"""Laws as others write them: a play that jumps, a tip that drags on its pad, rough faces."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from identification.gap.data import GapData
from identification.gap.laws.lost_motion import _side
from rig.diagnosis.gap_data import gap_data
from rig.worlds.arm import place
from tests.conformance.gap_designs import DESIGNS, TCP_MM, TRUE, Array, Q, imported, meta, noisy
from tests.explained import explained
from tests.slow import slow_ones

JOINT, WIDTH_RAD, STRENGTH_NM = 3, 1.5e-3, 0.9


def measured(law: object, design: str = "medium") -> GapData:
    return gap_data(imported(noisy(DESIGNS[design], law), meta(DESIGNS[design])))  # type: ignore[arg-type]


def weights(rows: pd.DataFrame) -> Array:
    """(n,) Nm of the arm's own weight on the joint, without a tool."""
    each = {p: float(place(np.array(q)).gravity_torques()[JOINT]) for p, q in Q.items()}
    return np.array([each[str(p)] for p in rows["pose"]])


def jumps(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """The joint lies at one side of its play until the net torque pushes it over, against friction
    that holds it; what it does is counted from where it first lay."""
    net = lever[:, JOINT] * rows["force_N"].to_numpy() + weights(rows)
    side, out = float(np.sign(net[0])), []
    for x in net:
        side = float(np.sign(x)) if abs(x) > STRENGTH_NM else side
        out.append(side)
    deflection = np.zeros((len(rows), 6))
    deflection[:, JOINT] = 0.5 * WIDTH_RAD * (np.array(out) - out[0])
    return np.zeros(len(rows)), deflection


@pytest.mark.slow
def test_a_play_in_which_friction_holds_the_joint() -> None:
    found = explained(measured(jumps, "rich"))
    assert [e.name for e in found.effects] == ["joint_backlash"]
    assert found.where.joints == (JOINT + 1,)
    width = found.effects[0].parameters["width"]
    assert width.value == pytest.approx(WIDTH_RAD, rel=0.05)
    assert found.after < 1.1 * found.noise


def test_which_side_it_lies_at() -> None:
    x = np.array([-0.1, 2.0, 0.5, -0.5, -2.0, 0.5, 0.1, 0.5])
    fresh = np.array([True, False, False, False, False, False, True, False])
    np.testing.assert_array_equal(_side(x, 1.0, fresh), [0, 1, 1, 1, -1, -1, 0, 0])


SEATS = {
    "logarithmic": lambda f: 15.0 * np.log1p(f / 4.0),  # rough faces
    "Hertz": lambda f: 1.2 * np.abs(f) ** (2 / 3),  # a ball on a plate
    "slack": lambda f: 30.0 * np.minimum(f / 31.0, 1.0),  # a gap that closes on a weak spring
}


@pytest.mark.parametrize("kind", slow_ones(SEATS, ("logarithmic", "slack")))
def test_seats_of_other_shapes(kind: str) -> None:
    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        return 1e-6 * SEATS[kind](rows["force_N"].to_numpy()), np.zeros((len(rows), 6))

    found = explained(measured(law))
    assert [e.name for e in found.effects] == ["contact_seating"]
    assert kind in found.effects[0].label
    depth = found.effects[0].parameters["depth"]
    assert depth.value == pytest.approx(1e-3 * SEATS[kind](np.array(200.0)), rel=0.1)
    assert found.after < 1.1 * found.noise


def dragging(rows: pd.DataFrame) -> Array:
    """(n, 2) N across the direction: the tip drags on its pad, and turns the load soon, then no
    more; two components, as shares of a tangent each."""
    force = rows["force_N"].to_numpy()
    turned = force * np.tanh(3 * np.abs(force) / 200.0)
    return np.column_stack([0.12 * turned, -0.07 * turned])


@pytest.mark.slow
def test_a_tip_that_drags_on_its_pad_is_a_load_askew() -> None:
    design = DESIGNS["rich"]

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        moved = np.zeros((len(rows), 6))
        for pose, angles in Q.items():
            arm = place(np.array(angles))
            levers = arm.levers(arm.tool(np.array(TCP_MM) * 1e-3))  # (6, 3)
            for direction, others in (("x", (1, 2)), ("y", (2, 0))):
                mine = ((rows["pose"] == pose) & (rows["direction"] == direction)).to_numpy()
                moved[mine] = dragging(rows)[mine] @ levers[:, others].T / TRUE
        return np.zeros(len(rows)), moved

    table = noisy(design, law)
    across = dragging(table)  # of the readings: half a newton of noise in 200 turns next to nothing
    for direction, others in (("x", "yz"), ("y", "zx")):
        mine = (table["direction"] == direction).to_numpy()
        for k, axis in enumerate(others):
            table.loc[mine, f"force_{axis}_N"] += across[mine, k]
    found = explained(gap_data(imported(table, meta(design))))
    assert found.verdict == "load_misalignment"
    assert found.probabilities["load_misalignment"] > 0.8
    assert found.after < 1.1 * found.noise
    tangents = [
        p.value for n, p in found.effects[0].parameters.items() if n.startswith("tangent_x")
    ]
    assert np.hypot(*tangents) == pytest.approx(np.hypot(0.12, 0.07), rel=0.05)
