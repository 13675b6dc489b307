"""What explanations of several effects are charged for: freedom of one law in the name of another,
effects that take each other back, effects below the noise. All in nats."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part, Sizes
from identification.gap.model.bench import Bench
from identification.gap.words import (
    CURVES,
    DRIFTS,
    FRICTION,
    JERKS,
    LATE,
    LINEAR,
    MECHANISMS,
    SPRINGS,
    UNMODELLED,
)

# A second effect smaller than this share of the first can't be told from the first one's law.
LEAST_SHARE = 0.12
# Mechanisms of the same kind mimic parts of each other: rate-dependent flow looks like creep.
LEAST_SHARE_AKIN = 0.3
CANCELLING = 1.4  # times the gap: larger effects of one explanation cancel each other
TOE_AND_KNEE = frozenset({"contact_seating", "joint_yield"})
FORBIDDEN = 1e4  # nats: beyond what any data bring
SAME_JOINT = 5.0  # nats: two troubles of one kind seldom sit in the same joint


def minor_parts(engine: Engine, parts: tuple[Part, ...], found: Sizes) -> float:
    """Penalty in nats, a steep wall, for parts that may be freedom of another one's law."""
    penalty, sizes = 0.0, _sizes_that_show(parts, found)
    for i, p in enumerate(parts):
        for k, other in enumerate(parts):
            if _only_rubs(engine, p, other) and found.signed and not found.signed[i]:
                penalty += FORBIDDEN
            if i < k and _same_element(engine, p, other) and not _on_its_own(parts, found, i, k):
                penalty += FORBIDDEN
            # a small knee beside a large error of the springs is no freedom of the latter
            if i == k or sizes[i] > sizes[k] or (other.word in LINEAR and p.word not in LINEAR):
                continue
            akin = p.word != other.word and {p.word, other.word} <= MECHANISMS
            if akin and set(p.variant.joints) & set(other.variant.joints):
                penalty += SAME_JOINT
            share = max(sizes[i] / max(sizes[k], 1e-300), 1e-6)
            if p.word == other.word and share < LEAST_SHARE:
                penalty += FORBIDDEN  # a joint that does next to nothing is another's law
            least = LEAST_SHARE_AKIN if akin else LEAST_SHARE
            penalty += _wall(least / share)
    return penalty


def cancelling(engine: Engine, parts: tuple[Part, ...], found: Sizes, sizes: Array) -> float:
    """Penalty in nats for effects that are larger than the gap and take each other back.

    Linear effects may be large: the springs take them back. On an arm they are charged only where
    another linear one takes back nearly all of them, and one mechanism beside them is not charged:
    springs may hide most of either.
    """
    bent = [float(s) for p, s in zip(parts, sizes, strict=True) if p.word not in LINEAR]
    arm = engine.bench.data.arm
    linear = _taken_back(parts, found) if arm else 0.0  # of a bench the sizes say it already
    if arm and len(bent) < 2:
        return linear
    share = max(max(bent, default=0.0) / max(engine.structural, 1e-300), 1e-6)
    return linear + _wall(share / CANCELLING)


def _taken_back(parts: tuple[Part, ...], found: Sizes) -> float:
    """Penalty in nats, a steep wall, for linear effects of which hardly anything is left."""
    moved = [float(m) for p, m in zip(parts, found.moved, strict=True) if p.word in LINEAR]
    if len(moved) < 2:
        return 0.0
    return _wall(_LEFT * max(moved) / max(found.linear, 1e-300))


_LEFT = 0.3  # of what the larger one moves


def _wall(beyond: float) -> float:
    """Nats for what is so many times beyond its limit: steep, so that a limit holds, but finite, so
    that of two that are beyond it the nearer one is better."""
    return _STEEP * max(0.0, float(np.log(max(beyond, 1e-300))))


_STEEP = 60.0  # nats per factor e


def unbent_curves(engine: Engine, parts: tuple[Part, ...], found: Sizes) -> float:
    """Penalty in nats, a wall, for curves that hardly bend: there a spring is off.

    Curves of joints that have a line of their own, and seats of a rig without an arm that go on
    like a spring. An arm's turning bends its line a little (BENDS); a bench's line that is far off
    may bend within the noise of a sample, where that is known to a factor only.
    """
    noise, arm, penalty = engine.bench.noise, engine.bench.data.arm, 0.0
    for p, gap, moved in zip(parts, found.gap, found.moved, strict=True):
        line = p.variant.has_line or (p.variant.goes_on and not arm)
        if not line or not moved > 0:
            continue
        least = BENDS * moved
        if not arm:
            hidden = not noise.sure and moved > _FAR_MORE * gap
            least = noise.stated if hidden else 0.0
        penalty += _wall(max(least, 1e-300) / max(float(gap), 1e-6 * float(moved)))
    return penalty


