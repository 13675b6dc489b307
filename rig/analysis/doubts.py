"""The few facts about a recording that make its numbers doubtful, in sentences.

The intervals of k rest on the scatter between repetitions; what goes wrong in the same way in all
of them leaves them narrow. All facts, doubtful or not, are in the report's chapter on data quality.
"""

from __future__ import annotations

from collections.abc import Iterator

from rig.analysis.quality import STILL, Recorded, slots_missed, unsettled_levels, zeros_of
from rig.digits import number
from rig.scale import off_scale

_MOST_MISSED = 0.1  # of the sampling slots


def doubts(dataset: Recorded) -> tuple[str, ...]:
    """One sentence each; none for a recording that went as it should."""
    units = (f"{said}." for said in off_scale(dataset.meta, dataset.columns))
    return (*units, *_missed(dataset), *_unsettled(dataset), *_zero_moved(dataset))


def _missed(dataset: Recorded) -> Iterator[str]:
    missed = slots_missed(dataset)
    rows = len(dataset.columns["force_N"])
    if missed and missed > _MOST_MISSED * (rows + missed):
        yield (
            f"{100 * missed / (rows + missed):.0f} % of the sampling slots were missed ({missed} "
            f"of {rows + missed}): the program was held up. Force and limits were seen late, and "
            "levels may be overshot. Measure again on a machine that keeps up (an emulated "
            "station: with a lower --speed)."
        )


def _unsettled(dataset: Recorded) -> Iterator[str]:
    found = unsettled_levels(dataset)
    if found is not None and found[0]:
        count, held = found
        yield (
            f"{count} of {held} levels had not settled when they were sampled: force or "
            "displacement still moved, and k depends on how long was waited. Give `settle` of the "
            "protocol a longer deadline_s, or wider bands if that motion is of no concern."
        )


def _zero_moved(dataset: Recorded) -> Iterator[str]:
    """Of the run in which the force at zero load moved most, in relation to what it measured."""
    runs = [r for r in zeros_of(dataset) if r.change_N is not None and r.span_N > 0]
    worst = max(runs, key=lambda r: abs(r.change_N or 0.0) / r.span_N, default=None)
    if worst is None or worst.change_N is None:
        return
    share = abs(worst.change_N) / worst.span_N
    if share > STILL:
        where = " ".join(filter(None, (worst.pose, worst.direction)))
        yield (
            f"The force at zero load moved by {number(abs(worst.change_N), 3)} N within a run "
            f"({where}, repetition {worst.repetition}), {100 * share:.0f} % of the range of force "
            "there. A straight line over time is taken off; what did not drift evenly stays in "
            "the levels. Reset the amplifier before each run, and look for what makes it drift."
        )
