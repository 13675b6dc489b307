"""One channel lags the other: shows where the load changes, at the first samples of a hold.

Pure delay of the laser, `u(t) = u_0(t - d)`, or of the force; a first-order filter of either, or
one that is delayed as well, or two alike (a critically damped one of second order); or a mean over
the last readings, late by half of its window; or something between delay and filter.
Lags of filters, averaging and transmission: 0.05 to 10 s.

Size: 0.05 to 10 s; 0.3 to 12 times the sampling interval here, on a finer grid about what is found.
Prior: coefficient above LEAST, 1 is the lag itself; channels and kinds equally likely, what lies
between two kinds half as much; lags up to 2.5 samples equally likely, longer ones the less.
Source: averaging and filter settings of amplifiers and laser sensors.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.closer import (
    RefinementTarget,
    closing_in,
    evidence,
    scored_beside,
    shows,
)
from identification.gap.laws.effect import Effect
from identification.gap.laws.interval import Coefficients, Parameter, normal
from identification.gap.laws.lags import (
    CHANNELS,
    KINDS,
    driven_channel,
    kinds_of,
    late,
    still,
    way_shown,
)
from identification.gap.laws.law import Law, Laws, Term
from identification.gap.laws.springs_found import about_springs
from identification.gap.model.bench import Bench
from identification.gap.model.history import (
    sampling_time,
    unread_ramp_duration,
)
from identification.gap.model.variants import Variant, variant

WORD = "time_lag"
# of the time between two samples
LAGS = (0.3, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.2, 7.0, 9.0, 12.0)

# Sums of a delay's and a filter's share that are not negative where nothing is ahead of the load:
# when the delay is over, and long after it. A hand's overshoot is no lag.
_NEVER_AHEAD = np.array([[1.0, np.exp(-1.0)], [0.5, 1.0]])
LEAST = 0.6  # of the lag itself: a part of the response that comes late is creep
_USUAL = 2.5  # samples: a reading so late would have been noticed, the later the sooner
_OF_STROKE = 0.5  # of the time that one pass of the load takes


def variants(bench: Bench) -> list[Variant]:
    """Lags of laser or force, as delays and as filters; coefficient 1 is the lag itself."""
    if bench.load_history.timeless or bench.data.lets_go or _like_a_soft_start(bench):
        return []  # a channel that is late would let go at another place than it touches, too
    sample = sampling_time(bench.rows)
    channels = [c for c in CHANNELS if c != driven_channel(bench) or not _ripples(bench)]
    out = []
    for multiple in LAGS:
        lag = multiple * sample
        if bench.rows.continuous and lag > _OF_STROKE * bench.load_history.stroke_s:
            break  # the load would have come before anybody turned a screw
        if not bench.data.arm and bench.rows.hold_starts.all() and multiple > _USUAL:
            break  # one reading a step, and that of a step long past
        for channel in channels:
            out += _of(bench, channel, lag, _likely(multiple))
    return out


_STEP = 1.13
_STEPS = np.array([-3, -2, -1, 0, 1, 2, 3])


def refined(bench: Bench, found: Variant, close: float = 1.0) -> list[Variant]:
    """Lags of the same channel about one that was found. close: share of the steps."""
    out, longest = [], float(found.info["lag_s"]) / sampling_time(bench.rows)
    for step in _STEPS:
        multiple = longest * _STEP ** (close * step)
        likely = _likely(multiple) * 2 / len(_STEPS)
        out += _of(bench, found.info["channel"], multiple * sampling_time(bench.rows), likely)
    return out


def _likely(multiple: float) -> float:
    """Prior of a lag of so many samples against that of a short one."""
    return min(1.0, _USUAL / multiple)


def _of(bench: Bench, channel: str, lag: float, likely: float) -> list[Variant]:
    """A lag as a delay, a filter, a mean, and as something between delay and filter."""
    out, pair = [], []
    # else all but a filter are alike
    known = channel != driven_channel(bench) or not way_shown(bench)
    for kind in KINDS if known else KINDS[:2]:
        change = late(bench, channel, kind, lag)
        if not np.any(change):
            continue
        column = bench.add(change)
        pair += [column] if kind in KINDS[:2] else []
        info: dict[str, Any] = {"lag_s": lag, "kind": kind, "channel": channel}
        out.append(
            variant(
                WORD,
                f"{channel} {kind} {lag:.3g} s",
                [column],
                (0.5, 1.0),
                prior=likely,
                least=LEAST,
                **info,
            )
        )
    if len(pair) > 1:
        info = {"lag_s": lag, "kind": "window", "channel": channel}
        out.append(
            variant(
                WORD,
                f"{channel} window {lag:.3g} s",
                pair,
                (0.5,),
                prior=0.5 * likely,
                least=LEAST,
                within=_NEVER_AHEAD,
                **info,
            )
        )
    return out


def _like_a_soft_start(bench: Bench) -> bool:
    """Without an arm one reading a step, and every run goes one way: a lag would be but a step's
    worth of datum. Of an arm, a hand on the screw takes another time for every step."""
    rows = bench.rows
    if bench.data.arm or rows.continuous or not rows.hold_starts.all():
        return False
    way = np.diff(bench.load)[~rows.starts[1:]]
    return bool(np.all(way >= 0) or np.all(way <= 0))


def _ripples(bench: Bench) -> bool:
    """Whether the force changes in its holds as no lag makes of a load that stands still there. The
    first readings of a hold may show, late, what a hand did on the way there: ripples go on."""
    rows, meter = bench.rows, bench.data.instruments
    if bench.imposed or way_shown(bench):
        return False
    begins = rows.hold_starts.copy()
    begins[1:] |= rows.hold_starts[:-1]
    moves = _moves(bench, rows.weight)
    goes_on = _moves(bench, np.where(begins, 0.0, rows.weight))
    if min(moves, goes_on) <= _MOVES * rows.rms(meter.force / np.sqrt(rows.weight)):
        return False
    lags = np.array(LAGS) * sampling_time(rows)
    missed = (still(bench, kind, lag)[1] for kind in KINDS[:2] for lag in lags)
    return min(map(rows.rms, missed)) > _UNLIKE * moves


def _moves(bench: Bench, weight: Array) -> float:
    """rms (N) by which the force changes within holds; weight (n,) of the rows."""
    hold = bench.rows.hold
    total = np.maximum(np.bincount(hold, weights=weight), 1e-300)
    about = bench.load - (np.bincount(hold, weights=weight * bench.load) / total)[hold]
    return float(np.sqrt(weight @ about**2 / max(weight.sum(), 1e-300)))


_MOVES, _UNLIKE = 5.0, 0.8  # times its noise; share of what it does within holds


def _parameters(bench: Bench, v: Variant, found: Coefficients) -> dict[str, Parameter]:
    """Mean delay. Readings do not change in proportion to a lag (one shorter than the wait before
    a sample is not seen at all), and no coefficient tells what kind it is: the effect as fitted
    is read as the lag of every kind that does the same, each the more the closer it comes."""
    n, info, w = bench.rows.n, v.info, found.w
    does = sum(
        (much * bench.columns[c][:n] for much, c in zip(w, v.columns, strict=True)), np.zeros(n)
    )
    if "compliance" in info:  # lags are compared as they show through the simulated springs
        own = bench.slope_of(info["compliance"])
        does = does * np.divide(bench.slope, own, out=np.zeros(n), where=own > 0)
    total = found.linear(np.ones(len(w)), "1")
    relative = total.sd / max(abs(total.value), 1e-6)
    lags, misses, spread = np.zeros((3, len(KINDS)))
    for k, kind in enumerate(KINDS):
        lags[k], misses[k] = closest_lag(bench, info["channel"], kind, does)
        more, _ = closest_lag(bench, info["channel"], kind, does * (1 + min(relative, 0.5)))
        spread[k] = more - lags[k]
    # what the noise hides of a miss tells no kind from another
    hidden = 1 / max(float(np.linalg.norm(does / bench.noise.response)), 1.0)
    share = 1 / (misses**2 + hidden**2)
    share /= share.sum()
    value = float(share @ lags)
    variance = float(share @ (spread**2 + (lags - value) ** 2))
    return {"lag": normal(value, variance + _turning_sd(bench, value) ** 2, "s")}


def _turning_sd(bench: Bench, lag: float) -> float:
    """s by which a lag is uncertain because nobody recorded when the load began to move: between
    two samples, so that it took half a sample more or less. What a lag shows at the first sample of
    a hold is the share of that way which it is late."""
    half, way = bench.rows.half_sample, unread_ramp_duration(bench.rows)
    return 0.0 if way is None else 0.5 * half / max(way, half) * max(lag - half, 0.0)


_LAGS = np.geomspace(0.2, 16.0, 32)  # of the time between two samples: lags that are compared


def closest_lag(bench: Bench, channel: str, kind: str, does: Array) -> tuple[float, float]:
    """Lag s of that kind that does most nearly the same (n,), and what it misses, as a share."""
    lags, columns = _lagging(bench, channel, kind)
    scale = 1 / bench.noise.response
    y, does_each = does * scale, columns * scale
    i = int(np.sum((does_each - y) ** 2, axis=1).argmin())
    best = (np.inf, float(lags[i]))
    for k in (i - 1, i):  # between two lags, what a lag does is straight
        if 0 <= k < len(lags) - 1:
            way, ahead = does_each[k + 1] - does_each[k], y - does_each[k]
            at = float(np.clip(way @ ahead / max(float(way @ way), 1e-300), 0.0, 1.0))
            left = float(np.sum((ahead - at * way) ** 2))
            best = min(best, (left, float(lags[k] + at * (lags[k + 1] - lags[k]))))
    return best[1], float(np.sqrt(best[0] / max(float(y @ y), 1e-300)))


def _lagging(bench: Bench, channel: str, kind: str) -> tuple[Array, Array]:
    """Lags (k,) s and what each does to the responses (k, n). Kept with the bench: a cache of the
    module would keep the benches of many diagnoses alive."""
    if (channel, kind) not in bench.lags:
        lags = _LAGS * sampling_time(bench.rows)
        does = [late(bench, channel, kind, float(t))[: bench.rows.n] for t in lags]
        bench.lags[channel, kind] = lags, np.array(does)
    return bench.lags[channel, kind]


def _describe(_: Bench, v: Variant) -> tuple[Law, Array]:
    """One term: 1 where the lag is as long as stated; of a window half delay, half filter."""
    constants = {
        "channel": str(v.info["channel"]),
        "way": str(v.info["kind"]),
        "lag": float(v.info["lag_s"]),
    }
    terms = (Term("share"),) * len(v.columns)
    return Law(constants, terms), np.ones(len(terms))


def _columns(bench: Bench, law: Law) -> list[Array]:
    """The channel shows where the load was a little earlier."""
    c = law.constants
    return [late(bench, c["channel"], kind, c["lag"]) for kind in kinds_of(law)]


def _look_closer(word: RefinementTarget) -> list[Variant]:
    """Lags about those that were found; of a driven force that lags also with the springs as they
    are, of whose response it shows a part too late."""
    if not shows(word):
        return []
    channels = {s.variant.info["channel"]: s for s in reversed(word.beside or word.alone)}
    finer = closing_in(word, refined, list(channels.values()))
    imposed = word.engine.bench.imposed
    driven = [v for v in finer if v.info["channel"] == "force" and not imposed]
    found = scored_beside(word.engine, word.families, word.ranked, driven)
    best = max(found, key=evidence, default=None)
    return finer if best is None else [*finer, about_springs(_LAWS, word.engine, best.variant)]


_LAWS = Laws(_describe, _columns, through_springs=True)
EFFECT = Effect(
    WORD,
    variants=variants,
    parameters=_parameters,
    laws=_LAWS,
    lengths=(),
    finer=_look_closer,
    beside=True,
    not_negative=("lag",),
)
