"""Laws of instruments and geometry: drifts, gains, shifts, lags, wrong leverage."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.arm import place
from rig.worlds.hidden.effect import Drawn, Form, Unsuited, draw_joint
from rig.worlds.hidden.meaning import straight_factor
from rig.worlds.hidden.scene import Change, Scene

# drifts on the session clock


def drift_path(scene: Scene, law: str, random: Generator) -> tuple[Array, dict[str, Any]]:
    """(n) from 0, about 1 at the end of the session, and the law's numbers."""
    t = scene.history.time - scene.history.time[0]
    span = float(t[-1])
    if law == "linear":
        return np.asarray(t / span), {}
    if law == "root":
        return np.sqrt(t / span), {}
    slow = span * float(np.exp(random.uniform(np.log(0.08), np.log(0.7))))
    if law == "warm_up":
        return np.asarray(np.expm1(-t / slow) / np.expm1(-span / slow)), {"time_constant_s": slow}
    if law == "two_rates":
        fast, share = slow * random.uniform(0.05, 0.25), random.uniform(-0.6, 0.6)
        path = share * np.expm1(-t / fast) + (1 - abs(share)) * np.expm1(-t / slow)
        return np.asarray(path / np.abs(path).max()), {"times_s": [fast, slow], "share": share}
    # a smooth wander: random walk seen through a window of a tenth of the session
    grid = np.linspace(0.0, span, 400)
    walk = np.cumsum(random.standard_normal(440))
    smooth = np.convolve(walk, np.hanning(41) / np.hanning(41).sum(), mode="valid")
    path = np.interp(t, grid, smooth - smooth[0])
    return np.asarray(path / np.abs(path).max()), {}


def drifting_force(law: str) -> Callable[[Scene, Generator], Drawn]:
    """The amplifier drifts by `size` N over the session, in its channels alike or each its own."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        each = law == "each_channel"
        path, extra = drift_path(scene, "warm_up" if each else law, random)
        along = float(random.choice([-1.0, 1.0]))  # every direction
        channels = along * np.ones(3)
        if each:
            channels = random.choice([-1.0, 1.0], 3) * random.uniform(0.3, 1.0, 3)
        else:  # alike along every direction that has no opposite
            channels = channels * np.sign(scene.unit.sum(axis=0) + 1e-9)

        def change(size: float) -> Change:
            added = size * path[:, None] * channels
            return Change(force=lambda force: force + added)

        def parameters(size: float) -> dict[str, Any]:
            end = size * float(path[-1])  # a path that turns back ends elsewhere than at its most
            drift = end * channels if each else end * along
            return {
                "drift_over_session_N": drift,
                "session_s": float(scene.history.time[-1]),
                **extra,
            }

        return Drawn(change, parameters, (0.03, 15.0))

    return draw


def drifting_target(law: str) -> Callable[[Scene, Generator], Drawn]:
    """Arm and stand warm up: the target wanders by up to `size` mm along a fixed course."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        path, extra = drift_path(scene, law, random)
        course = random.choice([-1.0, 1.0], 3) * random.uniform(0.4, 1.0, 3)
        along = (scene.unit @ course)[scene.history.setup]
        moved = 1e-3 * path * along

        def parameters(size: float) -> dict[str, Any]:
            return {
                "drift_over_session_mm": {
                    s.direction: float(size * (np.array(s.unit) @ course) * path[-1])
                    for s in scene.plan.setups
                },
                "session_s": float(scene.history.time[-1]),
                **extra,
            }

        return Drawn(lambda size: Change(outside=size * moved), parameters, (0.003, 0.6))

    return draw


# datum


