"""Which channel the rig drove, where nobody says: the one that follows the simpler path in time.

A controller leads its channel along straight lines and half cosines from turning point to turning
point, and holds it still; what answers has knees, plateaus, drifts and relaxes. So both channels
are described by pieces (a line or half a cosine each), and the one that needs fewer pieces, or
leaves less, was driven. What a channel leaves counts by its part that repeats from sample to sample
or exceeds the stated noise, as a share of the channel's own range: nothing depends on units, on
sizes, on how noisy either sensor is, or on the clock (both channels share it). On a straight spring
both are alike; force is the answer then, and it does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import ZERO, GapData
from identification.gap.recording.bins import even_path
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.turns import turns, way_back
from identification.gap.recording.white import white_sd
from identification.running import first_rows

_POINTS = 1000  # bins of a recording: more do not tell the path better
_CLOSEST = 3e-7  # of the squared range: a piece that leaves less is as good as exact
_PER_PIECE = 0.1  # nats that one more piece costs
_MARGIN = 0.05  # nats by which the displacement has to be simpler: half a piece
_SLIDING = -2.5  # nats, where it slides to and fro: so much simpler the force may look by chance
_FLAT = 0.33  # of the displacement's change, each in its range: what the force changes on a plateau
_SPENT, _MOST = 0.15, 0.45  # of the time, and of the way, in each sense
_BEYOND = 3.0  # standard deviations of a point: so far it goes from one mean of points to the next
_STILL = 2.0  # stated standard uncertainties: a channel that spreads by no more stands still
_FOLLOWS = 0.5  # of its variance that the other channel explains
_MISJUDGED = 3.0  # factor by which a stated uncertainty may be too small
_PASS, _OFTEN = 0.5, 4  # of the range; turns
_ELSEWHERE, _ALIKE = 0.04, 0.2  # of the range; of what the other channel does
_TURNS = (0.5, 0.2, 0.08)  # of the range: what counts as going back
_TOP = 0.03  # of a leg: a level next to its turning point
_MOST_PIECES, _PIECES_PER_LEG, _SPARE = 200, 4, 9
_FEWEST = 20  # samples: fewer show no path


@dataclass(frozen=True, eq=False)
class _Channel:
    """values (n,) over time (n,) in units of their range; noise: standard deviation of a point."""

    time: Array
    values: Array
    noise: float


def displacement_imposed(data: GapData) -> bool:
    """Whether force is predicted from the displacement: where the rig drove that, as stated, else
    as the data show. The joints of an arm that is read at rest bear the force that was
    read, whatever its screw holds: the displacement is linear in what they give way, the force is
    not. So it is with a rig that rests at levels of force."""
    if data.imposed == "force" or (data.arm and data.imposed is None):
        return False
    if not np.ptp(data.force) > 0:
        return False  # what moves without any force nobody presses
    hold = hold_ids(data)
    if data.imposed is not None:
        return not data.arm or is_continuous(data, hold)
    return displacement_simpler(data) if is_continuous(data, hold) else on_plateau(data, hold)


def displacement_simpler(data: GapData) -> bool:
    """Whether the displacement follows a simpler path in time than the force, by the setup with
    most samples; False where they are alike."""
    mine = np.flatnonzero(data.setup == np.bincount(data.setup).argmax())
    force, moved = data.force[mine], data.displacement[mine]
    if approaches(data, mine) or _goes_on(force, moved, data.instruments.force):
        return True
    instruments = data.instruments
    stands = (
        _still(force, instruments.force, moved),
        _still(moved, instruments.displacement, force),
    )
    if any(stands) or len(mine) < _FEWEST:
        return stands == (False, True)
    back = _comes_back(data, mine, force), _comes_back(data, mine, moved)
    if any(back) and not all(back):
        return back[1]
    turned = turned_alike(force, moved), turned_alike(moved, force)
    if any(turned) and not all(turned):
        return turned[1]
    channels = _channels(
        _clock(data, mine), (force, moved), (instruments.force, instruments.displacement)
    )
    floor = max(_CLOSEST, *(c.noise**2 / np.sqrt(len(c.time)) for c in channels))
    by_force, by_moved = (_cost(c, floor) for c in channels)
    return by_force - by_moved > (_SLIDING if _slides(*channels) else _MARGIN)


def approaches(data: GapData, mine: Ints) -> bool:
    """Whether samples mine (m,), in order, are a single pull that begins with a way at no force: a
    platen that comes nearer. Nobody finds such a place by setting a force; what creeps or drifts
    there is slower than the rest. Where the displacement is known to be driven, nothing at all may
    be felt until shortly before."""
    if len(mine) < _FEWEST:
        return False
    force, path = (np.abs(v[mine] - v[mine[0]]) for v in (data.force, data.displacement))
    none = max(_NO_FORCE * float(force.max()), _BEYOND * data.instruments.force)
    end = int(np.argmax(force > none))
    early = np.abs(data.force[mine[:end]]).max(initial=0.0) > 2 * none
    back = way_back(path) > _NO_FORCE * float(path.max())
    if early or back or not force[end] > none:
        return False
    last = max(end - 1, 0)  # with the first force that is felt a rig gives way at once
    went = float(path[last] / path.max()) if path.max() > 0 else 0.0
    if data.imposed == "displacement":
        before = force[:end][path[:end] < _WELL_BEFORE * path[last]]
        return went > _APPROACH and before.max(initial=0.0) < _NOTHING * data.instruments.force
    time = _clock(data, mine)
    spent = (time[last] - time[0]) / (time[-1] - time[0] or 1.0)
    return bool(went > max(_APPROACH, _FAST * spent))


_NO_FORCE, _APPROACH = 0.02, 0.3  # of the largest force (or a way back), and of the way
_FAST = 2.0  # times as fast as all of it
_WELL_BEFORE, _NOTHING = 0.75, 4.0  # of the way at no force; standard uncertainties: a curve that
# begins to stiffen shows more force there


def _goes_on(force: Array, moved: Array, sd: float) -> bool:
    """Whether a single pull, of force (m,) and displacement (m,), goes on while its force falls, as
    beyond the neck of a bar: under a force that is lowered nothing goes on. sd: of a force."""
    if len(moved) < _FEWEST or not np.ptp(moved) > 0:
        return False
    size, way = np.abs(force), np.abs(moved - moved[0]) / float(np.ptp(moved))
    first = int(size.argmax())
    last = first + int(size[first:].argmin())
    noise = max(white_sd(np.diff(force, 2)), sd)
    fell = size[first] - size[last] > max(_FALLS * size[first], _CLEARLY * noise)
    return bool(fell and way[last] - way[first] > _FURTHER and way_back(way) < _TOP)


_FALLS, _FURTHER = 0.08, 0.05  # of the largest force; of the way
_CLEARLY = 8.0  # standard deviations: of many readings the largest two are far apart


def on_plateau(data: GapData, hold: Ints) -> bool:
    """Whether levels follow one another on which the force is the same and the displacement is not:
    nobody finds these by setting a force. hold (n,): consecutive ids."""
    starts = first_rows(hold)
    on = np.diff(data.run[starts]) == 0
    went = [
        np.abs(np.diff(v[starts])) / (np.ptp(v) or 1.0) for v in (data.force, data.displacement)
    ]
    flat = on & (went[0] < _SAME) & (went[1] > _OTHER)
    return bool(np.any(flat[:-2] & flat[1:-1] & flat[2:]))


_SAME, _OTHER = 0.01, 0.03  # of the ranges of force and displacement


def _comes_back(data: GapData, mine: Ints, values: Array) -> bool:
    """Whether a channel (m,) of samples mine is in every run where it was in the first, at rest and
    at its furthest: as what is driven, whatever drifts or slips in the other one."""
    run, rests = data.run[mine], data.branch[mine] == ZERO
    near = _SAME_PLACE * float(np.ptp(values))
    places = []
    for r in np.unique(run):
        at_rest, all_of_it = values[(run == r) & rests], values[run == r]
        if not at_rest.size:
            return False
        places.append([float(at_rest.mean()), float(all_of_it.min()), float(all_of_it.max())])
    return len(places) >= _RUNS and bool(np.all(np.ptp(places, axis=0) < near))


_SAME_PLACE, _RUNS = 0.01, 3  # of the range


def turned_alike(values: Array, other: Array, least: float = _ELSEWHERE) -> bool:
    """Whether a channel (m,) that comes and goes turns where it turned before, while the middle of
    the other one's way is elsewhere each time, and its length about the same: whatever drifts,
    slips or has a datum of its own answers so. (Strokes that grow against what yields or rubs turn
    elsewhere at either end, to either side.) least: share of its range that this has to be."""
    at = np.array(turns(values, _PASS), dtype=np.intp)
    if len(at) < 2 * _OFTEN:
        return False
    high = values[at] > np.median(values)
    span = float(np.ptp(values))
    spread = max(float(np.std(values[at[end]])) for end in (high, ~high)) / span
    there = other[at]
    length, middle = np.diff(there) * np.where(high[1:], 1, -1), (there[1:] + there[:-1]) / 2
    wanders = float(np.std(middle)) / (float(np.ptp(other)) or 1.0)
    steady = float(np.std(length)) < float(np.std(middle))
    return steady and wanders > least and spread < min(_SAME_PLACE, _ALIKE * wanders)


def _slides(force: _Channel, moved: _Channel) -> bool:
    """Whether the displacement goes to and fro while the force hardly changes: a force that was
    driven would hold such a plateau in one sense only, as under a weight, or run through it."""
    length = float(_senses(moved) @ np.diff(moved.values))  # of all legs
    if not length > 0:
        return False
    points = len(moved.values)
    step = int(np.clip(_BEYOND * moved.noise * points / length, 1, max(points // _FEWEST, 1)))
    force, moved = _coarser(force, step), _coarser(moved, step)
    went, time = np.diff(moved.values), np.diff(force.time)
    flat = np.abs(np.diff(force.values)) < _FLAT * np.abs(went)
    sense = _senses(moved)  # of its legs: what noise does back and forth is no way
    for way in (sense > 0, sense < 0):
        path, spent = np.abs(went) * way, time * way
        if flat @ spent < _SPENT * time.sum() or flat @ path < _MOST * path.sum():
            return False
    return True


def _coarser(channel: _Channel, step: int) -> _Channel:
    """Means of so many points each."""
    edges = np.arange(0, len(channel.values), step)
    count = np.diff(np.append(edges, len(channel.values)))
    mean = [np.add.reduceat(y, edges) / count for y in (channel.time, channel.values)]
    return _Channel(mean[0], mean[1], channel.noise / step**0.5)


def _senses(channel: _Channel) -> Array:
    """(n - 1,) sense of the leg that every step from point to point belongs to."""
    y = channel.values
    edges = np.minimum(_zigzag(y, max(_TURNS[-1], 6 * channel.noise)), len(y) - 1)
    return np.repeat(np.sign(np.diff(y[edges])), np.diff(edges))


def _still(values: Array, sd: float, other: Array) -> bool:
    """A channel that shows no more than its noise: what is held, or not loaded at all. One that
    follows the other channel moves, however noisy it is."""
    if not np.ptp(values) > 0:
        return True
    follows = np.ptp(other) > 0 and np.corrcoef(values, other)[0, 1] ** 2 > _FOLLOWS
    return bool(np.std(values) <= _STILL * sd and not follows)


def _clock(data: GapData, mine: Ints) -> Array:
    """(m,) s: the session's clock, or the runs' one after the other; the number of the sample where
    neither goes forward."""
    time = data.time[mine] if data.session is None else data.session[mine]
    step = np.diff(time, prepend=time[0])
    if data.session is None:
        starts = np.diff(data.run[mine], prepend=data.run[mine[0]]) != 0
        step[starts] = np.median(step[~starts])
    if np.any(step < 0) or not step.sum() > 0:
        return np.arange(len(mine), dtype=float)
    return np.asarray(np.cumsum(step))


def _channels(
    time: Array, values: tuple[Array, Array], sds: tuple[float, float]
) -> tuple[_Channel, _Channel]:
    """Both channels in the same bins. The noise is what second differences show (their median, so
    that jumps do not count), and no more than a stated uncertainty that was misjudged: a coarse
    recording shows its bends there."""
    edges = _edges(values)
    count = np.diff(np.append(edges, len(time)))

    def mean(y: Array) -> Array:
        return np.asarray(np.add.reduceat(y, edges) / count)

    def one(y: Array, sd: float) -> _Channel:
        points = mean(y)
        span = float(np.ptp(points)) or 1.0
        shown = min(white_sd(np.diff(points, 2)), _MISJUDGED * sd)
        return _Channel(mean(time), points / span, shown / span)

    return one(values[0], sds[0]), one(values[1], sds[1])


def _edges(values: tuple[Array, Array]) -> Ints:
    """First samples of bins of equal path."""
    n = len(values[0])
    if n <= _POINTS:
        return np.arange(n)
    return first_rows(even_path(*values, _POINTS))


def _cost(channel: _Channel, floor: float) -> float:
    """Nats: half the logarithm of what the best number of pieces leaves, and what they cost."""
    costs, known = [], set()
    for share in (np.inf, *_TURNS):
        edges, times = _turns(channel, max(share, 6 * channel.noise))
        if len(edges) > _MOST_PIECES or edges.tobytes() in known:
            continue
        known.add(edges.tobytes())
        costs += [
            0.5 * float(np.log(left + floor)) + _PER_PIECE * pieces
            for pieces, left in _refined(channel, edges, times, 0.1 * floor)
        ]
    return min(costs)


def _turns(channel: _Channel, back: float) -> tuple[Ints, Array]:
    """Ends of the legs (from 0 to n), and when the channel turned there: where it goes back by
    `back`, between passing a level next to it on the way there and back. Line and cosine alike
    pass it at a distance in proportion to the length of their leg."""
    t, y, edges = channel.time, channel.values, _zigzag(channel.values, back)
    places, times = [0], [float(t[0])]
    for before, here, after in zip(edges, edges[1:], edges[2:], strict=False):
        low, high = here - (here - before) // 4, here + (after - here) // 4
        depth = np.abs(y[low : high + 1] - y[here])
        leg = min(abs(y[here] - y[before]), abs(y[here] - y[after - 1]))
        start, end = _passes(t[low : high + 1], depth, max(3 * channel.noise, _TOP * float(leg)))
        came, goes = t[here] - t[before], t[after - 1] - t[here]
        times.append(start + (end - start) * float(came / max(came + goes, 1e-300)))
        places.append(int(np.searchsorted(t, times[-1])))
    kept, first = np.unique([*places, len(y)], return_index=True)
    return kept.astype(np.int64), np.array([*times, float(t[-1])])[first]


def _passes(t: Array, depth: Array, level: float) -> tuple[float, float]:
    """When the depth under a turning point first is less than the level, and last."""
    near = np.flatnonzero(depth <= level)
    first, last = int(near[0]), int(near[-1])
    start, end = float(t[first]), float(t[last])
    if first > 0:
        start = float(np.interp(-level, -depth[first - 1 : first + 1], t[first - 1 : first + 1]))
    if last + 1 < len(t):
        end = float(np.interp(level, depth[last : last + 2], t[last : last + 2]))
    return start, end


def _zigzag(y: Array, back: float) -> list[int]:
    turns, low, high, rising = [0], 0, 0, None
    values = y.tolist()
    for i, x in enumerate(values):
        low = i if x < values[low] else low
        high = i if x > values[high] else high
        if rising is not False and values[high] - x > back:
            turns.append(high)
            low, rising = i, False
        elif rising is not True and x - values[low] > back:
            turns.append(low)
            high, rising = i, True
    return sorted({*turns, len(values)})


def _refined(
    channel: _Channel, edges: Ints, times: Array, enough: float
) -> list[tuple[int, float]]:
    """(pieces, squared share that they leave), the worst piece cut in two again and again."""
    when = {int(i): float(t) for i, t in zip(edges, times, strict=True)}
    broken = _broken_off(edges, times)

    def misfit(start: int, end: int) -> Array:
        spans = [(when[start], when[end]), *broken.get((start, end), [])]
        return _misfit(channel.time[start:end], channel.values[start:end], spans)

    pieces = {(int(a), int(b)): misfit(int(a), int(b)) for a, b in pairwise(edges)}
    most, out = min(_MOST_PIECES, _PIECES_PER_LEG * len(pieces) + _SPARE), []
    while True:
        left = _structure(channel, np.concatenate([pieces[p] for p in sorted(pieces)]))
        out.append((len(pieces), left))
        start, end = max(pieces, key=lambda p: float(pieces[p] @ pieces[p]))
        if left < enough or len(pieces) >= most or end - start < 3:
            return out
        cut = start + _best_cut(channel.time[start:end], channel.values[start:end])
        when[cut] = float(channel.time[cut])
        del pieces[start, end]
        for a, b in ((start, cut), (cut, end)):
            pieces[a, b] = misfit(a, b)


def _broken_off(edges: Ints, times: Array) -> dict[tuple[int, int], list[tuple[float, float]]]:
    """Of the first and the last leg, of which the recording may hold a part: from when to when
    they last if they are as long as their neighbours."""
    if len(edges) < 3:
        return {}
    e, t = edges.tolist(), times.tolist()
    return {
        (e[0], e[1]): [(t[1] - (t[2] - t[1]), t[1])],
        (e[-2], e[-1]): [(t[-2], t[-2] + (t[-2] - t[-3]))],
    }


def _misfit(t: Array, y: Array, spans: list[tuple[float, float]]) -> Array:
    """What a line leaves of the points, or half a cosine over one of the spans of time, whichever
    is least."""
    if len(t) < 3:
        return np.zeros(len(t))
    y = y - y.mean()
    left = [_beside(t, y)]
    left += [_beside(np.cos(np.pi * (t - a) / max(b - a, 1e-300)), y) for a, b in spans]
    return min(left, key=lambda e: float(e @ e))


def _beside(shape: Array, y: Array) -> Array:
    """What of y (n,) of mean 0 the shape does not explain."""
    x = shape - shape.mean()
    return np.asarray(y - x * float(x @ y) / max(float(x @ x), 1e-300))


def _structure(channel: _Channel, misfit: Array) -> float:
    """Mean square of what is no noise: it repeats in the next point, or goes beyond the noise."""
    repeats = float(misfit[1:] @ misfit[:-1]) / len(misfit)
    beyond = float(misfit @ misfit) / len(misfit) - (_MISJUDGED * channel.noise) ** 2
    return max(repeats, beyond, 0.0)


def _best_cut(t: Array, y: Array) -> int:
    """Where two lines, one after the other, leave least of the points (at least three)."""
    t, y = t - t[0], y - y.mean()
    sums = np.cumsum([np.ones_like(t), t, t * t, y, t * y, y * y], axis=1)
    at = np.arange(1, len(t))
    first = sums[:, at - 1]
    return int(at[np.argmin(_left_of(first) + _left_of(sums[:, -1:] - first))])


def _left_of(sums: Array) -> Array:
    """Square sums (k,) that lines leave, of the sums (6, k) of 1, t, t^2, y, t y, y^2."""
    n, t, tt, y, ty, yy = sums
    across, spread = ty - t * y / n, tt - t * t / n
    flat = yy - y * y / n
    line = np.divide(across**2, spread, out=np.zeros_like(flat), where=spread > 0)
    return np.asarray(flat - line)
