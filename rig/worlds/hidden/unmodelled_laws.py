"""Effects that no word names: the right answer to them is that something is unknown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden.effect import Drawn, Form
from rig.worlds.hidden.scene import Change, Scene

_SIZES_MM = (0.002, 0.8)


def _outside(path: Array, extra: dict[str, Any]) -> Drawn:
    """A path (n), about 1 at most, of which `size` mm is seen."""
    moved = 1e-3 * path
    return Drawn(
        lambda size: Change(outside=size * moved),
        lambda size: {"amplitude_mm": size, **extra},
        _SIZES_MM,
    )


def jumps_at_random_loads(scene: Scene, random: Generator) -> Drawn:
    """Steps up and down at loads of their own in every run, undone when the load has gone."""
    path = np.zeros_like(scene.history.load)
    for run in range(int(scene.history.run[-1]) + 1):
        mine = scene.history.run == run
        load = scene.history.load[mine]
        for _ in range(int(random.integers(2, 6))):
            at = random.uniform(0.05, 0.95) * float(load.max())
            path[mine] += random.choice([-1.0, 1.0]) * random.uniform(0.3, 1.0) * (load > at)
    return _outside(path, {})


def room_air_periodic(scene: Scene, random: Generator) -> Drawn:
    """Air conditioning comes and goes."""
    period, phase = random.uniform(40.0, 300.0), random.uniform(0, 2 * np.pi)
    wave = np.sin(2 * np.pi * scene.history.time / period + phase)
    return _outside(wave, {"period_s": period, "phase_rad": phase})


def laser_spot_wander(scene: Scene, random: Generator) -> Drawn:
    """The spot travels over a machined surface: error periodic in displacement."""
    top = float(np.abs(scene.elastic).max())
    pitch, phase = top * random.uniform(0.08, 0.3), random.uniform(0, 2 * np.pi)

    def change(size: float) -> Change:
        def laser(moved: Array) -> Array:
            wave = np.sin(2 * np.pi * moved / pitch + phase) - np.sin(phase)
            return np.asarray(moved + 1e-3 * size * wave)

        return Change(laser=laser)

    return Drawn(
        change,
        lambda size: {"amplitude_mm": size, "pitch_mm": 1e3 * pitch, "phase_rad": phase},
        _SIZES_MM,
    )


def crosstalk_bumps(scene: Scene, random: Generator) -> Drawn:
    """The laser's reading is pushed aside in narrow windows of force, to and fro."""
    load = np.abs(scene.history.load)
    path = np.zeros_like(load)
    centres = random.uniform(0.1, 0.95, 4) * load.max()
    for k, centre in enumerate(centres):
        width = random.uniform(0.03, 0.08) * load.max()
        path += (-1.0) ** k * random.uniform(0.5, 1.0) * np.exp(-(((load - centre) / width) ** 2))
    return _outside(path, {"centres_N": centres})


def vibration_bursts(scene: Scene, random: Generator) -> Drawn:
    """Near one tension the arm rings: readings there scatter far beyond the noise."""
    load = np.abs(scene.history.load)
    centre = random.uniform(0.3, 0.8) * load.max()
    window = np.exp(-(((load - centre) / (0.15 * load.max())) ** 2))
    return _outside(window * random.standard_normal(len(load)), {"centre_N": centre})


def cable_stick_slip(scene: Scene, random: Generator) -> Drawn:
    """A cable drags and lets go: a saw-tooth over the load with another phase in every run."""
    load, run = scene.history.load, scene.history.run
    runs = int(run[-1]) + 1
    pitch = load.max() * random.uniform(0.12, 0.4, runs)[run]
    phase = random.uniform(0, 1, runs)[run]
    turn = load / pitch + phase
    saw = turn - np.floor(turn) - (phase - np.floor(phase))
    return _outside(saw, {})


def magnet_snap(scene: Scene, random: Generator) -> Drawn:
    """Something snaps over at one load and back at a lower one, a little elsewhere each run."""
    load, run = scene.history.load, scene.history.run
    path = np.zeros_like(load)
    over, side = random.uniform(0.5, 0.8), 0
    wander = random.normal(0.0, 0.06, int(run[-1]) + 1)
    tops = {k: float(load[run == k].max()) for k in range(int(run[-1]) + 1)}
    for i, x in enumerate(load):
        share = x / tops[int(run[i])] - wander[run[i]]
        side = 1 if share > over else (0 if share < 0.4 * over else side)
        path[i] = side - 0.6 * share * side  # and pulls back as it is stretched on
    return _outside(path, {"snaps_at_share": over})


