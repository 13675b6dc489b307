"""True stiffnesses come back from a world that shares no code with the identification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.arm import Arm, along, tool_offset
from identification.joints import Gains, JointFit, Observation, Prior, identify
from identification.next_poses import (
    _CRITERIA,
    Plan,
    Proposal,
    _candidates,
    propose,
)
from rig.models.robot import load_robot
from tests.recovery.joint_world import deflect, place

Array = NDArray[np.float64]

PAPER_Q = np.deg2rad([13.43, -99.84, -108.10, -62.06, 90.0, -76.57])
PAPER_C = np.array([37201.0, 56946, 18110, 7108, 7533, 8000])
OFFSET = np.array([0.08, 0.0, 0.10])  # beside axis 6, so that joint 6 is seen
GAINS = Gains(0.005, 0.003)
FORCE = 50.0
AXES = np.eye(3)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_robot("ur10e")


def default_prior(arm: Arm) -> Prior:
    return Prior(arm.joint_stiffness, arm.joint_stiffness_relative_sd)


def rich_poses() -> Array:
    return np.deg2rad(
        [
            [13, -100, -108, -62, 90, -77],
            [40, -70, -90, -20, 60, 30],
            [-60, -120, -60, -100, -70, 100],
            [90, -45, -120, 60, 40, -140],
            [150, -90, 90, -30, 120, 10],
            [-120, -60, 100, -120, -45, 60],
        ]
    )


def draw(
    rng: np.random.Generator,
    truth: Array,
    poses: Array,
    *,
    directions: Array = AXES,
    tool: Array = OFFSET,
    relative: float = 0.003,
    setup: int = 0,
    gains: Array | None = None,
) -> list[Observation]:
    """Compliances with noise and one pair of gains for the whole session."""
    g = gains if gains is not None else rng.normal(0, [GAINS.force, GAINS.displacement])
    out = []
    for q in poses:
        for n in directions:
            s = float(n @ deflect(q, truth, FORCE * n, tool)[0]) / FORCE
            read = s * (1 + g[1]) / (1 + g[0]) * (1 + relative * rng.standard_normal())
            label = f"pose {np.round(q, 2)}, direction {n}"
            out.append(
                Observation(q, n, tool_offset(tool), read, relative * s, setup=setup, label=label)
            )
    return out


def random_truth(rng: np.random.Generator, prior: Prior) -> Array:
    return np.asarray(prior.stiffness * np.exp(0.35 * rng.standard_normal(6)))


def test_the_world_is_a_ur10e(arm: Arm) -> None:
    rng = np.random.default_rng(0)
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        np.testing.assert_allclose(place(q, OFFSET)[0], arm.fk(q, tool_offset(OFFSET))[:3, 3])


def test_intervals_cover_and_identified_joints_are_right(arm: Arm) -> None:
    """50 true sets in six poses and three directions each."""
    rng = np.random.default_rng(2024)
    prior = default_prior(arm)
    covered, errors = [], []
    identified = conflicts = 0
    for _ in range(50):
        truth = random_truth(rng, prior)
        fit = identify(arm, draw(rng, truth, rich_poses()), [GAINS], prior)
        assert fit.rank == 6
        covered.append((fit.ci95[:, 0] <= truth) & (truth <= fit.ci95[:, 1]))
        errors += list(np.abs(fit.stiffness / truth - 1)[fit.identified])
        identified += int(fit.identified.sum())
        conflicts += fit.conflict is not None
    assert conflicts <= 3  # of draws from the prior itself: 1 in 370
    assert 0.92 <= np.mean(covered) <= 0.98
    assert identified > 150
    assert max(errors) < 0.05


def test_one_pose_determines_two_combinations(arm: Arm) -> None:
    rng = np.random.default_rng(5)
    data = draw(rng, PAPER_C, PAPER_Q[None], directions=np.eye(3)[:2], tool=np.zeros(3))
    fit = identify(arm, data, [GAINS], default_prior(arm))
    assert fit.rank == 2
    assert fit.null_space.shape == (6, 4)
    assert (~fit.identified).sum() >= 4
    assert np.isinf(fit.condition_number)
    np.testing.assert_allclose(fit.stiffness[5], 8000, rtol=1e-6)  # nothing but the prior
    assert fit.data_share[5] == pytest.approx(0, abs=1e-6)
    # what the data do not see may change without a trace
    for direction in fit.null_space.T:
        changed = fit.stiffness * np.exp(1e-4 * direction)
        for one in data:
            lever = one.levers(arm)
            s, t = (lever**2 / fit.stiffness).sum(), (lever**2 / changed).sum()
            assert abs(t / s - 1) < 1e-7


def test_a_joint_without_a_lever_has_no_share_and_no_bound(arm: Arm) -> None:
    """Exactly none: rounding had left shares below 0 and bounds of 1e-28 Nm/rad."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        data = draw(rng, PAPER_C, PAPER_Q[None], directions=np.eye(3)[:2], tool=np.zeros(3))
        fit = identify(arm, data, [GAINS], default_prior(arm))
        assert (fit.data_share[5], fit.lower_bound[5]) == (0.0, 0.0)
        assert (fit.data_share[:5] > 0).all()
        assert (fit.lower_bound[:4] > 0).all()


