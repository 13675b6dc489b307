"""Curves without memory: joint_nonlinear_stiffness, joint_backlash, contact_seating.

What is accepted beside the word: one bench and one direction do not tell a soft start of the
specimen from one of its seat, so a curve that ends straight after a soft start is both; a clearance
with corners as round as itself is a curve; a slack from zero force on is half a clearance.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.memory import slider
from rig.worlds.benches.paths import Path, samples, through, to_and_fro
from rig.worlds.benches.trial import Form, Imposed, Trial, bent, log_uniform, whole

_SEAT = frozenset({"contact_seating"})
_CURVE = frozenset({"joint_nonlinear_stiffness"})


def _drive(random: Generator, low: float) -> Path:
    """A few cycles from 0 to 1 and down to `low`, or from 0 if that is 0."""
    points = to_and_fro(low, 1.0, whole(random, 1, 10), float(random.choice([0.0, 0.0, 0.6])))
    return through(points, samples(random, len(points)), eased=bool(random.random() < 0.4))


def _with_loop(random: Generator, u: Array, force: Array) -> Array:
    """The curve with a small loop: at most a tenth of what is bent in it."""
    most = random.uniform(0.0, 0.1) * bent(u, force)
    length = random.uniform(0.02, 0.1)
    return np.asarray(force + most * slider(u / length, np.ones(len(u))))


def _curve(
    random: Generator, path: Path, force: Array, first: float, accept: frozenset[str] = frozenset()
) -> Trial:
    repeated = path.repetition if random.random() < 0.5 else None
    force = _with_loop(random, path.value, force)
    return Trial(path.time, force, path.value, stiffness=first, accept=accept, repetition=repeated)


def rubber_strip(random: Generator) -> Trial:
    """Softer first, then locking (Gent 1996), stretched to up to three times its length; or
    Mooney's two constants, stretched and squeezed."""
    path = _drive(random, 0.0)
    stretch = 1 + path.value * random.uniform(1.0, 3.0)
    invariant = stretch**2 + 2 / stretch - 3
    lock = float(invariant.max()) * random.uniform(1.1, 3.0)
    second = random.uniform(0.0, 0.6)
    force = (stretch - stretch**-2) * (lock / (lock - invariant) + second / stretch)
    slope = 3 * (1 + second) * float(np.ptp(stretch))
    return _curve(random, path, force, slope)


def tendon(random: Generator) -> Trial:
    """An exponential toe that goes on stiffening, or runs into a straight line (then a soft seat
    looks the same)."""
    path, bend = _drive(random, 0.0), random.uniform(2.0, 6.0)
    if random.random() < 0.5:
        force = np.expm1(bend * path.value) / bend
        return _curve(random, path, force, 1.0)
    knee = random.uniform(0.15, 0.5)
    toe = np.expm1(bend * np.minimum(path.value, knee) / knee) * knee / bend
    force = toe + np.exp(bend) * np.maximum(path.value - knee, 0.0)
    return _curve(random, path, force / np.exp(bend), 1.0, _SEAT)


def foam(random: Generator) -> Trial:
    """Walls that buckle at one stress, then touch: steep, flat, steep (Gibson and Ashby)."""
    path = _drive(random, 0.0)
    u, first = path.value, random.uniform(0.03, 0.1)
    flat, at = random.uniform(0.1, 0.5), random.uniform(1.05, 1.3)
    touching = np.maximum(u, 0.0) / (at - u)  # a drive may swing back a hair beyond its start
    force = 1 - np.exp(-u / first) + flat * u + 0.3 * touching ** random.uniform(1.0, 2.0)
    return _curve(random, path, force, 1 / first)


def disc_spring(random: Generator) -> Trial:
    """Belleville's washer up to near flat: softening by height over thickness (Almen 1936); or a
    conical coil, whose turns come to rest one after another."""
    path = _drive(random, 0.0)
    u = path.value
    if random.random() < 0.5:
        high = random.uniform(0.9, 1.4)
        deep = 0.9 * u * high
        force = deep * ((high - deep) * (high - deep / 2) + 1)
        return _curve(random, path, force, 0.9 * high * (high**2 + 1))
    at, more = random.uniform(0.3, 0.6), random.uniform(2, 8)
    force = u + more * np.maximum(u - at, 0.0) ** 2
    return _curve(random, path, force, 1.0)


def ball_on_plate(random: Generator) -> Trial:
    """Hertz: a power of three halves from the first touch, pressed by displacement. A seat that
    is soft at first looks the same."""
    path = _drive(random, 0.0)
    force = np.maximum(path.value, 0.0) ** random.uniform(1.45, 1.6)
    return _curve(random, path, force, 1.5, _SEAT)


def magnets(random: Generator) -> Trial:
    """A magnet held between two that push: stiffer towards either."""
    path, gap = _drive(random, -1.0), random.uniform(1.3, 3.0)
    n = random.uniform(2.0, 4.0)
    force = (gap - path.value) ** -n - (gap + path.value) ** -n
    return _curve(random, path, force, 2 * n * gap ** -(n + 1))


def bent_leaf(random: Generator) -> Trial:
    """A leaf spring through zero: stretched as it bends (stiffer), or soft beyond small bends."""
    path = _drive(random, -1.0)
    u = path.value
    if random.random() < 0.6:
        return _curve(random, path, u + random.uniform(0.5, 6.0) * u**3, 1.0)
    steep = random.uniform(1.0, 4.0)
    return _curve(random, path, np.tanh(steep * u), steep)


