"""joint_hysteresis: friction, dampers, rubber, alloys with memory.

What is accepted beside it: strokes far beyond the presliding are a slider that gives way as well
(joint_yield); where the mean curve is bent about as much as the loop is wide, the larger share is a
matter of a few percent (joint_nonlinear_stiffness). That is computed: `curve_too`.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.memory import bouc_wen, lowpass, pursuit, slider, stops
from rig.worlds.benches.paths import Path, samples, through, to_and_fro
from rig.worlds.benches.trial import Form, Trial, bent, log_uniform, whole

_SLIDES = frozenset({"joint_yield"})
_AS_LARGE = 0.5  # of the loop: a curve from here on may be called the main cause


def curve_too(x: Array, curve: Array, loop: Array) -> frozenset[str]:
    """joint_nonlinear_stiffness where the mean curve over x is bent enough, else nothing."""
    share = bent(x, curve) / max(bent(x, loop), 1e-300)
    return frozenset({"joint_nonlinear_stiffness"} if share > _AS_LARGE else ())


def _strokes(random: Generator, eased: bool, stroke: float) -> Path:
    """To and fro; the recording begins anywhere in the first stroke, moving."""
    start, cycles = random.uniform(-0.8, 0.8) * stroke, whole(random, 1, 12)
    points = [start, *[stroke, -stroke] * cycles]
    if random.random() < 0.3:
        points = [start, *[-stroke, stroke] * cycles]
    return through(points, samples(random, len(points)), eased=eased)


def seal_strokes(random: Generator) -> Trial:
    """A piston with its ring: presliding over a small part of the stroke, a force that falls with
    speed and then rises, a pressure that answers the sense of motion with a lag (Armstrong)."""
    stroke = log_uniform(random, 4, 60)  # in lengths of presliding
    path = _strokes(random, bool(random.random() < 0.4), stroke)
    speed = path.speed / np.abs(path.speed).max()
    sense = np.sign(speed)
    dip, at = random.uniform(0.0, 0.4), random.uniform(0.05, 0.4)
    steady = sense * (
        1 + dip * np.exp(-((speed / at) ** 2)) + random.uniform(0, 0.3) * sense * speed
    )
    state = pursuit(path.value, steady, 1.0, float(steady[0]) * float(random.random() < 0.5))
    pressure = lowpass(path.time, sense, random.uniform(0.002, 0.02) * np.ptp(path.time))
    tilt = random.uniform(-0.004, 0.004) * path.value
    where = 1 + random.uniform(0, 0.15) * np.sin(path.value / stroke * random.uniform(0.5, 2))
    force = where * state + random.uniform(0, 0.4) * pressure + tilt
    if random.random() < 0.4:  # wear and warming
        force = force * (1 + random.uniform(-0.15, 0.15) * path.time)
    return Trial(path.time, force, path.value, accept=_SLIDES)


def slide_with_breakaway(random: Generator) -> Trial:
    """A guide on bristles, moved by a crank: break-away peak, Stribeck dip, viscous rest
    (Canudas de Wit 1995), and another level each way."""
    stroke = log_uniform(random, 3, 30)
    path = _strokes(random, True, stroke)
    speed = path.speed / np.abs(path.speed).max()
    peak, at, viscous = random.uniform(0.1, 0.8), random.uniform(0.01, 0.1), random.uniform(0, 0.4)
    steady = np.sign(speed) * (1 + peak * np.exp(-((speed / at) ** 2)))
    uneven = 1 + random.uniform(0.0, 0.2) * np.sign(speed)
    force = pursuit(path.value, steady * uneven, 1.0) + viscous * speed
    return Trial(path.time, force, path.value, accept=_SLIDES)


def wearing_loop(random: Generator) -> Trial:
    """A smooth loop that loses strength and slope with the work done (Bouc, Wen, Baber, Noori)."""
    high, cycles = random.uniform(1.5, 8), whole(random, 4, 15)
    points = to_and_fro(-high, high, cycles, float(random.choice([0.0, 0.8])))
    path = through(points, samples(random, len(points), 6000), eased=True)
    wear = random.uniform(0.0, 0.3) / (2 * high * cycles)
    loop = bouc_wen(path.value, random.uniform(1, 4), random.uniform(0.5, 0.9), wear, wear)
    spring = random.uniform(0.01, 0.2) * path.value
    return Trial(path.time, loop + spring, path.value, stiffness=1.0, accept=_SLIDES)


def strain_wave_gear(random: Generator) -> Trial:
    """The output of a gear loaded to and fro, input held: it stiffens, and friction in the teeth
    makes a loop (Taghirad; Ruderman). Torque is driven."""
    points = to_and_fro(-1.0, 1.0, whole(random, 1, 6))
    path = through(points, samples(random, len(points)), eased=bool(random.random() < 0.5))
    hard = random.uniform(0.3, 2.0)
    curve = np.arcsinh(hard * path.value) / hard
    radius = random.uniform(0.02, 0.12, 3)
    loop = sum(
        random.uniform(0.5, 1.5) * (path.value - slider(path.value, np.full(len(path.time), r)))
        for r in radius
    )
    loop = np.asarray(loop) * random.uniform(0.2, 0.6) - 0.0
    loss = np.asarray(path.value * (loop @ path.value) / (path.value @ path.value)) - loop
    moved = curve - loss
    accept = curve_too(path.value, curve, loss)
    return Trial(path.time, path.value, moved, "force", accept=accept)


def wire_rope(random: Generator) -> Trial:
    """Strands that rub on each other from the smallest motion on, and stiffen when stretched."""
    points = to_and_fro(-1.0, 1.0, whole(random, 4, 10), random.uniform(0.5, 0.9))
    path = through(points, samples(random, len(points), 8000), eased=True)
    u = path.value
    limit, stiff = _spectrum(random, 12, 0.01, 0.6)
    loop = stops(u, limit * stiff, stiff)
    curve = random.uniform(0.2, 0.6) * u + random.uniform(0.0, 0.3) * np.maximum(u, 0) ** 2
    first = float(stiff.sum())
    return Trial(path.time, loop + curve, u, stiffness=first, accept=curve_too(u, curve, loop))


def _spectrum(random: Generator, k: int, low: float, high: float) -> tuple[Array, Array]:
    """Motions (k,) at which sliders give way, and their slopes."""
    reach = np.geomspace(low, high, k)
    return reach, reach ** -random.uniform(0.2, 1.0) * random.uniform(0.5, 1.5, k) / k


def damper_of_a_building(random: Generator) -> Trial:
    """Lead in rubber, or a sliding plate: a parallelogram with rounded corners whose strength
    falls as it warms; cycles of one or of growing amplitude."""
    high, cycles = random.uniform(3, 20), whole(random, 2, 8)
    points = to_and_fro(-high, high, cycles, float(random.choice([0.0, 0.8])))
    path = through(points, samples(random, len(points), 8000), eased=True)
    warm = random.uniform(0.0, 0.35) * path.time
    loop = bouc_wen(path.value, random.uniform(1, 6), 0.5, 0.0, 0.0) * (1 - warm)
    hard = random.uniform(0.0, 0.05) / high**2
    after = random.uniform(0.0, 0.12) * path.value + hard * path.value**3
    accept = _SLIDES | curve_too(path.value, after, loop)
    return Trial(path.time, loop + after, path.value, accept=accept)


def alloy_with_memory(random: Generator) -> Trial:
    """A flag: up over one plateau, back over a lower one, nothing stays (superelastic wire).
    The plateau itself is a curve without memory, and as large as the loop."""
    high, lower = random.uniform(3, 8), random.uniform(0.3, 0.75)
    cycles = whole(random, 2, 6)
    points = to_and_fro(0.0, high, cycles, float(random.choice([0.0, 0.7])))
    path = through(points, samples(random, len(points)))
    u, rise = path.value, random.uniform(0.02, 0.08)
    upper, under = 1 + rise * (u - 1), lower + rise * (u - lower)
    force = _between(u, np.minimum(u, upper), np.minimum(u, under))
    curve = 0.5 * (np.minimum(u, upper) + np.minimum(u, under))
    accept = curve_too(u, curve, force - curve)
    return Trial(path.time, force, u, accept=accept)


def _between(u: Array, upper: Array, lower: Array) -> Array:
    """A state of slope 1 kept between two curves (n,)."""
    out, state = np.empty(len(u)), 0.0
    for i, step in enumerate(np.diff(u, prepend=0.0)):
        state = float(min(max(state + step, lower[i]), upper[i]))
        out[i] = state
    return out


def fluid_in_a_field(random: Generator) -> Trial:
    """A magnetorheological damper shaken: a saturating force of speed, with a lag over the stroke,
    beside a spring (Kwok 2006). One or a few amplitudes at one rate."""
    cycles = whole(random, 3, 15)
    path = through(
        to_and_fro(-1, 1, cycles, float(random.choice([0.0, 0.6]))),
        samples(random, 2 * cycles),
        eased=True,
    )
    speed = path.speed / np.abs(path.speed).max()
    steep, shift = random.uniform(4, 15), random.uniform(0.02, 0.25)
    goal = np.tanh(steep * speed)
    loop = pursuit(path.value, goal, shift) + random.uniform(0, 0.15) * speed
    force = loop + random.uniform(0.0, 0.5) * path.value + random.uniform(-0.1, 0.1)
    return Trial(path.time, force, path.value, stiffness=1 / shift, accept=_SLIDES)


def filled_rubber(random: Generator) -> Trial:
    """Softer the further it is strained (Payne): a spectrum of sliders beside a spring."""
    points = to_and_fro(-1.0, 1.0, whole(random, 5, 10), 0.97)
    path = through(points, samples(random, len(points), 8000), eased=True)
    u = path.value
    limit, stiff = _spectrum(random, 10, 0.005, 0.5)
    loop = stops(u, limit * stiff, stiff)
    curve = random.uniform(0.1, 0.5) * u + random.uniform(-0.1, 0.2) * u**3
    accept = curve_too(u, curve, loop)
    return Trial(path.time, loop + curve, u, stiffness=float(stiff.sum()), accept=accept)


def loops_within_loops(random: Generator) -> Trial:
    """A pulled and released cable or a piezo stack with reversals on the way; force is driven."""
    turns = random.uniform(0.0, 1.0, whole(random, 6, 20))
    points = [0.0, 1.0, *turns.tolist(), 0.0]
    path = through(points, samples(random, len(points), 8000))
    radius = np.geomspace(0.01, 0.4, 8)
    stiff = random.uniform(0.3, 1.0, 8)
    share = random.uniform(0.1, 0.5) / stiff.sum()
    memory = path.value * stiff.sum() - stops(path.value, radius * stiff, stiff)
    moved = path.value + share * memory
    return Trial(path.time, path.value, moved, "force")


FORMS: dict[str, tuple[Form, ...]] = {
    "joint_hysteresis": (
        Form("seal_strokes", seal_strokes, (0.2, 200.0), (1.0, 100.0), (5.0, 300.0)),
        Form("slide_with_breakaway", slide_with_breakaway, (0.2, 300.0), (0.5, 100.0), (2, 200)),
        Form("wearing_loop", wearing_loop, (50.0, 5e4), (0.5, 80.0)),
        Form("strain_wave_gear", strain_wave_gear, (1.0, 500.0), (0.05, 5.0)),
        Form("wire_rope", wire_rope, (5.0, 2000.0), (0.2, 20.0), (2, 300)),
        Form("damper_of_a_building", damper_of_a_building, (500.0, 5e4), (3.0, 100.0), (2, 300)),
        Form("alloy_with_memory", alloy_with_memory, (1.0, 2000.0), (0.1, 20.0)),
        Form("fluid_in_a_field", fluid_in_a_field, (20.0, 5e4), (1.0, 60.0), (0.5, 60)),
        Form("filled_rubber", filled_rubber, (1.0, 2e4), (0.05, 20.0), (2, 600)),
        Form("loops_within_loops", loops_within_loops, (0.5, 1000.0), (1e-4, 2.0)),
    )
}
