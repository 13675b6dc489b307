"""Joint torsional stiffnesses from compliances that were measured in one or many poses.

A load F along n at the tool turns joint j by `J_nj F / c_j`, so both the laser's compliance
`s = sum_j J_nj^2 / c_j` and a joint reading's `J_nj / c_j` are linear in 1 / c_j (Salisbury 1980).
Estimated are ln c_j, with a normal prior in the open, together with the gains of force and
displacement, which all observations of one set-up share: maximum of the posterior by Gauss-Newton,
its covariance from the curvature there (Laplace).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.arm import JOINTS, Arm, unit_vector
from identification.arrays import Array
from identification.uncertainty import TWO_SIDED, TWO_SIDED_90

# A joint counts as identified when its 95 % interval is well inside +-5 % (three standard
# uncertainties), and when at least nine tenths of what is known of it come from the data.
IDENTIFIED_RELATIVE = 0.05 / 3
IDENTIFIED_SHARE = 0.9
_DUST = 1e-9  # shares below are rounding
_NO_LEVER = 1e-6  # m: a joint with less is not loaded
_RANK = 1e-7  # singular values below this share of the largest are rounding
_ITERATIONS = 60


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
    uncertainties were enlarged because the residuals ask for it."""

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

    @property
    def relative_sd(self) -> Array:
        """Standard uncertainty of ln c, (6,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def ci95(self) -> Array:
        """95 % intervals (6, 2) Nm/rad, from those of ln c."""
        half = TWO_SIDED * self.relative_sd
        return self.stiffness[:, None] * np.exp(np.stack([-half, half], axis=-1))


@dataclass(frozen=True, eq=False)
class _Rows:
    """value = (1 + gain . g) (A x); A (m, 6), value, u (m,), gain (m, 2 setups)."""

    A: Array
    value: Array
    u: Array
    gain: Array


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
    parameters, residuals, chi2 = _maximise(rows, prior, sd_gains)
    J = _sensitivity(rows, parameters)
    dof = max(0.0, rows.value.size - _effective(J, prior, sd_gains))
    birge = _birge(chi2, dof)
    information = J.T @ J / birge**2 + np.diag(_prior_weights(prior, sd_gains))
    covariance: Array = np.asarray(np.linalg.inv(information), dtype=np.float64)
    own = covariance[:JOINTS, :JOINTS]
    share = 1 - np.diag(own) / np.log1p(np.square(prior.relative_sd))
    share[np.abs(share) < _DUST] = 0.0
    sd = np.sqrt(np.diag(own))
    rank, null, condition = _rank(J[:, :JOINTS])
    return JointFit(
        stiffness=np.exp(parameters[:JOINTS]),
        covariance=own,
        data_share=share,
        lower_bound=_lower_bounds(arm, observations, gains),
        rank=rank,
        null_space=null,
        condition_number=condition,
        identified=(sd <= IDENTIFIED_RELATIVE) & (share >= IDENTIFIED_SHARE),
        residuals=residuals,
        chi2=chi2,
        dof=dof,
        birge=birge,
        prior=prior,
    )


def _rows(arm: Arm, observations: Sequence[Observation], setups: int) -> _Rows:
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
    return _Rows(np.array(A), np.array(value), np.array(u), np.array(gain))


def _predict(rows: _Rows, p: Array) -> Array:
    return np.asarray((rows.A @ np.exp(-p[:JOINTS])) * (1 + rows.gain @ p[JOINTS:]))


def _sensitivity(rows: _Rows, p: Array) -> Array:
    """d prediction / d (ln c, gains) over u, (m, 6 + 2 setups)."""
    x = np.exp(-p[:JOINTS])
    scale = 1 + rows.gain @ p[JOINTS:]
    by_joint = -rows.A * x * scale[:, None]
    by_gain = (rows.A @ x)[:, None] * rows.gain
    return np.hstack([by_joint, by_gain]) / rows.u[:, None]


def _prior_weights(prior: Prior, sd_gains: Array) -> Array:
    sd = np.concatenate([np.sqrt(np.log1p(np.square(prior.relative_sd))), sd_gains])
    return np.asarray(1.0 / np.maximum(sd, 1e-9) ** 2)


def _maximise(rows: _Rows, prior: Prior, sd_gains: Array) -> tuple[Array, Array, float]:
    """Gauss-Newton with damping (Levenberg 1944); parameters, residuals over u, their chi^2."""
    centre = np.concatenate([np.log(prior.stiffness), np.zeros(sd_gains.size)])
    weights = _prior_weights(prior, sd_gains)

    def cost(p: Array) -> float:
        r = (rows.value - _predict(rows, p)) / rows.u
        return float(r @ r + weights @ (p - centre) ** 2)

    p, damping = centre.copy(), 1e-3
    best = cost(p)
    for _ in range(_ITERATIONS):
        J = _sensitivity(rows, p)
        r = (rows.value - _predict(rows, p)) / rows.u
        H = J.T @ J + np.diag(weights)
        step = np.linalg.solve(H + damping * np.diag(np.diag(H)), J.T @ r - weights * (p - centre))
        step *= min(1.0, 2.0 / max(float(np.abs(step).max()), 1e-300))
        new = cost(p + step)
        if new < best:
            p, damping = p + step, damping / 10
            if best - new < 1e-12 * best:
                break
            best = new
        else:
            damping *= 10
            if damping > 1e12:
                break
    r = (rows.value - _predict(rows, p)) / rows.u
    return p, r, float(r @ r)


def _effective(J: Array, prior: Prior, sd_gains: Array) -> float:
    """Parameters that the data, not the prior, determine: trace of the hat matrix."""
    H = J.T @ J
    return float(np.trace(np.linalg.solve(H + np.diag(_prior_weights(prior, sd_gains)), H)))


def _birge(chi2: float, dof: float) -> float:
    """sqrt(chi^2 / dof) where chi^2 is improbably large (3 sigma; Birge 1932), 1 otherwise."""
    if dof < 1 or chi2 <= dof + 3 * np.sqrt(2 * dof):
        return 1.0
    return float(np.sqrt(chi2 / dof))


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
    uncertainties, gains of different set-ups counted)."""
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
