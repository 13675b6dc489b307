"""Springs and gains that data and a prior make most probable, and whether the two contradict each
other.

Whether they do is asked as Box (1980, J. R. Stat. Soc. A 143) checks a prior against what it
predicts: what the prior adds to the least sum of squares is chi^2 distributed where it holds, with
as many degrees of freedom as the data determine combinations of springs (of a linear model; Evans
and Moshonov 2006 keep this apart from whether the data agree among themselves, which the least sum
of squares without prior tells).

Where it does not hold, the prior is what was stated too sure. One factor common to all springs, as
another unit makes it, is left to the data if it is beyond doubt and makes the rest plausible.
Otherwise the prior's standard deviations are enlarged as Birge (1932) enlarges those of data, by
the moments of DerSimonian and Laird (1986).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.arm import JOINTS
from identification.arrays import Array

_ITERATIONS = 60
_VAGUE = 10.0  # sd of ln c that leaves all to the data: e^10 either way
_BEYOND_DOUBT = 5.0  # standard uncertainties: a common factor moves joints that nobody saw, too
_IMPROBABLE = 0.0027  # three standard deviations of a normal distribution, both sides


@dataclass(frozen=True, eq=False)
class Rows:
    """value = (1 + gain . g) (A x); A (m, 6), value, u (m,), gain (m, 2 setups)."""

    A: Array
    value: Array
    u: Array
    gain: Array


@dataclass(frozen=True, eq=False)
class Normal:
    """Prior of (ln c, gains): centre (6 + 2 setups,) and information, the inverse covariance."""

    centre: Array
    information: Array

    def of_springs(self, information: Array) -> Normal:
        """The same with another information (6, 6) of ln c."""
        whole = self.information.copy()
        whole[:JOINTS, :JOINTS] = information
        return replace(self, information=whole)


@dataclass(frozen=True, eq=False)
class Peak:
    """Most probable parameters, residuals over u (m,), their chi^2, and the whole of what was
    minimised, in which the prior counts too."""

    parameters: Array
    residuals: Array
    chi2: float
    cost: float


@dataclass(frozen=True, eq=False)
class Conflict:
    """Of data and prior. prior: as it is to be taken instead; parameters: most probable then.

    away (6,): ln c less the stated one, in stated standard deviations. log_factor: what is common
    to all ln c, None where nothing is; u_log_factor: its standard uncertainty. enlarged: how many
    times the stated standard deviations the prior has."""

    prior: Normal
    parameters: Array
    away: Array
    log_factor: float | None
    u_log_factor: float
    enlarged: float


def stated_prior(stiffness: Array, relative_sd: Array, sd_gains: Array) -> Normal:
    """stiffness (6,) Nm/rad with relative_sd (6,), of a log-normal distribution; sd_gains (2
    setups,) about 0."""
    sd = np.concatenate([np.sqrt(np.log1p(np.square(relative_sd))), sd_gains])
    centre = np.concatenate([np.log(stiffness), np.zeros(sd_gains.size)])
    return Normal(centre, np.diag(1.0 / np.maximum(sd, 1e-9) ** 2))


def predict(rows: Rows, p: Array) -> Array:
    """(m,) what the parameters make of the rows."""
    return np.asarray((rows.A @ np.exp(-p[:JOINTS])) * (1 + rows.gain @ p[JOINTS:]))


def sensitivity(rows: Rows, p: Array) -> Array:
    """d prediction / d (ln c, gains) over u, (m, 6 + 2 setups)."""
    x = np.exp(-p[:JOINTS])
    scale = 1 + rows.gain @ p[JOINTS:]
    by_joint = -rows.A * x * scale[:, None]
    by_gain = (rows.A @ x)[:, None] * rows.gain
    return np.hstack([by_joint, by_gain]) / rows.u[:, None]


def maximise(rows: Rows, prior: Normal, start: Array | None = None) -> Peak:
    """Gauss-Newton with damping (Levenberg 1944), from the prior's centre unless told otherwise."""
    centre, information = prior.centre, prior.information

    def cost(p: Array) -> float:
        r = (rows.value - predict(rows, p)) / rows.u
        return float(r @ r + (p - centre) @ information @ (p - centre))

    p, damping = (centre if start is None else start).copy(), 1e-3
    best = cost(p)
    for _ in range(_ITERATIONS):
        J = sensitivity(rows, p)
        r = (rows.value - predict(rows, p)) / rows.u
        H = J.T @ J + information
        step = np.linalg.solve(
            H + damping * np.diag(np.diag(H)), J.T @ r - information @ (p - centre)
        )
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
    r = (rows.value - predict(rows, p)) / rows.u
    return Peak(p, r, float(r @ r), cost(p))


