"""The arm in its actual pose and under its actual load.

A pose error, a load across the direction or a force reading that lags change the joints' torques
and the levers. A mechanism (yield, friction, play) answers to the torque that the joint really
carries, and moves the target by the lever that it really has: a tool that is 70 mm off changes both
by as much as the wrist's joints have, and beside that a law of the simulated torques misses by many
times the noise. Drifts of the force reading are taken off elsewhere (`Bench.true_load`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from identification.arrays import Array
from identification.gap.laws.across_law import loads_across
from identification.gap.laws.lags import ahead_of_reading, kinds_of
from identification.gap.laws.law import Law, in_pose
from identification.gap.laws.leverage import changes, changes_turned
from identification.gap.model.bench import ArmState, Bench

_STANDS = frozenset({"offset", "angle", "turn"})
_PULLS = frozenset({"tangent", "as_read"})


class LawValues(NamedTuple):
    """A law with values (k,) of its terms in SI units."""

    law: Law
    values: Array


def changes_torques(law: Law) -> bool:
    """Whether a law changes the torques that other mechanisms answer to: of a pose error (offset,
    angle, turn), of a load across (tangent, as_read), or of a lag of the force channel."""
    turns = any(t.coefficient in _STANDS | _PULLS for t in law.terms)
    return turns or law.constants.get("channel") == "force"


def bench_of_actual_arm(bench: Bench, acts: Iterable[LawValues]) -> Bench:
    """A copy of the bench with the levers (n, m), torques (n, m) and true load (n,) that these laws
    make. The bench itself where none of them changes torques, without an arm, and where the
    displacement is imposed."""
    acting = [a for a in acts if changes_torques(a.law)]
    if not acting or not bench.data.arm or bench.imposed:
        return bench
    lever, moment = bench.lever, np.zeros((bench.rows.n, 3))
    across, ahead = np.zeros((bench.rows.n, 2)), np.zeros(bench.rows.n)
    for law, values in acting:
        longer, more = _levers(bench, law, values)
        lever, moment = lever + longer, moment + more
        across = across + loads_across(bench, law, values)
        ahead = ahead + _ahead(bench, law, values)
    setups, setup = bench.data.setups, bench.rows.setup
    torque = np.einsum("nk,nkj->nj", across, np.stack([s.tangent_lever for s in setups])[setup])
    force = np.einsum("nk,nkc->nc", across, np.stack([s.tangents for s in setups])[setup])
    twist = np.cross(np.stack([s.point + np.zeros(3) for s in setups])[setup], force)
    return bench.with_arm_state(ArmState(lever, torque, ahead, moment, force, twist))


def _ahead(bench: Bench, law: Law, values: Array) -> Array:
    """(n,) N by which the load is ahead of a force that lags so."""
    out = np.zeros(bench.rows.n)
    if law.constants.get("channel") == "force":
        for kind, value in zip(kinds_of(law), values, strict=True):
            out += value * ahead_of_reading(bench, kind, law.constants["lag"])
    return out


def _levers(bench: Bench, law: Law, values: Array) -> tuple[Array, Array]:
    """(n, m) m by which the levers of an arm that stands so are others, and (n, 3) m by which the
    moment of a newton about the base's origin is, that one to first order."""
    offset, turn, angles = np.zeros(3), np.zeros(3), np.zeros(bench.data.joints)
    for t, value in zip(law.terms, values, strict=True):
        if t.coefficient == "angle":
            angles[t.shape["joint"]] = value
        elif t.coefficient in _STANDS:
            (offset if t.coefficient == "offset" else turn)["xyz".index(t.shape["axis"])] = value
    levers, moments = [], []
    for s in bench.data.setups:
        shifts, swings = changes(s, offset, angles)
        levers.append(shifts @ offset + swings @ angles + changes_turned(s, turn) @ turn)
        moved = np.dot(s.shifted_point, offset) + np.dot(s.turned_point, angles)
        swung = np.cross(s.point + np.zeros(3), -np.cross(turn, s.unit_vector))
        moments.append(np.cross(moved + np.zeros(3), s.unit_vector) + swung)
    there = in_pose(bench, law.constants.get("only_in"))[:, None]
    setup = bench.rows.setup
    return np.stack(levers)[setup] * there, np.stack(moments)[setup] * there
