"""joint_creep: polymers, tissue, foam, standard solids; time counts from 0 to 1 of the test.

Held or stepped, nothing but creep looks like it. Cycles at rates far apart tell it from friction;
where the elastic curve is bent as much, that word is accepted too (`curve_too`).
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.loops import curve_too
from rig.worlds.benches.memory import maxwell
from rig.worlds.benches.paths import samples, through
from rig.worlds.benches.trial import Form, Trial, log_uniform, whole


def _fading(random: Generator, time: Array) -> tuple[Array, str]:
    """(n,) share of the stress that is left after `time`: a power, a stretched exponential, or a
    logarithm of it (Findley; Kohlrausch; Guiu and Pratt)."""
    tau, kind = log_uniform(random, 1e-3, 0.2), whole(random, 0, 2)
    if kind == 0:
        return (1 + time / tau) ** -random.uniform(0.03, 0.25), "power"
    if kind == 1:
        rest = random.uniform(0.2, 0.8)
        return rest + (1 - rest) * np.exp(-((time / tau) ** random.uniform(0.3, 0.8))), "stretched"
    slope = random.uniform(0.1, 0.5) / np.log1p(1 / tau)
    return 1 - slope * np.log1p(time / tau), "logarithm"


def held_stretch(random: Generator) -> Trial:
    """Stretched within a moment, then held: force relaxes. Often only the hold is recorded."""
    count = samples(random, 2)
    rise = float(random.choice([0.0, log_uniform(random, 0.002, 0.05)]))
    time = np.linspace(0, 1, count)
    moved = np.minimum(time / rise, 1.0) if rise else np.ones(count)
    left, kind = _fading(random, np.maximum(time - rise, 0.0))
    return Trial(time, moved * left, moved, timeless=False, parameters={"law": kind})


def _prony(random: Generator, decades: tuple[float, float], total: float) -> tuple[Array, Array]:
    """Times (k,) and shares (k,) that sum to `total`."""
    tau = np.geomspace(*decades, 10)
    share = random.uniform(0.2, 1.0, 10) * tau ** random.uniform(-0.2, 0.2)
    return tau, total * share / share.sum()


def loads_in_steps(random: Generator) -> Trial:
    """Weights put on, one after the other or off again: displacement creeps and recovers; a part
    may flow for good (Findley's power, Burgers' dashpot)."""
    steps = whole(random, 1, 5)
    levels = np.cumsum(random.uniform(0.3, 1, steps)).tolist()
    if random.random() < 0.6:
        levels += [0.0]
    time = np.linspace(0, 1, samples(random, 2 * len(levels)))
    edge = np.linspace(random.uniform(0.01, 0.05), 1, len(levels) + 1)[:-1]
    rise = log_uniform(random, 5e-4, 0.01)
    force, moved = np.zeros_like(time), np.zeros_like(time)
    n, size, flow = random.uniform(0.1, 0.4), random.uniform(0.1, 1.0), random.uniform(0, 0.1)
    for at, jump in zip(edge, np.diff([0.0, *levels]), strict=True):
        since = np.maximum(time - at, 0.0)
        on = np.minimum(since / rise, 1.0)
        force += jump * on
        moved += jump * (on + size * since**n + flow * since)
    if random.random() < 0.3:  # stiffer under load: elastic part only
        moved = moved * (1 - random.uniform(0, 0.05) * force / force.max())
    return Trial(time, force, moved, "force", timeless=False, parameters={"exponent": n})


def tissue_in_ramps(random: Generator) -> Trial:
    """Ramp and hold, once or in steps: an exponential toe times fading memory (Fung's
    quasi-linear law)."""
    steps, bend = whole(random, 1, 4), random.uniform(0.3, 2.5)
    points, seconds = [0.0], []
    for k in range(steps):
        points += [(k + 1) / steps] * 2
        seconds += [random.uniform(0.02, 0.1), 1.0]
    path = through(points, samples(random, 2 * steps, 8000), seconds=seconds)
    elastic = np.expm1(bend * path.value) / bend
    tau, share = _prony(random, (0.005 / steps, 0.5), random.uniform(0.25, 0.7))
    slow = elastic * (1 - share.sum()) + maxwell(path.time, elastic, tau, share)
    loss = elastic - slow
    accept = curve_too(path.value, elastic, loss)
    return Trial(path.time, slow, path.value, accept=accept, timeless=False)


def cycles_at_several_rates(random: Generator) -> Trial:
    """A standard solid taken to and fro at rates decades apart: narrow when fast and when slow."""
    low = float(random.choice([-1.0, 0.0]))
    points, seconds, clock = [0.0], [], random.uniform(0.01, 0.03)
    for _ in range(whole(random, 2, 4)):
        points += [1.0, low, 1.0, low]
        seconds += [clock, clock * (1 - low), clock * (1 - low), clock * (1 - low)]
        clock *= random.uniform(5, 12)
    path = through(points, samples(random, 4 * len(points), 20_000), seconds=seconds)
    # As many samples for every cycle, as a recorder clocked by the stroke gives.
    even = np.linspace(0, len(seconds) - 1e-9, len(path.time))
    edges = np.concatenate([[0.0], np.cumsum(seconds)]) / np.sum(seconds)
    time = np.interp(even, np.arange(len(edges)), edges)
    moved = np.interp(time, edges, points)
    longest = float(np.sum(seconds[-4:]) / np.sum(seconds))
    middle = longest * log_uniform(random, 0.02, 0.3)
    tau, share = _prony(random, (middle / 5, middle * 5), random.uniform(0.2, 0.6))
    force = moved * (1 - share.sum()) + maxwell(time, moved, tau, share)
    return Trial(time, force, moved, timeless=False, parameters={"fading": float(share.sum())})


def foam_let_go(random: Generator) -> Trial:
    """Squeezed, held, and released to a smaller squeeze, where force grows again."""
    part = random.uniform(0.3, 0.7)
    path = through([0, 1, 1, part, part], samples(random, 5, 8000), seconds=[0.02, 1, 0.02, 1])
    tau, share = _prony(random, (0.003, 0.6), random.uniform(0.2, 0.6))
    fading = maxwell(path.time, path.value, tau, share)
    force = path.value * (1 - share.sum()) + fading
    return Trial(path.time, force, path.value, timeless=False)


_LONG = (20.0, 1e5)
FORMS: dict[str, tuple[Form, ...]] = {
    "joint_creep": (
        Form("held_stretch", held_stretch, (0.01, 5000.0), (0.01, 30.0), _LONG),
        Form("loads_in_steps", loads_in_steps, (0.05, 5000.0), (1e-3, 20.0), _LONG),
        Form("tissue_in_ramps", tissue_in_ramps, (1e-3, 200.0), (0.05, 20.0), _LONG),
        Form("cycles_at_several_rates", cycles_at_several_rates, (0.1, 2000), (0.02, 20), _LONG),
        Form("foam_let_go", foam_let_go, (0.1, 2000.0), (0.5, 50.0), _LONG),
    )
}