def test_bound_that_holds_for_sure(arm: Arm) -> None:
    """c1 >= ky * lever^2 = 32.3 kNm/rad, less the measurement's uncertainty."""
    s = 1 / 57.42e3
    one = Observation(PAPER_Q, np.array([0, 1.0, 0]), None, s, 1e-6 * s)
    fit = identify(arm, [one], [Gains(1e-9, 1e-9)], default_prior(arm))
    assert fit.lower_bound[0] == pytest.approx(57.42e3 * 0.75**2, rel=1e-3)
    unsure = identify(arm, [one], [GAINS], default_prior(arm))
    assert unsure.lower_bound[0] < fit.lower_bound[0]


def test_joint_readings_tell_the_joints_apart(arm: Arm) -> None:
    rng = np.random.default_rng(8)
    data = []
    for n in np.eye(3)[:2]:
        shift, turned = deflect(PAPER_Q, PAPER_C, FORCE * n, np.zeros(3))
        s = float(n @ shift) / FORCE
        read = turned / FORCE + 1e-8 * rng.standard_normal(6)
        data.append(Observation(PAPER_Q, n, None, s, 0.003 * s, read, np.full(6, 1e-8)))
    fit = identify(arm, data, [GAINS], default_prior(arm))
    assert fit.rank == 5
    assert fit.identified[[0, 2, 3]].all()
    assert not fit.identified[5]
    np.testing.assert_allclose(fit.stiffness[[0, 2]], PAPER_C[[0, 2]], rtol=0.03)


def test_more_uncertain_data_count_less(arm: Arm) -> None:
    """Weights scale as they should: with all uncertainties doubled, prior aside, so is the sd."""
    rng = np.random.default_rng(11)
    wide = Prior(arm.joint_stiffness, np.full(6, 50.0))
    exact = [Gains(1e-9, 1e-9)]
    truth = PAPER_C
    once = identify(arm, draw(rng, truth, rich_poses(), gains=np.zeros(2)), exact, wide)
    twice_data = draw(rng, truth, rich_poses(), relative=0.006, gains=np.zeros(2))
    twice = identify(arm, twice_data, exact, wide)
    np.testing.assert_allclose(twice.relative_sd / once.relative_sd / 2, np.ones(6), rtol=0.05)


def test_unexplained_scatter_widens_the_intervals(arm: Arm) -> None:
    rng = np.random.default_rng(12)
    data = draw(rng, PAPER_C, rich_poses(), relative=0.03, gains=np.zeros(2))
    claimed = [
        Observation(o.q, o.direction, o.tool, o.compliance, o.u_compliance / 10) for o in data
    ]
    fit = identify(arm, claimed, [GAINS], default_prior(arm))
    assert 5 < fit.birge < 20
    assert fit.conflict is None  # it is the data that were stated too sure, not the prior


