"""One channel lags the other: shows where the load changes, at the first samples of a hold.

Pure delay of the laser, `u(t) = u_0(t - d)`, or of the force; or a first-order filter of either.
Lags of filters, averaging and transmission: 0.05 to 10 s.

Size: 0.05 to 10 s; 0.6 to 12 times the sampling interval here.
Prior: coefficient positive, 1 is the lag itself; lags, channels and kinds equally likely.
Source: averaging and filter settings of amplifiers and laser sensors.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.gap.bench import Bench
from identification.gap.data import Array
from identification.gap.history import delayed, half_sample, rests, retarded
from identification.gap.variants import Variant, variant

WORD = "time_lag"
LAGS = (0.3, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 4.0, 7.0, 12.0)  # of the time between two samples


def variants(bench: Bench) -> list[Variant]:
    """Lags of laser or force, as delays and as filters; coefficient 1 is the lag itself."""
    sample = 2 * half_sample(bench.rows) if not bench.rows.continuous else _typical_step(bench)
    out = []
    rest, line = rests(bench.rows), bench.line
    for multiple in LAGS:
        lag = multiple * sample
        late = delayed(line, lag, bench.rows) - line
        slow = retarded(line[:, None], np.array([lag]), bench.rows, rest)[:, 0] - line
        for kind, change in (("delay", late), ("filter", slow)):
            if not np.any(change):
                continue
            info: dict[str, Any] = {"lag_s": lag, "kind": kind}
            stiff = np.where(bench.slope > 0, change / bench.slope, 0.0)
            laser = bench.add(bench.stacked(bench.sense * change))
            force = bench.add(bench.force_column(-bench.sense * stiff))
            for channel, column in (("displacement", laser), ("force", force)):
                out.append(
                    variant(WORD, f"{channel} {kind} {lag:.3g} s", [column], (0.5, 1.0),
                            channel=channel, **info)
                )  # fmt: skip
    return out


def _typical_step(bench: Bench) -> float:
    step: Array = np.diff(bench.rows.time)
    return float(np.median(step[step > 0])) if np.any(step > 0) else 1.0
