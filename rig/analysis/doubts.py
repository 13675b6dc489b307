"""The few facts about a recording that make its numbers doubtful, in sentences.

The intervals of k rest on the scatter between repetitions; what goes wrong in the same way in all
of them leaves them narrow. All facts, doubtful or not, are in the report's chapter on data quality.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rig.analysis.quality import (
    STILL,
    Recorded,
    RunZeros,
    slots_missed,
    unsettled_levels,
    zeros_of,
)
from rig.digits import number
from rig.scale import off_scale

_MOST_MISSED = 0.1  # of the sampling slots


def doubts(dataset: Recorded) -> tuple[str, ...]:
    """One sentence each; none for a recording that went as it should."""
    units = (f"{said}." for said in off_scale(dataset.meta, dataset.columns))
    zeros = zeros_of(dataset)
    pressed = (f"{fact} {_NO_DRIFT}" for fact in tared_under_load(zeros))
    return (*units, *_missed(dataset), *_unsettled(dataset), *pressed, *_zero_moved(zeros))


def doubts_of_effects(dataset: Recorded) -> tuple[str, ...]:
    """The same for a diagnosis, with what it may take such a recording for. Of units it speaks by
    itself, and of what had not settled where the procedure has recorded that."""
    late = any(e["kind"] == "not_settled" for e in dataset.events)
    zeros = zeros_of(dataset)
    found = (
        (missed_slots(dataset), _UNSEEN),
        ("" if late else unsettled(dataset), _STILL_MOVED),
        *((fact, _PRESSED) for fact in tared_under_load(zeros)),
        (zero_moved(zeros), _DRIFTED),
    )
    return tuple(f"{fact} {meaning}" for fact, meaning in found if fact)


_UNSEEN = (
    "A load that went beyond its level and came back unseen leaves what looks like lost motion, "
    "friction or a joint that gave way."
)
_STILL_MOVED = "What still moved may look like a drift, a swing or creep."
_PRESSED = "Its levels are off by that: an effect that it alone shows is none of the rig."
_DRIFTED = (
    "An amplifier that drifts, or was zeroed under load, shifts every level: look for what did it "
    "before you believe in an effect of the rig."
)
_NO_DRIFT = (
    "A straight line over time is taken off the force, but this was no drift: its levels and k are "
    "wrong. Measure it again, with the screw clear of the arm when it is tared."
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


def tared_under_load(zeros: Iterable[RunZeros]) -> Iterator[str]:
    """One sentence a repetition: what stands in its levels is no drift."""
    for run in zeros:
        if run.under_load:
            first, last = run.plateaus[0], run.plateaus[-1]
            where = " ".join(filter(None, (run.pose, run.direction)))
            yield (
                f"Repetition {run.repetition} ({where}) seems to have been tared while the screw "
                "still pressed: unloaded, force and displacement stood "
                f"{number(abs(last.force - first.force), 3)} N and "
                f"{number(abs(last.displacement - first.displacement), 3)} mm below their zeros, "
                "in the ratio of the loading curve."
            )


def zero_moved(zeros: Iterable[RunZeros]) -> str:
    """Of the run in which the force at zero load moved most, in relation to what it measured."""
    runs = [r for r in zeros if r.change_N is not None and r.span_N > 0 and not r.under_load]
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


def _zero_moved(zeros: Iterable[RunZeros]) -> Iterator[str]:
    if fact := zero_moved(zeros):
        yield (
            f"{fact} A straight line over time is taken off; what did not drift evenly stays in "
            "the levels. Reset the amplifier before each run, and look for what makes it drift."
        )
