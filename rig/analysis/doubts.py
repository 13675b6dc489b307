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


def doubts_of_effects(dataset: Recorded) -> tuple[str, ...]:
    """The same for a diagnosis, with what it may take such a recording for. Of units it speaks by
    itself, and of what had not settled where the procedure has recorded that."""
    late = any(e["kind"] == "not_settled" for e in dataset.events)
    found = (
        (missed_slots(dataset), _UNSEEN),
        ("" if late else unsettled(dataset), _STILL_MOVED),
        (zero_moved(dataset), _DRIFTED),
    )
    return tuple(f"{fact} {meaning}" for fact, meaning in found if fact)


_UNSEEN = (
    "A load that went beyond its level and came back unseen leaves what looks like lost motion, "
    "friction or a joint that gave way."
)
_STILL_MOVED = "What still moved may look like a drift, a swing or creep."
_DRIFTED = (
    "An amplifier that drifts, or was zeroed under load, shifts every level: look for what did it "
    "before you believe in an effect of the rig."
)


def missed_slots(dataset: Recorded) -> str:
    """What was missed; empty for what is of no concern, as in all that follow."""
    missed = slots_missed(dataset)
    rows = len(dataset.columns["force_N"])
    if not missed or missed <= _MOST_MISSED * (rows + missed):
        return ""
    return (
        f"{100 * missed / (rows + missed):.0f} % of the sampling slots were missed ({missed} "
        f"of {rows + missed}): the program was held up. Force and limits were seen late, and "
        "levels may be overshot."
    )


def _missed(dataset: Recorded) -> Iterator[str]:
    if fact := missed_slots(dataset):
        yield (
            f"{fact} Measure again on a machine that keeps up (an emulated station: with a lower "
            "--speed)."
        )


def unsettled(dataset: Recorded) -> str:
    """Levels that were sampled too early."""
    found = unsettled_levels(dataset)
    if found is None or not found[0]:
        return ""
    return f"{found[0]} of {found[1]} levels had not settled when they were sampled."


def _unsettled(dataset: Recorded) -> Iterator[str]:
    if fact := unsettled(dataset):
        yield (
            f"{fact.removesuffix('.')}: force or displacement still moved, and k depends on how "
            "long was waited. Give `settle` of the protocol a longer deadline_s, or wider bands if "
            "that motion is of no concern."
        )


def zero_moved(dataset: Recorded) -> str:
    """Of the run in which the force at zero load moved most, in relation to what it measured."""
    runs = [r for r in zeros_of(dataset) if r.change_N is not None and r.span_N > 0]
    worst = max(runs, key=lambda r: abs(r.change_N or 0.0) / r.span_N, default=None)
    if worst is None or worst.change_N is None:
        return ""
    share = abs(worst.change_N) / worst.span_N
    if share <= STILL:
        return ""
    where = " ".join(filter(None, (worst.pose, worst.direction)))
    return (
        f"The force at zero load moved by {number(abs(worst.change_N), 3)} N within a run "
        f"({where}, repetition {worst.repetition}), {100 * share:.0f} % of the range of force "
        "there."
    )


def _zero_moved(dataset: Recorded) -> Iterator[str]:
    if fact := zero_moved(dataset):
        yield (
            f"{fact} A straight line over time is taken off; what did not drift evenly stays in "
            "the levels. Reset the amplifier before each run, and look for what makes it drift."
        )
