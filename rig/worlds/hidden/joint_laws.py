"""Laws of joints: yield, friction, creep, curved elasticity, lost motion, wrong springs.

Every law turns the torque of one joint into a path of its own beside the linear spring; the size
is that path's share of the spring's compliance where nothing else is said.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden import memory
from rig.worlds.hidden.effect import Drawn, Form, Unsuited, draw_joint, one_joint, share_of_joints
from rig.worlds.hidden.meaning import equal_work_threshold, run_seconds, straight_factor
from rig.worlds.hidden.scene import Change, Index, Scene

_HUNG = 0.75
_PUSHED = 0.2  # of a joint's torque: less beyond its weight shows nothing
_STEEPEST = 12.0  # of a curve that may also take deflection away

Parameters = Callable[[float], dict[str, Any]]


def _top(scene: Scene, joint: int) -> float:
    return float(np.abs(scene.torque[:, joint]).max())


def _in_joint(
    scene: Scene,
    joint: int,
    path_Nm: Array,
    parameters: Parameters,
    sizes: tuple[float, float],
    onset_N: dict[str, float] | None = None,
) -> Drawn:
    """An effect whose path is given in units of torque, of which size over stiffness is seen."""
    rad = one_joint(joint, path_Nm / scene.plan.springs[joint])
    return Drawn(lambda size: Change(joints=size * rad), parameters, sizes, (joint + 1,), onset_N)


def onset(scene: Scene, joint: int, threshold: float) -> dict[str, float]:
    """Force per direction at which the joint's net torque comes to the threshold, where it does."""
    lever = np.einsum("sj,sj->s", scene.levers[:, joint], scene.unit)
    out: dict[str, float] = {}
    for setup, arm, weight in zip(scene.plan.setups, lever, scene.weight[:, joint], strict=True):
        left = threshold - math.copysign(weight, arm * weight)  # what the push must bring
        if abs(arm) * setup.top_N > left:
            out[setup.direction] = min(left / abs(arm), out.get(setup.direction, math.inf))
    return out


def _reached(scene: Scene, joint: int, share: float) -> float:
    """A net torque of that share of the way from what weights do alone to the largest one."""
    alone = float(np.abs(scene.weight[:, joint]).max())
    most = float(np.abs(scene.net[:, joint]).max())
    if most < alone + _PUSHED * _top(scene, joint):
        raise Unsuited  # every push takes load off the joint
    return alone + share * (most - alone)


# yield


