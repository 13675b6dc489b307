"""Noise of the channels: measured within holds where there are enough samples, stated elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.gap.data import Array, GapData
from identification.gap.rows import Rows, hold_ids

ENCODER_RAD = 1e-5  # resolution and jitter of a joint reading, where holds can't tell
ENCODER_OFFSET_RAD = 4e-5  # repeatability of the arm, 0.05 mm at 1.3 m: q against command
# The stated uncertainty of one sample includes what is common to a hold (vibration, linearity) and
# to a run (datum); a third of it each leaves nine tenths for the single sample.
HOLD_SHARE = 0.2
RUN_SHARE = 0.33
_ENOUGH = 30  # second differences: then their scatter is known to about an eighth


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations. response (n,) m and q (m,), of a row of weight w divided by sqrt(w)
    already in `response`; hold, run: common to a hold, a run, m; force N of one sample; stated m."""

    response: Array
    q: Array
    force: float
    hold: float
    run: float
    stated: float


def estimate_noise(data: GapData, rows: Rows, slope: Array, imposed: bool) -> Noise:
    """Noise of the rows; slope (n,) m/N turns noise of the force into that of the response."""
    meter = data.instruments
    fallback = np.hypot(meter.displacement, slope * meter.force)
    hold = hold_ids(data)
    per_sample = fallback
    if not rows.continuous:
        typical = float(np.median(slope))
        compensated = data.displacement - typical * data.force
        measured = _scatter(compensated, hold)
        if measured is not None:
            # never less than digits and a third of what is stated: holds can't see everything
            floor = 0.33 * meter.displacement
            per_sample = np.full(rows.n, max(measured, floor))
    weight = np.ones(rows.n) if rows.continuous else rows.weight
    q = np.full(data.joints, ENCODER_RAD)
    if data.q is not None and not rows.continuous:
        for j in range(data.joints):
            found = _scatter(data.q[:, j], hold)
            q[j] = max(found or ENCODER_RAD, 1e-7)
    stated = float(np.median(fallback)) if imposed else meter.displacement
    return Noise(
        response=per_sample / np.sqrt(weight), q=q, force=meter.force,
        hold=HOLD_SHARE * stated, run=RUN_SHARE * stated, stated=stated,
    )  # fmt: skip


def _scatter(values: Array, hold: Array) -> float | None:
    """Standard deviation of the white part, from second differences within holds, the first
    sample left out (it may lag); trimmed at 5 %, corrected for that (normal noise: 0.8713)."""
    second = values[3:] - 2 * values[2:-1] + values[1:-2] if len(values) > 3 else np.zeros(0)
    same = (hold[3:] == hold[:-3]) if len(values) > 3 else np.zeros(0, dtype=bool)
    squares = np.sort((second[same]) ** 2)
    if squares.size < _ENOUGH:
        return None
    kept = squares[: int(0.95 * squares.size)]
    return float(np.sqrt(kept.mean() / 6.0) / 0.8713)