# ---------------------------------------------------------------------------------- clearances


def _play(u: Array, half: float, round_: float) -> Array:
    """Force of a spring of slope 1 behind a clearance, corners rounded over `round_`."""
    edge = max(round_, 1e-9)

    def soft(x: Array) -> Array:
        return np.asarray(edge * np.logaddexp(0.0, x / edge))

    return soft(u - half) - soft(-u - half)


def bolted_joint(random: Generator) -> Trial:
    """A bolt in a larger hole, moved to and fro: nothing but friction until it bears."""
    path = _drive(random, -1.0)
    half = random.uniform(0.05, 0.5)
    round_ = half * log_uniform(random, 0.01, 0.4)
    shift = random.uniform(-0.4, 0.4) * half * float(random.random() < 0.4)
    force = _play(path.value - shift, half, round_)
    rub = random.uniform(0.0, 0.08) * (1 - half)
    force = force + rub * slider(path.value / random.uniform(0.005, 0.03), np.ones(len(force)))
    accept = _CURVE if round_ > 0.1 * half else frozenset()
    repeated = path.repetition if random.random() < 0.5 else None
    return Trial(
        path.time,
        force,
        path.value,
        accept=accept,
        repetition=repeated,
        parameters={"width_share": 2 * half},
    )


def geared_joint(random: Generator) -> Trial:
    """Teeth that change flanks where the torque passes zero, or where gravity has moved that to;
    friction holds them in between. Torque is driven, the flanks change alike in every cycle."""
    path = _drive(random, -1.0)
    half, rub = random.uniform(0.08, 0.6), random.uniform(0.005, 0.1)
    zero = float(random.random() < 0.4) * random.uniform(-0.3, 0.3)
    edge = rub * random.uniform(0.1, 0.5)
    held = path.value - zero - slider(path.value - zero, np.full(len(path.time), rub))
    moved = path.value + half * np.tanh(held / edge)
    accept = frozenset({"joint_hysteresis"}) if rub > 0.05 else frozenset()
    return Trial(
        path.time, path.value, moved, "force", accept=accept, parameters={"width_share": 2 * half}
    )


# --------------------------------------------------------------------------------------- seats


def _pressed(random: Generator) -> tuple[Path, Imposed]:
    """Pressed and released several times, all alike."""
    points = to_and_fro(0.0, 1.0, whole(random, 3, 8))
    path = through(points, samples(random, len(points)))
    return path, "force" if random.random() < 0.5 else "displacement"


def _seated(random: Generator, moved_at: Array, force_at: Array, accept: frozenset[str]) -> Trial:
    """Of a curve given by points: driven by force or by displacement."""
    path, imposed = _pressed(random)
    if imposed == "force":
        force, moved = path.value, np.interp(path.value, force_at, moved_at)
    else:
        moved = path.value * moved_at[-1]
        force = np.interp(moved, moved_at, force_at)
    return Trial(path.time, force, moved, imposed, accept=accept, repetition=path.repetition)


def asperities(random: Generator) -> Trial:
    """Peaks that flatten: the gap closes exponentially, or with the logarithm of the load, before
    the parts themselves are all that gives (Greenwood and Williamson 1966)."""
    force = np.linspace(0, 1, 4000)
    depth, at = random.uniform(0.1, 0.8), random.uniform(0.03, 0.15)
    if random.random() < 0.5:
        soft = depth * (1 - np.exp(-force / at))
    else:
        soft = depth * np.log1p(force / (at / 4)) / np.log1p(4 / at)
    return _seated(random, force + soft, force, _CURVE)


def slack(random: Generator) -> Trial:
    """Something hangs loose: nearly no force at first, then all of it."""
    depth = random.uniform(0.1, 0.6)
    moved = np.linspace(0, 1 + depth, 4000)
    weak = random.uniform(0.002, 0.03)
    edge = depth * log_uniform(random, 0.01, 0.1)
    force = weak * moved + edge * np.logaddexp(0.0, (moved - depth) / edge)
    force = force - force[0]
    return _seated(random, moved, force, _CURVE | {"joint_backlash"})


_SMALL = (1e-6, 100.0)
FORMS: dict[str, tuple[Form, ...]] = {
    "joint_nonlinear_stiffness": (
        Form("rubber_strip", rubber_strip, (0.5, 1000.0), (1.0, 100.0)),
        Form("tendon", tendon, (0.1, 2000.0), (0.1, 20.0)),
        Form("foam", foam, (0.5, 5000.0), (1.0, 60.0)),
        Form("disc_spring", disc_spring, (5.0, 2e4), (0.2, 20.0)),
        Form("ball_on_plate", ball_on_plate, _SMALL, (1e-6, 0.05)),
        Form("magnets", magnets, (0.05, 200.0), (0.5, 50.0)),
        Form("bent_leaf", bent_leaf, (0.01, 500.0), (0.05, 50.0)),
    ),
    "joint_backlash": (
        Form("bolted_joint", bolted_joint, (5.0, 5e4), (0.05, 20.0)),
        Form("geared_joint", geared_joint, (0.5, 2000.0), (0.02, 20.0)),
    ),
    "contact_seating": (
        Form("asperities", asperities, (1.0, 2e4), (1e-3, 1.0)),
        Form("slack", slack, (0.1, 1e4), (0.02, 10.0)),
    ),
}
