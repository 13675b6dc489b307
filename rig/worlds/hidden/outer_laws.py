"""Laws between floor and laser target that no encoder sees: links, mounting, fixture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.arm import place
from rig.worlds.hidden.effect import Drawn, Form, Unsuited
from rig.worlds.hidden.joint_yield import knee_path
from rig.worlds.hidden.scene import Change, Scene

# links as beams

_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(8)


def _links(scene: Scene, setup: int) -> list[tuple[Array, Array]]:
    """Ends (3) m of upper arm, forearm and wrist in a setup."""
    plan = scene.plan.setups[setup].pose
    points = place(scene.plan.poses[plan]).points
    return [(points[1], points[2]), (points[2], points[3]), (points[4], scene.tool[setup])]


def _bends(scene: Scene, setup: int, link: int, twist: float, taper: float) -> float:
    """m/N along the direction for a beam of EI 1 N m2 (GJ = `twist`), thicker towards the base:
    integral of M^2 / EI along it, M the moment of a unit force at the tool."""
    start, end = _links(scene, setup)[link]
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    share = (_GAUSS + 1) / 2
    moment = np.cross(
        scene.tool[setup] - (start + share[:, None] * (end - start)), scene.unit[setup]
    )
    along = moment @ axis
    bending = np.sum(moment**2, axis=1) - along**2
    stiff = 1.0 + taper * (0.5 - share)
    return float(np.sum(_GAUSS_WEIGHTS / 2 * length * (bending + along**2 / twist) / stiff))


def beam_compliance(scene: Scene, setup: int, link: int) -> float:
    """m/N along the direction for an even tube of EI 1 N m2 as upper arm (0) or forearm (1)."""
    return _bends(scene, setup, link, twist=0.75, taper=0.0)


def beams(which: str) -> Callable[[Scene, Generator], Drawn]:
    """Segments bend and twist; size is 1e4 N m2 over EI of the upper arm."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        twist = random.uniform(0.5, 0.9)
        taper = random.uniform(0.6, 1.4) if which == "tapered" else 0.0
        softer = random.uniform(1.3, 3.5)  # forearm against upper arm
        parts = {
            "upper_arm": (1.0, 0.0, 0.0),
            "forearm": (0.0, 1.0, 0.0),
            "with_wrist": (1.0, softer, softer * random.uniform(1.0, 3.0)),
        }.get(which, (1.0, softer, 0.0))
        unit = np.array(
            [
                sum(p * _bends(scene, s, k, twist, taper) for k, p in enumerate(parts) if p)
                for s in range(len(scene.plan.setups))
            ]
        )
        path = 1e-4 * unit[scene.history.setup] * scene.history.load

        def parameters(size: float) -> dict[str, Any]:
            stiff = {
                name: 1e4 / (size * part)
                for name, part in zip(("2", "3", "wrist"), parts, strict=True)
                if part
            }
            return {"EI_Nm2_by_segment": stiff, "GJ_over_EI": twist, "taper": taper}

        return Drawn(lambda size: Change(outside=size * path), parameters, (0.03, 4.0))

    return draw


# mounting


def moments(scene: Scene, depth: float) -> Array:
    """(s, 3) m: moment per newton along the direction about axes `depth` m below the base."""
    return np.cross(scene.point + np.array([0.0, 0.0, depth]), scene.unit)


def moments_of_load(scene: Scene, depth: float) -> Array:
    """(n, 3) Nm about these axes under the load as it acts."""
    above = scene.point[scene.history.setup] + np.array([0.0, 0.0, depth])
    return np.cross(above, scene.force)


