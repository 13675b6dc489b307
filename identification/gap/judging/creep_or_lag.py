"""Creep that is but a lag.

Of a rig without an arm that is driven fast, the noise of the driven force stands in the line of its
spring. Creep that is over soon, beside a spring that is far stiffer than stated, makes up for all
of that line: it shows the whole response late and without that noise, as a lag does that keeps the
line as it was read. But what creeps gives way at once by what was stated, and then by more. Where
nothing of the spring that was stated is left, and a lag alone leaves no more than the noise, it is
the lag.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.gap.evidence.engine import Engine
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.explanations.verdict import AS_STATED

_CREEP, _LAG = "joint_creep", "time_lag"


def but_lags(engine: Engine, ranked: Sequence[Explanation]) -> list[Explanation]:
    """Of explanations of a rig without an arm, the best first, those by a creep that is but a lag,
    as far as they are likelier than the lag."""
    noise = engine.bench.noise.stated
    lag = next((e for e in ranked if e.words == {_LAG} and e.adequate and e.eta <= noise), None)
    if lag is None:
        return []
    creeps = (e for e in ranked if _CREEP in e.words and _LAG not in e.words)
    likelier = (e for e in creeps if e.log_weight > lag.log_weight)
    return [e for e in likelier if _stiffer(engine, e) > AS_STATED]


def _stiffer(engine: Engine, explanation: Explanation) -> float:
    """By how many standard deviations springs come out stiffer than stated at most."""
    base, found = engine.base, fit(engine, explanation).base
    where = list(base.springs.values())
    off = -found[where] / base.sd[where] / np.maximum(1 + found[where], _NEARLY_NONE)
    return float(off.max(initial=0.0))


_NEARLY_NONE = 0.05  # of a compliance