def heated_by_cycles(scene: Scene, random: Generator) -> Drawn:
    """Every turn of the screw warms the fixture, which then cools and shrinks back, overshooting:
    a damped swing that starts anew whenever the load changes."""
    history = scene.history
    period, decay = random.uniform(8.0, 40.0), random.uniform(10.0, 60.0)
    kick = np.abs(np.diff(history.load, prepend=0.0)) / history.load.max()
    pole = -1.0 / decay + 2j * np.pi / period
    state, path = 0j, np.zeros_like(history.load)
    steps = np.exp(pole * np.diff(history.time, prepend=history.time[0]))
    for i in range(len(path)):
        state = state * steps[i] + kick[i]
        path[i] = state.imag
    path = path / np.abs(path).max()
    return _outside(path, {"period_s": period, "decay_s": decay})


def teeth(scene: Scene, random: Generator) -> Drawn:
    """The screw's thread is eccentric: a wave over its advance, with dead starts."""
    advance = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(scene.history.load)))])
    pitch = scene.history.load.max() * random.uniform(0.17, 0.45)
    wave = np.sin(2 * np.pi * advance / pitch + random.uniform(0, 2 * np.pi))
    return _outside(
        wave * np.minimum(1.0, scene.history.load / (0.1 * scene.history.load.max())),
        {"pitch_N": pitch},
    )


def force_dropouts(scene: Scene, random: Generator) -> Drawn:
    """The amplifier loses charge in bursts and finds it again; size in N."""
    path = np.zeros_like(scene.history.load)
    for _ in range(int(random.integers(6, 25))):
        begin = int(random.integers(0, len(path)))
        path[begin : begin + int(random.integers(4, 30))] += random.choice([-1, 1])

    def change(size: float) -> Change:
        return Change(force=lambda load: load + size * path[:, None])

    return Drawn(change, lambda size: {"burst_N": size}, (0.1, 30.0))


def stiffness_of_each_run(scene: Scene, random: Generator) -> Drawn:
    """The screw is set anew before every run, a little elsewhere each time."""
    history = scene.history
    each = random.standard_normal(int(history.run[-1]) + 1)
    return _outside(each[history.run] * history.load / np.abs(history.load).max(), {})


def bolt_works_loose(scene: Scene, random: Generator) -> Drawn:
    """Softer from one moment of the session on; somebody tightens it later."""
    history = scene.history
    begin, end = np.sort(random.uniform(0.1, 0.95, 2)) * history.time[-1]
    loose = (history.time > begin) & (history.time < end)
    path = loose * history.load / np.abs(history.load).max()
    return _outside(path, {"from_s": begin, "to_s": end})


def somebody_leans(scene: Scene, random: Generator) -> Drawn:
    """Somebody leans on the bench now and then, for some seconds to a minute."""
    time = scene.history.time
    path = np.zeros_like(time)
    for _ in range(int(random.integers(2, 7))):
        at, width = random.uniform(0.0, time[-1]), random.uniform(5.0, 60.0)
        path += random.choice([-1.0, 1.0]) * np.exp(-(((time - at) / width) ** 2))
    return _outside(path, {})


def readings_of_the_wrong_step(scene: Scene, random: Generator) -> Drawn:
    """After some steps the reading is off for a while."""
    load = scene.history.load
    path, steps = np.zeros_like(load), np.flatnonzero(np.diff(load))
    for step in random.choice(steps, max(1, len(steps) // 6), replace=False):
        last = step + 1 + int(random.integers(3, 20))
        path[step + 1 : last] += random.choice([-1.0, 1.0]) * random.uniform(0.3, 1.0)
    return _outside(path, {})


_KINDS: tuple[Callable[[Scene, Generator], Drawn], ...] = (
    jumps_at_random_loads,
    room_air_periodic,
    laser_spot_wander,
    crosstalk_bumps,
    vibration_bursts,
    cable_stick_slip,
    magnet_snap,
    heated_by_cycles,
    teeth,
    force_dropouts,
    stiffness_of_each_run,
    bolt_works_loose,
    somebody_leans,
    readings_of_the_wrong_step,
)
FORMS: dict[str, tuple[Form, ...]] = {
    "unknown": tuple(Form(kind.__name__, False, kind) for kind in _KINDS)
}
