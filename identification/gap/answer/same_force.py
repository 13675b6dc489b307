"""Steps of a load that the force does not show."""

from __future__ import annotations

import numpy as np

from identification.gap.answer.notes import FAULT, Note
from identification.gap.model.bench import Bench

_STEPS = 3  # a load that is held while something creeps has one, or is let go and has two
_SCATTERS, _MOVES = 1.5, 10.0  # times what is stated: a force that stands still; what does not


def same_force(bench: Bench) -> tuple[Note, ...]:
    """A note where the force reads the same at all steps of the load, and something moves."""
    data = bench.data
    meter, steps = data.instruments, np.unique(data.step[data.step > 0])
    force, way = float(np.median(data.force)), float(np.ptp(data.displacement))
    if len(steps) < _STEPS or not np.ptp(data.force) > 0 or not way > _MOVES * meter.displacement:
        return ()
    if data.force.std() > _SCATTERS * meter.force:
        return ()
    text = (
        f"The force reads {force:.4g} N at all {len(steps)} steps, as nearly as it is uncertain "
        f"({meter.force:.2g} N), while the target moves {1e3 * way:.3g} mm: nothing was loaded, or "
        "the force sensor is not connected, or stuck. Until that is clear believe no verdict."
    )
    return (Note(FAULT, text),)
