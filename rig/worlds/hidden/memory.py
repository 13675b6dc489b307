"""Laws with memory: what a load history (n) leaves, in units of the load.

Own formulations: friction by closed loops of a stress-strain backbone (Masing 1926), flow by its
rate equation, springs in time by exact exponential steps. Every law starts anew where `standing`
(n) changes: the arm drives to another pose and its friction works in afresh.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.scene import Index

Backbone = Callable[[float], float]


def play(load: Array, width: float, fresh: Index) -> Array:
    """What follows the load at a distance of `width` at most: sharp yield without hardening."""
    out = np.empty_like(load)
    state = 0.0
    for i, x in enumerate(load.tolist()):
        if i and fresh[i] != fresh[i - 1]:
            state = 0.0
        state = min(max(state, x - width), x + width)
        out[i] = state
    return out


def loops(load: Array, backbone: Backbone, fresh: Index) -> Array:
    """Masing's loops: the odd `backbone` on first loading; after a turn twice its half; a loop
    that closes is forgotten."""
    out = np.empty_like(load)
    # open branches: load and answer where each began, and the load at which it is forgotten
    turns: list[tuple[float, float]] = []
    last, answer, sense = 0.0, 0.0, 0
    for i, x in enumerate(load.tolist()):
        if i and fresh[i] != fresh[i - 1]:
            turns, last, answer, sense = [], 0.0, 0.0, 0
        if x != last:
            now = 1 if x > last else -1
            if sense and now != sense:
                turns.append((last, answer))
            sense = now
            turns = _forget(turns, x, sense)
        if turns:
            x0, y0 = turns[-1]
            answer = y0 + math.copysign(2.0 * backbone(abs(x - x0) / 2.0), x - x0)
        else:
            answer = math.copysign(backbone(abs(x)), x)
        out[i] = answer
        last = x
    return out


def _forget(turns: list[tuple[float, float]], x: float, sense: int) -> list[tuple[float, float]]:
    """The open branches after the load has come to x."""
    while len(turns) >= 2 and sense * (x - turns[-2][0]) >= 0.0:
        turns = turns[:-2]
    if len(turns) == 1 and abs(x) > abs(turns[0][0]):
        turns = []
    return turns


def flow(
    time: Array, load: Array, limit: float, viscosity_s: float, power: float, fresh: Index
) -> Array:
    """Overstress flow (Perzyna 1966): `y' = (<|x - y| - limit> / limit)^power limit / T`."""
    out = np.empty_like(load)
    y, before = 0.0, float(time[0])
    for i, (t, x) in enumerate(zip(time.tolist(), load.tolist(), strict=True)):
        if i and fresh[i] != fresh[i - 1]:
            y = 0.0
        y = _flowed(y, x, t - before, limit, viscosity_s, power)
        before = t
        out[i] = y
    return out


def _flowed(y: float, x: float, dt: float, limit: float, viscosity_s: float, power: float) -> float:
    """`y` after dt seconds; closed form of the overstress's decay."""
    over = abs(x - y) - limit
    if over <= 0.0 or dt <= 0.0:
        return y
    if power == 1.0:
        left = over * math.exp(-dt / viscosity_s)
    else:
        s = over / limit
        s = (s ** (1.0 - power) + (power - 1.0) * dt / viscosity_s) ** (1.0 / (1.0 - power))
        left = s * limit
    return y + math.copysign(over - left, x - y)


def backstress(
    load: Array, limit: float, first: float, recall: float, second: float, fresh: Index
) -> Array:
    """Plastic path with two back stresses (Armstrong, Frederick 1966; Chaboche 1986), of which
    one saturates at `first / recall`: at yield `dy = dx / (first - recall a sign + second)`."""
    out = np.empty_like(load)
    a = b = y = last = 0.0
    for i, x in enumerate(load.tolist()):
        if i and fresh[i] != fresh[i - 1]:
            a = b = y = last = 0.0
        rise = x - last
        last = x
        over = abs(x - a - b) - limit
        sign = 1.0 if x > a + b else -1.0
        if over > 0.0 and rise * sign > 0.0:
            parts = 8
            for _ in range(parts):
                dy = sign * over / parts / (first - recall * a * sign + second)
                a += first * dy - recall * a * abs(dy)
                b += second * dy
                y += dy
        out[i] = y
    return out


