"""How a hidden measurement is carried out: poses, directions, steps, clock, what is recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.arm import place

DESIGNS = ("rich", "medium", "paper")
_DESIGN_SHARES = (0.4, 0.35, 0.25)
_HASTY = 0.15  # of the hands turn past a level now and then

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_TOP_N = {"x": (165.0, 220.0), "y": (82.0, 102.0), "z": (70.0, 115.0)}
_TOOL_DOWN_RAD = -1.5 * np.pi  # q2 + q3 + q4 with the tool pointing down
_Q5_RAD, _Q6_RAD = 0.5 * np.pi, -1.336399
_TYPICAL_Nm_per_rad = np.array([37000.0, 57000.0, 18000.0, 7100.0, 7500.0, 8000.0])


@dataclass(frozen=True)
class Setup:
    """The arm in one pose with the fixture turned to one direction (unit vector, base frame)."""

    pose: str
    direction: str
    unit: tuple[float, float, float]
    top_N: float


@dataclass(frozen=True)
class Instruments:
    """Stated uncertainty of one sample and of the gains, and the last digits."""

    force_N: float
    force_gain: float
    displacement_mm: float
    displacement_gain: float
    force_digit_N: float
    displacement_digit_mm: float


@dataclass(frozen=True)
class Recorded:
    """Which optional columns the table has, and what encoders, tare and datum are like."""

    q: bool
    components: bool
    temperature: bool
    session: bool
    encoder: str
    tare: str
    datum: str


@dataclass(frozen=True)
class Plan:
    """One measurement before anything moves.

    poses: name -> commanded joint angles (6) rad; tcp_mm (3) in the flange frame; steps up to the
    largest load; hold and zero in samples; springs Nm/rad as the simulator believes them, and as
    they are. tool_kg: mass of what is screwed to the flange; nobody wrote it down. beyond: share of
    the levels that the hand first turns past, and then back to, before anything is read.
    """

    name: str
    poses: dict[str, Array]
    tcp_mm: Array
    setups: tuple[Setup, ...]
    repetitions: int
    steps: int
    hold: int
    zero_before: int
    zero_after: int
    unloads: bool
    instruments: Instruments
    recorded: Recorded
    believed: Array
    relative_sd: float
    springs: Array
    tool_kg: float
    beyond: float


def draw_plan(random: Generator, design: str | None) -> Plan:
    """A measurement of the named design (`rich`, `medium`, `paper`), or of any."""
    name = design or str(random.choice(DESIGNS, p=_DESIGN_SHARES))
    rich, paper = name == "rich", name == "paper"
    tcp = np.array([0.0, 0.0, float(round(random.uniform(0.0, 150.0)))])
    poses = {"P1": _draw_pose(random, tcp, (0.7, 0.8), 0.02)}
    if rich:
        poses["P2"] = _draw_pose(random, tcp, (0.55, 0.95), 0.5)
    believed, relative_sd, springs = _draw_springs(random)
    hold = _whole(random, 1, 2) if paper else (_whole(random, 6, 10) if rich else 4)
    zero = _whole(random, 1, 2) if paper else (_whole(random, 6, 9) if rich else 4)
    after = 0 if paper or (not rich and random.random() < 0.5) else zero
    return Plan(
        name=name,
        poses=poses,
        tcp_mm=tcp,
        setups=_draw_setups(random, name, tuple(poses)),
        repetitions=int(random.choice([2, 3, 4], p=[0.05, 0.9, 0.05])),
        steps=_whole(random, 9, 11) if paper else _whole(random, 7, 12 if rich else 10),
        hold=hold,
        zero_before=zero,
        zero_after=after,
        unloads=not paper,
        instruments=_draw_instruments(random),
        recorded=_draw_recorded(random, name),
        believed=believed,
        relative_sd=relative_sd,
        springs=springs,
        tool_kg=round(random.uniform(0.0, 3.0), 2),
        beyond=round(random.uniform(0.05, 0.4), 2) if random.random() < _HASTY else 0.0,
    )


def _whole(random: Generator, low: int, high: int) -> int:
    return int(random.integers(low, high + 1))


def _draw_pose(
    random: Generator, tcp_mm: Array, radius_m: tuple[float, float], turn: float
) -> Array:
    """Joint angles (6) rad with the tool pointing down at a radius and height an arm works at."""
    for _ in range(2000):
        q2, q3 = random.uniform(-2.1, -1.3), random.uniform(-2.3, -1.3)
        q = np.array([0.0, q2, q3, _TOOL_DOWN_RAD - q2 - q3, _Q5_RAD, _Q6_RAD])
        x, y, z = place(q).tool(tcp_mm * 1e-3)
        if not (radius_m[0] < np.hypot(x, y) < radius_m[1] and 0.15 < z < 0.6):
            continue
        q[0] = random.normal(0.0, turn) - np.arctan2(y, x)
        q[0] = (q[0] + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(np.round(q, 6))
    raise RuntimeError("no pose within the bounds in 2000 draws")  # pragma: no cover


def _draw_setups(random: Generator, name: str, poses: tuple[str, ...]) -> tuple[Setup, ...]:
    axes = ["x", "y"]
    if name == "rich" and random.random() < 0.5:
        axes.append("z")
    elif name != "rich" and random.random() < 0.12:
        axes = [str(random.choice(["x", "y"]))]
    tops = {a: random.uniform(*_TOP_N[a]) for a in axes}
    back = str(random.choice(axes)) if random.random() < 0.1 else ""
    both = random.random() < 0.4
    loads: list[tuple[str, tuple[float, float, float], float]] = []
    for a in axes:
        if a != back or both:
            loads.append((a, _AXES[a], tops[a]))
        if a == back:
            x, y, z = _AXES[a]
            loads.append((f"{a}_reversed", (-x, -y, -z), tops[a]))
    return tuple(Setup(p, d, u, top) for p in poses for d, u, top in loads)


def _draw_instruments(random: Generator) -> Instruments:
    return Instruments(
        force_N=round(random.uniform(0.03, 0.11), 3),
        force_gain=float(random.choice([0.003, 0.005, 0.01])),
        displacement_mm=round(random.uniform(0.0014, 0.0034), 4),
        displacement_gain=float(random.choice([0.002, 0.003, 0.005])),
        force_digit_N=float(random.choice([0.01, 0.05])),
        displacement_digit_mm=float(random.choice([0.0001, 0.0005], p=[0.8, 0.2])),
    )


def _draw_recorded(random: Generator, name: str) -> Recorded:
    return Recorded(
        q=bool(random.random() < (0.65 if name == "rich" else 0.45)),
        components=bool(random.random() < 0.45),
        temperature=bool(random.random() < 0.4),
        session=bool(name != "paper" or random.random() < 0.7),
        encoder="output" if random.random() < 0.75 else "motor",
        tare="session" if random.random() < 0.75 else "run",
        datum="setup" if random.random() < 0.9 else "repetition",
    )


def _draw_springs(random: Generator) -> tuple[Array, float, Array]:
    """What is believed (Nm/rad, rounded), its stated relative sd, and what is true."""
    believed = np.round(_TYPICAL_Nm_per_rad * random.normal(1.0, 0.06, 6), -2)
    relative_sd = float(random.choice([0.05, 0.07, 0.1, 0.15, 0.2], p=[0.3, 0.3, 0.3, 0.05, 0.05]))
    off = np.clip(random.standard_normal(6), -2.5, 2.5)
    return believed, relative_sd, np.asarray(believed * (1.0 + relative_sd * off))
