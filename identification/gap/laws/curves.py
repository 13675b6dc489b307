"""Curves of a load in straight pieces, and what a line makes of one that bends."""

from __future__ import annotations

import numpy as np

from identification.arrays import Array

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
