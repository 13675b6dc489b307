"""unknown: what no word names. Beside it stands what honestly describes the same data.

A reversible curve, even one that falls, is a nonlinear spring; a loop that closes is hysteresis,
whatever made it; a loop that leaves something behind may be yield. Ringing, bursts, jumps and waves
over the position are none of them.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.memory import bouc_wen, rough
from rig.worlds.benches.paths import samples, through, to_and_fro
from rig.worlds.benches.trial import Form, Trial, log_uniform, whole

_CURVE = frozenset({"joint_nonlinear_stiffness"})
_LOOP = frozenset({"joint_hysteresis"})
_FRICTION = frozenset({"joint_hysteresis", "joint_yield"})


def beam_that_snaps(random: Generator) -> Trial:
    """A bistable beam pushed over and back: its force falls between two states. Pushed by force
    it jumps, at one load over and at another back."""
    points = to_and_fro(-1.0, 1.0, whole(random, 1, 6))
    path = through(points, samples(random, len(points)))
    dip = random.uniform(1.3, 3.0)
    if random.random() < 0.5:
        u = path.value * 1.3
        force = dip * u**3 - u
        return Trial(path.time, force, u, stiffness=3 * dip - 1.0, accept=_CURVE)
    side, out = 1.0, np.empty(len(path.time))
    top = 2 / (3 * np.sqrt(3 * dip))
    grid = np.linspace(1 / np.sqrt(3 * dip), 3.0, 4000)
    branch = dip * grid**3 - grid
    for i, load in enumerate(path.value * top * random.uniform(1.5, 3.0)):
        if side * load < -top:
            side = -side
        out[i] = side * np.interp(side * load, branch, grid)
    return Trial(path.time, path.value, out, "force", stiffness=0.5, accept=_LOOP | _CURVE)


def rubber_that_softens(random: Generator) -> Trial:
    """Every stretch beyond the last one costs stiffness below it (Mullins; Ogden and Roxburgh
    1999). Nothing stays when released: a loop of the first pull only."""
    cycles = whole(random, 4, 10)
    points = to_and_fro(0.0, 1.0, cycles, random.uniform(0.5, 0.9))
    path = through(points, samples(random, len(points)))
    u, most = path.value, np.maximum.accumulate(path.value)
    damage = random.uniform(0.3, 0.8) * np.tanh((most - u) / random.uniform(0.1, 0.4))
    virgin = u + random.uniform(-0.3, 0.5) * u**2
    return Trial(path.time, virgin * (1 - damage), u, accept=_LOOP)


def concrete_that_cracks(random: Generator) -> Trial:
    """Slope and strength fall with the largest strain so far, a part of which stays (Mazars)."""
    points = [0.0]
    for top in np.linspace(0.2, 1.0, whole(random, 3, 8)):
        points += [float(top), float(top * random.uniform(0.15, 0.35))]
    path = through(points, samples(random, len(points)))
    most = np.maximum.accumulate(path.value)
    peak = random.uniform(0.15, 0.4)
    envelope = most / peak * np.exp((1 - (most / peak) ** 1.2) / 1.2)
    stays = 0.15 * most
    force = envelope * np.clip((path.value - stays) / np.maximum(most - stays, 1e-9), 0, 1)
    return Trial(path.time, force, path.value, stiffness=np.exp(1 / 1.2) / peak, accept=_FRICTION)


def sticks_and_slips(random: Generator) -> Trial:
    """Drawn over a dry plate by a spring: a saw whose teeth are of many sizes; one pull, or to
    and fro."""
    teeth = random.uniform(10, 60)
    points = [0.0, 1.0] if random.random() < 0.5 else to_and_fro(-1, 1, whole(random, 1, 4))
    path = through(points, samples(random, 8 * len(points)))
    drop, force = random.uniform(0.3, 0.9), np.empty(len(path.time))
    state, limit = 0.0, 1.0
    for i, step in enumerate(np.diff(path.value * teeth, prepend=0.0)):
        state += float(step)
        if abs(state) > limit:
            state *= 1 - drop * random.uniform(0.5, 1.0)
            limit = random.uniform(0.8, 1.2)
        force[i] = state
    return Trial(path.time, force, path.value, stiffness=teeth, accept=_FRICTION)


def rings_after_steps(random: Generator) -> Trial:
    """Loads put on at once set a mass swinging; it dies out before the next."""
    steps = whole(random, 3, 8)
    levels = np.concatenate([[0.0], random.uniform(0.2, 1.0, steps), [0.0]])
    time = np.linspace(0, 1, samples(random, 20 * steps, 8000))
    edge = np.linspace(0.03, 1, steps + 2)[:-1]
    decay, turns = 0.4 / steps * random.uniform(0.3, 0.8), random.uniform(4, 15) * steps
    force, moved = np.zeros_like(time), np.zeros_like(time)
    for at, jump in zip(edge, np.diff(levels), strict=True):
        since = np.maximum(time - at, 0)
        on = (time >= at).astype(float)
        swing = np.exp(-since / decay) * np.cos(2 * np.pi * turns * since)
        force += jump * on
        moved += jump * on * (1 - swing)
    return Trial(time, force, moved, "force", timeless=False)


def pinched_and_worn(random: Generator) -> Trial:
    """A nailed joint: loops thin in the middle where the nail has made room, and ever weaker
    (Baber and Noori 1986). A pinched loop is a loop."""
    cycles = whole(random, 5, 12)
    points = to_and_fro(-6.0, 6.0, cycles, 0.8)
    path = through(points, samples(random, len(points), 6000), eased=True)
    most = np.maximum.accumulate(np.abs(path.value))
    wear = random.uniform(0.1, 0.5) / (24.0 * cycles)
    loop = bouc_wen(path.value, random.uniform(1, 2), 0.6, wear, 2 * wear)
    room = random.uniform(0.2, 0.5) * most + 1e-9
    pinch = 1 - random.uniform(0.5, 0.9) * np.exp(-((path.value / room) ** 2)) * (most > 1.5)
    force = loop * pinch + 0.1 * path.value
    return Trial(path.time, force, path.value, accept=_FRICTION)


def _spring(random: Generator, least: int = 2) -> tuple[Array, Array]:
    points = to_and_fro(float(random.choice([-1, 0])), 1.0, whole(random, least, 8))
    path = through(points, samples(random, len(points), 8000))
    return path.time, path.value


def readings_in_bursts(random: Generator) -> Trial:
    """A loose plug: stretches in which the reading is anywhere, and single ones far off."""
    time, u = _spring(random)
    n, gone = len(time), np.zeros(len(time))
    for _ in range(whole(random, 4, 15)):
        at, long = whole(random, 0, n - 1), max(3, int(n * log_uniform(random, 0.003, 0.03)))
        gone[at : at + long] = random.standard_normal(len(gone[at : at + long]))
    gone += (random.random(n) < 0.005) * random.standard_normal(n)
    return Trial(time, u + random.uniform(0.2, 0.6) * gone, u, clean=True)


def motor_in_the_reading(random: Generator) -> Trial:
    """The drive's poles show in the force: waves over the position, alike on the way back."""
    time, u = _spring(random)
    pitch = float(np.ptp(u)) / random.uniform(5, 25)
    wave = np.sin(2 * np.pi * u / pitch) + random.uniform(0, 0.6) * np.sin(4 * np.pi * u / pitch)
    return Trial(time, u + random.uniform(0.05, 0.3) * wave, u, clean=True)


