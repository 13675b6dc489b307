"""Elements with memory, sample by sample: friction in parallel, and Maxwell's."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rig.arrays import Array


def stops(path: Array, limit: Array, stiff: Array) -> Array:
    """(n,) force of springs (k,) in series with sliders (k,) that give way at `limit` each
    (Iwan 1966; the stop operators of Prandtl). They start without load at the first sample."""
    state = np.zeros(len(limit))
    out = np.zeros(len(path))
    for i, step in enumerate(np.diff(path), start=1):
        state = np.minimum(np.maximum(state + stiff * step, -limit), limit)
        out[i] = state.sum()
    return out


def slider(path: Array, limit: Array) -> Array:
    """(n,) force of one spring of stiffness 1 with a slider whose limit (n,) changes on the way."""
    out, state = np.empty(len(path)), 0.0
    steps = np.diff(path, prepend=path[0]).tolist()
    for i, (step, most) in enumerate(zip(steps, limit.tolist(), strict=True)):
        state = min(max(state + step, -most), most)
        out[i] = state
    return out


def pursuit(path: Array, goal: Array, length: float, start: float = 0.0) -> Array:
    """(n,) a state that nears `goal` (n,) exponentially over the distance gone: Dahl's presliding
    (1968), with LuGre's steady state as its goal."""
    out, state = np.empty(len(path)), start
    keep = np.exp(-np.abs(np.diff(path, prepend=path[0])) / length).tolist()
    for i, (share, end) in enumerate(zip(keep, goal.tolist(), strict=True)):
        state = end + (state - end) * share
        out[i] = state
    return out


def lowpass(time: Array, signal: Array, tau: float) -> Array:
    """(n,) a first-order filter's answer; exact for a signal that goes straight from sample to
    sample, so that it comes late by tau, and not by half a sample less."""
    out, late = np.empty(len(signal)), 0.0  # by how much the answer lies behind the signal
    change = np.diff(time, prepend=time[0]) / tau
    fades = np.exp(-change).tolist()
    grows = np.divide(-np.expm1(-change), change, out=np.ones(len(change)), where=change > 0)
    steps = np.diff(signal, prepend=signal[0])
    for i, (share, step) in enumerate(zip(fades, (grows * steps).tolist(), strict=True)):
        late = late * share + step
        out[i] = late
    return np.asarray(signal - out)


def maxwell(time: Array, strain: Array, tau: Array, weight: Array) -> Array:
    """(n,) overstress of Maxwell elements (k,), exact for straight pieces of strain."""
    state, out = np.zeros(len(tau)), np.zeros(len(strain))
    pieces = zip(np.diff(time).tolist(), np.diff(strain).tolist(), strict=True)
    for i, (dt, de) in enumerate(pieces, start=1):
        x = dt / tau
        decay = np.exp(-x)
        state = state * decay + de * np.where(x > 1e-8, (1 - decay) / np.maximum(x, 1e-300), 1.0)
        out[i] = weight @ state
    return out


def chaboche(strain: Array, back: Sequence[tuple[float, float]], q: float, b: float) -> Array:
    """(n,) stress of a metal with modulus 1 and yield stress 1 (Chaboche 1986): backstresses
    (modulus, rate of recovery), and a yield surface that grows by q at the rate b."""
    alpha, radius, stress = [0.0] * len(back), 1.0, 0.0
    out = np.empty(len(strain))
    for i, step in enumerate(np.diff(strain, prepend=strain[0]).tolist()):
        parts = max(1, math.ceil(abs(step) / 0.05))
        for _ in range(parts):
            stress += step / parts
            over = abs(stress - sum(alpha)) - radius
            if over <= 0:
                continue
            sign = math.copysign(1.0, stress - sum(alpha))
            slope = sum(c - g * a * sign for (c, g), a in zip(back, alpha, strict=True))
            p = over / max(1.0 + slope + b * (q + 1.0 - radius), 0.05)
            alpha = [a + (c * sign - g * a) * p for (c, g), a in zip(back, alpha, strict=True)]
            radius += b * (q + 1.0 - radius) * p
            stress = sum(alpha) + sign * radius
        out[i] = stress
    return out


def bouc_wen(path: Array, n: float, gamma: float, weaken: float, soften: float) -> Array:
    """(n,) hysteretic part with unit slope and unit strength at first (Bouc, Wen; Baber and Noori
    1985 for what wears: strength falls by `weaken`, slope by `soften` per unit of work)."""
    z, work, out = 0.0, 0.0, np.empty(len(path))
    for i, step in enumerate(np.diff(path, prepend=path[0]).tolist()):
        parts = max(1, math.ceil(abs(step) / 0.05))
        dx = step / parts
        for _ in range(parts):
            turn = 1.0 if dx * z > 0 else -1.0
            pull = abs(z) ** n * (gamma * turn + 1.0 - gamma) * (1.0 + weaken * work)
            z += dx * (1.0 - pull) / (1.0 + soften * work)
            work += abs(z * dx)
        out[i] = z
    return out


def rough(random: np.random.Generator, n: int, pieces: int) -> Array:
    """(n,) a smooth wander of sd about 1: a random walk through `pieces` points."""
    knots = np.cumsum(random.standard_normal(pieces + 1)) / np.sqrt(pieces)
    return np.asarray(np.interp(np.linspace(0, pieces, n), np.arange(pieces + 1), knots))
