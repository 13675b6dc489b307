"""joint_yield: metals, clutches and indents; strain and stress count in those of first yield.

What is accepted beside it: a cycled metal is a spectrum of friction elements as well
(joint_hysteresis: Masing, Iwan); a single pull that bends gradually could be a softening spring
(joint_nonlinear_stiffness), one with a sharp knee or a falling plateau could not.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.benches.memory import chaboche, slider
from rig.worlds.benches.paths import samples, through, to_and_fro
from rig.worlds.benches.trial import Form, Ints, Trial, log_uniform, whole

_CYCLED = frozenset({"joint_hysteresis"})
_ONE_PULL = frozenset({"joint_nonlinear_stiffness"})


def _hardening(random: Generator, longest: float) -> Callable[[Array], Array]:
    """Flow stress over plastic strain: Voce's saturation or Ludwik's power law, or both."""
    q, b = random.uniform(0.1, 0.8), random.uniform(2.0, 8.0) / longest
    n, end = random.uniform(0.3, 0.7), random.uniform(0.1, 0.8)
    kind = whole(random, 0, 2)
    first, second = float(kind != 1), float(kind != 0)

    def flow(plastic: Array) -> Array:
        power = end * (plastic / longest) ** n
        return np.asarray(1.0 + first * q * (1 - np.exp(-b * plastic)) + second * power)

    return flow


def _pulled(path: Array, flow: Callable[[Array], Array], loss: float) -> Array:
    """Stress of a pull with unloadings, which are straight and lose up to `loss` of the slope."""
    grid = np.concatenate([[0.0], np.geomspace(1e-4, 2 * path.max(), 4000)])
    total = flow(grid) + grid
    most = np.maximum.accumulate(path)
    plastic = np.where(most > total[0], np.interp(most, total, grid), 0.0)
    top = np.where(most > total[0], flow(plastic), most)
    slope = 1.0 - loss * (1.0 - np.exp(-3.0 * plastic / grid[-1]))
    return np.asarray(top - slope * (most - path))


def coupon_pulled_once(random: Generator) -> Trial:
    """A tensile test up to the largest force, sharp or gradual (Ludwik 1909, Voce 1948)."""
    longest = log_uniform(random, 4, 60)
    path = through([0, longest], samples(random, 1))
    if random.random() < 0.5:
        force = _pulled(path.value, _hardening(random, longest), 0.0)
        return Trial(path.time, force, path.value, parameters={"sharp": True})
    # Ramberg-Osgood: strain = s + a s^m has no knee that one could point at
    m, a = random.uniform(3, 9), random.uniform(0.3, 1.5)
    stress = np.linspace(0, 30, 20_000)
    force = np.interp(path.value, stress + a * stress**m, stress)
    extra = {"sharp": False, "exponent": m}
    return Trial(path.time, force, path.value, accept=_ONE_PULL, parameters=extra)


def coupon_with_plateau(random: Generator) -> Trial:
    """Upper yield point, a band running through (serrated), then hardening (Lueders)."""
    longest, plateau = random.uniform(12, 60), random.uniform(2.5, 8)
    path = through([0, longest], samples(random, 1))
    flow = _hardening(random, longest)
    u, upper = path.value, random.uniform(1.0, 1.2)
    beyond = np.maximum(u - 1.0 - plateau, 0.0)
    force = np.where(u < upper, u, flow(beyond))
    drop = (upper - 1.0) * np.exp(-np.maximum(u - upper, 0) / 0.15)
    force = force + np.where(u < upper, 0.0, drop)
    pitch, depth = plateau / random.uniform(6, 20), random.uniform(0.0, 0.02)
    saw = depth * (np.mod(u, pitch) / pitch - 0.5)
    force = force + np.where((u > upper) & (u < 1 + plateau), saw, 0.0)
    return Trial(path.time, force, u, parameters={"plateau": plateau, "upper": upper})


def coupon_with_unloadings(random: Generator) -> Trial:
    """A pull taken back now and then, on straight lines a little softer than the first."""
    longest, loops = random.uniform(5, 30), whole(random, 1, 5)
    flow = _hardening(random, longest)
    tops = np.sort(random.uniform(0.25, 1.0, loops)) * longest
    back = random.uniform(0.5, 0.95)
    points = [0.0]
    for top in tops:
        points += [float(top), float(top - back * flow(np.array([top - 1.0]))[0])]
    points.append(longest)
    path = through(points, samples(random, len(points)))
    force = _pulled(path.value, flow, random.uniform(0.0, 0.15))
    return Trial(path.time, force, path.value, parameters={"unloadings": loops})


def coupon_cycled(random: Generator) -> Trial:
    """Strain to and fro: two backstresses, a yield surface that grows or shrinks (Chaboche)."""
    high, cycles = random.uniform(2.5, 15), whole(random, 3, 15)
    points = to_and_fro(-high, high, cycles, float(random.choice([0.0, 0.7])))
    path = through(points, samples(random, len(points), 6000), eased=bool(random.random() < 0.3))
    back = [(random.uniform(0.3, 1.5), random.uniform(1, 5)), (random.uniform(0.005, 0.05), 0.0)]
    q, b = random.uniform(-0.3, 0.6), random.uniform(0.02, 0.5)
    force = chaboche(path.value, back, q, b)
    return Trial(path.time, force, path.value, accept=_CYCLED, parameters={"saturation": q})


def bar_of_growing_cycles(random: Generator) -> Trial:
    """Reinforcing steel: curves between two asymptotes, rounder after every excursion
    (Menegotto and Pinto 1973)."""
    points = to_and_fro(-random.uniform(0.5, 1) * 8, 8.0, whole(random, 4, 10), 0.85)
    path = through(points, samples(random, len(points)))
    force = _menegotto(path.value, path.leg, random.uniform(0.01, 0.06), random.uniform(12, 20))
    return Trial(path.time, force, path.value, accept=_CYCLED)


def _menegotto(strain: Array, leg: Ints, b: float, r0: float) -> Array:
    out = np.empty_like(strain)
    last_e, last_s, far, at = 0.0, 0.0, {1.0: 0.0, -1.0: 0.0}, 0.0
    for k in range(int(leg.max()) + 1):
        mine = leg == k
        e = strain[mine]
        sign = 1.0 if e[-1] > last_e else -1.0
        corner = (last_e - last_s + sign * (1 - b)) / (1 - b)
        height = sign * (1 - b) + b * corner
        xi = abs(far[sign] - corner) if k else 0.0
        r = max(r0 - 18.5 * xi / (0.15 + xi), 1.2)
        x = (e - last_e) / (corner - last_e)
        y = b * x + (1 - b) * x / (1 + np.abs(x) ** r) ** (1 / r)
        out[mine] = last_s + y * (height - last_s)
        at, last_s = float(e[-1]), float(out[mine][-1])
        far[sign], last_e = at, at
    return out


def slipping_clutch(random: Generator) -> Trial:
    """A clutch turned to and fro: elastic up to its torque, then it slips, a little unevenly."""
    stroke, cycles = random.uniform(3, 12), whole(random, 2, 8)
    points = to_and_fro(-stroke if random.random() < 0.6 else 0.0, stroke, cycles)
    path = through(points, samples(random, len(points)))
    pitch = stroke / random.uniform(3, 12)
    uneven = random.uniform(0.0, 0.04) * np.sin(2 * np.pi * path.value / pitch)
    worn = 1.0 - random.uniform(0.0, 0.1) * path.time
    force = slider(path.value, worn + uneven)
    return Trial(path.time, force, path.value, accept=_CYCLED, parameters={"limit": 1.0})


def indent(random: Generator) -> Trial:
    """A hard tip pressed in and drawn out: a power of 1.5 to 2 going in, a stiff return to a pit
    that stays (Oliver and Pharr 1992). The first slope of the return is the machine's number.
    Most of what was pressed in stays: neither a spring nor a soft start."""
    m, pit, n = random.uniform(1.5, 2.0), random.uniform(0.5, 0.9), random.uniform(1.2, 1.5)
    count = samples(random, 2)
    by_force = bool(random.random() < 0.6)
    drive = through([0, 1, 0] if by_force else [0, 1, pit], count)
    into = drive.leg == 0
    if by_force:
        force = drive.value
        deep = np.where(into, force ** (1 / m), pit + (1 - pit) * force ** (1 / n))
    else:
        deep = drive.value
        force = np.where(into, deep**m, (np.maximum(deep - pit, 0) / (1 - pit)) ** n)
    return Trial(
        drive.time,
        force,
        deep,
        "force" if by_force else "displacement",
        stiffness=n / (1 - pit),
        accept=_CYCLED,
        parameters={"pit_share": pit},
    )


FORMS: dict[str, tuple[Form, ...]] = {
    "joint_yield": (
        Form("coupon_pulled_once", coupon_pulled_once, (200.0, 5e4), (0.03, 10.0)),
        Form("coupon_with_plateau", coupon_with_plateau, (200.0, 5e4), (0.05, 10.0)),
        Form("coupon_with_unloadings", coupon_with_unloadings, (200.0, 5e4), (0.05, 10.0)),
        Form("coupon_cycled", coupon_cycled, (500.0, 5e4), (0.05, 3.0)),
        Form("bar_of_growing_cycles", bar_of_growing_cycles, (1e3, 5e4), (0.2, 30.0)),
        Form("slipping_clutch", slipping_clutch, (0.05, 2000.0), (0.1, 90.0)),
        Form("indent", indent, (1e-6, 5.0), (1e-5, 0.02), (1.0, 120.0)),
    )
}