def jumping_datum(law: str) -> Callable[[Scene, Generator], Drawn]:
    """The laser's datum jumps in the rests between repetitions; size in mm."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        plan = scene.plan
        if plan.recorded.datum != "setup" or plan.repetitions < 2:
            raise Unsuited
        runs = len(plan.setups) * plan.repetitions
        first = np.arange(runs) % plan.repetitions == 0
        shift = np.zeros(runs)
        if law == "one_jump":
            at = int(random.choice(np.flatnonzero(~first)))
            same = np.arange(runs) // plan.repetitions == at // plan.repetitions
            shift[same & (np.arange(runs) >= at)] = random.choice([-1.0, 1.0])
        elif law == "every_run":
            shift[~first] = np.clip(random.standard_normal(int((~first).sum())), -2, 2)
        else:  # settles: large jumps first, then smaller ones
            k = np.arange(runs) % plan.repetitions
            shift = random.choice([-1.0, 1.0]) * (1.0 - random.uniform(0.3, 0.7) ** k)
        path = 1e-3 * shift[scene.history.run]

        def parameters(size: float) -> dict[str, Any]:
            return {"shift_mm_by_run": size * shift}

        return Drawn(lambda size: Change(outside=size * path), parameters, (0.003, 0.5))

    return draw


# gains


def wrong_gain(channel: str, high: bool, bent: bool) -> Callable[[Scene, Generator], Drawn]:
    """One channel reads high or low by `size`, evenly or (`bent`) a little more at full range."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        sign = 1.0 if high else -1.0
        bend = random.uniform(0.03, 0.08) if bent else 0.0
        top = float(np.abs(scene.elastic).max())
        most = max(s.top_N for s in scene.plan.setups)

        def change(size: float) -> Change:
            def laser(moved: Array) -> Array:
                return np.asarray(moved * (1 + sign * size * (1 + bend * np.abs(moved) / top)))

            def force(load: Array) -> Array:
                return np.asarray(load * (1 + sign * size * (1 + bend * np.abs(load) / most)))

            return Change(laser=laser) if channel == "laser" else Change(force=force)

        def parameters(size: float) -> dict[str, Any]:
            factor = straight_factor(lambda x: x * (1 + sign * size * (1 + bend * x)))
            return {"factor": factor, "bend": bend, "law_size": sign * size}

        return Drawn(change, parameters, (0.01, 0.25))

    return draw


# lag


def lagging(channel: str, law: str) -> Callable[[Scene, Generator], Drawn]:
    """One channel comes `size` seconds late."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        time = scene.history.time
        damping = random.uniform(0.6, 1.2)

        def late(signal: Array, size: float) -> Array:
            if signal.ndim == 2:
                return np.stack([late(c, size) for c in signal.T], axis=1)
            if law == "delay":
                return np.asarray(np.interp(time - size, time, signal))
            if law == "window":  # mean over the last 2 x size seconds
                shares = (np.arange(24) + 0.5) / 24
                past = [np.interp(time - 2 * size * s, time, signal) for s in shares]
                return np.asarray(np.mean(past, axis=0))
            return _filtered(time, signal, size, law, damping)

        def change(size: float) -> Change:
            if channel == "laser":
                return Change(laser=lambda moved: late(moved, size))
            return Change(force=lambda load: late(load, size))

        return Drawn(change, lambda size: {"lag_s": size, "channel": channel}, (0.3, 8.0))

    return draw


def _filtered(time: Array, signal: Array, lag_s: float, law: str, damping: float) -> Array:
    """A filter of first or second order on a fine even clock."""
    step = min(0.1, lag_s / 6)
    grid = np.arange(time[0], time[-1] + step, step)
    x = np.interp(grid, time, signal)
    from scipy.signal import lfilter

    if law == "first_order":
        a = float(np.exp(-step / lag_s))
        y = lfilter([1 - a], [1, -a], x)
    else:  # two real or complex poles whose group delay at zero is the lag
        w = 2 * damping / lag_s
        r = np.exp(-damping * w * step)
        root = np.sqrt(abs(1 - damping**2)) * w * step
        turn = np.cos(root) if damping < 1 else np.cosh(root)
        den = [1.0, float(-2 * r * turn), float(r * r)]
        y = lfilter([sum(den)], den, x)
    return np.asarray(np.interp(time, grid, y))


# where load and arm stand


def misaligned_load(law: str) -> Callable[[Scene, Generator], Drawn]:
    """A share of the load acts across the direction."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        names = list(dict.fromkeys(s.direction for s in scene.plan.setups))
        chosen = [str(random.choice(names))] if law == "one_direction" else names
        tangent = np.zeros((len(scene.plan.setups), 3))
        for name in chosen:
            across = random.standard_normal(3)
            for s, setup in enumerate(scene.plan.setups):
                if setup.direction == name:
                    unit = scene.unit[s]
                    side = across - unit * (across @ unit)
                    tangent[s] = side / np.linalg.norm(side) * 0.2
        path = tangent[scene.history.setup]
        if law == "turns_with_load":  # the screw's tip walks as the arm gives way
            share = np.abs(scene.history.load) / scene.history.load.max()
            path = path * (1.0 + random.uniform(-0.4, 0.4) * share)[:, None]

        def parameters(size: float) -> dict[str, Any]:
            return {
                f"tangent_{name}": size
                * tangent[[s.direction for s in scene.plan.setups].index(name)]
                for name in chosen
            }

        return Drawn(lambda size: Change(across=size * path), parameters, (0.03, 1.7))

    return draw