def scaled(data: list[Observation], times: float) -> list[Observation]:
    """As if the displacement, and the joints' turning, were so many times as far."""
    return [
        replace(
            o,
            compliance=times * o.compliance,
            u_compliance=times * o.u_compliance,
            joints=None if o.joints is None else times * o.joints,
            u_joints=None if o.u_joints is None else times * o.u_joints,
        )
        for o in data
    ]


def seen_by_joints(truth: Array) -> list[Observation]:
    """Two directions in the published pose, without noise but with its uncertainties."""
    data = []
    for n in np.eye(3)[:2]:
        shift, turned = deflect(PAPER_Q, truth, FORCE * n, np.zeros(3))
        s = float(n @ shift) / FORCE
        read, u = turned / FORCE, np.full(6, 1e-6)
        data.append(Observation(PAPER_Q, n, None, s, 0.003 * s, read, u, label="one"))
    return data


@pytest.mark.parametrize("times", [1000.0, 4.448, 1 / 25.4])
def test_a_factor_common_to_all_joints_is_found(arm: Arm, times: float) -> None:
    """Another unit: the answer is the data's, not the prior's, and tells how far they are apart."""
    prior = default_prior(arm)
    two = [replace(o, joints=None, u_joints=None) for o in seen_by_joints(PAPER_C)]
    plain = identify(arm, two, [GAINS], prior)
    assert plain.conflict is None
    fit = identify(arm, scaled(two, times), [GAINS], prior)
    conflict = fit.conflict
    assert conflict is not None
    assert conflict.log_factor is not None
    assert fit.birge == 1.0  # the data agree among themselves
    assert abs(conflict.log_factor + np.log(times)) < 3 * conflict.u_log_factor
    assert np.abs(conflict.away).min() > 4
    # every joint, seen or not: the truth by the same factor, within what is stated
    assert (np.abs(np.log(fit.stiffness * times / PAPER_C)) < 2.5 * fit.relative_sd).all()
    assert (fit.data_share[[1, 5]] == 0).all()
    seen = identify(arm, scaled(seen_by_joints(PAPER_C), times), [GAINS], prior)
    np.testing.assert_allclose(seen.stiffness[[0, 2]] * times, PAPER_C[[0, 2]], rtol=0.03)


def test_a_single_joint_beyond_the_prior_widens_the_prior(arm: Arm) -> None:
    """Nothing is common to all: unseen joints keep their value, which is less sure."""
    prior = default_prior(arm)
    truth = PAPER_C / [1, 1, 10, 1, 1, 1]
    fit = identify(arm, seen_by_joints(truth), [GAINS], prior)
    conflict = fit.conflict
    assert conflict is not None
    assert conflict.log_factor is None
    assert np.argmax(np.abs(conflict.away)) == 2
    # as if the prior were drawn so wide: root mean square of what is seen, about
    seen = np.log(PAPER_C / prior.stiffness)[[0, 2, 3, 4]] + [0, np.log(0.1), 0, 0]
    stated = np.sqrt(np.log1p(prior.relative_sd[0] ** 2))
    assert conflict.enlarged == pytest.approx(np.sqrt(np.mean(seen**2)) / stated, rel=0.15)
    np.testing.assert_allclose(fit.stiffness[[0, 2]], truth[[0, 2]], rtol=0.03)
    assert fit.stiffness[5] == pytest.approx(prior.stiffness[5])
    assert fit.relative_sd[5] == pytest.approx(conflict.enlarged * stated)


def test_laser_and_joint_readings_of_different_units_are_refused(arm: Arm) -> None:
    data = seen_by_joints(PAPER_C)
    for times in (1000.0, 1 / 25.4):
        laser = [replace(o, compliance=times * o.compliance) for o in data]
        with pytest.raises(ValueError, match="one: displacement and joint readings contradict"):
            identify(arm, laser, [GAINS], default_prior(arm))
    soft = [replace(o, compliance=1.3 * o.compliance) for o in data]  # a mounting that gives
    assert identify(arm, soft, [GAINS], default_prior(arm)).birge > 1


