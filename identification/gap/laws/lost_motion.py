"""Shapes of lost motion: where in its play a joint lies, and the friction beside that."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.model.bench import Bench
from identification.running import first_rows, stretches

KEPT = ("kept", "kept 1/2", "jumps")  # where the push before left it
SOFTER = 2.5  # of soft ends one than the other
UNEVEN = {"softer up": (SOFTER, 1.0), "softer down": (1.0, SOFTER)}
_LOOSE = ("free", "friction", "friction 1/2", "friction 3", "soft", "slow", "arctan")
PLACED = ("gap", "carried", "held", "dragged")  # by the data: flanks.py
HELD = ("rubbing", *KEPT)  # stays where it was left: no free place
KINDS = (*_LOOSE, "rubbing", *KEPT)
MOST_RUB = 0.25  # of it at most
_RADII = {"friction": 1.0, "friction 3": 3.0, "rubbing": 0.7, "friction 1/2": 0.5}  # zones


class Play:
    """A play of one zone (Nm) on the net torque x (n,) of a joint. Its memory is lost in every
    setup, as that of the free places is; of `KEPT` only when the arm moves, whichever way it is
    pushed next."""

    def __init__(self, bench: Bench, x: Array, zone: float) -> None:
        self._bench, self._x, self._zone = bench, x, zone

    def place(self, kind: str) -> Array:
        """(n,) -1/2 to 1/2."""
        x, zone = self._x, self._zone
        if kind in _RADII:
            state = self._states[:, list(_RADII).index(kind)] / zone
            soft = kind in ("friction 3", "rubbing")
            return np.asarray(np.tanh(state) if soft else np.clip(state, -1, 1)) / 2
        if kind == "jumps":
            return _side(x, zone, self._bench.moved) / 2
        if kind in KEPT:
            return np.clip(self._kept[:, KEPT.index(kind)] / zone, -1, 1) / 2
        if kind == "free":
            return np.tanh(x / zone) / 2
        if kind == "slow":
            return np.asarray(x / (np.abs(x) + zone) / 2)
        if kind == "sprung":
            return np.asarray(np.clip(x / (2 * zone), -1, 1)) / 2
        if kind == "arctan":
            return np.arctan(x / zone) / np.pi
        up, down = UNEVEN.get(kind, (1.0, 1.0))
        return _ends(x, up * zone, down * zone)

    def rub(self, kind: str) -> Array:
        """(n,) the friction beside it, of the zone's strength."""
        return self._kept_rub if kind in KEPT else self._rub

    @cached_property
    def _states(self) -> Array:
        radii = self._zone * np.array(list(_RADII.values()))
        return self._bench.plays(self._x, radii, self._bench.rebuilt)

    @cached_property
    def _kept(self) -> Array:
        return self._bench.plays(self._x, self._zone * np.array([1.0, 0.5]), self._bench.moved)

    @cached_property
    def _rub(self) -> Array:
        return np.asarray(-(self._x - self._states[:, 0]) / (2 * self._zone))

    @cached_property
    def _kept_rub(self) -> Array:
        return np.asarray(-(self._x - self._kept[:, 0]) / (2 * self._zone))


def _ends(x: Array, up: float, down: float) -> Array:
    """(n,) -1/2 to 1/2: place in the play under the net torque x (n,), its ends soft over these."""
    return np.where(x > 0, -np.expm1(-np.maximum(x, 0) / up), np.expm1(np.minimum(x, 0) / down)) / 2


def _side(x: Array, zone: float, fresh: Flags) -> Array:
    """(n,) -1 or 1: the side of its play to which the net torque x (n,) last pushed a joint that
    friction of the zone's strength holds there; 0, its middle, until it is pushed after fresh."""
    pushed = np.abs(x) > zone
    knows = pushed | fresh
    knows[0] = True
    last = np.maximum.accumulate(np.where(knows, np.arange(len(x)), 0))
    return np.where(pushed[last], np.sign(x[last]), 0.0)


def net(bench: Bench, j: int, crossing: str, kg: float, preload: float = 0.0) -> Array:
    """(n,) Nm whose zero the play is passed at: of the load, or with the weights and a tool of that
    mass; with a preload (Nm)."""
    torque = bench.true_torque[:, j]
    return preload + (torque + bench.weight(j, kg) if crossing == "weight" else torque)


def resting_columns(bench: Bench, joint: int) -> dict[str, Array]:
    """Pose -> column (size,) of a reading that is off in it: the controller sends the joint to
    where its reading should be, whichever side of its play it lies at."""
    if not bench.has_q:
        return {}
    poses, out = [s.pose for s in bench.data.setups], {}
    for pose in dict.fromkeys(poses):
        q = np.zeros((bench.rows.n, bench.data.joints))
        q[np.array([p == pose for p in poses])[bench.rows.setup], joint] = 1.0
        out[pose] = bench.stacked(q=q)
    return out


def free_places(bench: Bench, loose: Flags) -> Iterator[tuple[int, bool, Flags]]:
    """Setup, whether in its first run, and rows (n,) of every place that is left free: where the
    joint is loose (n,), of setups in which it is held as well."""
    for s in range(len(bench.data.setups)):
        held = not np.all(loose[bench.rows.setup == s])
        for first in (True, False):
            place = loose_in(bench, s, first, loose)
            if held and place.any():
                yield s, first, place


def loose_in(bench: Bench, s: int, first: bool, loose: Flags) -> Flags:
    """(n,) loose rows of a setup, in its first run or in later ones."""
    rows = bench.rows
    mine = rows.setup == s
    in_first = rows.run == rows.run[mine].min()
    return np.asarray(mine & loose & (in_first if first else ~in_first))


def less_rub(k: int) -> Array:
    """(k,) of the coefficients, positive where the play is so much larger than the friction beside
    it: more of it is hysteresis."""
    out = np.zeros(k)
    out[:2] = 1.0, -1.0 / MOST_RUB
    return out


def within_play(k: int, work: Array) -> Array:
    """(m, k) of the coefficients: a play of that zone rubs as much too much at most as too little;
    free places, from the third on, are no further off than half of the play, to either side; both
    together use up work, of which each takes `work` (2,), and give out none."""
    free = np.eye(k)[2:]
    out = np.zeros((1 + 2 * len(free), k))
    out[:, 0], out[0, 1] = 1.0, 1.0 / MOST_RUB
    out[1::2] += 2.0 * free
    out[2::2] -= 2.0 * free
    if not np.any(work):
        return out
    return np.vstack([out, np.pad(work / np.linalg.norm(work), (0, k - 2))])


def work_taken(bench: Bench, x: Array, places: Array) -> Array:
    """(k,) Nm: work that net torques x (n,) do on places (n, k), in all runs together, beyond what
    the torque at the start of each does. None is known where the load went further than rows
    show."""
    run = bench.rows.run
    if np.any(bench.rows.overshoot):
        return np.zeros(places.shape[1])
    beyond = x - x[first_rows(run)][stretches(run)]
    same = run[1:] == run[:-1]
    mean = np.where(same, (beyond[1:] + beyond[:-1]) / 2, 0.0)
    return np.asarray(mean @ np.diff(places, axis=0))


def crosses(net: Array, torque: Array) -> bool:
    """Whether the net torque comes to zero, or near it (weights are known to a few percent)."""
    margin = 0.05 * float(np.abs(net - torque).max()) + 0.02 * float(np.abs(torque).max())
    return bool(net.min() < margin and net.max() > -margin)