def rounded_knee(load: Array, limit: float, ratio: float, sharpness: float, fresh: Index) -> Array:
    """Plastic path of the smooth bilinear law of Menegotto and Pinto (1973), load-controlled.

    Per branch the law `s = b e + (1 - b) e / (1 + |e|^R)^(1/R)` runs from the point of the turn to
    the point where the asymptotes meet; it is turned around by a table.
    """
    e = np.concatenate([np.linspace(0.0, 3.0, 1500), np.geomspace(3.01, 400.0, 600)])
    s = ratio * e + (1 - ratio) * e / (1 + e**sharpness) ** (1 / sharpness)
    out = np.empty_like(load)
    edges = np.flatnonzero(np.diff(fresh, prepend=fresh[0] - 1))
    for begin, end in zip(edges, [*edges[1:], len(load)], strict=True):
        out[begin:end] = _branches(load[begin:end], limit, ratio, e, s)
    return out


def _branches(load: Array, limit: float, ratio: float, e: Array, s: Array) -> Array:
    rise = np.sign(np.diff(load, prepend=0.0))
    total = np.zeros_like(load)
    x0 = y0 = 0.0
    i = 0
    while i < len(load):
        sense = rise[i]
        j = i + 1
        while j < len(load) and (rise[j] == sense or rise[j] == 0.0 or sense == 0.0):
            sense = sense or rise[j]
            j += 1
        if sense:
            # elastic line from the turn meets the hardening asymptote of this sense
            meet = sense * limit - (x0 - y0) / (1 - ratio)
            reach = max(abs(meet - y0), 1e-3 * limit)
            total[i:j] = y0 + sense * reach * np.interp(np.abs(load[i:j] - x0) / reach, s, e)
        else:
            total[i:j] = y0
        x0, y0, i = load[j - 1], total[j - 1], j
    return np.asarray(total - load)


def bristles(load: Array, reach: float, power: float, gamma: float, fresh: Index) -> Array:
    """Friction state -1..1 of Bouc (1967) and Wen (1976) carried along by the load:
    `z' = x' (1 - |z|^power (gamma sign(x' z) + 1 - gamma)) / reach`; gamma 1, power 1: Dahl."""
    out = np.empty_like(load)
    z = last = 0.0
    for i, x in enumerate(load.tolist()):
        if i and fresh[i] != fresh[i - 1]:
            z = last = 0.0
        part = (x - last) / reach / 4.0
        for _ in range(4):
            side = 1.0 if part * z > 0 else -1.0
            z += part * (1.0 - abs(z) ** power * (gamma * side + 1.0 - gamma))
            z = min(max(z, -1.0), 1.0)
        last = x
        out[i] = z
    return out


def retarded(time: Array, load: Array, times_s: Array, weights: Array) -> Array:
    """Sum of Kelvin elements `T y' = x - y` with weights; the load runs straight between instants,
    for which the step is exact. The clock goes on through rests."""
    return np.asarray(retarded_each(time, load, times_s) @ weights)


def plays(load: Array, widths: Array, fresh: Index) -> Array:
    """(n, c) `play` of many at once: loads (n, c) with a width (c) each."""
    begins = np.diff(fresh, prepend=fresh[0]) != 0
    moves = np.any(np.diff(load, axis=0, prepend=np.inf) != 0.0, axis=1) | begins
    at = np.flatnonzero(moves)
    low, high = load[at] - widths, load[at] + widths
    out = np.empty((len(at), load.shape[1]))
    state = np.zeros(load.shape[1])
    for k, i in enumerate(at):
        if begins[i]:
            state = np.zeros(load.shape[1])
        state = np.minimum(np.maximum(state, low[k]), high[k])
        out[k] = state
    return np.asarray(out[np.cumsum(moves) - 1])


def retarded_each(time: Array, load: Array, times_s: Array) -> Array:
    """(n, times) the Kelvin elements of `retarded`, each by itself."""
    dt = np.diff(time, prepend=time[0])[:, None]
    decay = np.exp(-dt / times_s)
    ramp = np.where(dt > 0, times_s / np.maximum(dt, 1e-12) * (1 - decay), 1.0)
    rise = np.diff(load, prepend=0.0)
    # what is missing to the load decays, and grows by what the load rises
    gain = rise[:, None] * ramp
    out = np.empty((len(load), len(times_s)))
    missing = np.zeros(len(times_s))
    for i in range(len(load)):
        missing = missing * decay[i] + gain[i]
        out[i] = missing
    return np.asarray(load[:, None] - out)


def flows(time: Array, load: Array, limits: Array, time_s: float, fresh: Index) -> Array:
    """(n, c) `flow` of power 1 of many at once: loads (n, c) with a limit (c) each."""
    grow = -np.expm1(-np.diff(time, prepend=time[0]) / time_s)
    begins = np.diff(fresh, prepend=fresh[0]) != 0
    out = np.empty(load.shape)
    state = np.zeros(load.shape[1])
    for i in range(len(load)):
        if begins[i]:
            state = np.zeros(load.shape[1])
        ahead = load[i] - state
        over = ahead - np.minimum(np.maximum(ahead, -limits), limits)
        state = state + over * grow[i]
        out[i] = state
    return out
