"""The numbers behind the figures of a diagnosis: what was measured, simulated before and after."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.arrays import Array, Ints
from identification.gap.answer.remainder import Remainder, branches
from identification.gap.answer.result import EffectFound, GapResult
from identification.gap.data import BRANCH_NAMES, ZERO
from identification.gap.judging.heldout import HeldOut, stated_prediction
from identification.gap.model.bench import Bench
from rig.units import MM_PER_M

RISING, FALLING = 1, 2
Table = Mapping[str, Sequence[Any] | NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Points:
    """n points in the order of measurement: means of holds; of a running recording, its rows.

    setup, run, repetition (n,): numbers. branch (n,): as `data.BRANCH_NAMES`. sense (n,): 0 at zero
    load, RISING or FALLING; of a running recording, which way the load goes; RISING of cycles that
    are held at levels. session s, force N, displacement mm, as measured. before, after (n,) mm:
    what the simulation predicts of the answering quantity, as stated and with the effects (and
    springs, gains, datum as fitted); measured (n,) mm: that quantity. Where the displacement is
    imposed the answer is the force over the simulated stiffness `stated` (n,) mm/N. noise (n,) mm:
    standard deviation of a point by the instruments.
    """

    setup: Ints
    run: Ints
    repetition: Ints
    branch: Ints
    sense: Ints
    step: Ints
    session: Array
    force: Array
    displacement: Array
    measured: Array
    before: Array
    after: Array
    stated: Array
    noise: Array

    @property
    def gap_before(self) -> Array:
        """(n,) mm: measured minus simulated as stated."""
        return self.measured - self.before

    @property
    def gap_after(self) -> Array:
        """(n,) mm: measured minus simulated with the effects."""
        return self.measured - self.after


@dataclass(frozen=True, eq=False)
class Shown:
    """What figures and tables show of a diagnosis beside its points: no samples.

    setups: (pose, direction) each. imposed: whether the rig drove the displacement; clock: whether
    the session's time was recorded; continuous: a running recording; remembers: the simulation has
    effects, which may go another way in every run. before, after, noise: m rms.
    """

    setups: tuple[tuple[str, str], ...]
    imposed: bool
    clock: bool
    continuous: bool
    remembers: bool
    verdict: str
    probabilities: dict[str, float]
    effects: tuple[EffectFound, ...]
    noise: float
    before: float
    after: float
    held_out: tuple[HeldOut, ...]
    runners_up: dict[str, float]

    def setup_name(self, number: int) -> str:
        """`P1, x`; without an arm, `x`."""
        pose, direction = self.setups[number]
        return f"{pose}, {direction}" if pose else direction

    @property
    def with_what(self) -> str:
        """What stands in the simulation after."""
        if self.effects:
            return "with " + " + ".join(dict.fromkeys(e.name for e in self.effects))
        return "with springs and gains refitted"


def shown(r: GapResult) -> Shown:
    """Of a diagnosis."""
    rows = r.bench.rows
    return Shown(
        setups=tuple((s.pose, s.direction) for s in r.bench.data.setups),
        imposed=r.bench.imposed,
        clock=rows.clock,
        continuous=rows.continuous,
        remembers=r.bench.known is not None,
        verdict=r.verdict,
        probabilities=r.probabilities,
        effects=r.effects,
        noise=r.noise,
        before=r.before,
        after=r.after,
        held_out=r.held_out,
        runners_up=r.runners_up,
    )


def points(r: GapResult) -> Points:
    """The points of a diagnosis."""
    bench, rows = r.bench, r.bench.rows
    number = np.arange(rows.n) if rows.continuous else rows.hold
    weight = np.bincount(number, weights=rows.weight)
    first = np.unique(number, return_index=True)[1]

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(number, weights=rows.weight * values) / weight)

    left = r.engine.target[: rows.n] - r.fit.response
    response = mean(bench.response)
    precision = np.bincount(number, weights=1 / r.engine.sigma[: rows.n] ** 2)
    noise = np.sqrt(1 / precision + bench.noise.hold[first] ** 2)
    return Points(
        setup=rows.setup[first],
        run=rows.run[first],
        repetition=rows.repetition[first],
        branch=rows.branch[first],
        sense=_sense(bench)[first],
        step=rows.step[first],
        session=mean(rows.session),
        force=mean(rows.measured_force),
        displacement=mean(rows.displacement) * MM_PER_M,
        measured=response * MM_PER_M,
        before=mean(stated_prediction(r.engine)) * MM_PER_M,
        after=(response - mean(left)) * MM_PER_M,
        stated=mean(bench.stated_slope) * MM_PER_M,
        noise=noise * MM_PER_M,
    )


def _sense(bench: Bench) -> Ints:
    """(n,) 0 at zero load, RISING or FALLING: the branch; of cycles, the direction of the load."""
    found = branches(bench)
    sense = np.where(found == FALLING, FALLING, RISING)
    return sense if bench.rows.continuous else np.where(bench.rows.zero, ZERO, sense)


def session_clock(p: Points) -> tuple[Array, str]:
    """(n,) time since the first point, and its unit."""
    seconds = p.session - p.session.min()
    span = float(seconds.max())
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if span > 3 * length:
            return seconds / length, unit
    return seconds, "s"


def point_table(r: Shown, p: Points) -> Table:
    """One row per point; lengths in mm."""
    table: dict[str, Sequence[Any] | NDArray[Any]] = {
        "pose": [r.setups[s][0] for s in p.setup],
        "direction": [r.setups[s][1] for s in p.setup],
        "repetition": p.repetition,
        "branch": [BRANCH_NAMES[b] for b in p.branch],
        "step": p.step,
        "session_s": p.session,
        "force_N": p.force,
        "displacement_mm": p.displacement,
    }
    if r.imposed:
        table["simulated_before_N"] = p.before / p.stated
        table["simulated_after_N"] = p.after / p.stated
    else:
        table["simulated_before_mm"] = p.before
        table["simulated_after_mm"] = p.after
    return {
        **table,
        "gap_before_mm": p.gap_before,
        "gap_after_mm": p.gap_after,
        "noise_sd_mm": p.noise,
    }


def remainder_table(r: Shown, m: Remainder) -> Table:
    """One row per level: residual mean, and the posterior of what repeats."""
    return {
        "pose": [r.setups[s][0] for s in m.setup],
        "direction": [r.setups[s][1] for s in m.setup],
        "branch": [BRANCH_NAMES[b] for b in m.branch],
        "load_N": m.load,
        "samples": m.samples,
        "residual_mm": m.residual * MM_PER_M,
        "residual_sd_mm": m.noise * MM_PER_M,
        "remainder_mm": m.mean * MM_PER_M,
        "remainder_sd_mm": m.sd * MM_PER_M,
    }


def held_table(r: Shown) -> Table:
    """Before and after, fitted, per way of withholding, and with other effects instead."""
    nan = float("nan")
    named = " + ".join(dict.fromkeys(e.name for e in r.effects)) or r.verdict
    rows = [("fitted", named, r.before, r.after, nan, nan)]
    rows += [(f"withheld {h.fold}", named, h.before, h.after, *h.ci95) for h in r.held_out]
    if r.held_out:
        main = r.held_out[0]
        rows += [
            (f"withheld {main.fold}", word, main.before, after, nan, nan)
            for word, after in r.runners_up.items()
        ]
    names = (
        "judged_on",
        "explanation",
        "before_rms_mm",
        "after_rms_mm",
        "shrink_ci95_low",
        "shrink_ci95_high",
    )
    table = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
    for key in ("before_rms_mm", "after_rms_mm"):
        table[key] = [v * MM_PER_M for v in table[key]]
    return {**table, "noise_rms_mm": [r.noise * MM_PER_M] * len(rows)}


def write_table(table: Table, comments: Sequence[str], path: Path) -> None:
    """CSV with the comments (banners first) behind `#`; nine digits, nothing for nan."""
    with path.open("w", encoding="utf-8", newline="") as file:
        for line in comments:
            file.write(f"# {line}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        for row in zip(*table.values(), strict=True):
            writer.writerow([_cell(v) for v in row])


def _cell(value: Any) -> Any:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{float(value):.9g}"
    return value
