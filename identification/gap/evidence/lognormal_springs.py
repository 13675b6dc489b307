"""Lognormal prior of an arm's stated stiffnesses.

All else is linear in the compliances, and so are the columns of the springs; the evidence counts
them as normal in the compliance. That is the same for small changes, but half a stiffness that is
known to a fifth is 5 standard deviations then, and one and a half times as much 1.7. What is stated
of a positive number is taken as lognormal, for stiffness and compliance alike: 3.5 and 2. The
evidence is corrected by the ratio of the two integrals over the springs alone, all else integrated
out: the one exact, the other in the logarithms of the springs by Laplace's method (Tierney and
Kadane, J. Am. Stat. Assoc. 81 (1986) 82-86), which is exact for springs that the data say nothing
of.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.factor import factor_of
from identification.gap.evidence.parts import Part, log_joint_between
from identification.gap.model.variants import block

_LEAST = 0.05  # of the stated compliance, where the search begins
_MOST = 10.0  # nats by which a spring may be off
_TURNS, _THERE = 30, 1e-6  # steps at most; nats


def lognormal_prior_correction(engine: Engine, parts: Sequence[Part], level: int) -> float:
    """Nats to add to the evidence of parts at a level; 0 for a rig without an arm, of which laws
    bring a stiffness of their own."""
    springs = list(engine.base.springs.values())
    if not engine.bench.data.arm or not springs:
        return 0.0
    columns = [c for p in parts for c in p.variant.columns]
    mean, covariance = engine.of_base(springs, columns, block([p.root for p in parts]), level)
    return log_ratio(mean, covariance, engine.base.sd[springs])


def stated_between(engine: Engine, eta: float) -> float:
    """log evidence of springs as they are stated, for an imperfection (m) that is none of the
    levels."""
    springs = list(engine.base.springs.values())
    evidence = log_joint_between(engine, (), eta)
    if not engine.bench.data.arm or not springs:
        return evidence
    return evidence + log_ratio(*engine.of_base_between(springs, eta), engine.base.sd[springs])


def log_ratio(mean: Array, covariance: Array, sd: Array) -> float:
    """log of the evidence under a prior that is lognormal, over that under one that is normal in
    the compliance.

    mean (m,), covariance (m, m): posterior of relative changes of the compliance under the latter;
    sd (m,): relative, of both priors.
    """
    precision = np.asarray(np.linalg.inv(covariance / np.outer(sd, sd)))
    asked = precision @ (mean / sd)
    width = nats_of(sd)
    springs = _Springs(sd, width, precision - np.eye(len(sd)), asked)
    u = np.log(np.maximum(1 + mean, _LEAST)) / width
    here, most = springs.at(u), _MOST / width
    for _ in range(_TURNS):
        further, there = u, here
        for share in _SHARES:
            further = np.clip(u - share * here.step, -most, most)
            there = springs.at(further)
            if there.value <= here.value:
                break
        gained, u, here = here.value - there.value, further, there
        if gained < _THERE:
            break
    size = np.log(np.diag(factor_of(here.curved)) / np.diag(factor_of(precision))).sum()
    return float(-0.5 * (asked @ (mean / sd)) - here.value - size)


def nats_of(sd: Array) -> Array:
    """Standard deviations of the logarithm of what is lognormal with relative ones (m,)."""
    return np.asarray(np.sqrt(np.log1p(sd**2)))


_SHARES = (1.0, 0.5, 0.25, 0.1, 0.01)  # of a step


class _At(NamedTuple):
    """-log of prior and likelihood, Newton's step (m,) from there, and the second derivatives
    (m, m) that it was made with."""

    value: float
    step: Array
    curved: Array


class _Springs(NamedTuple):
    """sd (m,): relative prior sd of the compliances; width (m,): sd of their logarithms. The
    likelihood of x = change / sd: told (m, m), its precision; asked (m,), that precision times its
    mode."""

    sd: Array
    width: Array
    told: Array
    asked: Array

    def at(self, u: Array) -> _At:
        """Of compliances whose logarithm is u (m,) standard deviations off."""
        softer = np.exp(self.width * u)
        change = (softer - 1) / self.sd
        first, second = softer * self.width / self.sd, softer * self.width**2 / self.sd
        left = self.told @ change - self.asked
        value = 0.5 * float(u @ u) + 0.5 * float(change @ (left - self.asked))
        curved = np.eye(len(u)) + first[:, None] * self.told * first
        # where that is no longer convex, without what bends the parameters (Gauss-Newton)
        bent = curved + np.diag(second * left)
        curved = bent if np.linalg.eigvalsh(bent)[0] > _CONVEX else curved
        return _At(value, np.asarray(np.linalg.solve(curved, u + first * left)), curved)


_CONVEX = 0.1
