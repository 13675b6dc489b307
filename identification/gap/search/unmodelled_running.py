"""Troubles of recordings that run on, which no word names: jerks, damage, softening, wandering.

On a rig without an arm a grip slips in jerks or an interferometer loses fringes, fibres break for
good, rubber is softer wherever it was stretched before (Mullins 1969). Words with any freedom, as
drifts that take every path, follow such a thing somehow. So these take part in the search as words
do, alone and beside them; what they explain best is `unknown`, and what it looks like is said.

jerks: the response jumps at rows found one after the other, and stays. damage: the stiffness that
is lost grows with the largest load so far. softening: below the largest load so far it is softer,
and back where it was at that load (Ogden, Roxburgh 1999). wanders: the stiffness goes its own way
in time, as it does by fatigue, cure, humidity or a pressure that nobody holds; or it is another one
in every run.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import exp, lgamma, log

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from identification.arrays import Array, Flags
from identification.gap.effects.contact_seating import ARMLESS_SLACKS, pressed
from identification.gap.evidence.factor import span_of
from identification.gap.explanations.explanation import PLAIN, GapPattern, SearchResult
from identification.gap.laws.drift import free_path, path_root
from identification.gap.model.base import Base
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, variant
from identification.gap.recording.turns import rises, turns
from identification.gap.words import DAMAGE, JERKS, SOFTENING, UNMODELLED, WANDERS

SHARES = (0.01, 0.03, 0.1, 0.3, 1.0)  # of the largest response, by one jump
COUNTS = (1, 2, 4, 8, 12)  # jumps
LOSSES = (0.03, 0.1, 0.3)  # of the stiffness
KNOTS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.0)  # of the largest load
BELOW = (0.05, 0.15, 0.5)  # of the largest load: so far below what it bore it is as soft as it gets
_FEWEST_ROWS = 30
_PASSES, _LEAST_PIECES, _PIECES = 3, 3, 12  # of the load; of a path in time
_STAYS = 0.3  # of the way, when the load is gone: what only softens comes back
_CURVE, _LOOP, _SLOW = 7, 4, 5  # degrees of a smooth response that jumps are looked for beside
_NOTHING_NEW = 1e-6  # of its square is left of a jump beside what is known


def troubles_of(bench: Bench, base: Base, target: Array) -> list[Variant]:
    """Variants of a running recording without an arm whose load moves (`word`: the kind)."""
    moves = bench.rows.continuous and not (bench.data.arm or bench.load_history.rests)
    if not moves or bench.rows.n < _FEWEST_ROWS:
        return []
    lasting = _damage(bench) if bench.load_history.returns else []
    if bench.load_history.returns and bench.load_history.stays < _STAYS:
        lasting += _softening(bench)
    return [*lasting, *_wanders(bench), *_of_runs(bench), *_jerks(bench, base, target)]


def with_plain_trouble(found: SearchResult) -> SearchResult:
    """With what the gap looks like, where one of these is plain: the larger part of what explains
    it better than words do."""
    best = found.unmodelled[0] if found.unmodelled else None
    if best is None or best.parts[0].word not in UNMODELLED:
        return found
    ahead = best.log_weight - max(found.explanations[0].log_weight, found.unknown)
    if ahead < PLAIN:
        return found
    first = best.parts[0]
    kind = "slopes" if first.variant.form == EACH_RUN else first.word
    return replace(found, looks_like=GapPattern(kind, None, best.log_weight))


def _load_so_far(bench: Bench) -> Array:
    """(n,) N: largest load so far in a row's setup."""
    out = np.abs(bench.load)
    for s in range(len(bench.data.setups)):
        mine = bench.rows.setup == s
        out[mine] = np.maximum.accumulate(out[mine])
    return out


def _damage(bench: Bench) -> list[Variant]:
    spring, largest = bench.slope * bench.load, _load_so_far(bench)
    at = np.array(KNOTS) * float(largest.max())
    lost = [np.clip((largest - a) / (b - a), 0.0, 1.0) for a, b in pairwise(at)]
    columns = [bench.add(bench.outside_column(spring * part)) for part in lost]
    return [variant(DAMAGE, "lasts", columns, LOSSES, each=True)]


def _softening(bench: Bench) -> list[Variant]:
    spring, largest = bench.slope * bench.load, _load_so_far(bench)
    top, out = float(largest.max()), []
    for share in BELOW:
        soft = spring * np.clip((largest - np.abs(bench.load)) / (share * top), 0.0, 1.0)
        columns = [bench.add(bench.outside_column(c)) for c in (soft, soft * largest / top)]
        out.append(variant(SOFTENING, f"below {share:g}", columns, LOSSES, prior=1 / len(BELOW)))
    return out


def _wanders(bench: Bench) -> list[Variant]:
    """Of a load that comes and goes often enough to tell time from load."""
    pieces = min(bench.load_history.passes - _PASSES, _PIECES)
    if not bench.load_history.returns or pieces < _LEAST_PIECES:
        return []
    spring, hats = bench.slope * bench.load, free_path(bench, pieces)
    columns = [bench.add(bench.outside_column(spring * hat)) for hat in hats.T]
    return [variant(WANDERS, "in time", columns, LOSSES, root=path_root(pieces), positive=False)]


