"""Whether levels have a stiffness at all, and how well one number describes them; in sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from identification.arrays import Array
from identification.levels import Grid, LevelTable, PointwiseStiffness

Status = Literal["ok", "doubtful", "undefined"]
BENT = 0.2  # change of the stiffness along a curve that is worth a word
STRAIGHT = 0.8  # share of the displacement's variance below which a line is a poor description
BY_CHANCE = 1e-3  # of calling a straight curve bent
_SAME_SHARE = 0.1  # of the stated gain: less is not worth a word
SIGNIFICANT = 3.0  # slope over its standard deviation, where the force is within its noise


def undefined(table: LevelTable, through_origin: bool) -> str:
    """Why these levels have no stiffness, as a sentence; empty if they have one."""
    start = "The stiffness is undefined: "
    if table.size == 0:
        return start + "there are no loaded levels."
    if table.size == 1 and not through_origin:
        return start + "there is one level only, and no measured origin to draw a line from."
    force = np.append(table.force, 0.0) if through_origin else table.force
    displacement = np.append(table.displacement, 0.0) if through_origin else table.displacement
    if np.ptp(force) == 0.0:
        return start + f"the force is {force[0]:.4g} N from its zero throughout."
    if np.ptp(displacement) == 0.0:
        return start + "the displacement is the same at every force."
    if np.ptp(force) <= 3.0 * float(np.median(table.u_force)) and not _related(force, displacement):
        return (
            start + f"the force varies by {np.ptp(force):.3g} N, within its uncertainty of "
            f"{float(np.median(table.u_force)):.3g} N, and the displacement does not follow it."
        )
    return ""


def _related(force: Array, displacement: Array) -> bool:
    """Whether the slope of displacement over force is told from zero by the points' own scatter."""
    if force.size < 4:
        return False
    r = float(np.corrcoef(force, displacement)[0, 1])
    return abs(r) * math.sqrt((force.size - 2) / max(1e-300, 1.0 - r * r)) > SIGNIFICANT


def judge(table: LevelTable, residuals: Array, k: float) -> tuple[Status, str]:
    """Whether one line describes the levels; k N/m. A doubt comes with its sentence."""
    if k < 0:
        return "doubtful", (
            "The displacement falls while the force rises: k is negative. Unless what was loaded "
            "gave way there, one of the two has the wrong sign: turn the one that does not count "
            "along the direction."
        )
    if table.size > 2 and np.ptp(table.displacement) > 0:
        spread = float(np.sum((table.displacement - table.displacement.mean()) ** 2))
        explained = 1.0 - float(np.sum(residuals**2)) / spread
        if explained < STRAIGHT:
            return "doubtful", (
                f"A line explains only {100 * max(0.0, explained):.0f} % of how the displacement "
                "varies: k is an average over a curve that is not straight; look at the pointwise "
                "k."
            )
    return "ok", ""


def bend(pointwise: Sequence[PointwiseStiffness], rivals: Sequence[float]) -> tuple[str, ...]:
    """A note where the stiffness between levels changes along the curve, plainly beyond its
    scatter: one number is then a matter of averaging. rivals N/m: k under other choices."""
    known = [p for p in pointwise if math.isfinite(p.stiffness) and math.isfinite(p.sd)]
    third = len(known) // 3
    if third < 1:
        return ()
    ends = []
    for part in (known[:third], known[-third:]):
        mean = float(np.mean([p.stiffness for p in part]))
        ends.append((mean, float(np.sqrt(np.sum([p.sd**2 / p.n for p in part]))) / third))
    (first, u_first), (last, u_last) = ends
    change = abs(last - first)
    if change < max(BENT * min(abs(first), abs(last)), SIGNIFICANT * math.hypot(u_first, u_last)):
        return ()
    way = "falls" if last < first else "rises"
    note = (
        f"The stiffness between neighbouring levels {way} from {first / 1e3:.4g} to "
        f"{last / 1e3:.4g} N/mm along the curve (means over its first and last third): k is an "
        "average"
    )
    if rivals:
        note += f"; other choices give {min(rivals) / 1e3:.4g} to {max(rivals) / 1e3:.4g} N/mm"
    return (f"{note}.",)


def levels_move(k: float, gain_sd: float, u: float) -> tuple[str, ...]:
    """A note where the gain of the force, known to gain_sd, is worth another share of k (N/m) in
    its uncertainty u (N/m): whoever works the budget out by hand would miss it."""
    share = u / abs(k)
    if abs(share - gain_sd) <= _SAME_SHARE * gain_sd:
        return ()
    return (
        f"The gain of the force is stated to {100 * gain_sd:.3g} %, and is worth {100 * share:.3g} "
        "% of k: it moves the levels, too, over which a curve that is not straight is averaged.",
    )


def leaves_line(grid: Grid, *, origin: bool) -> bool:
    """Whether the runs leave straight lines beyond their noise. origin: they begin at a measured
    zero.

    Every run has a line of its own (its zero, its mounting). What runs leave of it in common is
    compared with what each leaves alone; and all that they leave with how rough it is (second
    differences of noise have six times its variance, those of a bend hardly any), since what has
    yielded in the first run may stay so. Noise is never less than what is stated of a level.
    """
    there = np.isfinite(grid.displacement).all(axis=0)
    force, moved = grid.force[:, there], grid.displacement[:, there]
    runs = force.shape[0]
    if origin:
        force, moved = (np.hstack([np.zeros((runs, 1)), a]) for a in (force, moved))
    free = force.shape[1] - 2
    if runs == 0 or free < 1 or not np.all(np.ptp(force, axis=1) > 0):
        return False
    lines = [np.polyfit(f, u, 1) for f, u in zip(force, moved, strict=True)]
    left = np.array([u - np.polyval(p, f) for f, u, p in zip(force, moved, lines, strict=True)])
    softness = float(np.mean([p[0] for p in lines]))
    u_level = np.hypot(grid.u_displacement[:, there], softness * grid.u_force[:, there])
    stated, alike = float(np.mean(u_level**2)), left.mean(axis=0)
    rough = float(np.mean(np.diff(left, 2) ** 2)) / 6
    # neighbouring second differences share values: 18 of 35 are free
    every = (float(np.sum(left**2)), runs * free, rough, runs * free * 18 / 35)
    tests = [every]
    if runs > 1:
        own = (runs - 1) * free
        scatter = float(np.sum((left - alike) ** 2)) / own
        tests.append((runs * float(np.sum(alike**2)), free, scatter, own))
    return any(_beyond(*one, stated) for one in tests)


def _beyond(squares: float, free: int, noise: float, of_noise: float, stated: float) -> bool:
    """Whether a sum of squares with so many degrees of freedom is more than noise makes: a variance
    that was seen with `of_noise` of them, or the stated one where that is more."""
    from scipy.special import chdtrc, fdtrc

    if max(noise, stated) <= 0:
        return False
    if stated >= noise:
        return bool(chdtrc(free, squares / stated) < BY_CHANCE)
    return bool(fdtrc(free, of_noise, squares / free / noise) < BY_CHANCE)