def test_contradictory_data_are_refused(arm: Arm) -> None:
    rng = np.random.default_rng(13)
    first = draw(rng, PAPER_C, PAPER_Q[None], setup=0)
    second = draw(rng, 1.5 * PAPER_C, PAPER_Q[None], setup=1)
    with pytest.raises(ValueError, match="contradict each other"):
        identify(arm, first + second, [GAINS, GAINS], default_prior(arm))
    with pytest.raises(ValueError, match="Leave out the one that no longer holds"):
        identify(arm, first + second, [GAINS, GAINS], default_prior(arm))
    bent = [replace(o, bent_over=(20.0, 220.0), label="a") for o in first]
    with pytest.raises(ValueError, match=r"average over what was loaded \(a over 20 to 220 N\)"):
        identify(arm, bent + second, [GAINS, GAINS], default_prior(arm))
    with pytest.raises(ValueError, match="no observation"):
        identify(arm, [], [GAINS], default_prior(arm))
    negative = Observation(PAPER_Q, np.eye(3)[0], None, -1e-6, 1e-8)
    with pytest.raises(ValueError, match="must be above 0"):
        identify(arm, [negative], [GAINS], default_prior(arm))


# --- next poses ----------------------------------------------------------------------------------


def measured(
    rng: np.random.Generator, truth: Array, chosen: list[tuple[Array, Array, float]], plan: Plan
) -> list[Observation]:
    """What the plan's instruments make of these poses, directions and forces."""
    g = rng.normal(0, [GAINS.force, GAINS.displacement])
    out = []
    for q, n, force in chosen:
        s = float(n @ deflect(q, truth, force * n, OFFSET)[0]) / force
        u = np.sqrt(12 / plan.levels) * np.hypot(plan.u_displacement, s * plan.u_force) / force
        read = s * (1 + g[1]) / (1 + g[0]) + u * rng.standard_normal()
        out.append(Observation(q, n, tool_offset(OFFSET), read, u, setup=1))
    return out


def test_proposals_keep_their_promise_and_beat_chance(arm: Arm) -> None:
    rng = np.random.default_rng(21)
    prior = default_prior(arm)
    plan = Plan(tool=tool_offset(OFFSET), gains=GAINS)
    better = 0
    for draw_number in range(10):
        truth = random_truth(rng, prior)
        start = draw(rng, truth, PAPER_Q[None], directions=np.eye(3)[:2], tool=OFFSET)
        before = identify(arm, start, [GAINS], prior)
        found = propose(arm, before, plan, 4, seed=draw_number, candidates=600)
        chosen = [(p.q, p.direction, p.force) for p in found]
        after = identify(arm, start + measured(rng, truth, chosen, plan), [GAINS] * 2, prior)
        promised = before.relative_sd.sum() - found[-1].expected.sum()
        assert before.relative_sd.sum() - after.relative_sd.sum() >= promised / 2
        chance = random_plan(arm, rng, plan, before.stiffness)
        rival = identify(arm, start + measured(rng, truth, chance, plan), [GAINS] * 2, prior)
        better += after.relative_sd.sum() < rival.relative_sd.sum()
    assert better >= 9