def yields(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Gives way above a threshold; size is plastic over elastic compliance beyond it."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        limit = _reached(scene, joint, random.uniform(0.4, 0.88))
        path, extra = knee_path(scene, scene.net[:, joint], limit, law, random)
        path = scene.since_standing(path)

        def parameters(size: float) -> dict[str, Any]:
            return {"hardening_ratio": 1.0 / (1.0 + size), **extra}

        return _in_joint(scene, joint, path, parameters, (0.02, 40.0), onset(scene, joint, limit))

    return draw


def knee_path(
    scene: Scene, load: Array, limit: float, law: str, random: Generator
) -> tuple[Array, dict[str, Any]]:
    """(n) plastic path in units of the load; the threshold as a sharp knee of equal work has it,
    the limit as the law has it, and the law's further parameters."""
    fresh, time = scene.standing, scene.history.time
    if law == "perzyna":  # loaded slowly, it gives way at the limit, all at once
        power, time_s = random.choice([1.0, 1.5, 2.0]), random.uniform(1.5, 15.0)
        path = memory.flow(time, load, limit, time_s, power, fresh)
        return path, {"threshold_Nm": limit, "flow_time_s": time_s, "power": power}
    follow, extra = _knee_law(limit, law, random)
    if law == "taken_back":
        fresh = scene.history.run
    threshold = equal_work_threshold(
        lambda x: follow(x, np.zeros(len(x), dtype=np.int64)), float(np.abs(load).max())
    )
    return follow(load, fresh), {"threshold_Nm": threshold, "law_limit_Nm": limit, **extra}


def _knee_law(
    limit: float, law: str, random: Generator
) -> tuple[Callable[[Array, Index], Array], dict[str, Any]]:
    """A law that knows no time: path (n) of a load (n) that starts anew with `fresh` (n)."""
    if law == "sharp":
        return lambda x, fresh: memory.play(x, limit, fresh), {}
    if law == "taken_back":
        return lambda x, fresh: memory.play(x, limit, fresh), {"returns": "between runs"}
    if law == "menegotto_pinto":
        sharp = random.uniform(3.0, 15.0)
        ratio = random.uniform(0.1, 0.6)
        part = ratio / (1.0 - ratio)
        return lambda x, fresh: part * memory.rounded_knee(x, limit, ratio, sharp, fresh), {
            "Steel02_R0": sharp
        }
    if law == "ramberg_osgood":
        power = random.uniform(4.0, 12.0)
        return lambda x, fresh: memory.loops(x, lambda s: limit * (s / limit) ** power, fresh), {
            "power": power
        }
    first, recall = random.uniform(0.2, 1.0), random.uniform(1.0, 6.0) / limit
    second = random.uniform(0.5, 1.5)
    return lambda x, fresh: memory.backstress(x, limit, first, recall, second, fresh), {
        "backstress_ratio": first,
        "recall_per_Nm": recall,
    }


# friction


def friction(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Friction beside the spring, which takes part of the torque off it."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        top = _top(scene, joint)
        # the weight came on last, or a controller that dithers let friction settle under it
        torque = (scene.net if random.random() < _HUNG else scene.torque)[:, joint]
        fresh = scene.standing
        if law in ("dahl", "bouc_wen", "stribeck_bristles"):
            reach = top * float(np.exp(random.uniform(np.log(0.08), np.log(0.8))))
            power = 1.0 if law == "dahl" else random.uniform(0.7, 2.5)
            gamma = 1.0 if law == "dahl" else random.uniform(0.5, 1.0)
            state = memory.bristles(torque, reach, power, gamma, fresh)
            if law == "stribeck_bristles":  # standing still, the bristles grip tighter than moving
                state = state * (1.0 + random.uniform(0.1, 0.4) * _at_rest(scene))
            most = 0.3 * top
            stiffness = float(scene.plan.springs[joint])

            def parameters(size: float) -> dict[str, Any]:
                return {"friction_Nm": size * most, "reach_rad": reach / stiffness}

            # bristles and spring side by side: at most as stiff as the spring itself
            limit = min(1.0, 0.5 * reach / most)
            held = -most * scene.since_standing(state)
            return _in_joint(scene, joint, held, parameters, (0.003, limit))
        path, extra = _loop_path(scene, torque, top, law, random)
        path = scene.since_standing(path)
        return _in_joint(scene, joint, path, lambda size: {"share": size, **extra}, (0.005, 1.5))

    return draw


def _at_rest(scene: Scene) -> Array:
    still = np.diff(scene.history.load, prepend=0.0) == 0.0
    return np.asarray(still, dtype=float)


def _loop_path(
    scene: Scene, torque: Array, top: float, law: str, random: Generator
) -> tuple[Array, dict[str, Any]]:
    fresh = scene.standing
    if law == "iwan":
        strength = top * random.uniform(0.1, 0.9)

        def even(x: float) -> float:  # strengths evenly spread up to the largest
            return x**2 / (2 * strength) if x < strength else x - strength / 2

        return memory.loops(torque, even, fresh), {"friction_Nm": strength}
    if law == "iwan_weibull":
        shape, scale = random.uniform(0.8, 2.5), top * random.uniform(0.1, 0.6)
        grid = np.linspace(0.0, 2.5 * top, 4000)
        slip = np.concatenate([[0.0], np.cumsum(1 - np.exp(-((grid[1:] / scale) ** shape)))])
        slip *= grid[1]

        def weibull(x: float) -> float:
            at = min(int(x / grid[1]), len(grid) - 2)
            return float(slip[at] + (slip[at + 1] - slip[at]) * (x / grid[1] - at))

        return memory.loops(torque, weibull, fresh), {"friction_Nm": scale, "shape": shape}
    if law == "power":
        power = random.uniform(1.3, 2.2)
        return memory.loops(torque, lambda x: top * (x / top) ** power, fresh), {"power": power}
    count = int(random.integers(3, 7))
    widths = top * np.sort(random.uniform(0.02, 0.6, count))
    weights = random.dirichlet(np.ones(count))
    path = sum(
        (w * memory.play(torque, b, fresh) for w, b in zip(weights, widths, strict=True)),
        np.zeros(1),
    )
    return np.asarray(path), {"friction_Nm": float(weights @ widths), "elements": count}


# creep


def creep(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Deflection that follows late; size is the late share of the elastic deflection."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        times, weights, extra = _spectrum(law, random)
        load, part = scene.torque[:, joint], 1.0
        if law == "stress_dependent":  # grows faster than the load
            load = load * np.abs(load) / _top(scene, joint)
            part = straight_factor(lambda x: x**2)
        path = memory.retarded(scene.history.time, load, times, weights)
        seconds = run_seconds(scene)
        after = part * float(weights @ -np.expm1(-seconds / times))  # of a load that stands so long
        ends = law not in ("power", "logarithmic", "burgers")

        def parameters(size: float) -> dict[str, Any]:
            found = {"creep_fraction_of_run": size * after, "run_s": seconds, "law_size": size}
            if ends:
                found["creep_fraction"] = size * part * float(weights.sum())
            return found | (extra or {"times_s": times, "weights": weights})

        return _in_joint(scene, joint, path, parameters, (0.003, 0.8))

    return draw


def _spectrum(law: str, random: Generator) -> tuple[Array, Array, dict[str, Any]]:
    """Retardation times s, weights, and what the law is named by."""
    if law in ("standard_solid", "stress_dependent"):
        times = np.exp(random.uniform(np.log(3.0), np.log(120.0), 1))
        extra = {} if law == "standard_solid" else {"time_s": float(times[0])}
        return times, np.ones(1), extra
    if law in ("two_term_prony", "three_term_prony"):
        count = 2 if law.startswith("two") else 3
        edges = np.log(np.array([2.0, 8.0, 60.0, 400.0])[[0, 1, 3] if count == 2 else slice(None)])
        times = np.exp(random.uniform(edges[:-1], edges[1:]))
        return times, random.dirichlet(np.full(count, 3.0)), {}
    if law == "burgers":  # a Kelvin element, and a dashpot that never comes back
        time, viscous = np.exp(random.uniform(np.log([3.0, 300.0]), np.log([60.0, 3000.0])))
        share = {"time_s": float(time), "viscous_s": float(viscous)}
        return np.array([time, _NEVER_S]), np.array([1.0, _NEVER_S / viscous]), share
    times = np.geomspace(0.1, 3e4, 30)
    if law == "power":  # J = (t / 100 s)^n has a spectrum that grows as T^n
        power = random.uniform(0.1, 0.5)
        weights = times**power * np.log(times[1] / times[0]) / math.gamma(1 - power) * power
        return times, weights / 100.0**power, {"power": power}
    start = random.uniform(0.5, 10.0)  # J = log(1 + t / start): even from `start` on
    return times, 0.2 * np.exp(-start / times) * np.log(times[1] / times[0]), {"start_s": start}


_NEVER_S = 1e9


# curved elasticity


def curved(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Reversible and curved; size is the extra deflection at the largest torque."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        joint = draw_joint(scene, random)
        top = float(np.abs(scene.net[:, joint]).max())
        shape, extra = _curve(law, random)
        grid = np.linspace(0.0, 1.0, 2001)
        steepest = float(np.diff(shape(grid)).max() / grid[1])
        sense = float(random.choice([-1.0, 1.0])) if steepest < _STEEPEST else 1.0
        # deflection never falls as the torque grows
        most = 0.6 if sense > 0 else min(0.6, 0.8 / steepest)
        path = scene.since_standing(sense * top * shape(scene.net[:, joint] / top))

        def parameters(size: float) -> dict[str, Any]:
            return {"extra_share_at_top": sense * size, "torque_top_Nm": top, **extra}

        return _in_joint(scene, joint, path, parameters, (0.005, most))

    return draw


def _curve(law: str, random: Generator) -> tuple[Callable[[Array], Array], dict[str, Any]]:
    if law == "k1k2k3":
        a, b = np.sort(random.uniform(0.15, 0.85, 2))
        w = random.uniform(0.2, 0.8)

        def pieces(x: Array) -> Array:
            size = np.abs(x)
            bent = w * np.maximum(size - a, 0) / (1 - a)
            return np.asarray(np.sign(x) * (bent + (1 - w) * np.maximum(size - b, 0) / (1 - b)))

        return pieces, {"T1_share": a, "T2_share": b}
    if law == "cubic":
        return lambda x: x**3, {}
    if law == "tanh":
        width = random.uniform(0.1, 0.5)
        return lambda x: np.tanh(x / width) / np.tanh(1 / width), {"width_share": width}
    if law == "hertz":
        power = random.choice([random.uniform(0.5, 0.8), random.uniform(1.3, 1.8)])
        return lambda x: np.sign(x) * np.abs(x) ** power, {"power": power}
    rate = random.uniform(1.5, 5.0)
    return lambda x: np.sign(x) * np.expm1(rate * np.abs(x)) / np.expm1(rate), {"rate": rate}


# lost motion


def lost_motion(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Play of width `size` (rad) taken up where the joint's net torque passes zero; of one that
    hoses and cables preload, wherever the load overcomes them."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        net, top = scene.net, np.abs(scene.torque).max(axis=0)
        crosses = (net.min(axis=0) < 0.03 * top) & (net.max(axis=0) > -0.03 * top)
        if law == "preloaded":
            crosses[:] = True
        able = np.flatnonzero(crosses & (share_of_joints(scene) > 0.05))
        if not len(able):
            raise Unsuited
        joint = int(random.choice(able))
        zone = float(top[joint] * np.exp(random.uniform(np.log(0.004), np.log(0.06))))
        x, preload = net[:, joint], 0.0
        if law == "preloaded":
            preload = -float(x.min() + random.uniform(0.15, 0.85) * np.ptp(x))
        place = _taken_up(law, x + preload, zone, scene, random)
        rad = one_joint(joint, place)

        def parameters(size: float) -> dict[str, Any]:
            crossing = _crossing(scene, joint, preload)
            return {"width_rad": size, "zone_Nm": zone, "crossing_N": crossing}

        return Drawn(
            lambda size: Change(joints=size * rad), parameters, (4e-6, 1.5e-3), (joint + 1,)
        )

    return draw


def _taken_up(law: str, x: Array, zone: float, scene: Scene, random: Generator) -> Array:
    """(n) place in the play, -1/2 to 1/2."""
    if law in ("smooth", "preloaded"):
        return np.asarray(np.tanh(x / zone) / 2)
    if law == "gap_with_friction":
        return np.asarray(np.clip(memory.play(x, zone, scene.standing) / zone, -1, 1) / 2)
    if law == "soft_flanks":  # two flanks of unequal softness
        other = zone * random.uniform(1.5, 4.0)
        return np.asarray(np.where(x > 0, 1 - np.exp(-x / zone), np.expm1(x / other)) / 2)
    return np.asarray(np.arctan(x / zone) / np.pi)


def _crossing(scene: Scene, joint: int, preload: float) -> dict[str, float]:
    lever = np.einsum("sj,sj->s", scene.levers[:, joint], scene.unit)
    return {
        setup.direction: float(-(scene.weight[s, joint] + preload) / lever[s])
        for s, setup in enumerate(scene.plan.setups)
        if abs(lever[s]) > 1e-3
    }


# wrong springs


def wrong_springs(which: str) -> Callable[[Scene, Generator], Drawn]:
    """Springs off by far more than stated; size is the logarithm of the factor."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        part = share_of_joints(scene)
        able = np.flatnonzero(part > 0.1)
        count = {"one_joint": 1, "two_joints": 2, "all_random": 6}[which]
        joints = np.arange(6) if count == 6 else random.permutation(able)[:count]
        pattern = np.zeros(6)
        pattern[joints] = random.choice([-1.0, -1.0, 1.0], len(joints)) * random.uniform(
            0.5, 1.0, len(joints)
        )

        def parameters(size: float) -> dict[str, Any]:
            return {f"factor_joint{j + 1}": float(np.exp(size * pattern[j])) for j in joints}

        return Drawn(
            lambda size: Change(springs=np.exp(size * pattern)),
            parameters,
            (3.0 * scene.plan.relative_sd, 1.3),
            tuple(int(j) + 1 for j in np.sort(joints)),
        )

    return draw


FORMS: dict[str, tuple[Form, ...]] = {
    "joint_yield": (
        Form("sharp", True, yields("sharp")),
        Form("controller_clamp", True, yields("taken_back")),
        Form("rounded", False, yields("menegotto_pinto")),
        Form("ramberg_osgood", False, yields("ramberg_osgood")),
        Form("rate_dependent", False, yields("perzyna")),
        Form("two_backstresses", False, yields("chaboche")),
    ),
    "joint_hysteresis": (
        Form("maxwell_slip", True, friction("maxwell_slip")),
        Form("iwan", True, friction("iwan")),
        Form("dahl", True, friction("dahl")),
        Form("bouc_wen", False, friction("bouc_wen")),
        Form("stribeck_bristles", False, friction("stribeck_bristles")),
        Form("iwan_weibull", False, friction("iwan_weibull")),
        Form("prandtl_power", False, friction("power")),
    ),
    "joint_creep": (
        Form("standard_solid", True, creep("standard_solid")),
        Form("two_term_prony", True, creep("two_term_prony")),
        Form("three_term_prony", False, creep("three_term_prony")),
        Form("power_law", False, creep("power")),
        Form("logarithmic", False, creep("logarithmic")),
        Form("stress_dependent", False, creep("stress_dependent")),
        Form("burgers", False, creep("burgers")),
    ),
    "joint_nonlinear_stiffness": (
        Form("k1k2k3", True, curved("k1k2k3")),
        Form("cubic", True, curved("cubic")),
        Form("tanh", False, curved("tanh")),
        Form("hertz", False, curved("hertz")),
        Form("exponential", False, curved("exponential")),
    ),
    "joint_backlash": (
        Form("smooth", True, lost_motion("smooth")),
        Form("gap_with_friction", True, lost_motion("gap_with_friction")),
        Form("soft_flanks", False, lost_motion("soft_flanks")),
        Form("slow_approach", False, lost_motion("slow_approach")),
        Form("preloaded", False, lost_motion("preloaded")),
    ),
    "joint_stiffness_error": (
        Form("one_joint", True, wrong_springs("one_joint")),
        Form("two_joints", True, wrong_springs("two_joints")),
        Form("all_random", True, wrong_springs("all_random")),
    ),
}
