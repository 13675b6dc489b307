"""The arm against numbers and laws that do not come from its own code."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.arm import (
    STANDARD_GRAVITY,
    Arm,
    along,
    invert_compliance,
    tool_offset,
    unit_vector,
)
from identification.elastic import ALUMINIUM, STEEL, Beam, cantilever, transport, tube
from identification.inverse import BRANCHES, nearest, solutions
from rig.models.robot import load_robot, robot_names

Array = NDArray[np.float64]
ROBOTS = robot_names()
F1_Q = np.deg2rad([13.43, -99.84, -108.10, -62.06, 90.0, -76.57])
F1_C = [37201, 56946, 18110, 7108, 7533, 8000]
angle = st.floats(-np.pi, np.pi)
pose = st.tuples(*[angle] * 6).map(np.array)


@pytest.fixture(scope="module")
def ur10e() -> Arm:
    return load_robot("ur10e")


@pytest.fixture(params=ROBOTS)
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_robot(request.param)


def random_poses(n: int, seed: int = 7) -> Array:
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, 6))


def rotation_vector(R: Array) -> Array:
    """Small rotation as a vector."""
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2


def test_three_arms_are_there() -> None:
    assert set(ROBOTS) >= {"ur10e", "ur5e", "ur16e"}


def test_flange_at_zero(ur10e: Arm) -> None:
    np.testing.assert_allclose(
        ur10e.fk(np.zeros(6))[:3, 3], [-1.18425, -0.29070, 0.06085], atol=1e-9
    )


def test_flange_in_the_published_pose(ur10e: Arm) -> None:
    T = ur10e.fk(F1_Q)
    np.testing.assert_allclose(T[:3, 3], [0.75, 0.0, 0.40], atol=1e-4)
    np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=1e-4)


def test_vectorised_is_the_same_as_one_by_one(arm: Arm) -> None:
    q = random_poses(6).reshape(2, 3, 6)
    tool = tool_offset([0.02, -0.03, 0.1])
    for function in (arm.frames, arm.fk, arm.jacobian, arm.gravity_torques, arm.compliance):
        many = function(q)
        for i in np.ndindex(2, 3):
            np.testing.assert_allclose(many[i], function(q[i]), atol=1e-12)
    np.testing.assert_allclose(arm.jacobian(q, tool)[1, 2], arm.jacobian(q[1, 2], tool), atol=1e-12)


def test_jacobian_is_the_derivative_of_fk(arm: Arm) -> None:
    tool = tool_offset([0.05, -0.02, 0.28])
    h = 1e-5
    for q in random_poses(20):
        J = arm.jacobian(q, tool)
        R = arm.fk(q, tool)[:3, :3]
        for i in range(6):
            e = np.eye(6)[i] * h
            ahead, behind = arm.fk(q + e, tool), arm.fk(q - e, tool)
            v = (ahead[:3, 3] - behind[:3, 3]) / (2 * h)
            w = rotation_vector((ahead[:3, :3] - behind[:3, :3]) @ R.T) / (2 * h)
            np.testing.assert_allclose(J[:, i], [*v, *w], atol=1e-6)


def potential(arm: Arm, q: Array) -> float:
    frames = arm.frames(q)
    heights = [
        m * (frames[k, :3, :3] @ c + frames[k, :3, 3])[2]
        for k, (m, c) in enumerate(zip(arm.mass, arm.centre, strict=True), start=1)
    ]
    load = arm.payload * (frames[6, :3, :3] @ arm.payload_centre + frames[6, :3, 3])[2]
    return -STANDARD_GRAVITY[2] * (sum(heights) + load)


def test_gravity_torques_are_the_gradient_of_the_potential(arm: Arm) -> None:
    from dataclasses import replace

    loaded = replace(arm, payload=3.0, payload_centre=np.array([0.01, -0.02, 0.1]))
    h = 1e-5
    for q in random_poses(10):
        gradient = [
            (potential(loaded, q + e) - potential(loaded, q - e)) / (2 * h) for e in np.eye(6) * h
        ]
        np.testing.assert_allclose(loaded.gravity_torques(q), gradient, atol=1e-6)


def test_loaded_term_is_the_derivative_of_the_load_torques(arm: Arm) -> None:
    tool = tool_offset([0.0, 0.03, 0.28])
    wrench = np.array([80.0, -50.0, 30.0, 4.0, -3.0, 6.0])
    h = 1e-5
    for q in random_poses(10):
        K = arm.loaded_term(q, wrench, tool, gravity=STANDARD_GRAVITY)
        for j, e in enumerate(np.eye(6) * h):
            ahead = arm.load_torques(q + e, wrench, tool) - arm.gravity_torques(q + e)
            behind = arm.load_torques(q - e, wrench, tool) - arm.gravity_torques(q - e)
            np.testing.assert_allclose(K[:, j], (ahead - behind) / (2 * h), atol=1e-5)


# --- compliance ----------------------------------------------------------------------------------


def test_published_single_stiffness(ur10e: Arm) -> None:
    arm = ur10e.with_stiffness(F1_C)
    found = [float(along(arm.compliance(F1_Q), n)) / 1e3 for n in np.eye(3)]
    np.testing.assert_allclose(found, [95.94, 57.42, 30.4], rtol=1e-3)


def test_compliance_is_what_the_springs_do(ur10e: Arm) -> None:
    """Deflection of the pose that balances a small load, found without any Jacobian."""
    from scipy.optimize import minimize

    arm = ur10e.with_stiffness(F1_C)
    force = np.array([3.0, -2.0, 1.0])
    start = arm.fk(F1_Q)[:3, 3]
    scale = 1e-4

    def energy(x: Array) -> float:
        dq = x * scale
        shift = arm.fk(F1_Q + dq)[:3, 3] - start
        return float(1e6 * (0.5 * dq @ (arm.joint_stiffness * dq) - force @ shift))

    found = minimize(energy, np.zeros(6), tol=1e-14).x * scale
    moved = arm.fk(F1_Q + found)[:3, 3] - start
    np.testing.assert_allclose(arm.compliance(F1_Q)[:3, :3] @ force, moved, rtol=2e-3)


def test_loaded_compliance_shifts_little_and_in_the_right_sense(ur10e: Arm) -> None:
    """Own geometry under load, PHYSICS's size: 0.1 to 1.3 %."""
    arm = ur10e.with_stiffness(F1_C)
    plain = along(arm.compliance(F1_Q), [1, 0, 0])
    loaded = along(arm.compliance(F1_Q, wrench=[200.0, 0, 0, 0, 0, 0]), [1, 0, 0])
    assert 1e-4 < abs(loaded / plain - 1) < 1.5e-2


