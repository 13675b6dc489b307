"""Points of several runs side by side: levels, their means and scatter, pointwise stiffness."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.curve import Curve, Point
from identification.knee import Samples


@dataclass(frozen=True)
class Level:
    """One force level of one branch over the repetitions that reached it.

    force N, displacement m: means; sd m: standard deviation of the displacement over the n
    repetitions (n - 1; nan for n = 1), the forces being what they were.
    """

    branch: str
    step: int
    force: float
    displacement: float
    sd: float
    n: int


@dataclass(frozen=True)
class Grid:
    """One branch: R repetitions by L levels, levels in the order of measurement; nan: not there.

    force N, displacement m, u_force, u_displacement: (R, L).
    """

    branch: str
    repetitions: tuple[int, ...]
    steps: tuple[int, ...]
    force: Array
    displacement: Array
    u_force: Array
    u_displacement: Array

    @property
    def count(self) -> Array:
        """(L,) repetitions that reached the level."""
        return np.asarray(np.isfinite(self.displacement).sum(axis=0), dtype=np.float64)

    @property
    def scatter(self) -> Array:
        """(L,) standard deviation of the displacement over the repetitions; nan below two."""
        return _sd(self.displacement)

    def levels(self) -> tuple[Level, ...]:
        """The mean curve."""
        force, displacement = _mean(self.force), _mean(self.displacement)
        rows = zip(self.steps, force, displacement, self.scatter, self.count, strict=True)
        return tuple(
            Level(self.branch, step, float(f), float(u), float(sd), int(n))
            for step, f, u, sd, n in rows
        )

    def keep(self, steps: Iterable[int]) -> Grid:
        """The grid of these steps only."""
        wanted = set(steps)
        mask = np.array([s in wanted for s in self.steps], dtype=bool)
        return Grid(
            self.branch,
            self.repetitions,
            tuple(s for s in self.steps if s in wanted),
            self.force[:, mask],
            self.displacement[:, mask],
            self.u_force[:, mask],
            self.u_displacement[:, mask],
        )

    def mean(self) -> LevelTable:
        """All repetitions together."""
        return LevelTable(
            _mean(self.force),
            _mean(self.displacement),
            _mean(self.u_force),
            _mean(self.u_displacement),
            self.scatter,
        )

    def run(self, row: int) -> LevelTable:
        """One repetition, the levels it reached; their scatter is that of all repetitions."""
        there = np.isfinite(self.displacement[row])
        return LevelTable(
            self.force[row, there],
            self.displacement[row, there],
            self.u_force[row, there],
            self.u_displacement[row, there],
            self.scatter[there],
        )


@dataclass(frozen=True)
class LevelTable:
    """Levels as a fit takes them, (n,) each: force N, displacement m, their stated standard
    uncertainties, and the scatter of the displacement over the repetitions (nan: unknown)."""

    force: Array
    displacement: Array
    u_force: Array
    u_displacement: Array
    scatter: Array

    @property
    def size(self) -> int:
        """Number of levels."""
        return self.force.size

    def shifted(self, force: Array | float, displacement: Array | float) -> LevelTable:
        """The same levels with errors (n,) N and m added."""
        return LevelTable(
            self.force + force,
            self.displacement + displacement,
            self.u_force,
            self.u_displacement,
            self.scatter,
        )

    def samples(self, origin: bool) -> Samples:
        """For the search of a knee: counted positive, whatever the sense of the load."""
        sign = 1.0 if self.force.size == 0 or self.force[np.argmax(np.abs(self.force))] > 0 else -1
        force, displacement = sign * self.force, sign * self.displacement
        return Samples(force, displacement, self.u_force, self.u_displacement, origin)


@dataclass(frozen=True)
class PointwiseStiffness:
    """(F_{i+1} - F_i) / (u_{i+1} - u_i) between neighbouring levels, mean over n repetitions.

    force N: middle between the two levels; stiffness, sd (n - 1; nan for n = 1): N/m, nan where
    the displacement did not change.
    """

    force: float
    stiffness: float
    sd: float
    n: int


def grid_of(points: Iterable[Point], branch: str) -> Grid:
    """The points of one branch. A level met twice in a run counts with the mean of both."""
    chosen = [p for p in points if p.branch == branch]
    repetitions = tuple(dict.fromkeys(p.repetition for p in chosen))
    steps = _merged([[p.step for p in chosen if p.repetition == r] for r in repetitions])
    row = {r: i for i, r in enumerate(repetitions)}
    column = {s: i for i, s in enumerate(steps)}
    sums = np.zeros((4, len(repetitions), len(steps)))
    count = np.zeros((len(repetitions), len(steps)))
    for p in chosen:
        at = (row[p.repetition], column[p.step])
        sums[(slice(None), *at)] += (p.force, p.displacement, p.u_force, p.u_displacement)
        count[at] += 1
    with np.errstate(invalid="ignore"):
        means = sums / np.where(count, count, np.nan)
    return Grid(branch, repetitions, steps, *means)


def _merged(sequences: Sequence[list[int]]) -> tuple[int, ...]:
    """Steps in an order that agrees with every run's: as they are numbered, where the numbers of
    every run rise, or those of every run fall; else one that the first run lacks comes behind the
    one that precedes it where it was met."""
    for falling in (False, True):
        if all(sequence == sorted(sequence, reverse=falling) for sequence in sequences):
            # Of two that no run has both, nothing else tells which comes first.
            return tuple(sorted(set().union(*sequences), reverse=falling))
    order: list[int] = []
    known: set[int] = set()
    for sequence in sequences:
        if not known:
            order = list(dict.fromkeys(sequence))
        elif not known.issuperset(sequence):
            at = 0
            for step in sequence:
                if step in known:
                    at = order.index(step) + 1
                elif step not in order[:at]:
                    order.insert(at, step)
                    known.add(step)
                    at += 1
        known.update(sequence)
    return tuple(order)


def pointwise(grid: Grid, *, origin: bool) -> tuple[PointwiseStiffness, ...]:
    """Pointwise stiffness of every repetition, mean and sd. origin: begins at the measured zero.
    Neighbours that no repetition has both are left out."""
    force, displacement = grid.force, grid.displacement
    if origin:
        zero = np.zeros((force.shape[0], 1))
        force, displacement = np.hstack([zero, force]), np.hstack([zero, displacement])
    du = np.diff(displacement, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        each = np.where(du != 0.0, np.diff(force, axis=1) / du, np.nan)
    middle = _mean(0.5 * (force[:, 1:] + force[:, :-1]))
    rows = zip(middle, _mean(each), _sd(each), np.isfinite(each).sum(axis=0), strict=True)
    return tuple(
        PointwiseStiffness(float(f), float(k), float(s), int(n))
        for f, k, s, n in rows
        if np.isfinite(f)
    )


@dataclass(frozen=True)
class Hysteresis:
    """What loading and unloading enclose, mean over the repetitions that have both.

    area J, sd J (n - 1; nan for n = 1); relative: to the work of loading from the measured zero,
    nan for a cycle without one; remaining m: mean
    displacement of the zero-load plateau after the run, nan without one.
    """

    area: float
    sd: float
    relative: float
    remaining: float
    n: int

    @property
    def gives_back(self) -> bool:
        """Whether more work came back than was put in, beyond the scatter of the repetitions."""
        scatter = self.sd / self.n**0.5 if self.n > 1 else 0.0
        return self.area < -_BEYOND * scatter and self.relative < -_LITTLE_WORK


_BEYOND, _LITTLE_WORK = 3.0, 0.1  # standard deviations of the mean; of the work: drifts do less


def hysteresis(curve: Curve, loading: Grid, unloading: Grid) -> Hysteresis | None:
    """Area of the loop in the (u, F) plane (shoelace formula); None without an unloading branch.
    Unloading counts up to the largest load of its own loading: beyond that is no loop."""
    areas, works = [], []
    after = _remaining(curve)
    for row, repetition in enumerate(loading.repetitions):
        if repetition not in unloading.repetitions:
            continue
        up = loading.run(row)
        down = _up_to(up, unloading.run(unloading.repetitions.index(repetition)))
        end = after.get(repetition)
        first, last = ([0.0], [0.0]) if curve.origin else ([], [])
        closing = [end] if end is not None and curve.origin else []
        u = np.concatenate([first, up.displacement, down.displacement, closing])
        f = np.concatenate([last, up.force, down.force, [0.0] * len(closing)])
        areas.append(-0.5 * float(u @ np.roll(f, -1) - f @ np.roll(u, -1)))
        path_u = np.concatenate([first, up.displacement])
        path_f = np.concatenate([last, up.force])
        works.append(float(np.sum(0.5 * (path_f[1:] + path_f[:-1]) * np.diff(path_u))))
    if not areas:
        return None
    sd = float(np.std(areas, ddof=1)) if len(areas) > 1 else float("nan")
    work = float(np.mean(np.abs(works)))
    remaining = float(np.mean(list(after.values()))) if after else float("nan")
    relative = float(np.mean(areas)) / work if work > 0 and curve.origin else float("nan")
    return Hysteresis(float(np.mean(areas)), sd, relative, remaining, len(areas))


_SAME_LOAD = 1.05  # no hand comes back to a level more exactly


def _up_to(up: LevelTable, down: LevelTable) -> LevelTable:
    """The levels of `down` under which `up` went, too."""
    if not up.size:
        return down
    top = float(up.force[np.argmax(np.abs(up.force))])
    mask = down.force * np.sign(top) <= _SAME_LOAD * abs(top)
    return LevelTable(
        down.force[mask],
        down.displacement[mask],
        down.u_force[mask],
        down.u_displacement[mask],
        down.scatter[mask],
    )


def _remaining(curve: Curve) -> dict[int, float]:
    """Displacement of each repetition's last zero-load plateau, if it follows loaded levels."""
    after: dict[int, float] = {}
    loaded: set[int] = set()
    for p in curve.points:
        if p.branch != "zero":
            loaded.add(p.repetition)
        elif p.repetition in loaded:
            after[p.repetition] = p.displacement
    return after


def _mean(values: Array) -> Array:
    """(L,) mean over the rows that are there; nan where none is."""
    there = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(there, values, 0.0).sum(axis=0) / _or_nan(there.sum(axis=0)))


def _sd(values: Array) -> Array:
    there = np.isfinite(values)
    deviations = np.where(there, values - _mean(values), 0.0)
    return np.asarray(np.sqrt((deviations**2).sum(axis=0) / _or_nan(there.sum(axis=0) - 1)))


def _or_nan(count: Array) -> Array:
    return np.where(count > 0, count, np.nan)