BENDS = 0.04  # of what a curve moves: so much the springs can't give at least


def within_stated(engine: Engine, parts: tuple[Part, ...], found: Sizes) -> float:
    """Penalty in nats, a steep wall, for an arm's gains that are off by no more than three times
    what is stated, and for one spring that is off by no more than one and a half times that: it is
    `none`."""
    if not engine.bench.data.arm:
        return 0.0
    meter, penalty = engine.bench.data.instruments, 0.0
    least = {
        "force_scale": _WITHIN * meter.force_gain,
        "displacement_scale": _WITHIN * meter.displacement_gain,
    }
    for p, moved in zip(parts, found.moved, strict=True):
        limit = least.get(p.word, 0.0)
        if p.variant.joint is not None and p.word == SPRINGS:
            sds = engine.bench.data.compliance_relative_sd
            limit = _SPRING_WITHIN * float(sds[p.variant.joint])
        if limit > 0:
            off = max(float(moved) / _rms_of_line(engine, p), 1e-6)
            penalty += _wall(limit / off)
    return penalty


def _rms_of_line(engine: Engine, part: Part) -> float:
    """rms (m) by which a gain of one, or a spring twice as soft, moves."""
    rows = engine.bench.rows
    line = engine.columns(part.variant.columns)[: rows.n, 0]
    return max(rows.rms_about_means(line), 1e-300)


_WITHIN, _SPRING_WITHIN = 3.0, 1.5  # standard deviations


def below_noise(engine: Engine, parts: tuple[Part, ...], found: Sizes) -> float:
    """Penalty in nats for effects that are smaller than the noise of a single sample.

    - Where the noise of samples is seen (running recordings, rigs without an arm): a slope below
      it, a wall below half of it. Thousands of samples would show such an effect, but noise of low
      frequency wanders as far; of a path that may take any way the wall stands at all of it, and of
      a curve over a load that is read less well than what answers.
    - Of levels at rest: a wall far below what is stated of a sample, where a gap is none.
    - What the springs hide, or other channels show, counts by how far it moves; if it moves
      nothing, by how far those channels are beyond what instruments do (`shown`).
    """
    noise, seen = engine.bench.noise.stated, engine.bench.noise.seen
    shown = np.array([p.variant.shown for p in parts])
    if seen > 0:
        sizes = np.maximum(_sizes_that_show(parts, found), shown * seen + 1e-300)
        below = _SLOPE * float(np.maximum(np.log(seen / sizes), 0.0).sum())
        loose = [
            p.variant.free_pieces
            or (p.word == "joint_nonlinear_stiffness" and _diluted(engine.bench))
            for p in parts
        ]
        share = [1.0 if free else _SLOW_PART for free in loose]
        return below + sum(_wall(w * seen / float(s)) for w, s in zip(share, sizes, strict=True))
    hidden = [p.word in _SHOWN_ELSEWHERE and not p.variant.bends for p in parts]
    elsewhere = np.array(hidden, dtype=bool)  # a gain that bends no spring hides
    least = (FAR_BELOW_NOISE if engine.bench.data.arm else _GUESSED) * noise
    sizes = np.where(elsewhere, found.moved, found.gap)
    sizes = np.maximum(sizes, shown * least + 1e-300)
    return sum(_wall(least / float(size)) for size in sizes)


def _diluted(bench: Bench) -> bool:
    """Whether more noise comes from what is driven than from what answers: over readings with noise
    even a straight line bends where they end (regression dilution: Fuller 1987)."""
    meter, steep = bench.data.instruments, float(np.median(np.abs(bench.slope)))
    answers, drives = meter.displacement, meter.force * steep
    return drives < answers if bench.imposed else answers < drives


_SLOPE = 20.0  # nats per factor e below the noise


_SLOW_PART = 0.5  # of the noise of a sample: as far as what is slow in it goes
# Lasers are off by a smooth micrometre or two, which is part of what is stated of a sample. Of 400
# hidden cases the smallest effect that was there did 0.45 of that, linear arms with such a laser
# were explained by 0.2 and 0.35 of it.
FAR_BELOW_NOISE = 0.5
_GUESSED = 0.2  # of a rig whose readings don't tell their noise: then what is stated may be a guess
_SHOWN_ELSEWHERE = LINEAR | {"force_drift"}


