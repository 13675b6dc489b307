"""The arm as it stands and is loaded: what a wrong pose, a load across and a force that is read too
late make of the torques on its joints.

A mechanism answers to the torque that the joint really carries, and moves the target by the lever
that it really has. A tool that is 70 mm off changes both by as much as the wrist's joints have, and
otherwise in every direction; beside that a law of the simulated torques misses by many times the
noise. What a drift adds to the reading, every mechanism is told already (`Bench.true_load`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from identification.arrays import Array
from identification.gap.laws.across_law import torques_across
from identification.gap.laws.lags import ahead_of_reading, kinds_of
from identification.gap.laws.law import Law, in_pose
from identification.gap.laws.leverage import changes, changes_turned
from identification.gap.model.bench import Bench

_STANDS = frozenset({"offset", "angle", "turn"})
_PULLS = frozenset({"tangent", "as_read"})


class Acts(NamedTuple):
    """A law with values (k,) of its terms in SI units."""

    law: Law
    values: Array


def changes_torques(law: Law) -> bool:
    """Whether a law is of where the arm stands, of a load across, or of a force that is read late:
    of what changes the torques that others answer to."""
    turns = any(t.coefficient in _STANDS | _PULLS for t in law.terms)
    return turns or law.constants.get("channel") == "force"


def as_it_stands(bench: Bench, acts: Iterable[Acts]) -> Bench:
    """The bench of the arm on which these laws act, as far as they change its torques; as it was,
    where none does, or of a rig without an arm."""
    acting = [a for a in acts if changes_torques(a.law)]
    if not acting or not bench.data.arm or bench.imposed:
        return bench
    lever, aside, ahead = bench.lever, np.zeros(bench.lever.shape), np.zeros(bench.rows.n)
    for law, values in acting:
        lever = lever + _levers(bench, law, values)
        aside = aside + torques_across(bench, law, values)
        if law.constants.get("channel") == "force":
            lag = law.constants["lag"]
            for kind, value in zip(kinds_of(law), values, strict=True):
                ahead = ahead + value * ahead_of_reading(bench, kind, lag)
    return bench.standing(lever, aside, ahead)


def _levers(bench: Bench, law: Law, values: Array) -> Array:
    """(n, m) m by which the levers are others, of an arm that stands so."""
    offset, turn, angles = np.zeros(3), np.zeros(3), np.zeros(bench.data.joints)
    for t, value in zip(law.terms, values, strict=True):
        if t.coefficient == "angle":
            angles[t.shape["joint"]] = value
        elif t.coefficient in _STANDS:
            (offset if t.coefficient == "offset" else turn)["xyz".index(t.shape["axis"])] = value
    each = []
    for s in bench.data.setups:
        shifts, swings = changes(s, offset, angles)
        each.append(shifts @ offset + swings @ angles + changes_turned(s, turn) @ turn)
    there = in_pose(bench, law.constants.get("only_in"))
    return np.asarray(np.stack(each)[bench.rows.setup] * there[:, None])
