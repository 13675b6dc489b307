"""Withheld data: parameters fitted without a fold, judged on the fold.

Folds are whole repetitions (many of them in groups), directions or poses; of a single run, blocks
of time. The first repetition of a setup is never withheld: where something slipped or yielded in it
for good, the later ones do not show what happened, and the datum is set in it. The zero-load rows
of a withheld run stay in: they carry its datum (of the laser, and of a drift), which no model can
know; as do the forces that it was pushed across with. The datum of a withheld direction, of a laser
that is zeroed before each run, or of a run that was never read without load is taken from its own
mean: what is left after is less that, as no model knows it. Before is the simulation as given.
Holds that tell themselves that the load went beyond them before (`search.overshoots`) are not
judged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array, Flags, Ints
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import Explanation
from identification.gap.explanations.fit import fit
from identification.gap.model.bench import Bench
from identification.gap.model.variants import block
from identification.uncertainty import coverage_factor

BLOCKS = 5
GROUPS = 10  # of repetitions at most: 200 one by one took ten times as long
ALWAYS_IN = -1  # number of the fold of rows that are never withheld


@dataclass(frozen=True, eq=False)
class HeldOut:
    """fold: what was withheld in turn; rms m before and after; shrink factor with ci95, whose ends
    are one number where too few blocks tell how far it may be off. own_datum: what is left after is
    less the mean of each setup, or run, that was withheld as a whole."""

    fold: str
    before: float
    after: float
    ci95: tuple[float, float]
    own_datum: bool = False

    @property
    def shrink(self) -> float:
        """before / after."""
        return self.before / self.after if self.after > 0 else 1.0


def folds(engine: Engine) -> dict[str, Ints]:
    """Name -> number of the fold of every row (n,), for all ways of withholding these data."""
    rows, data = engine.bench.rows, engine.bench.data
    directions = list(dict.fromkeys(s.direction for s in data.setups))
    poses = list(dict.fromkeys(s.pose for s in data.setups))
    out = {}
    if len(np.unique(rows.repetition)) > 1:
        later = _later(rows.setup, rows.repetition)
        if np.any(later != ALWAYS_IN):  # else no setup was measured twice
            out["repetition"] = later
    if len(directions) > 1:
        of = np.array([directions.index(s.direction) for s in data.setups])
        out["direction"] = of[rows.setup]
    if len(poses) > 1:
        of = np.array([poses.index(s.pose) for s in data.setups])
        out["pose"] = of[rows.setup]
    if "repetition" not in out and rows.n >= 4 * BLOCKS:
        out["block"] = (np.arange(rows.n) * BLOCKS // rows.n).astype(np.int64)
    return out


def _later(setup: Ints, repetition: Ints) -> Ints:
    """Number of the fold of every row, ALWAYS_IN for the first repetition of its setup: repetitions
    one by one; where there are many, in groups, the n-th of every setup in one, each from all over
    the measurement."""
    first = np.array([repetition[setup == s].min() for s in range(int(setup.max()) + 1)])
    number = np.unique(repetition, return_inverse=True)[1].astype(np.int64)
    later = repetition != first[setup]
    if len(np.unique(number[later])) > GROUPS:
        for s in np.unique(setup):
            mine = setup == s
            place = np.unique(repetition[mine], return_inverse=True)[1].astype(np.int64)
            number[mine] = (place - 1) % GROUPS
    return np.where(later, number, ALWAYS_IN)


def held_out(
    engine: Engine,
    explanation: Explanation,
    name: str,
    fold: Ints,
    loose: frozenset[str] = frozenset(),
) -> HeldOut:
    """Judges an explanation on every fold in turn. loose: words that no fold foretells of another:
    what they may do within a fold is told by that fold itself."""
    bench, n = engine.bench, engine.bench.rows.n
    after, scatter = np.zeros(n), np.zeros(n)
    judged = ~bench.rows.zero & ~bench.rows.gone_beyond & (fold != ALWAYS_IN)
    within = judged & _within(bench)
    if name == "repetition" and within.any():
        judged = within
    group, own_datum = _own_datum(bench), False
    for f in np.unique(fold[fold != ALWAYS_IN]):
        test = (fold == f) & judged
        if not test.any():
            continue
        out = fold == f
        fitted = fit(engine, explanation, _stacked_keep(engine, out))
        left = engine.target[:n] - fitted.response
        left[out] -= _told(engine, [p for p in explanation.parts if p.word in loose], left, out)
        whole = _whole(group, out) & test
        own_datum |= bool(whole.any())
        scatter[test] = bench.scatter_about(bench.response - left)[test]
        after[test] = _less_datum(group, left, whole)[test]
    stated = stated_prediction(engine)
    before = np.sqrt((bench.response - stated) ** 2 + bench.scatter_about(stated))
    after = np.sqrt(after**2 + scatter)
    blocks = bench.rows.run if len(np.unique(bench.rows.run)) > 2 else fold
    return HeldOut(
        name,
        _rms(before[judged], bench.rows.weight[judged]),
        _rms(after[judged], bench.rows.weight[judged]),
        _interval(
            before[judged],
            after[judged],
            blocks[judged],
            bench.rows.setup[judged],
            bench.rows.weight[judged],
        ),
        own_datum,
    )


def _told(engine: Engine, parts: list[Part], left: Array, rows: Flags) -> Array:
    """(k,) most probable share of parts in what is left (n,) of some rows."""
    if not parts:
        return np.zeros(int(rows.sum()))
    noise = engine.bench.noise
    white = 1 / np.sqrt(noise.response**2 + noise.hold**2 + noise.run**2)[rows]
    columns = engine.responses(c for p in parts for c in p.variant.columns)[rows]
    does = white[:, None] * (columns @ block([p.root for p in parts]))
    w = np.linalg.solve(does.T @ does + np.eye(does.shape[1]), does.T @ (white * left[rows]))
    return np.asarray(does @ w / white)


def stated_prediction(engine: Engine) -> Array:
    """(n,) response that the simulation as stated predicts."""
    bench = engine.bench
    return simulated_line(bench) + (
        0.0 if bench.known is None else bench.known.does[: bench.rows.n]
    )


def simulated_line(bench: Bench) -> Array:
    """(n,) m the response that was simulated: by a spring, or by another simulator."""
    return bench.stated_slope * bench.load if bench.simulated is None else bench.simulated


def _stacked_keep(engine: Engine, out: Flags) -> Flags:
    """Stacked rows to fit on: not the fold, but its zero-load rows, and the forces across that it
    was loaded with: like the load itself they are given, the motion is foretold."""
    row = ~out | engine.bench.rows.zero
    return engine.bench.layout.read_in(row, row[engine.bench.rows.edges])


def first_repetitions(engine: Engine) -> Flags | None:
    """(n,) rows that no fold of repetitions withholds; None where no setup was measured twice."""
    fold = folds(engine).get("repetition")
    return None if fold is None else np.asarray(fold == ALWAYS_IN)


def _within(bench: Bench) -> Flags:
    """(n,) rows with a load that other repetitions of the setup have reached: a law that was found
    below may bend beyond."""
    rows, out = bench.rows, np.ones(bench.rows.n, dtype=bool)
    margin = _MARGIN * float(np.ptp(bench.load))
    for run in np.unique(rows.run):
        mine = rows.run == run
        others = bench.load[(rows.setup == rows.setup[mine][0]) & ~mine]
        if others.size:
            load = bench.load[mine]
            out[mine] = (load >= others.min() - margin) & (load <= others.max() + margin)
    return out


_MARGIN = 0.02  # of the range of load


def _own_datum(bench: Bench) -> Ints:
    """(n,) groups of rows that, withheld as a whole, take their datum with them: setups, or runs
    where each has a datum of its own or was never read without load."""
    rows = bench.rows
    zeros = np.bincount(rows.run, weights=rows.zero)
    alone = (zeros[rows.run] == 0) | (bench.data.datum == "repetition")
    return np.where(alone, rows.run + int(rows.setup.max()) + 1, rows.setup)


def _whole(group: Ints, out: Flags) -> Flags:
    """(n,) rows of groups that are withheld as a whole."""
    inside = np.bincount(group, weights=~out)
    return np.asarray(inside[group] == 0)


def _less_datum(group: Ints, values: Array, rows: Flags) -> Array:
    """Values less their mean per group over `rows`, where a group was withheld as a whole."""
    out = values.copy()
    for g in np.unique(group[rows]):
        mine = rows & (group == g)
        out[mine] -= values[mine].mean()
    return out


def _rms(values: Array, weight: Array) -> float:
    return float(np.sqrt(weight @ values**2 / weight.sum())) if weight.size else 0.0


def _interval(
    before: Array, after: Array, blocks: Ints, setup: Ints, weight: Array
) -> tuple[float, float]:
    """95 % interval of the ratio from the scatter of its parts between the blocks of one setup
    (runs, or blocks of time): linearised log ratio, Student's t. So few blocks can't be
    bootstrapped, and blocks of different setups are no draws of one kind."""
    _, number = np.unique(blocks, return_inverse=True)
    of = setup[np.unique(number, return_index=True)[1]]
    a = np.bincount(number, weights=weight * before**2)
    b = np.bincount(number, weights=weight * after**2)
    ratio = float(np.sqrt(a.sum() / max(float(b.sum()), 1e-300)))
    part = 0.5 * (a / max(float(a.sum()), 1e-300) - b / max(float(b.sum()), 1e-300))
    variance, freedom = 0.0, 0
    for s in np.unique(of):
        mine = part[of == s]
        if len(mine) > 1:
            variance += len(mine) * float(mine.var(ddof=1))
            freedom += len(mine) - 1
    if not freedom:  # one run alone: blocks of its time
        if len(blocks) < 2 * BLOCKS:
            return ratio, ratio
        pieces = (np.arange(len(blocks)) * BLOCKS // len(blocks)).astype(np.int64)
        return _interval(before, after, pieces, np.zeros_like(setup), weight)
    half = coverage_factor(freedom) * variance**0.5
    return ratio * float(np.exp(-half)), ratio * float(np.exp(min(half, 700.0)))