def fibres_that_break(random: Generator) -> Trial:
    """A bundle pulled: fibre after fibre goes with a drop, the rest carries on softer. Nothing is
    unloaded, so the gradual part may pass for yield."""
    path = through([0, 1], samples(random, 6))
    fibres = whole(random, 5, 15)
    limit = random.uniform(0.3, 1.2, fibres)
    share = random.uniform(0.3, 1.5, fibres)
    whole_ = path.value[:, None] < limit[None, :]
    force = path.value * (whole_ @ (share / share.sum()))
    return Trial(path.time, force, path.value, accept=frozenset({"joint_yield"}))


def hums_in_spells(random: Generator) -> Trial:
    """A pump comes and goes: an oscillation of its own, in some stretches of time, on a spring."""
    time, u = _spring(random)
    spells = np.maximum(rough(random, len(time), 25), 0.0)
    spells = spells / max(float(spells.max()), 1e-9)
    wave = np.sin(2 * np.pi * random.uniform(20, 60) * time) * spells
    return Trial(time, u + random.uniform(0.1, 0.4) * wave, u, timeless=False, clean=True)


FORMS: dict[str, tuple[Form, ...]] = {
    "unknown": (
        Form("beam_that_snaps", beam_that_snaps, (0.01, 100.0), (0.01, 20.0)),
        Form("rubber_that_softens", rubber_that_softens, (0.5, 1000.0), (1.0, 100.0)),
        Form("concrete_that_cracks", concrete_that_cracks, (1e3, 5e4), (0.05, 2.0)),
        Form("sticks_and_slips", sticks_and_slips, (0.1, 500.0), (0.5, 100.0)),
        Form("rings_after_steps", rings_after_steps, (1.0, 2000.0), (0.01, 10.0), (1.0, 60.0)),
        Form("pinched_and_worn", pinched_and_worn, (200.0, 5e4), (5.0, 100.0)),
        Form("readings_in_bursts", readings_in_bursts),
        Form("motor_in_the_reading", motor_in_the_reading),
        Form("fibres_that_break", fibres_that_break, (1.0, 5e4), (0.05, 20.0)),
        Form("hums_in_spells", hums_in_spells, (0.1, 2000.0), (0.01, 10.0), (2.0, 60.0)),
    )
}
