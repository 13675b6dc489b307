"""Troubles that no word names and many rigs have: shapes that stand against the words.

`unknown` is not only what nothing explains. A swing of the air conditioning, a wave of the screw or
of the laser's target, a stiffness that is another one in every run are as definite as any effect;
where one of them explains a gap better than every word, the gap is unknown, and the note says what
it looks like. Each kind is a family of columns with Gaussian priors, as the effects are, so that
its evidence can be laid beside theirs.

Swings and waves have a period out of many: those that take most of the gap are looked at, and the
others count as having been looked at in vain.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import log

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.evidence.compare import by_word, log_mean, marginal, score
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.factor import span_of
from identification.gap.evidence.parts import Part, part_sizes
from identification.gap.explanations.explanation import PLAIN, GapPattern, SearchResult
from identification.gap.explanations.priors import log_unknown
from identification.gap.explanations.verdict import TAKES_TWO
from identification.gap.laws.drift import by_direction, free_path, path_root, waited
from identification.gap.model.base import Base
from identification.gap.model.bench import Bench
from identification.gap.model.history import retarded
from identification.gap.model.variants import Variant, smooth_root, variant
from identification.gap.recording.rows import ids

KINDS = 6
SHARES = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the largest response
# Of fewer periods (in the direction that was measured least, the setup with the shortest stroke) a
# swing is a drift, and a wave an elastic curve.
LEAST_SWINGS, LEAST_WAVES, MOST_WAVES = 2.0, 2.5, 20.0
RESTING_SWINGS = 6.0
_PER_PERIOD = 4  # steps of the number of periods: more tell nothing new of a whole record
_SHORTEST_ROWS = 4.0  # rows that a period lasts at least
_FASTEST = 3.0  # rows of a hold that the fastest swing lasts
_PERIODS_PER_ROW = 2.0  # at the most, pauses included: holds of milliseconds have no end of them
_PEAKS, _CLOSER = 3, 17
_PIECES = 32
_ALIKE, _MOST_LEVELS = 0.02, 200  # of the range of the load: loads that count as the same
_FEWEST_ROWS = 30  # a table shorter than that any wave passes


def with_unmodelled_evidence(found: SearchResult) -> SearchResult:
    """With unmodelled shapes beside the words: half of the prior of `unknown` is on no shape at
    all, half on theirs; and what the gap looks like, where one of them is plain."""
    engine = found.engine
    variants = unmodelled_variants(engine.bench, engine.base, engine.target)
    if not variants:
        return found
    alike = likenesses(engine, variants)
    alike = tuple(a for a in alike if a.kind != SETTLES or not _creeps(found, a.log_evidence))
    prior = log_unknown(engine.bench.load_history)
    none = found.unknown - prior
    shares = [1.0, *(1.0 / KINDS for _ in alike)]
    unknown = log_mean([none, *(a.log_evidence for a in alike)], shares)
    plain = next((a for a in alike if a.log_evidence > none + PLAIN), None)
    return replace(found, unknown=unknown + prior, looks_like=plain)


def _creeps(found: SearchResult, settles: float) -> bool:
    """Whether creep of the joints leaves no more than noise, and explains about as much as what
    settles (log evidence): in two directions what goes on by amounts and times of its own in each
    is what two joints do."""
    return any(
        e.words == {"joint_creep"}
        and e.eta <= found.engine.bench.noise.stated
        and e.adequate
        and e.log_weight > settles - TAKES_TWO
        for e in found.explanations
    )


SETTLES = "settles"


def unmodelled_variants(bench: Bench, base: Base, target: Array) -> list[Variant]:
    """Variants of all kinds that these data could show (`word`: the kind); the pool of the bench
    holds their columns afterwards."""
    if bench.rows.n < _FEWEST_ROWS or (bench.rows.continuous and not bench.load_history.rests):
        return []
    swings = _swings(bench, base, target)
    if bench.load_history.rests:
        return swings
    waves = _waves(bench, base, target)
    return [
        *_slopes(bench),
        *swings,
        *waves,
        *_rough(bench, target),
        *_jumps(bench),
        *_settles(bench),
    ]


def likenesses(engine: Engine, variants: list[Variant]) -> tuple[GapPattern, ...]:
    """What the kinds of unmodelled shapes say of a gap, the likeliest first. Periods that were not
    looked at count as nothing, and so does what lies below the noise of a sample: that is no
    gap."""
    out = []
    for kind, mine in by_word(score(engine, engine.levels, variants)).items():
        top = max(mine, key=lambda s: s.log_evidence)
        part = Part(top.variant, top.scale)
        size = float(part_sizes(engine, (part,), top.level).gap[0])
        if size < LEAST_SIZE * engine.bench.noise.stated:
            continue
        looked_at = min(sum(s.variant.prior for s in mine), 1.0)
        found = marginal(mine) + log(looked_at)
        out.append(GapPattern(kind, top.variant.period, found, top.variant.wanders))
    return tuple(sorted(out, key=lambda x: -x.log_evidence))


LEAST_SIZE = 0.6  # of the stated noise


def _scales(bench: Bench) -> tuple[float, ...]:
    return tuple(s * bench.reach for s in SHARES)


def _slopes(bench: Bench) -> list[Variant]:
    """Every run has a stiffness of its own, or the stiffness wanders over the session."""
    rows, line = bench.rows, bench.slope * bench.load
    top = float(np.abs(line).max())
    runs = np.unique(rows.run)
    if not (top > 0 and bench.load_history.comes_again):
        return []
    each = [bench.add(bench.outside_column(line / top * (rows.run == r))) for r in runs]
    hats = free_path(bench, _PIECES)
    path = [bench.add(bench.outside_column(line / top * hats[:, k])) for k in range(_PIECES)]
    scales = _scales(bench)
    return [
        variant("slopes", "each run", each, scales, positive=False, prior=0.5),
        variant(
            "slopes",
            "wander",
            path,
            scales,
            root=path_root(_PIECES),
            positive=False,
            prior=0.5,
            wanders=True,
        ),
    ]


def _swings(bench: Bench, base: Base, target: Array) -> list[Variant]:
    """Displacement swings with time, in every direction by an amplitude of its own. Where nothing
    is loaded anew, the slower ones may be heat that comes and goes with the day."""
    if not (bench.rows.clock or (bench.load_history.rests and bench.data.timed)):
        return []
    masks = list(by_direction(bench).values())
    span = bench.load_history.session_span
    least = LEAST_SWINGS * bench.rows.n / min(int(m.sum()) for m in masks)
    most = bench.rows.n / _SHORTEST_ROWS / 2
    if bench.data.arm and bench.noise.raised > 1.0 and bench.rows.row_time > 0:
        # readings of holds scatter more than stated, as with a hum that is sampled once a second
        fastest = span / (_FASTEST * bench.rows.row_time)
        most = max(most, min(fastest, _PERIODS_PER_ROW * bench.rows.n))
    if bench.load_history.rests or waited(bench).any():
        least = max(least, RESTING_SWINGS)
    count = np.arange(least, max(most, least), 1 / _PER_PERIOD)
    time = (bench.rows.session - bench.rows.session.min()) / span
    return _periodic(bench, base, target, "swings", time, count, masks, span)


def _waves(bench: Bench, base: Base, target: Array) -> list[Variant]:
    """A wave over the stroke, in every setup with a phase of its own."""
    u = bench.line  # what is seen has the wave in it
    masks = [bench.rows.setup == s for s in range(len(bench.data.setups))]
    strokes = [float(np.ptp(u[m])) for m in masks]
    start = sum((m * u[m].min() for m in masks), np.zeros(len(u)))
    span = max(strokes)
    if not min(strokes) > LEAST_WAVES / MOST_WAVES * span:
        return []
    count = np.arange(LEAST_WAVES * span / min(strokes), MOST_WAVES, 1 / _PER_PERIOD)
    return _periodic(bench, base, target, "waves", (u - start) / span, count, masks, span)


def _rough(bench: Bench, target: Array) -> list[Variant]:
    """Every level of the load is off by an amount of its own, the same whenever it is met; on a
    bench not where these make a smooth curve, which a spring may have."""
    rows = bench.rows
    step = np.round(bench.load / (_ALIKE * float(np.ptp(bench.load)) or 1.0))
    place = ids(np.column_stack([rows.setup, step]))
    if not int(place.max()) < _MOST_LEVELS:
        return []
    if not bench.data.arm and _one_curve(bench, place, target[: rows.n]):
        return []
    columns = [
        bench.add(bench.outside_column((place == k).astype(float)))
        for k in range(int(place.max()) + 1)
    ]
    return [variant("rough", "levels", columns, _scales(bench), positive=False)]


def _one_curve(bench: Bench, place: Ints, target: Array) -> bool:
    """Whether the levels (n,) lie near the line through their neighbours, by far nearer than their
    means of what is to be explained (n,) do to one line."""
    count = np.bincount(place, bench.rows.weight)
    load, mean = (np.bincount(place, bench.rows.weight * v) / count for v in (bench.load, target))
    setup = np.bincount(place, bench.rows.weight * bench.rows.setup) / count
    off, about = 0.0, 0.0
    for s in np.unique(setup):
        order = np.flatnonzero(setup == s)[np.argsort(load[setup == s])]
        x, y = load[order], mean[order]
        if len(x) < 3:  # two have no curve
            return False
        between = y[:-2] + (y[2:] - y[:-2]) * (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
        off += float(np.sum((y[1:-1] - between) ** 2))
        about += float(np.sum((y - np.polyval(np.polyfit(x, y, 1), x)) ** 2))
    return off < _SMOOTH**2 * about


_SMOOTH = 0.25


def _jumps(bench: Bench) -> list[Variant]:
    """The displacement jumps between holds, and is back when the next run starts."""
    rows = bench.rows
    first = np.flatnonzero(rows.hold_starts & ~rows.starts)
    if not 0 < len(first) <= _MOST_LEVELS:
        return []
    at = np.arange(rows.n)
    columns = [
        bench.add(bench.outside_column(((at >= k) & (rows.run == rows.run[k])).astype(float)))
        for k in first
    ]
    return [variant("jumps", "between holds", columns, _scales(bench), positive=False)]


def _settles(bench: Bench) -> list[Variant]:
    """The displacement of an arm goes on after every change of the load, in every setup by amounts
    and times of its own; what went on goes back between two runs, as the session's clock tells.
    Without an arm there is but one spring, whose creep that is."""
    rows, step = bench.rows, bench.rows.row_time
    times = step * np.array(SETTLING)
    times = times[times < bench.load_history.session_span / 3]
    if not (bench.data.arm and step > 0 and times.size):
        return []
    line = np.tile((bench.slope * bench.load)[:, None], (1, len(times)))
    z = retarded(line, times, rows, bench.rest)
    z /= float(np.abs(z).max()) or 1.0
    masks = [(rows.setup == s).astype(float) for s in np.unique(rows.setup)]
    columns = [bench.add(bench.outside_column(m * c)) for m in masks for c in z.T]
    root = np.asarray(np.kron(np.eye(len(masks)), smooth_root(len(times), 0.5)), dtype=float)
    return [
        variant(
            SETTLES, "each setup", columns, _scales(bench), root=root, positive=False, prior=SELDOM
        )
    ]


SELDOM = 0.1  # what settles is mostly a joint
SETTLING = (3.0, 9.0, 27.0, 81.0, 243.0)  # times s of a reading each second


def _periodic(
    bench: Bench,
    base: Base,
    target: Array,
    kind: str,
    phase: Array,
    count: Array,
    masks: list[Array],
    span: float,
) -> list[Variant]:
    """Sine and cosine of a phase (n,) from 0 to 1 for the numbers of periods in it that take most
    of the gap."""
    if not len(count):
        return []
    white = 1 / bench.sigma[: bench.rows.n]
    known = span_of(base.columns[: bench.rows.n] * white[:, None])
    left = white * target[: bench.rows.n]
    taken = partial(square_of, known, left - known @ (known.T @ left), white, phase, masks)
    parts = [count[i : i + _AT_ONCE] for i in range(0, len(count), _AT_ONCE)]
    power = np.concatenate([taken(part) for part in parts])
    higher = np.append(True, power[1:] >= power[:-1]) & np.append(power[:-1] >= power[1:], True)
    out = []
    for i in sorted(np.flatnonzero(higher), key=lambda i: -power[i])[:_PEAKS]:
        about = count[i] + np.linspace(-1, 1, _CLOSER) / _PER_PERIOD
        best = float(about[int(taken(about).argmax())])
        columns = [bench.add(bench.outside_column(c)) for c in _both(phase, best, masks).T]
        out.append(
            variant(
                kind,
                f"{best:.3g} periods",
                columns,
                _scales(bench),
                positive=False,
                prior=1.0 / len(count),
                period=span / best,
            )
        )
    return out


def square_of(
    known: Array, left: Array, white: Array, phase: Array, masks: list[Array], count: Array
) -> Array:
    """(c,) how much of the square of what a whitened, orthonormal base (n, b) leaves (n,) a sine
    and a cosine of each number of periods (c,) take beyond it, in every one of the masks, which
    share no row; white (n,): what whitens."""
    shape = len(count), 2 * len(masks)
    gram, moment = np.zeros((*shape, shape[1])), np.empty(shape)
    shared = np.empty((*shape, known.shape[1]))
    for k, mask in enumerate(masks):
        mine, at = np.flatnonzero(mask), slice(2 * k, 2 * k + 2)
        turn = 2 * np.pi * count[:, None] * phase[mine]
        both = np.stack([np.sin(turn), np.cos(turn)], axis=1) * white[mine]  # (c, 2, rows)
        gram[:, at, at] = both @ np.swapaxes(both, 1, 2)
        moment[:, at], shared[:, at] = both @ left[mine], both @ known[mine]
    gram -= shared @ np.swapaxes(shared, 1, 2)
    fitted = np.linalg.pinv(gram, rcond=_ALREADY_KNOWN, hermitian=True) @ moment[..., None]
    return np.asarray(np.sum(moment * fitted[..., 0], axis=1))


_AT_ONCE = 32  # numbers of periods: what they take stays near the processor
_ALREADY_KNOWN = 1e-10  # share of a square beyond the base, below which it is rounding


def _both(phase: Array, count: float, masks: list[Array]) -> Array:
    """(n, 2 m) sine and cosine, by mask."""
    turn = 2 * np.pi * count * phase
    return np.column_stack([m * f for m in masks for f in (np.sin(turn), np.cos(turn))])
