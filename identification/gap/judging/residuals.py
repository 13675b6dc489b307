"""What a fit leaves, and what of it is beyond the noise of the channels."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.fit import Fit
from identification.gap.judging.unread_ramps import unread_ramp_error
from identification.gap.model.bench import Bench


def noise_rms(bench: Bench) -> float:
    """rms that the instruments alone would leave in single samples, m."""
    noise, weight = bench.noise, bench.rows.weight
    count = np.ones(bench.rows.n) if bench.rows.continuous else weight
    square = noise.response**2 * count + noise.hold**2 + noise.run**2
    return float(np.sqrt(weight @ square / weight.sum()))


def residual_rms(engine: Engine, fitted: Fit) -> float:
    """rms (m) over samples that a fit leaves."""
    return sample_rms(engine.bench, fitted.whole(engine))


def sample_rms(bench: Bench, predicted: Array) -> float:
    """rms (m) over samples by which the response misses what was predicted of the rows (n,): that
    of the rows, and of the samples within them."""
    weight, left = bench.rows.weight, bench.response - predicted
    return float(np.sqrt(weight @ (left**2 + bench.scatter_about(predicted)) / weight.sum()))


def excess_response_rms(engine: Engine, fitted: Fit) -> float:
    """rms (m) of rows beyond their noise; what runs are off by together, the fit has taken."""
    bench, n = engine.bench, engine.bench.rows.n
    weight, noise = bench.rows.weight / bench.rows.weight.sum(), bench.noise
    missed = engine.target[:n] - fitted.response
    known = noise.response**2 + noise.hold**2 + unread_ramp_error(engine, fitted) ** 2
    square = weight @ (missed**2 - known)
    return float(np.sqrt(max(float(square), 0.0)))


PLAINLY = 3.0  # times the noise of the readings, which is known to a fifth


def excess_joint_reading_rms(engine: Engine, fitted: Fit) -> float:
    """rms (m) by which the target would be elsewhere, plainly beyond noise, were the joints where
    they were read and not where a fit has them; 0 without readings. However well it meets the
    displacement: what a joint was seen to do, no mounting did."""
    bench, rows = engine.bench, engine.bench.rows
    if not bench.has_q:
        return 0.0
    missed, noise = fitted.missed_readings(engine)
    lever = bench.lever[rows.edges].T  # (m, holds)
    moved = np.sum(lever * missed, axis=0)
    weight = rows.hold_weight[rows.edges] / rows.hold_weight[rows.edges].sum()
    square = weight @ (moved**2 - np.sum((lever * PLAINLY * noise) ** 2, axis=0))
    return float(np.sqrt(max(float(square), 0.0)))
