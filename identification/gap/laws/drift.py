"""Smooth paths on the session clock, shared by the effects that drift."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.laws.interval import Coefficients, Parameter
from identification.gap.model.bench import Bench
from identification.gap.model.history import followed
from identification.gap.model.variants import WARMS_UP, Variant, variant
from identification.gap.recording.turns import largest_reversal
from identification.gap.recording.white import white_sd
from identification.turns import turning_points

RATES = (0.01, 0.03, 0.08, 0.2, 0.5)  # time constants, of the session
_SEEN = 3  # rows within the time constant
# Pieces of a free smooth path: slower than a run, as slow as an air conditioner's swing. In a
# recording that runs on and on three passes of the load tell what comes again, and every further
# one bears three pieces; where nothing is loaded, nothing tells a quick path from other events.
WINDING = "winding path"
PIECES = {"free path": 10, WINDING: 32}
LONG_PIECES, RESTING_PIECES, LEAST_PIECES = 40, 20, 4
MOST_PIECES, _ROOM_S = 100, 300.0  # of long rests; s of each, in which a room gets no warmer


def warm_ups(bench: Bench) -> dict[str, Array]:
    """Named paths (n,), 0 at the start, about 1 at the end: line, exponentials, root of time."""
    t = _clock(bench)
    out = {"linear": t, "root": np.sqrt(t)}
    for share in RATES:
        out[f"{WARMS_UP}{share:g}"] = (1 - np.exp(-t / share)) / (1 - np.exp(-1 / share))
    return out


def rates(bench: Bench) -> list[Array]:
    """The line and the exponentials (n,) of which several rates at once are made."""
    return [path for label, path in warm_ups(bench).items() if label != "root"]


def _clock(bench: Bench) -> Array:
    """(n,) 0 to 1: share of the session that is over."""
    session = bench.rows.session
    return np.asarray((session - session.min()) / bench.load_history.session_span)


def by_direction(bench: Bench) -> dict[str, Array]:
    """Direction -> (n,) 1 where it was measured, else 0: what drifts is a vector."""
    names = np.array([s.direction for s in bench.data.setups])
    return {n: (names == n)[bench.rows.setup].astype(float) for n in dict.fromkeys(names.tolist())}


def own_clock(bench: Bench) -> bool:
    """Whether a path in time can be told from a curve of the load, or from creep under one.

    It can where the load comes and goes at least three times, in runs or in cycles of one; where
    something moves before anything is loaded; or where what the spring does not explain goes back
    while the load waits. A weight that hangs all the time creeps, unless what is read goes back, or
    against the weight.
    """
    if hangs(bench) and not (_goes_back(bench.response) or _against_it(bench)):
        return False
    if bench.load_history.passes >= 3:
        return True
    # a screw that relaxes, and is put right, takes the springs to and fro
    alone = bench.response - bench.slope * bench.load
    went = _way(alone[_before(bench)], bench.noise.stated) != 0
    return went or _goes_back(alone[waited(bench)])


def _before(bench: Bench) -> Flags:
    """(n,) rows of the rest before anything was loaded, in which nothing creeps."""
    return np.asarray(np.cumsum(~bench.rows.zero | bench.rows.continuous) == 0)


def _against_it(bench: Bench) -> bool:
    """Whether what is read under a standing load goes against it, as nothing does that creeps."""
    sign = float(np.sign(bench.load.mean())) * bench.sense
    return _way(bench.response, bench.noise.stated) * sign < 0


def _way(read: Array, stated: float) -> float:
    """By how much what is read (n,) is elsewhere in its last third than in its first; 0 where that
    is not beyond what it scatters, and what is stated of one reading."""
    third = len(read) // 3
    if third < _OF_EACH:
        return 0.0
    way = float(read[-third:].mean() - read[:third].mean())
    noise = max(white_sd(np.diff(read, 2)), stated) * (2 / third) ** 0.5
    return way if abs(way) > max(_CLEARLY * noise, stated) else 0.0


def waited(bench: Bench) -> Flags:
    """(n,) rows of the one hold that most of the time of all runs went by in; none where there is
    none. What goes by between two runs goes by without a load."""
    rows = bench.rows
    after = np.where(np.append(rows.starts[1:], True), 0.0, np.diff(rows.session, append=0.0))
    span = np.bincount(rows.hold, after)
    longest = int(span.argmax())
    return np.asarray((rows.hold == longest) & (span[longest] > 0.5 * after.sum()))


def hangs(bench: Bench) -> bool:
    """Whether a load stood all the time, from before anybody looked."""
    return bench.load_history.stands and _loaded(bench)


def _goes_back(read: Array) -> bool:
    """Whether what is read (n,) under a standing load goes to and fro, as nothing does that creeps,
    by a good part of its way: by means of even pieces, beyond what these scatter. By less, where it
    does so again and again; pieces that are as long as the swings scatter with them, readings do
    not."""
    count = min(_STRETCHES, len(read) // _OF_EACH)
    if count < LEAST_PIECES:
        return False
    pieces = np.array_split(read, count)
    mean = np.array([p.mean() for p in pieces])
    way, noise = float(np.ptp(mean)), white_sd(np.diff(mean, 2))
    if _back(mean) > max(_BACK * way, _CLEARLY * noise):
        return True
    noise = white_sd(np.diff(read, 2)) / _OF_EACH**0.5
    swings = turning_points(mean, max(_SWINGS * way, _CLEARLY * noise))
    return len(swings) >= _AGAIN


def _back(path: Array) -> float:
    """How far a path (n,) goes back, whichever way it went."""
    return min(largest_reversal(path * sign) for sign in (1.0, -1.0))


_STRETCHES, _OF_EACH = 100, 4  # pieces at most; rows of each at least
_BACK, _CLEARLY = 0.33, 5.0  # of all that was seen; standard deviations
_SWINGS, _AGAIN = 0.25, 4  # of all that was seen; turning points


def paths(bench: Bench, *, shown: bool = False) -> dict[str, Array]:
    """Named paths that a drift may take here: where it can't be told from a curve of the load,
    only the straight line, and seldom (SMALL); none in one running pull or cycle. shown: whether
    the channel itself shows it without load. What is over
    before it was read a few times is no path, but a reading that is off."""
    t = _clock(bench)
    over = {f"{WARMS_UP}{share:g}" for share in RATES if np.sum(t < share) < _SEEN}
    every = {label: path for label, path in warm_ups(bench).items() if label not in over}
    if own_clock(bench) or shown:
        return every
    return {} if bench.rows.continuous else {"linear": every["linear"]}


def shares(bench: Bench, usual: tuple[float, ...], path: Array | None = None) -> tuple[float, ...]:
    """Sizes of a drift, of the deflection or the largest force: the usual ones; up to all that is
    seen, and steeper, in a recording without load; small ones where it is but a curve. path (n,):
    what it follows, where that was recorded; what goes to and fro is no curve of the load."""
    if not own_clock(bench) and (path is None or _back(path) < _BACK * np.ptp(path)):
        return usual[:SMALL]
    if not bench.rows.continuous:
        return usual
    steep = (1.0, 3.0, 10.0) if _resting_pieces(bench) > RESTING_PIECES else (1.0, 3.0)
    return (*(s for s in usual if s < 0.3), 0.3, *(steep if bench.load_history.rests else ()))


_LOADED = 0.3  # of the largest force


def _loaded(bench: Bench) -> bool:
    """A recording that starts with a force: drifts are recorded from zero on. Where a stroke is
    imposed and there is none, no force is due, and what is read is the instrument's."""
    meter, stroke = bench.data.instruments, bench.rows.rms(bench.slope * bench.load)
    if bench.imposed and stroke <= 3 * meter.displacement:
        return False
    force = bench.rows.measured_force
    first = abs(float(force[: max(1, len(force) // 100)].mean()))
    return first > max(_LOADED * float(np.abs(force).max()), 3 * meter.force)


# Of the deflection, or the largest force: what amplifiers and warming arms drift in minutes.
SMALL = 2


class FreePath(NamedTuple):
    """pieces: of its length. steady: whether its rate wanders, rather than the path itself."""

    pieces: int
    steady: bool = False

    def root(self, paths: int = 1) -> Array:
        """Root of the covariance of so many such paths, free where they start."""
        one = steady_root(self.pieces) if self.steady else path_root(self.pieces)
        return np.asarray(np.kron(np.eye(paths), one), dtype=float)


def free_paths(bench: Bench) -> dict[str, FreePath]:
    """The free smooth paths, by name; none where time and load go together. Several rates at once
    are as free as a short one of these. What heats up or cools down goes on between two runs as it
    went at the end of one and goes at the start of the next: such a path is steady."""
    if not own_clock(bench):
        return {}
    if not bench.rows.continuous:
        most = _resting_pieces(bench) if np.any(waited(bench)) else 0
        return {
            label: FreePath(max(pieces, most * (label == WINDING)))
            for label, pieces in PIECES.items()
        }
    most = _resting_pieces(bench) if bench.load_history.rests else LONG_PIECES
    pieces = min(3 * (bench.load_history.passes - 3), most)
    if pieces < LEAST_PIECES:
        return {}
    return {"free path": FreePath(pieces), "steady path": FreePath(pieces, True)}


def _resting_pieces(bench: Bench) -> int:
    """Pieces of a path while nothing is loaded anew: of hours, in which a room swings, more."""
    slow = int(min(bench.load_history.session_span / _ROOM_S, bench.rows.n / _OF_EACH))
    return min(max(RESTING_PIECES, slow), MOST_PIECES)


def free_path(bench: Bench, pieces: int) -> Array:
    """Hat functions (n, pieces) over the session; with correlated coefficients a smooth path."""
    at = np.linspace(0, 1, pieces)
    return np.asarray(np.maximum(0.0, 1 - np.abs(_clock(bench)[:, None] - at) * (pieces - 1)))


def free_variant(
    word: str,
    label: str,
    path: FreePath,
    columns: list[int],
    scales: tuple[float, ...],
    names: tuple[str, ...],
    prior: float = 2.0,
) -> Variant:
    """Drifts along such a path each, called names; columns: path by path."""
    return variant(
        word,
        label,
        columns,
        scales,
        root=path.root(len(names)),
        positive=False,
        prior=prior,
        path="free",
        form=label,
        names=names,
        pieces=path.pieces,
        steady=path.steady,
    )


def path_root(pieces: int) -> Array:
    """Root (pieces, pieces) of a random walk's covariance over the pieces, free where it starts."""
    at = np.linspace(0.15, 1, pieces)
    covariance = np.minimum(at[:, None], at) + 1e-9 * np.eye(len(at))
    return np.asarray(np.linalg.cholesky(covariance), dtype=float)


def steady_root(pieces: int) -> Array:
    """Root (pieces, pieces) of the covariance of a random walk's integral over the pieces, of any
    place and rate where it starts; of a deviation of about 1."""
    t = np.linspace(0, 1, pieces)
    low, high = np.minimum(t[:, None], t), np.maximum(t[:, None], t)
    covariance = _PLACE + t[:, None] * t + _TURNS * low**2 * (high / 2 - low / 6)
    return np.asarray(np.linalg.cholesky(covariance + 1e-9 * np.eye(pieces)), dtype=float)


_PLACE, _TURNS = 0.15, 30.0  # variance where it starts; of its rate at the end, over that at first


def changes(
    bench: Bench, v: Variant, found: Coefficients, unit: str, scale: float = 1.0
) -> dict[str, Parameter]:
    """Change from start to end of the session, per direction where it has its own."""
    names, path = v.info["names"], v.info["path"]
    per = len(found.w) // len(names)
    out = {}
    for i, name in enumerate(names):
        f = np.zeros(len(found.w))
        mine = slice(i * per, (i + 1) * per)
        if path == "free":
            f[mine.start], f[mine.stop - 1] = -1.0, 1.0
        else:
            f[mine] = _end(bench, v)
        over = "drift" if path == "each run" else "drift_over_session"
        key = over + (f"_{name}" if name else "")
        out[key] = found.linear(f, unit, scale)
    return out


def _end(bench: Bench, v: Variant) -> Array | float:
    """Where the paths of a direction are at the end of the session: 1, but temperatures may have
    come back, and what follows one late is behind it."""
    sensor = v.info.get("sensor")
    if sensor is None:
        return 1.0
    t = temperature_of(bench, sensor)
    if "lags_s" in v.info:
        return np.asarray(followed(t, bench.rows.session, v.info["lags_s"])[-1] / np.ptp(t))
    return float((t[-1] - t[0]) / np.ptp(t))


def temperature_of(bench: Bench, sensor: str) -> Array:
    """(n,) deg C of a thermometer by its number from 1, or their mean; 0 where it was not read."""
    values, none = bench.rows.temperature, np.zeros(bench.rows.n)
    if values is None or (sensor != MEAN and int(sensor) > values.shape[1]):
        return none
    return np.asarray(values.mean(axis=1) if sensor == MEAN else values[:, int(sensor) - 1])


MEAN = "mean"  # of all thermometers
TEMPERATURE = "temperature"  # path that was read