def wrong_pose(law: str) -> Callable[[Scene, Generator], Drawn]:
    """The tool is offset by `size` x 100 mm, or joints stand off by `size` x 2 degrees."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        offset = random.standard_normal(3)
        offset *= 0.1 / np.linalg.norm(offset) * (law != "joint")
        turn = np.zeros(6)
        if law != "tool":
            turn[draw_joint(scene, random)] = np.radians(2.0) * random.choice([-1.0, 1.0])

        def change(size: float) -> Change:
            levers, tools = [], []
            for setup in scene.plan.setups:
                arm = place(scene.plan.poses[setup.pose] + size * turn)
                tools.append(arm.tool(scene.plan.tcp_mm * 1e-3 + size * offset))
                levers.append(arm.levers(tools[-1]))
            stands = np.tile(size * turn, (len(levers), 1))
            return Change(levers=np.array(levers), tools=np.array(tools), stands=stands)

        def parameters(size: float) -> dict[str, Any]:
            return {"offset_mm": size * offset * 1e3, "stands_off_rad": size * turn}

        return Drawn(change, parameters, (0.05, 3.0))

    return draw


_DRIFTS = (("linear", True), ("warm_up", True), ("root", True), ("two_rates", False))

FORMS: dict[str, tuple[Form, ...]] = {
    "force_drift": (
        *(Form(law, fitted, drifting_force(law)) for law, fitted in _DRIFTS),
        Form("each_channel", False, drifting_force("each_channel")),
        Form("wander", False, drifting_force("wander")),
    ),
    "thermal_drift": (
        *(Form(law, fitted, drifting_target(law)) for law, fitted in _DRIFTS),
        Form("wander", False, drifting_target("wander")),
    ),
    "zero_shift": (
        Form("one_jump", True, jumping_datum("one_jump")),
        Form("every_run", True, jumping_datum("every_run")),
        Form("settling_jumps", False, jumping_datum("settling_jumps")),
    ),
    "force_scale": (
        Form("reads_low", True, wrong_gain("force", False, False)),
        Form("reads_high", True, wrong_gain("force", True, False)),
        Form("bent_range", False, wrong_gain("force", True, True)),
    ),
    "displacement_scale": (
        Form("reads_low", True, wrong_gain("laser", False, False)),
        Form("reads_high", True, wrong_gain("laser", True, False)),
        Form("bent_range", False, wrong_gain("laser", False, True)),
    ),
    "time_lag": (
        Form("laser_delay", True, lagging("laser", "delay")),
        Form("force_delay", True, lagging("force", "delay")),
        Form("laser_first_order", True, lagging("laser", "first_order")),
        Form("force_first_order", True, lagging("force", "first_order")),
        Form("laser_second_order", False, lagging("laser", "second_order")),
        Form("laser_window", False, lagging("laser", "window")),
        Form("force_window", False, lagging("force", "window")),
    ),
    "load_misalignment": (
        Form("one_direction", True, misaligned_load("one_direction")),
        Form("each_direction", True, misaligned_load("each_direction")),
        Form("turns_with_load", False, misaligned_load("turns_with_load")),
    ),
    "pose_error": (
        Form("tool", True, wrong_pose("tool")),
        Form("joint", True, wrong_pose("joint")),
        Form("tool_and_joint", False, wrong_pose("both")),
    ),
}
