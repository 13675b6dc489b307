"""Joint torsional stiffnesses from compliances that were measured in one or many poses.

A load F along n at the tool turns joint j by `J_nj F / c_j`, so both the laser's compliance
`s = sum_j J_nj^2 / c_j` and a joint reading's `J_nj / c_j` are linear in 1 / c_j (Salisbury 1980).
Estimated are ln c_j, with a normal prior in the open, together with the gains of force and
displacement, which all observations of one set-up share (`identification.posterior`). Where data
and prior contradict each other, the prior gives way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.arm import JOINTS, Arm, unit_vector
from identification.arrays import Array
from identification.posterior import (
    Conflict,
    Rows,
    birge_factor,
    conflict_of,
    covariance,
    maximise,
    sensitivity,
    stated_prior,
)
from identification.uncertainty import TWO_SIDED, TWO_SIDED_90

# A joint counts as identified when its 95 % interval is well inside +-5 % (three standard
# uncertainties), and when at least nine tenths of what is known of it come from the data.
IDENTIFIED_RELATIVE = 0.05 / 3
IDENTIFIED_SHARE = 0.9
_DUST = 1e-9  # shares below are rounding
_APART = 10.0  # times as far: links, mounting and gains are not off by so much, units are
_NO_LEVER = 1e-6  # m: a joint with less is not loaded
_RANK = 1e-7  # singular values below this share of the largest are rounding


@dataclass(frozen=True, eq=False)
class Observation:
    """Compliance m/N of one pose and direction, with standard uncertainty (gains not in it).

    q (6,) rad; direction (3,) unit vector in the base frame; tool (4, 4) flange_T_tcp or None.
    joints, u_joints (6,) rad/N: how the joint readings moved per force; None when they do not see
    the deflection; NaN for a joint without a reading. setup: whose gains it shares. bent_over:
    lowest and highest force (N) of a curve that is not straight, of which this is an average.
    """

    q: Array
    direction: Array
    tool: Array | None
    compliance: float
    u_compliance: float
    joints: Array | None = None
    u_joints: Array | None = None
    setup: int = 0
    label: str = ""
    bent_over: tuple[float, float] | None = None

    def levers(self, arm: Arm) -> Array:
        """`n^T J` (6,): torque of each joint per force, m."""
        return np.asarray(unit_vector(self.direction) @ arm.jacobian(self.q, self.tool)[:3])


@dataclass(frozen=True)
class Gains:
    """Relative standard uncertainties of the gains of one set-up's instruments."""

    force: float
    displacement: float


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the joints beforehand: stiffness (6,) Nm/rad, relative_sd (6,) of it.
    made_from: what the source says of the data sets behind it."""

    stiffness: Array
    relative_sd: Array
    source: str = ""
    made_from: str = ""

    def __post_init__(self) -> None:
        if not (np.asarray(self.stiffness) > 0).all():
            raise ValueError("the prior of a joint stiffness must be above 0 Nm/rad")
        if not (np.asarray(self.relative_sd) > 0).all():
            raise ValueError("the prior's relative standard deviation must be above 0")


@dataclass(frozen=True, eq=False)
class JointFit:
    """stiffness (6,) Nm/rad; covariance (6, 6) of ln c; data_share (6,): how much of what is known
    comes from data; lower_bound (6,) Nm/rad holds for sure (95 %) whatever the other joints do;
    null_space (6, null_dimension): changes of ln c that these data do not see; condition_number of
    the weighted sensitivities (infinite with a null space); birge: factor by which the stated
    uncertainties were enlarged because the residuals ask for it; conflict: of data and prior, None
    where there is none."""

    stiffness: Array
    covariance: Array
    data_share: Array
    lower_bound: Array
    rank: int
    null_space: Array
    condition_number: float
    identified: NDArray[np.bool_]
    residuals: Array
    chi2: float
    dof: float
    birge: float
    prior: Prior
    conflict: Conflict | None

    @property
    def relative_sd(self) -> Array:
        """Standard uncertainty of ln c, (6,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def ci95(self) -> Array:
        """95 % intervals (6, 2) Nm/rad, from those of ln c."""
        half = TWO_SIDED * self.relative_sd
        return self.stiffness[:, None] * np.exp(np.stack([-half, half], axis=-1))


def identify(
    arm: Arm, observations: Sequence[Observation], gains: Sequence[Gains], prior: Prior
) -> JointFit:
    """The six stiffnesses that observations and prior make most probable.

    gains: one a set-up. Raises ValueError without observations, for compliances that are not above
    0, and for observations of one pose and direction that contradict each other.
    """
    if not observations:
        raise ValueError("no observation: at least one pose and direction is needed")
    for one in observations:
        if not (one.compliance > 0 and one.u_compliance > 0):
            raise ValueError(
                f"{one.label or 'an observation'}: compliance {one.compliance:g} m/N with standard "
                f"uncertainty {one.u_compliance:g} m/N; both must be above 0"
            )
    _check_agreement(arm, observations, gains)
    rows = _rows(arm, observations, len(gains))
    sd_gains = np.array([[g.force, g.displacement] for g in gains]).ravel()
    stated = stated_prior(prior.stiffness, prior.relative_sd, sd_gains)
    peak, taken = maximise(rows, stated), stated
    conflict = conflict_of(rows, stated, peak)
    if conflict is not None:
        taken = conflict.prior
        peak = maximise(rows, taken, conflict.parameters)
    birge, dof = birge_factor(rows, taken, peak)
    own = covariance(rows, taken, peak, birge)[:JOINTS, :JOINTS]
    enlarged = 1.0 if conflict is None else conflict.enlarged
    # what follows a common factor may be less sure than the prior was: nothing of it is data
    share = np.maximum(0.0, 1 - np.diag(own) * np.diag(stated.information)[:JOINTS] / enlarged**2)
    share[share < _DUST] = 0.0
    sd = np.sqrt(np.diag(own))
    J = sensitivity(rows, peak.parameters)
    rank, null, condition = _rank(J[:, :JOINTS])
    return JointFit(
        stiffness=np.exp(peak.parameters[:JOINTS]),
        covariance=own,
        data_share=share,
        lower_bound=_lower_bounds(arm, observations, gains),
        rank=rank,
        null_space=null,
        condition_number=condition,
        identified=(sd <= IDENTIFIED_RELATIVE) & (share >= IDENTIFIED_SHARE),
        residuals=peak.residuals,
        chi2=peak.chi2,
        dof=dof,
        birge=birge,
        prior=prior,
        conflict=conflict,
    )


def _rows(arm: Arm, observations: Sequence[Observation], setups: int) -> Rows:
    A, value, u, gain = [], [], [], []
    for one in observations:
        lever = one.levers(arm)
        # displacement read too large and force read too small both make the arm look softer
        laser, joint = np.zeros(2 * setups), np.zeros(2 * setups)
        laser[2 * one.setup : 2 * one.setup + 2] = -1.0, 1.0
        joint[2 * one.setup] = -1.0
        A.append(lever**2)
        value.append(one.compliance)
        u.append(one.u_compliance)
        gain.append(laser)
        if one.joints is None or one.u_joints is None:
            continue
        for j in np.flatnonzero(np.isfinite(one.joints) & (one.u_joints > 0)):
            A.append(np.eye(JOINTS)[j] * lever[j])
            value.append(float(one.joints[j]))
            u.append(float(one.u_joints[j]))
            gain.append(joint)
    return Rows(np.array(A), np.array(value), np.array(u), np.array(gain))


def _rank(J: Array) -> tuple[int, Array, float]:
    _, singular, Vt = np.linalg.svd(J)
    rank = int((singular > _RANK * singular[0]).sum())
    condition = float(singular[0] / singular[-1]) if rank == JOINTS else float("inf")
    return rank, Vt[rank:].T, condition


def _lower_bounds(arm: Arm, observations: Sequence[Observation], gains: Sequence[Gains]) -> Array:
    """`c_j >= J_nj^2 / s`: no joint gives way by more than the whole arm does (95 %)."""
    out = np.zeros(JOINTS)
    for one in observations:
        gain = np.hypot(gains[one.setup].force, gains[one.setup].displacement)
        u = np.hypot(one.u_compliance, gain * one.compliance)
        lever = one.levers(arm)
        lever[np.abs(lever) < _NO_LEVER] = 0.0
        out = np.maximum(out, lever**2 / (one.compliance + TWO_SIDED_90 * u))
    return out


def _check_agreement(arm: Arm, observations: Sequence[Observation], gains: Sequence[Gains]) -> None:
    """Observations with the same levers must have the same compliance (six standard
    uncertainties, gains of different set-ups counted), and each the one that its joint readings
    make, but for what moves beside the joints."""
    for one in observations:
        _check_readings(arm, one)
    levers = np.abs([one.levers(arm) for one in observations])
    same = np.abs(levers[:, None] - levers[None]).max(axis=-1) <= 1e-3
    for i, first in enumerate(observations):
        for k in np.flatnonzero(same[i, :i]).tolist():
            second = observations[k]
            u = np.hypot(first.u_compliance, second.u_compliance)
            if first.setup != second.setup:
                for one in (first, second):
                    g = gains[one.setup]
                    u = np.hypot(u, np.hypot(g.force, g.displacement) * one.compliance)
            if abs(first.compliance - second.compliance) > 6 * u + 0.05 * first.compliance:
                raise ValueError(
                    f"{second.label} and {first.label} contradict each other: "
                    f"{1e-3 / second.compliance:.4g} and {1e-3 / first.compliance:.4g} N/mm in the "
                    "same pose and direction, far beyond their uncertainties. "
                    f"{_why_apart(second, first)}"
                )


def _check_readings(arm: Arm, one: Observation) -> None:
    """Laser and joint readings of one observation are of the same order of size."""
    lever = one.levers(arm)
    if one.joints is None or one.u_joints is None:
        return
    read = np.isfinite(one.joints) & (one.u_joints > 0)
    if not read[np.abs(lever) > _NO_LEVER].all():
        return
    turned = float(lever[read] @ one.joints[read])
    u_turned = TWO_SIDED * float(np.linalg.norm(lever[read] * one.u_joints[read]))
    u = TWO_SIDED * one.u_compliance
    beyond = one.compliance - u > _APART * (max(turned, 0.0) + u_turned)
    if beyond or _APART * (one.compliance + u) < turned - u_turned:
        raise ValueError(
            f"{one.label}: displacement and joint readings contradict each other: "
            f"{1e6 * one.compliance:.3g} mm per kN by the laser, {1e6 * turned:.3g} mm per kN by "
            "the joints' turning. See whether displacements are in mm, joint readings in rad and "
            "taken behind the gears (joint_encoder), or go by the laser alone "
            "(--no-joint-readings)"
        )


def _why_apart(a: Observation, b: Observation) -> str:
    """What may be behind two compliances that contradict each other, and what to do."""
    bent = [one for one in (a, b) if one.bent_over is not None]
    if not bent:
        return (
            "Was something mounted, moved or set anew between the two? Leave out the one that no "
            "longer holds"
        )
    ranges = ", ".join(
        f"{one.label} over {one.bent_over[0]:.4g} to {one.bent_over[1]:.4g} N"
        for one in bent
        if one.bent_over is not None
    )
    return (
        "A curve that is not straight has no single stiffness, but an average over what was "
        f"loaded ({ranges}). Give the data set whose range of force matters, or measure both at "
        "the same levels; rig diagnose separates springs from effects"
    )
