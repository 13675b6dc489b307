"""What a mechanism with memory went through, load after load: those of the rows, and others."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.model.history import bristles, play, whiles


@dataclass(frozen=True, eq=False)
class Path:
    """Loads (m,), one after the other; rest (m,): before which it was zero; fresh (m,): before
    which the mechanism forgot; kept (m,): those of the n rows; weight (m,): what acts beside.
    worked_in: it was cycled before."""

    load: Array
    rest: Flags
    fresh: Flags
    kept: Flags
    weight: Array | None = None
    worked_in: bool = False

    def plays(self, radius: Array) -> Array:
        """States (n, k) of plays of radii (k,)."""
        tiled = np.tile(self.load[:, None], (1, len(radius)))
        beside = 0.0 if self.weight is None else self.weight[:, None]
        return self.at_rows(play(tiled, radius, self.rest, self.fresh, beside))

    def bristles(self, reach: Array, elastic: bool) -> Array:
        """States (n, k) of bristles that bend over reaches (k,)."""
        return self.at_rows(bristles(self.load, reach, self.fresh, elastic, self.weight))

    def slacks(self, radius: Array) -> Array:
        """(n, k) in units of the load: force of elements that slip at thresholds (k,) and wear
        their holes by that. One carries nothing until the load is back where it was last pushed to,
        less the threshold; each sense has a clearance of its own."""
        out = np.zeros((len(self.load), len(radius)))
        for a, b in whiles(self.fresh):
            for sign in (1.0, -1.0):
                pushed = sign * self.load[a:b]
                worn = np.maximum(np.maximum.accumulate(pushed)[:, None] - radius, 0.0)
                out[a:b] += sign * np.maximum(pushed[:, None] - worn, 0.0)
        return self.at_rows(out)

    def at_rows(self, states: Array) -> Array:
        """Those of states (m, ...) that rows show."""
        return states if self.kept.all() else states[self.kept]


def load_path(
    load: Array,
    rest: Flags,
    fresh: Flags,
    weight: Array | None,
    overshoot: Array,
    onward: Array | float = 0.0,
) -> Path:
    """The path of a load (n,) that before a row, on the way there, went beyond it by a share
    (overshoot (n,), 0: it did not) of that load, or first (onward (n,), likewise) beyond that of
    the row before."""
    on = np.broadcast_to(np.asarray(onward), load.shape)
    if not (overshoot.any() or on.any()):  # most paths go from row to row
        return Path(load, rest, fresh, np.ones(len(load), dtype=bool), weight)
    further = np.where(on != 0, np.roll(load, 1) * (1.0 + on), load * (1.0 + overshoot))
    row = np.repeat(np.arange(len(load)), 1 + ((overshoot != 0) | (on != 0)))
    kept = np.append(row[1:] != row[:-1], True)
    first = np.insert(kept[:-1], 0, True)
    return Path(
        np.where(kept, load[row], further[row]),
        rest[row] & first,
        fresh[row] & first,
        kept,
        None if weight is None else weight[row],
    )


def worked_in(path: Path) -> Path:
    """The path, without weights, with a cycle to its largest load and back before every fresh
    start."""
    parts, begins, kept = [], [], []
    for a, b in whiles(path.fresh):
        load = path.load[a:b]
        top = load[int(np.abs(load).argmax())]
        parts.append(np.concatenate([[top, 0.0], load]))
        begins.append(np.concatenate([[True], np.zeros(b - a + 1, dtype=bool)]))
        kept.append(np.concatenate([[False, False], path.kept[a:b]]))
    fresh = np.concatenate(begins)
    return Path(np.concatenate(parts), fresh, fresh, np.concatenate(kept), worked_in=True)


def with_loads(path: Path, by: Array) -> Path:
    """The path of what loads become, by (m,)."""
    return replace(path, load=by)
