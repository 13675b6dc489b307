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

from itertools import pairwise

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import ZERO, GapData
from identification.gap.recording.bins import even_path
from identification.gap.recording.holds import hold_ids, is_continuous
from identification.gap.recording.pieces import MISJUDGED, TOP, TURNS, Channel, cost, legs, zigzag
from identification.gap.recording.turns import largest_reversal, turns
from identification.gap.recording.white import white_sd
from identification.running import first_rows

_POINTS = 1000  # bins of a recording: more do not tell the path better
_CLOSEST = 3e-7  # of the squared range: a piece that leaves less is as good as exact
_MARGIN = 0.05  # nats by which the displacement has to be simpler: half a piece
_SLIDING = -2.5  # nats, where it slides to and fro: so much simpler the force may look by chance
_FLAT = 0.33  # of the displacement's change, each in its range: what the force changes on a plateau
_SPENT, _MOST = 0.15, 0.45  # of the time, and of the way, in each sense
_TURNS_BY = 0.1  # of the force's range, along most of the ways there and back
_BEYOND = 3.0  # standard deviations of a point: so far it goes from one mean of points to the next
_STILL = 2.0  # stated standard uncertainties: a channel that spreads by no more stands still
_FOLLOWS = 0.5  # of its variance that the other channel explains
_PASS, _OFTEN = 0.5, 4  # of the range; turns
_ELSEWHERE, _ALIKE = 0.04, 0.2  # of the range; of what the other channel does
_FEWEST = 20  # samples: fewer show no path


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
    common = min(map(legs, channels))
    by_force, by_moved = (cost(c, floor, common) for c in channels)
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
    back = largest_reversal(path) > _NO_FORCE * float(path.max())
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
    return bool(fell and way[last] - way[first] > _FURTHER and largest_reversal(way) < TOP)


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


def _slides(force: Channel, moved: Channel) -> bool:
    """Whether the displacement goes to and fro while the force hardly changes but at the turns: a
    force that was driven would hold such a plateau in one sense only, as under a weight, or run
    through it; what rings under a force that stands goes all of its ways at that one."""
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
    starts = np.flatnonzero(np.diff(sense, prepend=0.0))
    spans = [float(np.ptp(force.values[a : b + 1])) for a, b in pairwise([*starts, len(sense)])]
    ways = np.add.reduceat(np.abs(went), starts)
    return bool(ways @ (np.array(spans) > _TURNS_BY) > 0.5 * ways.sum())


def _coarser(channel: Channel, step: int) -> Channel:
    """Means of so many points each."""
    edges = np.arange(0, len(channel.values), step)
    count = np.diff(np.append(edges, len(channel.values)))
    mean = [np.add.reduceat(y, edges) / count for y in (channel.time, channel.values)]
    return Channel(mean[0], mean[1], channel.noise / step**0.5)


def _senses(channel: Channel) -> Array:
    """(n - 1,) sense of the leg that every step from point to point belongs to."""
    y = channel.values
    edges = np.minimum(zigzag(y, max(TURNS[-1], 6 * channel.noise)), len(y) - 1)
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
) -> tuple[Channel, Channel]:
    """Both channels in the same bins. The noise is what second differences show (their median, so
    that jumps do not count), and no more than a stated uncertainty that was misjudged: a coarse
    recording shows its bends there."""
    edges = _edges(values)
    count = np.diff(np.append(edges, len(time)))

    def mean(y: Array) -> Array:
        return np.asarray(np.add.reduceat(y, edges) / count)

    def one(y: Array, sd: float) -> Channel:
        points = mean(y)
        span = float(np.ptp(points)) or 1.0
        shown = min(white_sd(np.diff(points, 2)), MISJUDGED * sd)
        return Channel(mean(time), points / span, shown / span)

    return one(values[0], sds[0]), one(values[1], sds[1])


def _edges(values: tuple[Array, Array]) -> Ints:
    """First samples of bins of equal path."""
    n = len(values[0])
    if n <= _POINTS:
        return np.arange(n)
    return first_rows(even_path(*values, _POINTS))
