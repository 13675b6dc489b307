"""Columns of effects against finite differences of a forward model that knows nothing of them.

The six springs again, with another stiffness, gain or pose, a tilted load, a base that turns.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.arm import tool_offset
from identification.gap.effects.pose_error import secants
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant
from rig.models.robot import load_robot
from tests.conformance.effect_benches import (
    Array,
    of,
    readings,
)
from tests.conformance.gap_designs import (
    STATED,
    TCP_MM,
    Q,
)

# --- derivatives -------------------------------------------------------------------------------

STEP = 1e-5


def forward(
    rows_force: Array,
    setups: NDArray[np.int64],
    stiffness: Array,
    tcp_mm: Array,
    turn: Array,
    tilt: Array,
) -> Array:
    """Stacked response and readings (n, 1 + 6) of the springs: own kinematics of the arm."""
    arm, out = load_robot("ur10e"), np.empty((len(rows_force), 7))
    for s, axis in enumerate("xy"):
        n = np.eye(3)["xyz".index(axis)]
        J = arm.jacobian(np.array(Q["P1"]) + turn, tool_offset(tcp_mm * 1e-3))[:3]
        joints = J.T @ (n + tilt) / stiffness
        mine = setups == s
        out[mine, 0] = rows_force[mine] * (n @ J @ joints)
        out[mine, 1:] = rows_force[mine, None] * joints + turn
    return out


def plain(bench: Bench, **changes: Array | float) -> Array:
    """Forward model on the rows of medium, with changes."""
    force = bench.rows.force * (1 + float(np.asarray(changes.get("gain", 0.0))))
    none = np.zeros(3)
    base = load_robot("ur10e").fk(np.array(Q["P1"]), tool_offset(np.array(TCP_MM) * 1e-3))
    offset = base[:3, :3].T @ np.asarray(changes.get("offset", none)) * 1e3
    return forward(
        force,
        bench.rows.setup,
        STATED * (1 + np.asarray(changes.get("stiffness", np.zeros(6)))),
        np.array(TCP_MM) + offset,
        np.asarray(changes.get("turn", np.zeros(6))),
        np.asarray(changes.get("tilt", none)),
    )


def derivative(bench: Bench, name: str, unit: Array | float) -> Array:
    above = plain(bench, **{name: STEP * np.asarray(unit)})
    below = plain(bench, **{name: -STEP * np.asarray(unit)})
    return (above - below) / (2 * STEP)


def agree(bench: Bench, column: Array, expected: Array) -> None:
    edges, n = np.flatnonzero(bench.rows.hold_starts), bench.rows.n
    size = np.abs(expected[:, 0]).max()
    np.testing.assert_allclose(column[:n], expected[:, 0], rtol=1e-5, atol=1e-6 * size)
    q = readings(bench, column[:, None])[:, :, 0].T
    held = expected[edges, 1:]
    np.testing.assert_allclose(q, held, rtol=1e-5, atol=1e-6 * (np.abs(held).max() or 1.0))


def pick(word: str, like: str) -> tuple[Bench, Variant, Array]:
    bench, variants, columns = of(word, "medium")
    return bench, next(v for v in variants if like in v.label), columns


@pytest.mark.parametrize("joint", range(5))
def test_derivative_of_a_joints_compliance(joint: int) -> None:
    bench, v, columns = pick("joint_stiffness_error", f"joint {joint + 1}")
    softer = -np.eye(6)[joint]  # d compliance = - d stiffness
    agree(bench, columns[:, v.columns[0]], derivative(bench, "stiffness", softer))


def test_derivative_of_the_force_gain() -> None:
    """The joints feel less than is read."""
    bench, v, columns = pick("force_scale", "gain")
    agree(bench, columns[:, v.columns[0]], -derivative(bench, "gain", 1.0))


@pytest.mark.parametrize("axis", range(3))
def test_derivative_of_the_tools_place(axis: int) -> None:
    bench, v, columns = pick("pose_error", "tool 10 mm")
    agree(bench, columns[:, v.columns[axis]], derivative(bench, "offset", flange()[:, axis]))


@pytest.mark.parametrize("joint", range(6))
def test_derivative_of_where_a_joint_stands(joint: int) -> None:
    bench, v, columns = pick("pose_error", "joints 0.02 rad")
    agree(bench, columns[:, v.columns[joint]], derivative(bench, "turn", np.eye(6)[joint]))


def flange() -> Array:
    """Axes of the flange in the base frame, as columns: the tool's offset counts along them."""
    pose = load_robot("ur10e").fk(np.array(Q["P1"]), tool_offset(np.array(TCP_MM) * 1e-3))
    return np.asarray(pose[:3, :3])


def test_a_tool_far_off_acts_by_the_squares_of_the_levers() -> None:
    """Secants through where the tool is are exact there, however far."""
    bench, _, _ = pick("pose_error", "tool 10 mm")
    d, n = np.array([0.04, -0.12, 0.07]), bench.rows.n
    columns = secants(bench, d, np.zeros(6), bench.compliance)
    found = sum(x * c[:n] for x, c in zip(d, columns[:3], strict=True))
    expected = plain(bench, offset=flange() @ d)[:, 0] - plain(bench, offset=np.zeros(3))[:, 0]
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("tangent", range(2))
def test_derivative_of_a_load_across(tangent: int) -> None:
    bench, v, columns = pick("load_misalignment", "direction y")
    t = bench.data.setups[1].tangents[tangent]
    expected = derivative(bench, "tilt", t)
    expected[bench.rows.setup == 0] = 0.0
    agree(bench, columns[:, v.columns[tangent]], expected)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("depth", [0.0, 0.3])
def test_derivative_of_a_base_that_turns(axis: int, depth: float) -> None:
    """A small rotation about the axis under the moment of the load moves the target."""
    bench, variants, columns = of("base_compliance", "medium")
    v = next(v for v in variants if v.info["depth_m"] == depth and len(v.columns) == 3)
    arm = load_robot("ur10e")
    point = arm.fk(np.array(Q["P1"]), tool_offset(np.array(TCP_MM) * 1e-3))[:3, 3]
    r, a = point + np.array([0, 0, depth]), np.eye(3)[axis]
    expected = np.empty(bench.rows.n)
    for s in range(2):
        n = np.eye(3)[s]
        moment = a @ np.cross(r, n)  # per newton
        mine = bench.rows.setup == s
        expected[mine] = n @ np.cross(moment * a, r) * bench.rows.force[mine]
    np.testing.assert_allclose(
        columns[: bench.rows.n, v.columns[axis]], expected, rtol=1e-9, atol=1e-12
    )
