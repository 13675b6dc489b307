"""Textbook forms of every word, as an analyst would fit them: columns of linear models.

One or two standard shapes a word, driven by the force as measured, shape parameters on a grid.
They say which words explain a case as well as the true one; they are no diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.effect import share_of_joints
from rig.worlds.hidden.memory import flows, plays, retarded_each
from rig.worlds.hidden.observed import Bounds, Observed, tared_path
from rig.worlds.hidden.outer_laws import beam_compliance, moments

THRESHOLDS = np.array([0.25, 0.33, 0.41, 0.48, 0.55, 0.61, 0.67, 0.73, 0.79, 0.85, 0.9, 0.95])
FLOWS_S = (1.5, 4.0, 12.0, 40.0)  # of a yield that is reached late
_FREE: Bounds = (-np.inf, np.inf)
_POSITIVE: Bounds = (0.0, np.inf)
_LEAST_SHARE = 0.02


@dataclass(frozen=True)
class Explanation:
    """Columns (N) of one form, and what their coefficients may be."""

    columns: tuple[Array, ...]
    bounds: tuple[Bounds, ...]


def _form(columns: list[Array], bounds: Bounds | list[Bounds]) -> Explanation:
    each = bounds if isinstance(bounds, list) else [bounds] * len(columns)
    return Explanation(tuple(columns), tuple(each))


def _joints(seen: Observed) -> list[int]:
    return [int(j) for j in np.flatnonzero(share_of_joints(seen.scene) > _LEAST_SHARE)]


def _torque(seen: Observed) -> Array:
    lever = np.einsum("sij,sj->si", seen.scene.levers, seen.scene.unit)
    return np.asarray(lever[seen.scene.history.setup] * seen.force[:, None])


def _weights(seen: Observed) -> Array:
    return np.asarray(seen.scene.weight[seen.scene.history.setup])


def _one(seen: Observed, joint: int, torque_like: Array) -> Array:
    path = seen.scene.since_standing(torque_like)
    return seen.joint(joint, path / float(seen.scene.plan.believed[joint]))


def _knees(
    loads: Array,
    seen: Observed,
    column: Callable[[int, Array], Array],
    alone: Array | float = 0.0,
) -> list[Explanation]:
    """Of loads (n, c): neighbouring thresholds together, from what stands `alone` (c) on; kept
    while the arm stands, taken back in rests, or reached late. `column` turns the state of load c
    into a column."""
    count = len(THRESHOLDS)
    tops, least = np.abs(loads).max(axis=0), np.broadcast_to(alone, loads.shape[1:])
    widths = (least[:, None] + (tops - least)[:, None] * THRESHOLDS).ravel()
    many = np.repeat(loads, count, axis=1)
    out = []
    standing = seen.scene.standing
    states = plays(many, widths, standing)
    late = [flows(seen.scene.history.time, many[:, ::2], widths[::2], s, standing) for s in FLOWS_S]
    half = count // 2
    for c in range(loads.shape[1]):
        out += _pairs([column(c, x) for x in states[:, c * count : (c + 1) * count].T])
        for y in late:
            out += _pairs([column(c, x) for x in y[:, c * half : (c + 1) * half].T])
    states = plays(many, widths, seen.scene.history.run)
    for c in range(loads.shape[1]):
        out += _pairs([column(c, x) for x in states[:, c * count : (c + 1) * count].T])
    return out


def _pairs(columns: list[Array]) -> list[Explanation]:
    return [_form([a, b], _POSITIVE) for a, b in pairwise(columns)]


def _yield(seen: Observed) -> list[Explanation]:
    weights = _weights(seen)
    net = _torque(seen) + weights
    pushed = np.abs(net).max(axis=0) > 1.02 * np.abs(weights).max(axis=0)
    joints = [j for j in _joints(seen) if pushed[j]]
    if not joints:
        return []
    return _knees(
        net[:, joints],
        seen,
        lambda c, state: _one(seen, joints[c], state),
        np.abs(weights[:, joints]).max(axis=0),
    )


def _slip(seen: Observed) -> list[Explanation]:
    scene = seen.scene
    levers = []
    for axis in range(3):
        for depth in (0.0, 0.3, 0.6) if axis < 2 else (0.0,):
            lever = moments(scene, depth)[:, axis][scene.history.setup]
            if np.abs(lever).max() > 0.02:
                levers.append(lever)
    loads = np.stack(levers, axis=1) * seen.force[:, None]
    return _knees(loads, seen, lambda c, state: seen.outside(1e-6 * levers[c] * state))


def _hysteresis(seen: Observed) -> list[Explanation]:
    joints, out = _joints(seen), []
    torque, weights = _torque(seen)[:, joints], _weights(seen)[:, joints]
    shares = np.array([0.02, 0.06, 0.12, 0.2, 0.32, 0.5])
    widths = (np.abs(torque).max(axis=0)[:, None] * shares).ravel()
    for load in (torque, torque + weights):
        states = plays(np.repeat(load, len(shares), axis=1), widths, seen.scene.standing)
        for c, j in enumerate(joints):
            each = states[:, c * len(shares) : (c + 1) * len(shares)].T
            out.append(_form([_one(seen, j, state) for state in each], _POSITIVE))
    return out


def _creep(seen: Observed) -> list[Explanation]:
    torque, out = _torque(seen), []
    times = np.array([1.5, 3.0, 6.0, 12.0, 25.0, 60.0, 150.0, 500.0])
    for j in _joints(seen):
        states = retarded_each(seen.scene.history.time, torque[:, j], times)
        out.append(_form([_one(seen, j, states[:, k]) for k in range(len(times))], _POSITIVE))
    return out


def _curved(seen: Observed) -> list[Explanation]:
    torque, out = _torque(seen) + _weights(seen), []
    for j in _joints(seen):
        top = float(np.abs(torque[:, j]).max())
        x = torque[:, j] / top
        bent = [np.sign(x) * np.maximum(np.abs(x) - a, 0.0) for a in (0.15, 0.3, 0.45, 0.6, 0.75)]
        hinges = [_one(seen, j, top * b) for b in bent]
        out += [_form([a, b], _FREE) for k, a in enumerate(hinges) for b in hinges[k + 1 :]]
        out.append(_form([_one(seen, j, top * x**3), _one(seen, j, top * x * np.abs(x))], _FREE))
        for width in (0.08, 0.2, 0.5):
            out.append(_form([_one(seen, j, top * np.tanh(x / width))], _FREE))
    return out


def _lost_motion(seen: Observed) -> list[Explanation]:
    torque, weights, out = _torque(seen), _weights(seen), []
    scene = seen.scene
    for j in _joints(seen):
        top = float(np.abs(torque[:, j]).max())
        net = torque[:, j] + weights[:, j]
        if net.min() > 0.05 * top or net.max() < -0.05 * top:
            continue
        zones = top * np.array([0.003, 0.007, 0.015, 0.03, 0.06, 0.1])
        states = plays(np.repeat(net[:, None], len(zones), axis=1), zones, scene.standing)
        stiff = float(scene.plan.believed[j])
        for shape in (
            np.tanh(net[:, None] / zones),
            np.clip(states / zones, -1, 1),
            -np.sign(net)[:, None] * np.expm1(-np.abs(net)[:, None] / zones),
        ):
            columns = [_one(seen, j, stiff * 1e-3 * x) for x in shape.T]
            out += [_form([a, b], (0.0, 2.0)) for a, b in pairwise(columns)]
    return out


def _links(seen: Observed) -> list[Explanation]:
    scene = seen.scene
    columns = []
    for link in range(2):
        unit = np.array([beam_compliance(scene, s, link) for s in range(len(scene.plan.setups))])
        columns.append(seen.outside(1e-4 * unit[scene.history.setup] * seen.force))
    return [_form(columns, (0.0, 12.0))]


def _base(seen: Observed) -> list[Explanation]:
    scene, out = seen.scene, []
    for depth in (0.0, 0.2, 0.4, 0.6, 0.8):
        unit = moments(scene, depth)[scene.history.setup] ** 2
        unit[:, 2] = moments(scene, 0.0)[scene.history.setup][:, 2] ** 2
        columns = [seen.outside(1e-6 * unit[:, a] * seen.force) for a in range(3)]
        out.append(_form([c for c in columns if np.any(c)], (0.0, 20.0)))
    return out


def _seating(seen: Observed) -> list[Explanation]:
    load = np.abs(seen.force)
    out = []
    for share in (0.02, 0.035, 0.06, 0.1, 0.17, 0.28):
        x = load / (share * load.max())
        for shape in (-np.expm1(-x), x / (1 + x)):
            out.append(_form([seen.outside(1e-3 * shape)], (0.0, 0.4)))
    return out


def _misaligned(seen: Observed) -> list[Explanation]:
    scene = seen.scene
    names = [s.direction for s in scene.plan.setups]
    setup = scene.history.setup
    columns = []
    for name in dict.fromkeys(names):
        mine = np.array([n == name for n in names])[setup]
        axis = int(np.argmax(np.abs(scene.unit[names.index(name)])))
        for a in range(3):
            if a == axis:
                continue
            across = np.where(mine, seen.force, 0.0)
            rad = scene.levers[setup][:, :, a] * across[:, None] / scene.plan.believed
            column = seen.joints(rad)
            side = np.zeros((len(seen.rows), 3))
            side[:, a] = across[seen.instants]
            columns.append(column + seen.stack(components=side))
    return [_form(columns, (-0.4, 0.4))]


def _paths(seen: Observed) -> list[Array]:
    t = seen.scene.history.time - seen.scene.history.time[0]
    t = t / t[-1]
    curved = [np.expm1(-t / s) / np.expm1(-1 / s) for s in (0.015, 0.05, 0.12, 0.25, 0.5)]
    return [t, np.sqrt(t), *curved]


def _one_or_two(parts: list[list[Array]]) -> list[Explanation]:
    """Each path alone, and any two of them together."""
    out = [_form(p, _FREE) for p in parts]
    return out + [_form([*a, *b], _FREE) for a, b in combinations(parts, 2)]


def _force_drift(seen: Observed) -> list[Explanation]:
    scene, history = seen.scene, seen.scene.history
    parts = []
    for path in _paths(seen):
        drift = tared_path(scene, path)
        columns = []
        for a in range(3):
            along = scene.unit[history.setup][:, a] * drift
            channel = np.zeros((len(seen.rows), 3))
            channel[:, a] = drift[seen.instants]
            columns.append(seen.joints(seen.pushed(-along)) + seen.stack(components=channel))
        parts.append([c for c in columns if np.any(c)])
    return _one_or_two(parts)


def _thermal(seen: Observed) -> list[Explanation]:
    scene = seen.scene
    names = [s.direction for s in scene.plan.setups]
    masks = [
        np.array([n == name for n in names])[scene.history.setup] for name in dict.fromkeys(names)
    ]
    return _one_or_two([[seen.outside(1e-3 * path * m) for m in masks] for path in _paths(seen)])


def _shift(seen: Observed) -> list[Explanation]:
    run = seen.scene.history.run[seen.instants]
    if seen.scene.plan.recorded.datum == "repetition":
        return []
    per_setup = seen.scene.plan.repetitions
    columns = [seen.stack(1e-2 * (run == r).astype(float)) for r in np.unique(run) if r % per_setup]
    return [_form(columns, _FREE)]


def _lag(seen: Observed) -> list[Explanation]:
    """The laser behind the force, or the force behind what it does: then the load was ahead."""
    scene, out = seen.scene, []
    time = scene.history.time
    lever = np.einsum("sij,sj->si", scene.levers, scene.unit)
    elastic = np.sum(lever[scene.history.setup] * seen.pushed(seen.force), axis=1)
    lags = np.array([0.4, 0.6, 0.9, 1.3, 1.9, 2.8, 4.0, 6.0, 8.5])
    slow = retarded_each(time, elastic, lags)
    behind: list[list[Array]] = [[], []]
    ahead: list[list[Array]] = [[], []]
    for k, lag in enumerate(lags):
        for kind, moved in enumerate((np.interp(time - lag, time, elastic), slow[:, k])):
            behind[kind].append(seen.outside(moved - elastic))
        shifted = np.interp(time + lag, time, seen.force)
        for kind, force in enumerate((shifted, _unfiltered(time, seen.force, float(lag)))):
            early = force - seen.force
            channel = -scene.unit[seen.setup] * early[seen.instants][:, None]
            column = seen.joints(seen.pushed(early)) + seen.stack(components=channel)
            ahead[kind].append(column)
    for columns in (*behind, *ahead):  # lags in between by two neighbours
        out += [_form([a, b], (0.0, 1.3)) for a, b in pairwise(columns)]
    return out


def _unfiltered(time: Array, force: Array, lag_s: float) -> Array:
    """What a filter of first order was given, were that even between two instants."""
    decay = np.exp(-np.diff(time) / lag_s)
    given = (force[1:] - force[:-1] * decay) / np.maximum(1 - decay, 1e-9)
    return np.concatenate([force[:1], given])


def _force_gain(seen: Observed) -> list[Explanation]:
    return [_form([seen.joints(seen.pushed(seen.force))], (-0.4, 0.4))]


def _laser_gain(seen: Observed) -> list[Explanation]:
    return [_form([seen.stack(seen.displacement)], (-0.4, 0.4))]


def _springs(seen: Observed) -> list[Explanation]:
    elastic = seen.pushed(seen.force)
    columns = [seen.joints(elastic * (np.arange(6) == j)) for j in range(6)]
    return [_form(columns, (-0.75, 3.0))]


FORMS: dict[str, Callable[[Observed], list[Explanation]]] = {
    "joint_yield": _yield,
    "joint_backlash": _lost_motion,
    "joint_nonlinear_stiffness": _curved,
    "joint_hysteresis": _hysteresis,
    "joint_creep": _creep,
    "link_flexibility": _links,
    "base_compliance": _base,
    "base_slip": _slip,
    "contact_seating": _seating,
    "load_misalignment": _misaligned,
    "force_drift": _force_drift,
    "force_scale": _force_gain,
    "displacement_scale": _laser_gain,
    "thermal_drift": _thermal,
    "zero_shift": _shift,
    "time_lag": _lag,
    "joint_stiffness_error": _springs,
}
