"""Where the channels of an observation lie, one below the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.data import GapData
from identification.gap.recording.rows import Rows


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the channels lie in a stacked vector of `size`; empty slices for what is missing."""

    n: int
    joints: int
    q: slice
    tangential: slice
    zero_force: slice
    size: int

    def stacked(
        self,
        rows: Rows,
        response: Array | None = None,
        q: Array | None = None,
        tangential: Array | None = None,
        zero_force: Array | None = None,
    ) -> Array:
        """(size,) of response (n,), q (n, m), tangential (n, 2), zero_force (n,), as far as there
        are such channels: joint readings and force across the direction are too coarse to tell more
        of a hold than where it lies."""
        out = np.zeros(self.size)
        if response is not None:
            out[: self.n] = response
        if q is not None and self.q.stop > self.q.start:
            out[self.q] = rows.hold_means(q).T.reshape(-1)
        if tangential is not None and self.tangential.stop > self.tangential.start:
            out[self.tangential] = rows.hold_means(tangential).T.reshape(-1)
        if zero_force is not None and self.zero_force.stop > self.zero_force.start:
            out[self.zero_force] = zero_force[rows.zero]
        return out

    def read_in(self, row: Flags, held: Flags) -> Flags:
        """(size,) what moved, as read in rows (n,) and their holds (h,); of all rows what they were
        loaded with: like the load itself that is given."""
        out = np.ones(self.size, dtype=bool)
        out[: self.n] = row
        out[self.q] = np.tile(held, (self.q.stop - self.q.start) // max(len(held), 1))
        return out


def layout_of(data: GapData, rows: Rows, imposed: bool) -> Layout:
    """Of the channels that the data have; (n, m) from the rows and the joints."""
    n, m, h = rows.n, data.joints, len(rows.edges)
    q = h * m if data.q is not None and data.output_encoder else 0
    t = 0 if rows.tangential is None else 2 * h
    # what is held at no displacement may still be pressed, or pulled
    z = 0 if imposed or data.imposed == "displacement" else int(rows.zero.sum())
    return Layout(
        n,
        m,
        slice(n, n + q),
        slice(n + q, n + q + t),
        slice(n + q + t, n + q + t + z),
        n + q + t + z,
    )
