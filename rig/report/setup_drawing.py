"""The setup as a drawing: the arm in its pose from above and from the side, where screw and laser
act. Places of screw and laser are schematic: a data set knows their line, not their distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identification.arm import tool_offset
from rig.arrays import Array
from rig.canvas import blank
from rig.meta import Meta, MetaPose
from rig.models.robot import load_robot
from rig.plotting import COLOURS
from rig.units import MM_PER_M

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ARM, _LASER = "0.35", "#CC3311"
_LINE_POINTS, _LINE_MM = 13.0, 60.0  # of names above each other; about as much in the drawing
_BESIDE_MM = 45.0  # between screw and laser on the same side
_VIEWS = (("From above", 0, 1), ("From the side", 0, 2))


@dataclass(frozen=True)
class Load:
    """One measured direction: its name and unit vector (3,) in the base frame."""

    name: str
    vector: tuple[float, float, float]


def arm_points(meta: Meta, pose: MetaPose) -> Array:
    """Origins of the frames from base to flange, then the point of load: (8, 3) mm."""
    arm = load_robot(meta.robot)
    q, tool = np.array(pose.q_rad), tool_offset(np.array(pose.tcp_xyz_mm) / MM_PER_M)
    frames, tcp = arm.frames(q), arm.fk(q, tool)
    return np.vstack([frames[:, :3, 3], tcp[:3, 3]]) * MM_PER_M


def laser_sign(calibration: Mapping[str, Any]) -> int | None:
    """The laser's `sign` in a data set's settings: 1 where a motion along the direction makes the
    distance longer, -1 where it makes it shorter; None where none is recorded."""
    laser = calibration.get("laser")
    sign = laser.get("sign") if isinstance(laser, Mapping) else None
    return sign if sign in (1, -1) else None


def arm_setup(meta: Meta, name: str, loads: Sequence[Load], sign: int | None) -> Figure:
    """One pose: the arm from above and from the side, with every direction of load measured. sign:
    of the laser, as `laser_sign` has it."""
    points = arm_points(meta, meta.poses[name])
    figure = blank(9.0, 4.4)
    panels = figure.subplots(1, 2)
    for axes, (title, i, j) in zip(panels, _VIEWS, strict=True):
        _arm(axes, points[:, i], points[:, j])
        at, taken = points[-1, [i, j]], list[tuple[float, ...]]()
        for n, load in enumerate(loads):
            colour = COLOURS[n % len(COLOURS)]
            spot = _load(axes, at, np.array(load.vector), (i, j), colour, sign)
            _label(axes, spot, taken.count(spot.key), load.name, colour)
            taken.append(spot.key)
        axes.set_title(f"{title}, pose {name}", fontsize=10)
        axes.set_xlabel("x of the base in mm")
        axes.set_ylabel(f"{'xyz'[j]} of the base in mm")
        axes.set_aspect("equal")
    _same_scale(panels)
    _legend(figure, loads, sign)
    return figure


def bench_setup(loads: Sequence[Load]) -> Figure:
    """A rig without an arm: one spring a direction between ground, force and displacement."""
    figure = blank(7.5, 0.6 + 1.0 * len(loads))
    axes = figure.add_subplot()
    for n, load in enumerate(loads):
        _spring(axes, -float(n), load, COLOURS[n % len(COLOURS)])
    axes.set_xlim(-0.6, 9.0)
    axes.set_ylim(-len(loads) + 0.35, 0.65)
    axes.set_axis_off()
    return figure


def _arm(axes: Any, x: Array, y: Array) -> None:
    axes.plot(
        x[:7],
        y[:7],
        color=_ARM,
        linewidth=7,
        solid_capstyle="round",
        solid_joinstyle="round",
        alpha=0.45,
        zorder=2,
    )
    axes.plot(x[:7], y[:7], "o", color=_ARM, markersize=5, zorder=3)
    if np.hypot(x[7] - x[6], y[7] - y[6]) > 1:
        axes.plot(x[6:], y[6:], color=_ARM, linewidth=3, zorder=2)
    axes.plot(x[0], y[0], "s", color="black", markersize=13, zorder=3)
    axes.plot(x[7], y[7], "o", color="white", markeredgecolor="black", markersize=8, zorder=6)


@dataclass(frozen=True)
class _Spot:
    """Where a load's name goes: beside a mark at `at`, mm, by `step` points and aligned so; names
    at one spot stand above each other."""

    at: tuple[float, float]
    step: tuple[float, float]
    align: Literal["left", "center"]

    @property
    def key(self) -> tuple[float, ...]:
        """The same for marks that are nearer to each other than two lines of text."""
        return tuple(round(v / _LINE_MM) for v in self.at)


def _load(
    axes: Any, at: Array, vector: Array, view: tuple[int, int], colour: str, sign: int | None
) -> _Spot:
    """Screw and force behind the point of load, and the laser where its sign says it stands."""
    inside = vector[list(view)]
    length = float(np.hypot(*inside))
    if length < 0.05:  # along the line of sight
        towards = vector[3 - sum(view)] * (1 if view == (0, 1) else -1) > 0
        axes.plot(*at, "o", color="none", markeredgecolor=colour, markersize=16, zorder=5)
        axes.plot(*at, "." if towards else "x", color=colour, markersize=9, zorder=7)
        return _Spot((at[0], at[1]), (12.0, 12.0), "left")
    tail = at - 250 * inside
    axes.annotate(
        "",
        xy=at - 18 * inside,
        xytext=tail,
        zorder=5,
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.5},
    )
    block = at - 290 * inside
    axes.plot(*block, "s", color=colour, markersize=10, zorder=5)
    _laser(axes, at, inside, sign)
    upright = abs(inside[1]) > abs(inside[0])  # never on the line of its own arrow
    return _Spot(
        (block[0], block[1]), *(((10.0, 0.0), "left") if upright else ((0.0, 13.0), "center"))
    )


def _laser(axes: Any, at: Array, inside: Array, sign: int | None) -> None:
    """Its beam and place. A distance that grows with the motion is seen from behind, beside the
    screw and away from its name; one that shrinks, from ahead. Not recorded: the line alone."""
    ahead, beside = 250 * inside, np.zeros(2)
    if sign == 1:
        across = np.array([-inside[1], inside[0]]) / np.hypot(*inside)
        down = across if (abs(across[1]) < 1e-9 and across[0] < 0) or across[1] < 0 else -across
        ahead, beside = -250 * inside, _BESIDE_MM * down
    start, end = at + beside, at + beside + ahead
    axes.plot([start[0], end[0]], [start[1], end[1]], ":", color=_LASER, linewidth=1.6, zorder=4)
    if sign is not None:
        axes.plot(*(start + 1.12 * ahead), "D", color=_LASER, markersize=8, zorder=4, label="laser")


def _label(axes: Any, spot: _Spot, above: int, name: str, colour: str) -> None:
    """Above: names that stand at that spot already."""
    right, up = spot.step
    axes.annotate(
        name,
        spot.at,
        xytext=(right, up + _LINE_POINTS * above),
        color=colour,
        textcoords="offset points",
        ha=spot.align,
        va="center",
        fontsize=10,
        fontweight="bold",
        zorder=8,
    )


def _same_scale(panels: Sequence[Any]) -> None:
    """One scale for both views: the same width and height in mm, with a margin."""
    for get, put in (("get_xlim", "set_xlim"), ("get_ylim", "set_ylim")):
        limits = [getattr(axes, get)() for axes in panels]
        half = 0.54 * max(high - low for low, high in limits)
        for axes, (low, high) in zip(panels, limits, strict=True):
            getattr(axes, put)((low + high) / 2 - half, (low + high) / 2 + half)


def _legend(figure: Figure, loads: Sequence[Load], sign: int | None) -> None:
    from matplotlib.lines import Line2D

    marks = [
        Line2D(
            [],
            [],
            color=COLOURS[i % len(COLOURS)],
            marker="s",
            markersize=8,
            linewidth=2.5,
            label=f"screw with dynamometer, pushes along {load.name}",
        )
        for i, load in enumerate(loads)
    ]
    seen = Line2D([], [], color=_LASER, marker="D", linestyle=":", label="laser")
    if sign is None:
        seen = Line2D([], [], color=_LASER, linestyle=":", label="displacement, along this line")
    marks += [
        Line2D([], [], color="black", marker="s", linestyle="", markersize=9, label="base"),
        seen,
        Line2D([], [], color="white", marker="o", markeredgecolor="black", label="point of load"),
    ]
    figure.legend(
        handles=marks,
        loc="outside lower center",
        ncols=min(3, len(marks)),
        frameon=False,
        fontsize=8,
    )


def _spring(axes: Any, y: float, load: Load, colour: str) -> None:
    x = np.linspace(0.4, 4.0, 19)
    zigzag = y + 0.14 * np.array([0, 0, *[(-1) ** i for i in range(15)], 0, 0], dtype=float)
    axes.plot([0, 0], [y - 0.35, y + 0.35], color="black", linewidth=3)
    axes.plot([0, 0.4], [y, y], color=_ARM, linewidth=1.5)
    axes.plot(x, zigzag, color=_ARM, linewidth=1.5)
    axes.plot([4.0, 4.6], [y, y], color=_ARM, linewidth=1.5)
    axes.plot(4.8, y, "s", color=_ARM, markersize=13)
    axes.annotate(
        "",
        xy=(6.8, y),
        xytext=(5.1, y),
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2.5},
    )
    axes.text(
        6.95, y, f"{load.name}: force and displacement", va="center", color=colour, fontsize=9
    )