def random_plan(
    arm: Arm, rng: np.random.Generator, plan: Plan, stiffness: Array
) -> list[tuple[Array, Array, float]]:
    q, _, force = _candidates(arm.with_stiffness(stiffness), plan, int(rng.integers(1e6)), 200)
    rows = rng.choice(np.flatnonzero(force > 0.05 * plan.force), 4, replace=False)
    return [(q[i // 3], np.eye(3)[i % 3], float(force[i])) for i in rows]


def test_proposals_stay_within_the_limits(arm: Arm) -> None:
    prior = default_prior(arm)
    data = draw(np.random.default_rng(1), PAPER_C, PAPER_Q[None])
    fit = identify(arm, data, [GAINS], prior)
    plan = Plan(tool=tool_offset(OFFSET), torque_share=0.4, force=400.0, range=0.05)
    found: list[Proposal] = propose(arm, fit, plan, 5, candidates=500)
    spread = [p.expected.sum() for p in found]
    assert spread == sorted(spread, reverse=True)
    for p in found:
        wrench = np.concatenate([p.force * p.direction, np.zeros(3)])
        torque = np.abs(arm.load_torques(p.q, wrench, plan.tool)) + np.abs(arm.gravity_torques(p.q))
        assert (torque <= 0.4 * arm.torque_limit + 1e-6).all()
        singular = np.linalg.svd(arm.jacobian(p.q, plan.tool), compute_uv=False)
        assert singular[-1] >= plan.least_singular
        assert plan.lowest < arm.fk(p.q, plan.tool)[2, 3] < plan.highest
        assert p.force >= 0.05 * plan.force
        soft = arm.with_stiffness(fit.stiffness).compliance(p.q, plan.tool)
        moved = p.force / along(soft, p.direction)
        assert moved <= plan.range * (1 + 1e-9)


def test_criteria_are_what_their_letters_say(arm: Arm) -> None:
    """No candidate is better than the one chosen first, by covariances from added informations."""
    prior = default_prior(arm)
    # two poses: some joints are known well, others hardly, and the letters disagree
    data = draw(np.random.default_rng(3), PAPER_C, rich_poses()[:2], directions=np.eye(3)[:2])
    fit = identify(arm, data, [GAINS], prior)
    plan = Plan(tool=tool_offset(OFFSET), gains=GAINS)
    q, _, force = _candidates(arm.with_stiffness(fit.stiffness), plan, 0, 150)
    usable = np.flatnonzero(force >= 0.05 * plan.force)
    all_left = [
        _posterior(arm, fit, plan, q[i // 3], np.eye(3)[i % 3], float(force[i])) for i in usable
    ]
    chosen = []
    for letter, measure in (
        ("A", lambda P: np.sqrt(np.diag(P)).sum()),
        ("D", np.linalg.det),
        ("E", lambda P: np.linalg.eigvalsh(P)[-1]),
    ):
        first = propose(arm, fit, plan, 1, candidates=150, criterion=letter)[0]  # type: ignore[arg-type]
        left = _posterior(arm, fit, plan, first.q, first.direction, first.force)
        np.testing.assert_allclose(np.sqrt(np.diag(left)), first.expected, rtol=1e-6)
        assert measure(left) <= min(measure(P) for P in all_left) * (1 + 1e-9)  # type: ignore[no-untyped-call]
        chosen.append(tuple(first.q))
    assert len(set(chosen)) > 1
    with pytest.raises(ValueError, match='criterion "G" is unknown; allowed: A, D, E'):
        propose(arm, fit, plan, 1, criterion="G")  # type: ignore[arg-type]


def test_criteria_measure_what_is_left() -> None:
    rng = np.random.default_rng(4)
    L = rng.standard_normal((6, 6))
    P = L @ L.T + np.diag(10.0 ** np.arange(-3, 3))
    rows = 0.1 * rng.standard_normal((5, 6)) @ L.T
    rows *= 0.5 / np.sqrt(np.einsum("mi,ij,mj->m", rows, np.linalg.inv(P), rows))[:, None]
    left = P - rows[:, :, None] * rows[:, None, :]
    det = np.linalg.det(left) / np.linalg.det(P)
    np.testing.assert_allclose(_CRITERIA["D"](P, rows), det, rtol=1e-9)
    worst = [np.linalg.norm(one, 2) for one in left]
    np.testing.assert_allclose(_CRITERIA["E"](P, rows), worst, rtol=1e-9)
    summed = [np.sqrt(np.diag(one)).sum() for one in left]
    np.testing.assert_allclose(_CRITERIA["A"](P, rows), summed, rtol=1e-9)


def _posterior(
    arm: Arm, fit: JointFit, plan: Plan, q: Array, direction: Array, force: float
) -> Array:
    """Covariance of ln c after one more observation, by adding informations."""
    lever = direction @ arm.jacobian(q, plan.tool)[:3]
    parts = lever**2 / fit.stiffness
    s = parts.sum()
    u = np.sqrt(12 / plan.levels) * np.hypot(plan.u_displacement, s * plan.u_force)
    variance = (u / (s * force)) ** 2 + plan.gains.force**2 + plan.gains.displacement**2
    h = parts / s
    return np.linalg.inv(np.linalg.inv(fit.covariance) + np.outer(h, h) / variance)
