"""Curves of a load in straight pieces, and what a line makes of one that bends."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array
from identification.gap.evidence.alike import NEIGHBOUR

BENT_SLOPE = 0.75  # of the straight line of least squares through zero of x |x|, 0 to 1


def hinge(x: Array, bend: float) -> Array:
    """(n,) by how much the size of x (n,) is beyond a bend, with its sign."""
    return np.asarray(np.sign(x) * np.maximum(np.abs(x) - bend, 0.0))


def beyond(torque: Array, weight: Array, bend: float) -> Array:
    """(n,) by how much the size of the net torque is beyond a bend, with its sign, more than under
    the weight (n,) alone."""
    net = torque + weight
    return np.asarray(hinge(net, bend) - hinge(weight, bend))


def above(torque: Array, weight: Array, bend: float) -> Array:
    """(n,) by how much the net torque is above a bend more than under the weight (n,) alone."""
    return np.asarray(np.maximum(torque + weight - bend, 0.0) - np.maximum(weight - bend, 0.0))


def slopes(bends: int) -> Array:
    """(bends + 1, bends + 1) what a line and hinges, these in order, have for slopes up to each of
    the hinges and beyond the last."""
    return np.tril(np.ones((bends + 1, bends + 1)))


def from_level_to_level(places: Array) -> Array:
    """Root of the prior of a line and hinges between places (k + 1,), so that the curve at these
    is as rough as the imperfection of laws is (`evidence.alike`), none at the first of them."""
    near = np.exp(-np.abs(places[:, None] - places) / NEIGHBOUR)
    from_first = near - near[:1] - near[:, :1] + 1.0
    covariance = from_first[1:, 1:] + 1e-9 * np.eye(len(places) - 1)
    slopes = np.diff(np.eye(len(places)), axis=0)[:, 1:] / np.diff(places)[:, None]
    bends = np.diff(slopes, axis=0, prepend=0.0)
    return np.asarray(bends @ np.linalg.cholesky(covariance))
