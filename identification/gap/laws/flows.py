"""States of plays that are reached at once, or by viscoplastic flow.

What flows takes a loop over the rows, which lasts about as long for many states as for one: they
are made in one go where several are known to be wanted, and kept with the bench.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.model.bench import Bench
from identification.gap.model.flowing import flowing_play

Way = tuple[float, bool]  # flow time s, 0 for none; whether it flows with the square


@dataclass(frozen=True, eq=False)
class Flow:
    """Plays of a load (n,), of radii (k,), that follow in `time` s, 0: at once; fresh, weight (n,),
    square as in `flowing_play`."""

    load: Array
    radius: Array
    time: float
    fresh: Flags
    weight: Array | None = None
    square: bool = False

    @cached_property
    def key(self) -> bytes:
        """The same of flows that are the same."""
        weight = 0.0 if self.weight is None else self.weight
        given = (self.load, self.radius, self.time, self.fresh, weight, self.square)
        return b"".join(np.asarray(v).tobytes() for v in given)

    @property
    def kind(self) -> bytes:
        """The same of flows that can be made in one go."""
        weight = b"" if self.weight is None else self.weight.tobytes()
        return self.fresh.tobytes() + weight


def states(bench: Bench, flow: Flow) -> Array:
    """(n, k) what the plays of k thresholds have slipped, in the unit of the load."""
    if flow.time == 0:
        return bench.plays(flow.load, flow.radius, flow.fresh, flow.weight)
    make(bench, [flow])
    return bench.flows[flow.key]


def each_way(bench: Bench, ways: Sequence[Way], flow: Flow) -> Iterator[tuple[Way, Array]]:
    """The same plays (n, k) in every way."""
    each = [replace(flow, time=time, square=square) for time, square in ways]
    make(bench, each)
    yield from ((way, states(bench, one)) for way, one in zip(ways, each, strict=True))


def make(bench: Bench, flows: Sequence[Flow]) -> None:
    """Makes what `states` will be asked for."""
    by_kind: dict[bytes, dict[bytes, Flow]] = {}
    for flow in flows:
        if flow.time > 0 and flow.key not in bench.flows:
            by_kind.setdefault(flow.kind, {})[flow.key] = flow
    for many in by_kind.values():
        first, size = next(iter(many.values())), [len(f.radius) for f in many.values()]
        every = flowing_play(
            np.repeat(np.column_stack([f.load for f in many.values()]), size, axis=1),
            np.concatenate([f.radius for f in many.values()]),
            np.repeat([f.time for f in many.values()], size),
            bench.rows,
            first.fresh,
            first.weight,
            np.repeat([f.square for f in many.values()], size),
        )
        parts = np.split(every, np.cumsum(size)[:-1], axis=1)
        bench.flows.update(zip(many, parts, strict=True))
