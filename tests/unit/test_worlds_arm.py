"""The kinematics of the simulated rigs against numbers and formulations that are not theirs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rig.arrays import Array
from rig.worlds import arm
from rig.worlds.arm import place, tool_poses
from rig.worlds.linear import REFERENCE_Q_RAD

# Denavit-Hartenberg numbers (d, a, alpha) of the UR10e, as published by its maker
DH = (
    (0.1807, 0.0, np.pi / 2),
    (0.0, -0.6127, 0.0),
    (0.0, -0.57155, 0.0),
    (0.17415, 0.0, np.pi / 2),
    (0.11985, 0.0, -np.pi / 2),
    (0.11655, 0.0, 0.0),
)


def chain(q: Array) -> Array:
    """(4, 4) flange in base by a chain of link frames."""
    T = np.eye(4)
    for angle, (d, a, alpha) in zip(q, DH, strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        link = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d]]
        T = T @ np.vstack([link, [0, 0, 0, 1]])
    return T


def random_poses(n: int) -> Array:
    return np.random.default_rng(7).uniform(-np.pi, np.pi, (n, 6))


def test_flange_at_zero() -> None:
    assert place(np.zeros(6)).origin == pytest.approx([-1.18425, -0.29070, 0.06085], abs=1e-9)


@pytest.mark.parametrize("q", random_poses(10))
def test_flange_agrees_with_a_chain_of_link_frames(q: Array) -> None:
    T, placement = chain(q), place(q)
    np.testing.assert_allclose(placement.origin, T[:3, 3], atol=1e-12)
    np.testing.assert_allclose(placement.rotation, T[:3, :3], atol=1e-12)


def test_reference_pose_has_the_tool_down_on_the_base_x_axis() -> None:
    placement = place(np.array(REFERENCE_Q_RAD))
    assert placement.origin == pytest.approx([0.75, 0.0, 0.40], abs=1e-4)
    assert placement.rotation[:, 2] == pytest.approx([0, 0, -1], abs=1e-4)


@pytest.mark.parametrize("q", random_poses(5))
def test_levers_are_the_motion_per_radian(q: Array) -> None:
    tcp, step = np.array([0.02, -0.05, 0.11]), 1e-6
    placement = place(q)
    levers = placement.levers(placement.tool(tcp))
    for joint in range(6):
        ends = np.tile(q, (2, 1))
        ends[:, joint] += [step, -step]
        moved = tool_poses(ends, tcp)[:, :3]
        np.testing.assert_allclose(levers[joint], (moved[0] - moved[1]) / (2 * step), atol=1e-8)


def test_tool_poses_agree_with_the_placement() -> None:
    tcp = np.array([0.1, 0.2, 0.3])
    q = np.vstack([random_poses(20), [REFERENCE_Q_RAD], np.zeros((1, 6))])
    poses = tool_poses(q, tcp)
    for row, angles in zip(poses, q, strict=True):
        placement = place(angles)
        np.testing.assert_allclose(row[:3], placement.tool(tcp), atol=1e-12)
        turned = Rotation.from_rotvec(row[3:]).as_matrix()
        np.testing.assert_allclose(turned, placement.rotation, atol=1e-9)
        assert np.linalg.norm(row[3:]) <= np.pi + 1e-12


@pytest.mark.parametrize("q", random_poses(5))
def test_gravity_torques_are_the_slope_of_the_potential(q: Array) -> None:
    def potential(angles: Array) -> float:
        heights = place(angles).centres[:, 2]
        return float(arm._MASSES_KG @ heights * 9.80665)

    torques, step = place(q).gravity_torques(), 1e-6
    for joint in range(6):
        turn = step * np.eye(6)[joint]
        slope = (potential(q + turn) - potential(q - turn)) / (2 * step)
        assert torques[joint] == pytest.approx(-slope, abs=1e-5)


def test_gravity_of_the_stretched_arm_by_hand() -> None:
    # q = 0: upper arm, forearm and wrists at these distances outboard of the shoulder
    masses = [13.051, 3.989, 2.1, 1.98, 0.615]
    distances = [0.6127 - 0.38, 1.18425 - 0.24, 1.18425, 1.18425, 1.18425]
    weight = 9.80665 * float(np.dot(masses, distances))
    # lever (-L, 0, 0) x weight (0, 0, -W) = (0, -L W, 0), and the axis is (0, -1, 0)
    assert place(np.zeros(6)).gravity_torques()[1] == pytest.approx(weight, rel=1e-12)