def _of_runs(bench: Bench) -> list[Variant]:
    """Every run has a stiffness of its own, as what is fastened anew; of loads that come again, and
    of more than two runs: of fewer a drift is as likely."""
    runs = np.unique(bench.rows.run)
    if not (bench.load_history.comes_again and _FEW < len(runs) <= _MANY):
        return []
    spring = bench.slope * bench.load
    columns = [bench.add(bench.outside_column(spring * (bench.rows.run == r))) for r in runs]
    return [variant(WANDERS, EACH_RUN, columns, LOSSES, positive=False, form=EACH_RUN)]


EACH_RUN = "each run"
_FEW, _MANY = 2, 60  # runs; of more the path in time tells


def _jerks(bench: Bench, base: Base, target: Array) -> list[Variant]:
    """The first few jumps; every row might have been one of them."""
    n, scales = bench.rows.n, tuple(s * bench.reach for s in SHARES)
    places = jump_rows(bench, base, target, max(COUNTS))
    at = np.arange(n)
    columns = [bench.add(bench.outside_column((at >= k).astype(float))) for k in places]
    return [
        variant(
            JERKS,
            f"{k} of them",
            columns[:k],
            scales,
            positive=False,
            prior=exp(lgamma(k + 1) - k * log(n)) / len(COUNTS),
        )
        for k in COUNTS
        if k <= len(columns)
    ]


def jump_rows(bench: Bench, base: Base, target: Array, most: int) -> list[int]:
    """Rows, at most so many, from which on a jump of the response takes most of what the base, a
    curve of the load, smooth but where it comes to bear, with a smooth loop, a slow path and the
    jumps before it leave."""
    n = bench.rows.n
    white = 1 / bench.sigma[:n]
    load = _spread(bench.load)
    sense = np.where(rises(bench.load), 1.0, -1.0)
    smooth = [
        _loose(bench),
        chebvander(load, _CURVE),
        chebvander(load, _LOOP) * sense[:, None],
        chebvander(_spread(bench.rows.session), _SLOW),
    ]
    known = span_of(np.column_stack([base.columns[:n], *smooth]) * white[:, None])
    left = white * target[:n]
    left = left - known @ (known.T @ left)

    def from_here_on(values: Array) -> Array:
        """Product of whitened values (n, ...) with the jump at every row."""
        return np.asarray(np.cumsum((white * values.T).T[::-1], axis=0)[::-1])

    turned = _just_turned(bench)
    square = from_here_on(white)
    new = square - np.sum(from_here_on(known) ** 2, axis=1)
    out: list[int] = []
    for _ in range(min(most, n - 1)):
        able = new > _NOTHING_NEW * square
        able[bench.rows.starts | turned] = False
        if not able.any():
            break
        gain = np.where(able, from_here_on(left) ** 2 / np.where(able, new, 1.0), -1.0)
        k = int(gain.argmax())
        jump = np.where(np.arange(n) >= k, white, 0.0)
        for _again in range(2):  # twice is enough (Giraud and others 2005)
            jump = jump - known @ (known.T @ jump)
        jump /= np.linalg.norm(jump)
        known = np.column_stack([known, jump])
        left = left - jump * (jump @ left)
        new = new - from_here_on(jump) ** 2
        out.append(k)
    return out


def _loose(bench: Bench) -> Array:
    """(n, k) what hangs loose gives until it bears: at the same load in every pass, which no jerk
    does. None where the displacement is imposed: no force jumps there."""
    if bench.imposed:
        return np.empty((bench.rows.n, 0))
    size, sign = pressed(bench)
    return np.column_stack(
        [sign * np.minimum(size / (s * size.max()), 1.0) for s in ARMLESS_SLACKS]
    )


def _just_turned(bench: Bench) -> Flags:
    """(n,) rows in which an imposed stroke leaves the place where it began or turned: there the
    force changes fast because of friction and flow, and jerks are no news. Of a leg that rests
    there first, the last of that alone, and never more than a share of it."""
    out, load = np.zeros(bench.rows.n, dtype=bool), bench.load
    if not bench.imposed:
        return out
    for run in np.unique(bench.rows.run):
        mine = np.flatnonzero(bench.rows.run == run)
        for a, b in pairwise([0, *turns(load[mine]), len(mine)]):
            gone = np.abs(load[mine[a:b]] - load[mine[a]])
            end = a + int(np.argmax(gone > _TURNED * gone.max(initial=0.0)))
            begin = max(end - int(np.ceil(_OF_A_LEG * (b - a))), a - _BEFORE, 0)
            out[mine[begin : end + 1]] = True
    return out


_TURNED, _OF_A_LEG = 0.05, 0.15  # of a leg's way; of its rows
_BEFORE = 1  # rows: the furthest of a noisy stroke may come later than its turn


def _spread(values: Array) -> Array:
    """Values (n,) as they lie between -1 and 1."""
    low, high = float(values.min()), float(values.max())
    return np.asarray((2 * values - low - high) / ((high - low) or 1.0))
