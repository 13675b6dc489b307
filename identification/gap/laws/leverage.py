"""Where arm and tool stand: a fit that goes along with the squares of the levers.

With levers l + dl a target moves by `c (l + dl)^2 F`; with dl of a tool that is 0.1 m off, what is
linear in dl leaves a tenth of that. Secants are exact where they are taken, but going from one to
the next may end anywhere: at a gain of the displacement that is seven standard deviations off.
Here the sum of squares itself is least (Levenberg 1944, Marquardt 1963).

What a wrong place does is in proportion to the load in every setup, so that of all rows a Gram
matrix with as many columns as there are setups and readings is left, from which all else is
eliminated once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.gap.data import Setup
from identification.gap.evidence.engine import Engine
from identification.gap.evidence.parts import Part
from identification.gap.explanations.fit import weighed
from identification.gap.model.variants import block

SOFTEST = 0.1  # of the simulated compliance, at least
_EVALUATIONS = 50  # at most: what is not found by then is not the place of anything


@dataclass(frozen=True, eq=False)
class Place:
    """Where arm and tool stand: offset (3,) m of the tool, angles (m,) rad of the joints, turn (3,)
    rad of the base, beside those that are simulated; softer (m,): relative changes of the springs'
    compliance."""

    offset: Array
    angles: Array
    softer: Array
    turn: Array


def changes(setup: Setup, offset: Array, angles: Array) -> tuple[Array, Array]:
    """Of a setup's levers, per metre of offset (m, 3) and radian of angles (m, m), to second order
    in both: `dl = shifts offset + turns angles` where they are."""
    m = len(setup.lever)
    across = np.broadcast_to(setup.turned_offset, (m, m, 3))
    bent = np.broadcast_to(setup.bent_lever, (m, m, m))
    shifts = setup.offset_lever + 0.5 * np.einsum("ijk,j->ik", across, angles)
    return shifts, setup.turned_lever + 0.5 * (bent @ angles + across @ offset)


def changes_turned(setup: Setup, turn: Array) -> Array:
    """(m, 3) of a setup's levers, per radian by which the base stands turned about x, y, z, exact
    where it is: turn (3,) rad, `exp(-E) - 1 = -(1 - a E + b E^2) E` (Rodrigues)."""
    E = np.cross(turn, np.eye(3)).T  # E v = turn x v
    angle = max(float(np.linalg.norm(turn)), 1e-4)
    a, b = (1 - np.cos(angle)) / angle**2, (1 - np.sin(angle) / angle) / angle**2
    series = np.eye(3) - a * E + b * E @ E
    axes = np.vstack([setup.unit_vector, setup.tangents])
    seen = -axes @ series @ np.cross(np.eye(3), setup.unit_vector).T
    return np.asarray(np.vstack([setup.lever, setup.tangent_lever]).T @ seen)


class Leverage:
    """Fits places of one kind (tool, joints, both, base) to what an engine explains."""

    def __init__(self, engine: Engine, kind: str, root: Array, pose: str, read: bool) -> None:
        """root (k, k), diagonal: standard deviations of offset, angles or turn; pose: the only one
        in which it is so, "" all; read: whether readings show where joints stand."""
        self._engine, self._kind, self._sizes = engine, kind, np.diag(root)
        bench = self._bench = engine.bench
        self._there = [pose in ("", s.pose) for s in bench.data.setups]
        rows = bench.rows
        loads = [np.where(rows.setup == s, bench.load, 0.0) for s in range(len(self._there))]
        units = np.eye(bench.data.joints)
        columns = [bench.stacked(load) for load in loads]
        if bench.has_q:
            columns += [bench.stacked(q=np.outer(load, u)) for load in loads for u in units]
            stands = np.array(self._there, dtype=float)[rows.setup] * read
            columns += [bench.stacked(q=np.outer(stands, u)) for u in units]
        self._columns = np.column_stack(columns)
        self._own = np.array([n.startswith("spring") for n in engine.base.names], dtype=bool)

    def place(self, eta: float, beside: Iterable[Part], start: Array) -> Place:
        """The likeliest one with an imperfection of eta m, beside other parts, from start (k,)
        on."""
        from scipy.optimize import least_squares

        root, base = self._eliminated(eta, tuple(beside)), self._engine.base
        own = base.sd[self._own]

        def off(x: Array) -> Array:
            shown = np.concatenate([self._shown(x), x[len(self._sizes) :], [-1.0]])
            prior = np.concatenate([self._sizes, own])
            return np.concatenate([root @ shown, x / prior])

        first = np.concatenate([start, np.zeros(len(own))])
        scale = np.concatenate([self._sizes, own])
        found = least_squares(off, first, x_scale=scale, method="lm", max_nfev=_EVALUATIONS)
        return self._at(np.asarray(found.x))

    def _eliminated(self, eta: float, beside: tuple[Part, ...]) -> Array:
        """Root (z, z) of the squares of what is shown, with all else eliminated: the order is that
        of the columns, springs of the base, target."""
        engine = self._engine
        others = [c for p in beside for c in p.variant.columns]
        roots = block([np.diag(engine.base.sd[~self._own]), *(p.root for p in beside)])
        rest = np.hstack([engine.base.columns[:, ~self._own], engine.columns(others)]) @ roots
        shown = np.column_stack([self._columns, engine.base.columns[:, self._own], engine.target])
        every, k = np.hstack([rest, shown]), rest.shape[1]
        gram = every.T @ weighed(engine, every, eta)
        inner = gram[:k, :k] + np.eye(k)
        left = gram[k:, k:] - gram[k:, :k] @ np.linalg.solve(inner, gram[:k, k:])
        unit = np.sqrt(np.maximum(np.diag(gram)[k:], np.finfo(float).tiny))  # N, rad and m
        values, vectors = np.linalg.eigh(left / np.outer(unit, unit))
        return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * unit)

    def _at(self, x: Array) -> Place:
        """Of unknowns x: offset, angles or turn; changes of the springs that the base knows."""
        m, k = self._bench.data.joints, len(self._sizes)
        offset, angles, turn, softer = np.zeros(3), np.zeros(m), np.zeros(3), np.zeros(m)
        if self._kind == "base":
            turn = x[:k]
        if self._kind in ("tool", "both"):
            offset = x[:3]
        if self._kind in ("joints", "both"):
            angles = x[k - m : k]
        softer[list(self._engine.base.springs)] = x[k:]
        return Place(offset, angles, softer, turn)

    def _shown(self, x: Array) -> Array:
        """Coefficients of the columns: motion of the target per newton and setup; turn of every
        joint per newton, and where it stands."""
        at = self._at(x)
        compliance = self._bench.compliance * np.maximum(1 + at.softer, SOFTEST)
        moves, turns = [], []
        for setup, there in zip(self._bench.data.setups, self._there, strict=True):
            if self._kind == "base":
                change = changes_turned(setup, at.turn) @ at.turn
            else:
                shifts, swings = changes(setup, at.offset, at.angles)
                change = shifts @ at.offset + swings @ at.angles
            change = change * there
            moves.append(float(compliance * (2 * setup.lever + change) @ change))
            turns.append(compliance * change)
        if not self._bench.has_q:
            return np.array(moves)
        return np.concatenate([moves, *turns, at.angles])