def turning_base(which: str) -> Callable[[Scene, Generator], Drawn]:
    """The mounting turns elastically; size is 1e6 Nm/rad over its stiffness."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        depth = random.uniform(0.0, 0.8)
        below = 0.0 if which == "yaw" else depth
        lever = moments(scene, below)[scene.history.setup]
        moment = moments_of_load(scene, below)
        soft = random.uniform(0.5, 1.0, 3)
        if which == "tilt":
            soft[2] = 0.0
        elif which == "yaw":
            soft[:2] = 0.0
        if which == "oblique":  # one soft edge of the stand
            angle = random.uniform(0, np.pi)
            edge = np.array([np.cos(angle), np.sin(angle), 0.0])
            turned = (lever @ edge) * (moment @ edge)
        else:
            turned = (lever * moment) @ soft
        if which == "feet":  # and sinks on its feet
            sinks = random.uniform(0.05, 0.2) * scene.unit[:, 2] ** 2 + 0.01
            turned = turned + sinks[scene.history.setup] * scene.history.load
        path = 1e-6 * turned

        def parameters(size: float) -> dict[str, Any]:
            turn = {a: 1e6 / (size * s) for a, s in zip("xyz", soft, strict=True) if s}
            return {"turn_Nm_per_rad": turn, "axis_depth_m": depth}

        return Drawn(lambda size: Change(outside=size * path), parameters, (0.05, 8.0))

    return draw


def slipping_base(axis: str, law: str) -> Callable[[Scene, Generator], Drawn]:
    """The mounting gives way above a threshold moment; size is 1e6 Nm/rad over what is left."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        depth = 0.0 if axis == "yaw" else random.uniform(0.0, 0.7)
        turn = np.array([0.0, 0.0, 1.0])
        if axis == "tilt":
            angle = random.choice([0.0, np.pi / 2]) if law == "sharp" else random.uniform(0, np.pi)
            turn = np.array([np.cos(angle), np.sin(angle), 0.0])
        lever = moments(scene, depth) @ turn
        moment = moments_of_load(scene, depth) @ turn
        top = float(np.abs(moment).max())
        if top < 10.0:
            raise Unsuited
        limit = top * random.uniform(0.4, 0.88)
        path, extra = knee_path(scene, moment, limit, law, random)
        moved = 1e-6 * lever[scene.history.setup] * path
        onset = {
            s.direction: limit / abs(arm)
            for s, arm in zip(scene.plan.setups, lever, strict=True)
            if abs(arm) * s.top_N > limit
        }

        def parameters(size: float) -> dict[str, Any]:
            return {
                "stiffness_after_Nm_per_rad": 1e6 / size,
                "axis": turn,
                "axis_depth_m": depth,
                **extra,
            }

        def change(size: float) -> Change:
            return Change(outside=size * moved)

        return Drawn(change, parameters, (0.3, 1000.0), (), onset)

    return draw


# fixture


def _seated(law: str, x: Array, random: Generator) -> Array:
    """(n) 0 to 1: how far the fixture has seated itself at a load x (n) over its scale."""
    if law == "exponential":
        return np.asarray(-np.expm1(-x))
    if law == "hyperbolic":
        return np.asarray(x / (1 + x))
    if law == "arctan":
        return np.asarray(np.arctan(x) * 2 / np.pi)
    return np.asarray(np.minimum(x / 3.0, 1.0) ** random.uniform(0.35, 0.65))


def seating(law: str) -> Callable[[Scene, Generator], Drawn]:
    """The fixture seats itself at low force; size is the depth in mm."""

    def draw(scene: Scene, random: Generator) -> Drawn:
        load = np.abs(scene.history.load)
        scale = float(load.max() * np.exp(random.uniform(np.log(0.03), np.log(0.2))))
        path = 1e-3 * _seated(law, load / scale, random)
        seated = float(path.max()) * 1e3  # share of the depth that the largest load reaches

        def parameters(size: float) -> dict[str, Any]:
            return {"depth_mm": size * seated, "force_scale_N": scale, "law_size_mm": size}

        return Drawn(lambda size: Change(outside=size * path), parameters, (0.002, 0.15))

    return draw


FORMS: dict[str, tuple[Form, ...]] = {
    "link_flexibility": (
        Form("upper_arm", True, beams("upper_arm")),
        Form("forearm", True, beams("forearm")),
        Form("both_arms", True, beams("both_arms")),
        Form("tapered", False, beams("tapered")),
        Form("with_wrist", False, beams("with_wrist")),
    ),
    "base_compliance": (
        Form("tilt", True, turning_base("tilt")),
        Form("yaw", True, turning_base("yaw")),
        Form("tilt_and_yaw", True, turning_base("tilt_and_yaw")),
        Form("oblique_edge", False, turning_base("oblique")),
        Form("feet", False, turning_base("feet")),
    ),
    "base_slip": (
        Form("yaw_sharp", True, slipping_base("yaw", "sharp")),
        Form("tilt_sharp", True, slipping_base("tilt", "sharp")),
        Form("yaw_rounded", False, slipping_base("yaw", "menegotto_pinto")),
        Form("yaw_creeping", False, slipping_base("yaw", "perzyna")),
        Form("tilt_ramberg_osgood", False, slipping_base("tilt", "ramberg_osgood")),
    ),
    "contact_seating": (
        Form("exponential", True, seating("exponential")),
        Form("hyperbolic", True, seating("hyperbolic")),
        Form("arctan", False, seating("arctan")),
        Form("power", False, seating("power")),
    ),
}