def test_a_load_beyond_the_springs_is_refused(ur10e: Arm) -> None:
    with pytest.raises(ValueError, match="buckling"):
        ur10e.compliance(F1_Q, wrench=[1e6, 0, 0, 0, 0, 0])


def test_stiffness_is_the_inverse_of_compliance(arm: Arm) -> None:
    q = random_poses(20)
    C = arm.compliance(q)
    product = invert_compliance(C) @ C
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(6), product.shape), atol=1e-6)


@given(pose, st.floats(0.1, 10))
@settings(max_examples=30, deadline=None)
def test_compliance_scales_with_the_springs(q: Array, factor: float) -> None:
    arm = load_robot_once()
    stiffer = arm.with_stiffness(arm.joint_stiffness * factor)
    np.testing.assert_allclose(
        stiffer.compliance(q) * factor, arm.compliance(q), rtol=1e-12, atol=1e-18
    )


@given(pose, angle)
@settings(max_examples=30, deadline=None)
def test_turning_the_first_joint_turns_the_compliance(q: Array, turn: float) -> None:
    arm = load_robot_once()
    c, s = np.cos(turn), np.sin(turn)
    R = np.kron(np.eye(2), np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    turned = arm.compliance(q + np.array([turn, 0, 0, 0, 0, 0]))
    np.testing.assert_allclose(turned, R @ arm.compliance(q) @ R.T, atol=1e-15, rtol=1e-9)


_CACHE: list[Arm] = []


def load_robot_once() -> Arm:
    if not _CACHE:
        _CACHE.append(load_robot("ur10e"))
    return _CACHE[0]


# --- what bends besides the joints ---------------------------------------------------------------


def test_cantilever_by_hand() -> None:
    """Steel rod, 20 mm, 0.5 m: F L^3 / 3 E I with I = pi d^4 / 64."""
    C = cantilever(tube(STEEL, 0.02), 0.5)
    second_moment = np.pi * 0.02**4 / 64
    np.testing.assert_allclose(C[1, 1], 0.125 / (3 * 210e9 * second_moment), rtol=1e-12)
    np.testing.assert_allclose(C[5, 1], 0.25 / (2 * 210e9 * second_moment), rtol=1e-12)
    np.testing.assert_allclose(C[2, 4], -C[1, 5], rtol=1e-12)


def test_two_halves_of_a_beam_make_the_whole() -> None:
    section = tube(ALUMINIUM, 0.1, 0.005)
    A = transport(np.array([0.3, 0, 0]))
    joined = A @ cantilever(section, 0.4) @ A.T + cantilever(section, 0.3)
    np.testing.assert_allclose(joined, cantilever(section, 0.7), rtol=1e-12, atol=1e-20)


def test_links_are_split_without_a_change(ur10e: Arm) -> None:
    section = tube(ALUMINIUM, 0.12, 0.006)
    whole = [Beam(section, (0.6, 0, 0.1), (0, 0, 0.1), 2)]
    halves = [
        Beam(section, (0.6, 0, 0.1), (0.25, 0, 0.1), 2),
        Beam(section, (0.25, 0, 0.1), (0, 0, 0.1), 2),
    ]
    q = random_poses(5)
    np.testing.assert_allclose(
        ur10e.compliance(q, links=whole), ur10e.compliance(q, links=halves), rtol=1e-9, atol=1e-18
    )
    assert (along(ur10e.compliance(q, links=whole) - ur10e.compliance(q), [0, 0, 1]) > 0).all()


def test_size_of_the_links_in_the_published_pose(ur10e: Arm) -> None:
    """Tubes of aluminium: 50-100 um in x at 100 N."""
    more = ur10e.compliance(F1_Q, links=ur10e.links) - ur10e.compliance(F1_Q)
    assert 10e-6 < 100 * more[0, 0] < 150e-6


def test_base_tilt_of_the_published_size(ur10e: Arm) -> None:
    """5e5 Nm/rad: 32 um in x at 100 N with the tool 0.40 m up; turning: 112 um in y."""
    base = np.diag([0, 0, 0, 1 / 5e5, 1 / 5e5, 1 / 5e5])
    more = 100 * (ur10e.compliance(F1_Q, base=base) - ur10e.compliance(F1_Q))
    np.testing.assert_allclose(more[0, 0], 100 * 0.40**2 / 5e5, rtol=1e-3)
    np.testing.assert_allclose(more[1, 1], 100 * (0.40**2 + 0.75**2) / 5e5, rtol=1e-3)


# --- inverse -------------------------------------------------------------------------------------


def test_every_pose_comes_back(arm: Arm) -> None:
    q = random_poses(2000)
    found = arm.inverse(arm.fk(q))
    reached = np.isfinite(found[..., 0])
    back = arm.fk(np.nan_to_num(found))
    error = np.abs(back - arm.fk(q)[:, None]).max(axis=(-1, -2))
    assert error[reached].max() < 1e-9
    distance = np.abs((found - q[:, None] + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)
    assert np.nanmin(distance, axis=1).max() < 1e-6
    assert set(reached.sum(axis=1)) <= {2, 4, 6, 8}
    assert (reached.sum(axis=1) == 8).any()


def test_branches_are_told_by_their_signs(ur10e: Arm) -> None:
    for q in random_poses(50, seed=3):
        for name, solution in solutions(ur10e, ur10e.fk(q)).items():
            assert (solution[4] > 0) == ("wrist+" in name)
            assert (solution[2] > 0) == ("elbow+" in name)
    assert len(set(BRANCHES)) == 8


@pytest.mark.parametrize(
    "q",
    [np.zeros(6), [0.3, -1.0, 0.0, 0.4, 1.0, 0.2], [0.3, -1.0, 1.2, 0.4, 0.0, 0.2]],
    ids=["all zero", "stretched", "wrist singular"],
)
def test_singular_poses_come_back_too(ur10e: Arm, q: Array) -> None:
    T = ur10e.fk(q)
    back = ur10e.fk(nearest(ur10e, T, q))
    np.testing.assert_allclose(back, T, atol=1e-9)


def test_axis_six_is_free_in_a_wrist_singularity(ur10e: Arm) -> None:
    T = ur10e.fk([0.3, -1.0, 1.2, 0.4, 0.0, 0.2])
    found = ur10e.inverse(T, q6=0.7)
    singular = np.abs(np.sin(found[:, 4])) < 1e-9
    assert singular.any()
    np.testing.assert_allclose(found[singular, 5], 0.7)


def test_out_of_reach(ur10e: Arm) -> None:
    T = np.eye(4)
    T[:3, 3] = [2.0, 0.0, 0.5]
    assert np.isnan(ur10e.inverse(T)).all()
    with pytest.raises(ValueError, match=r"ur10e does not reach the pose at 2, 0, 0.5 m"):
        nearest(ur10e, T, np.zeros(6))


def test_reach_about_the_shoulder(ur10e: Arm) -> None:
    from identification.workspace import flange_points

    q = random_poses(1_000_000, seed=1)
    distance = np.linalg.norm(flange_points(ur10e, q) - [0, 0, ur10e.d[0]], axis=1)
    assert 1.355 < distance.max() < 1.36417


def test_flange_points_are_fk(arm: Arm) -> None:
    from identification.workspace import flange_points

    q = random_poses(50)
    np.testing.assert_allclose(flange_points(arm, q), arm.fk(q)[:, :3, 3], atol=1e-12)


# --- bad input -----------------------------------------------------------------------------------


def test_refusals(ur10e: Arm) -> None:
    with pytest.raises(ValueError, match=r"d of x has shape \(5,\); \(6,\) wanted"):
        Arm("x", d=np.zeros(5), a=np.zeros(6), alpha=np.zeros(6))
    with pytest.raises(ValueError, match="must be above 0 Nm/rad"):
        ur10e.with_stiffness([1, 2, 3, 0, 5, 6])
    with pytest.raises(ValueError, match=r"length 1\.41421; a unit vector is wanted"):
        unit_vector([1.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="last axis must be 6"):
        ur10e.fk(np.zeros(5))
    with pytest.raises(ValueError, match="not finite"):
        ur10e.fk([0, 0, 0, np.nan, 0, 0])
    with pytest.raises(ValueError, match="no rotation matrix"):
        ur10e.fk(np.zeros(6), np.diag([2.0, 1, 1, 1]))
    with pytest.raises(ValueError, match="singular pose"):
        invert_compliance(ur10e.compliance([0.3, -1.0, 1.2, 0.4, 0.0, 0.2]))
    other = Arm("scara", d=np.ones(6), a=np.ones(6), alpha=np.zeros(6))
    with pytest.raises(ValueError, match="scara is not"):
        other.inverse(np.eye(4))


def test_a_robot_is_read_once() -> None:
    """Commands ask for the same one again and again."""
    assert load_robot("ur10e") is load_robot("ur10e")