def covariance(rows: Rows, prior: Normal, peak: Peak, birge: float = 1.0) -> Array:
    """Of (ln c, gains), from the curvature at the peak (Laplace); birge: factor on all u."""
    J = sensitivity(rows, peak.parameters)
    return np.asarray(np.linalg.inv(J.T @ J / birge**2 + prior.information), dtype=np.float64)


def birge_factor(rows: Rows, prior: Normal, peak: Peak) -> tuple[float, float]:
    """sqrt(chi^2 / dof) where chi^2 is improbably large (3 sigma; Birge 1932), 1 otherwise; and
    dof: rows less the parameters that the data, not the prior, determine (trace of the hat
    matrix)."""
    J = sensitivity(rows, peak.parameters)
    H = J.T @ J
    dof = max(0.0, rows.value.size - float(np.trace(np.linalg.solve(H + prior.information, H))))
    if dof < 1 or peak.chi2 <= dof + 3 * np.sqrt(2 * dof):
        return 1.0, dof
    return float(np.sqrt(peak.chi2 / dof)), dof


def conflict_of(rows: Rows, prior: Normal, peak: Peak) -> Conflict | None:
    """None where the data are what the prior lets one expect. peak: of these rows and this prior.

    What the rows do not explain among themselves counts as their own uncertainty first.
    """
    vague = prior.of_springs(np.eye(JOINTS) / _VAGUE**2)
    alone = maximise(rows, vague, peak.parameters)
    unsure, _ = birge_factor(rows, vague, alone)
    if unsure > 1:
        rows = replace(rows, u=unsure * rows.u)
        peak = maximise(rows, prior, peak.parameters)
        alone = maximise(rows, vague, alone.parameters)
    seen = _determined(rows, vague, alone)
    excess = peak.cost - alone.cost
    if not _improbable(excess, seen):
        return None
    common = _common(rows, prior, alone.cost, max(1.0, seen - 1))
    if common is not None:
        return common
    # E[excess] = seen + (enlarged^2 - 1) * what the data determine against the stated prior
    square = 1 + max(0.0, excess - seen) / _determined(rows, prior, peak)
    wide = prior.of_springs(prior.information[:JOINTS, :JOINTS] / square)
    freed = maximise(rows, wide, peak.parameters).parameters
    return Conflict(wide, freed, _away(freed, prior), None, 0.0, float(np.sqrt(square)))


def _common(rows: Rows, prior: Normal, least: float, dof: float) -> Conflict | None:
    """One factor on all springs, where it is beyond doubt and no more than the plausible is left.
    least: cost without prior."""
    weight = np.diag(prior.information)[:JOINTS]
    shared = prior.of_springs(np.diag(weight) - np.outer(weight, weight) / weight.sum())
    found = maximise(rows, shared, _scaled(rows, prior))
    if _improbable(found.cost - least, dof):
        return None
    mean = np.concatenate([weight / weight.sum(), np.zeros(prior.centre.size - JOINTS)])
    log_factor = float(mean @ (found.parameters - prior.centre))
    # the springs about the factor, and those of the prior about theirs
    u = float(np.sqrt(mean @ covariance(rows, shared, found) @ mean + 1 / weight.sum()))
    if abs(log_factor) < _BEYOND_DOUBT * u:
        return None
    away = _away(found.parameters, prior)
    return Conflict(shared, found.parameters, away, log_factor, u, 1.0)


def _away(p: Array, prior: Normal) -> Array:
    return np.asarray(((p - prior.centre) * np.sqrt(np.diag(prior.information)))[:JOINTS])


def _improbable(excess: float, dof: float) -> bool:
    from scipy.special import chdtri

    return bool(excess > chdtri(dof, _IMPROBABLE))


def _determined(rows: Rows, prior: Normal, peak: Peak) -> float:
    """How many combinations of ln c the data determine better than the prior does."""
    own = np.diag(covariance(rows, prior, peak))[:JOINTS]
    return float(np.sum(1 - own * np.diag(prior.information)[:JOINTS]))


def _scaled(rows: Rows, prior: Normal) -> Array:
    """The prior's centre with all springs scaled as the rows ask for: where to start."""
    predicted = predict(rows, prior.centre) / rows.u
    times = float(predicted @ (rows.value / rows.u) / (predicted @ predicted))
    start = prior.centre.copy()
    start[:JOINTS] -= np.log(times) if times > 0 else 0.0
    return start