def _sizes_that_show(parts: tuple[Part, ...], found: Sizes) -> Array:
    """Size of each part; what is linear as it moves: the springs hide it in the displacement of one
    direction, other directions and channels show it."""
    linear = np.array([p.word in LINEAR for p in parts], dtype=bool)
    return np.where(linear, found.moved, found.gap)


def in_directions_of_their_own(bench: Bench, one: Part, other: Part) -> bool:
    """Of a rig without an arm: each part in a direction that shares no spring with the other's."""
    mine, others = set(one.variant.joints), set(other.variant.joints)
    return bool(not bench.data.arm and mine and others and not mine & others)


def _same_element(engine: Engine, one: Part, other: Part) -> bool:
    """Both are friction of one joint, or would be, for all that the data show; or one is the
    linear part of the other: a mechanism's law brings its own mean stiffness."""
    if in_directions_of_their_own(engine.bench, one, other):
        return False
    same = bool(set(one.variant.joints) & set(other.variant.joints))
    words = {one.word, other.word}
    holds = "joint_creep" in words and not engine.bench.load_history.always_moves
    bench = engine.bench  # without any return all memory is hidden; arms are let go between runs
    hidden = bench.load_history.monotonic or not (bench.data.arm or bench.load_history.returns)
    # but what gets stiffer at the start and softer in the end is two things
    if hidden and words <= MECHANISMS and not holds and words != TOE_AND_KNEE:
        return True
    if bench.load_history.never_held and "time_lag" in words and words & MECHANISMS:
        return True  # of a single pull: what comes late and what bends are one curve
    if not engine.bench.data.arm and words == LATE and _as_late(one, other):
        return True
    if engine.bench.load_history.rests and words <= DRIFTS:
        return True  # what is read beside a load that stands is one path in time
    bends = MECHANISMS | frozenset(UNMODELLED) - {JERKS}
    if not engine.bench.data.arm and (words <= CURVES or (words & LINEAR and words & bends)):
        return True
    springs = SPRINGS in words and words & MECHANISMS
    if not (springs or words <= FRICTION):
        return False
    return same or not (engine.bench.has_q or _apart(engine, one, other))


_AS_LATE = 3.0  # times the lag: what comes as soon as that is the lag's own law


def _as_late(one: Part, other: Part) -> bool:
    """Whether what creeps is over about when the lag is: by the mean of its times' logarithms."""
    creeps, late = sorted((one.variant, other.variant), key=lambda v: v.lag_s)
    return float(np.exp(np.mean(np.log(creeps.times_s)))) < _AS_LATE * late.lag_s


def _only_rubs(engine: Engine, play: Part, curve: Part) -> bool:
    """Without an arm a curve may take back what a play does but for its friction."""
    if in_directions_of_their_own(engine.bench, play, curve):
        return False
    return not engine.bench.data.arm and play.word == "joint_backlash" and curve.word in CURVES


def _on_its_own(parts: tuple[Part, ...], found: Sizes, i: int, k: int) -> bool:
    """One of them is wrong springs, or a gain, and moves far more than the mechanism beside it: no
    linear part of its law. A curve that has a line of its own has one of any size."""
    for a, b in ((i, k), (k, i)):
        line = parts[b].variant.has_line
        if parts[a].word in LINEAR and parts[b].word not in LINEAR and not line:
            return bool(found.moved[a] > _FAR_MORE * found.moved[b])
    return False


_FAR_MORE = 5.0  # times


def _apart(engine: Engine, one: Part, other: Part) -> bool:
    """They move the arm in different directions: seen apart without joint readings."""
    shares = [_by_direction(engine, p) for p in (one, other)]
    return float(np.minimum(*shares).sum()) < _SHARED


def _by_direction(engine: Engine, part: Part) -> Array:
    """Share of what a part can do, in every direction."""
    names = [s.direction for s in engine.bench.data.setups]
    number = np.array([names.index(n) for n in names])[engine.bench.rows.setup]
    does = engine.columns(part.variant.columns)[: engine.bench.rows.n] @ part.root
    square = np.sum(engine.bench.rows.about_means(does) ** 2, axis=1)
    sums = np.bincount(number, weights=square, minlength=len(names))
    return np.asarray(sums / max(float(sums.sum()), 1e-300))


_SHARED = 0.2
