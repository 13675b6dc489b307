"""The runs of a data set, sample by sample, as the evaluation takes them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Flags
from identification.running import first_rows, stretches
from rig.arrays import Array
from rig.units import M_PER_MM


@dataclass(frozen=True)
class Run:
    """Samples of one run in the order of measurement, (n,) each; displacement in m."""

    repetition: int
    time: Array
    branch: NDArray[np.str_]
    step: NDArray[np.int64]
    force: Array
    displacement: Array
    settled: NDArray[np.bool_] | None


def setups(columns: dict[str, NDArray[Any]]) -> Iterator[tuple[tuple[str, str], list[Run]]]:
    """Runs of each pose and direction. Rows may be interleaved; their order within a run stays."""
    used = ~columns["discarded"] if "discarded" in columns else np.ones(_rows(columns), dtype=bool)
    pose, direction, repetition = (columns[n] for n in ("pose", "direction", "repetition"))
    if not used.size:
        return
    starts = first_rows(pose, direction, repetition)
    pieces: dict[tuple[str, str], dict[int, list[int]]] = {}
    for index, at in enumerate(starts):
        setup = (str(pose[at]), str(direction[at]))
        pieces.setdefault(setup, {}).setdefault(int(repetition[at]), []).append(index)
    bounds = np.append(starts, used.size)
    for setup, by_repetition in pieces.items():
        runs = []
        for number, indices in by_repetition.items():
            rows = np.concatenate([np.arange(bounds[i], bounds[i + 1]) for i in indices])
            rows = rows[used[rows]]
            if rows.size:
                runs.append(_run(columns, number, rows))
        if runs:
            yield setup, runs


def of_setup(columns: Mapping[str, NDArray[Any]], pose: str, direction: str) -> Flags:
    """(n,) samples of one pose and direction."""
    return np.asarray((columns["pose"] == pose) & (columns["direction"] == direction))


def left_out(columns: dict[str, NDArray[Any]], rows: Flags) -> dict[str, NDArray[Any]]:
    """The columns with rows (n,) not to be used."""
    if not rows.any():
        return columns
    return columns | {"discarded": columns["discarded"] | rows if "discarded" in columns else rows}


def _rows(columns: dict[str, NDArray[Any]]) -> int:
    return len(columns["force_N"])


def _run(columns: dict[str, NDArray[Any]], repetition: int, rows: NDArray[np.intp]) -> Run:
    time = columns["session_s"] if "session_s" in columns else columns["time_s"]
    settled = columns["settled"][rows] != 0 if "settled" in columns else None
    return Run(
        repetition,
        np.asarray(time[rows], dtype=np.float64),
        columns["branch"][rows],
        np.asarray(columns["step"][rows], dtype=np.int64),
        np.asarray(columns["force_N"][rows], dtype=np.float64),
        np.asarray(columns["displacement_mm"][rows], dtype=np.float64) * M_PER_MM,
        settled,
    )


def blocks(run: Run) -> Iterator[slice]:
    """Neighbouring samples of one branch and step."""
    edges = [*first_rows(run.branch, run.step).tolist(), run.force.size]
    yield from (slice(a, b) for a, b in pairwise(edges))


def ends_of_loading(
    columns: Mapping[str, NDArray[Any]], events: Iterable[Mapping[str, Any]]
) -> Iterator[tuple[int, int, bool]]:
    """Where loading ended at the run's own limit of displacement: the number of samples before that
    moment, the step that was on its way, and whether what was reached is recorded under its number.
    Earlier versions did not; then no row shows how far the arm was pushed."""
    branch, step = columns["branch"], columns["step"]
    for event in events:
        if event["kind"] == "top" and event.get("branch") == "loading":
            at, number = int(event["sample"]), int(event["step"])
            there = at < len(step) and branch[at] == "loading" and step[at] == number
            yield at, number, bool(there)


def said_of_skipped(events: Sequence[Mapping[str, Any]], pose: str, direction: str) -> list[str]:
    """A sentence on every level of a pose and direction that the operator skipped, with the reason;
    without those of repetitions that were measured anew as a whole."""
    said = []
    for at, event in enumerate(events):
        how, _, why = str(event.get("outcome", "")).partition(": ")
        where = event.get("pose"), event.get("direction")
        if event["kind"] != "step_done" or how != "skipped" or where != (pose, direction):
            continue
        row = int(event["sample"]) - 1
        if any(e["kind"] == "discard" and e["first"] <= row <= e["last"] for e in events[at:]):
            continue
        what = str(event["text"]).partition(":")[0]
        reason = f": {why.strip().rstrip('.')}" if why.strip() else ", no reason given"
        said.append(
            f"Skipped by the operator: {what} (step {event['step']}, repetition "
            f"{event['repetition']}){reason}."
        )
    return said


def unseen_ends(
    columns: Mapping[str, NDArray[Any]], events: Iterable[Mapping[str, Any]], used: Flags
) -> Array:
    """(n,) by what share of the last load an end of loading lay beyond it that no sample shows, at
    the first sample in use (used: (n,)) behind it; 0 elsewhere. It lay on the way to another level,
    and is taken in the middle of one as wide as the last."""
    out = np.zeros(len(used))
    run = stretches(*(columns[n] for n in ("pose", "direction", "repetition")))
    for at, _, recorded in ends_of_loading(columns, events):
        level = at - 1
        if recorded or level < 0 or not used[level] or columns["branch"][level] != "loading":
            continue
        mine = np.flatnonzero(used & (run == run[level]))
        other = mine[(mine < at) & (columns["step"][mine] != columns["step"][level])]
        last, before = columns["force_N"][level], columns["force_N"][other[-1]] if other.size else 0
        out[mine[mine >= at][:1]] = 0.5 * (last - before) / last if last else 0.0
    return out


def stitched(columns: Mapping[str, NDArray[Any]]) -> dict[tuple[str, str], tuple[list[int], bool]]:
    """(pose, direction) -> repetitions within which the force was tared anew, and whether there are
    others beside them.

    Earlier versions took up an interrupted repetition where it had stopped. Its force and its
    displacement then have two zeros, and its unloading may have been reached from no load.
    """
    if "segment" not in columns:
        return {}
    used = ~columns["discarded"]
    names = ("pose", "direction", "repetition", "segment")
    rows = zip(*(columns[name][used].tolist() for name in names), strict=True)
    tarings: dict[tuple[str, str], dict[int, int]] = {}
    for pose, direction, repetition, _ in dict.fromkeys(rows):
        of_repetition = tarings.setdefault((str(pose), str(direction)), {})
        of_repetition[repetition] = of_repetition.get(repetition, 0) + 1
    found = {}
    for setup, count in tarings.items():
        torn = [repetition for repetition, n in count.items() if n > 1]
        if torn:
            found[setup] = torn, len(torn) < len(count)
    return found


def of_stitched(
    columns: Mapping[str, NDArray[Any]], found: Mapping[tuple[str, str], tuple[list[int], bool]]
) -> Flags:
    """(n,) samples of stitched repetitions (found: as `stitched` gives them) that there are others
    beside."""
    rows = np.zeros(len(columns["force_N"]), dtype=bool)
    for (pose, direction), (repetitions, others) in found.items():
        if others:
            mine = np.isin(columns["repetition"], repetitions)
            rows |= of_setup(columns, pose, direction) & mine
    return rows


def said_of_stitched(repetitions: list[int], *, others: bool) -> str:
    """The sentence for one pose and direction."""
    *first, last = map(str, repetitions)
    which = f"Repetitions {', '.join(first)} and {last} were" if first else f"Repetition {last} was"
    ending = "left out." if others else "it counts, because there is no other; measure it again."
    return (
        f"{which} interrupted and taken up again midway, with the force tared anew and from no "
        f"load: {ending}"
    )
