"""What a drawn effect is, and helpers that the laws share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator

from rig.arrays import Array
from rig.worlds.hidden.scene import Change, Scene

_FAIR_SHARE = 0.08  # of the elastic deflection in a setup, for a joint that an effect sits at


@dataclass(frozen=True)
class Effect:
    """One effect with everything drawn but its size.

    `change` and `parameters` take the size, whose physical bounds are `sizes`; `joints` count
    from 1; `onset_N` is the force per direction at which a threshold is reached.
    """

    word: str
    form: str
    fitted: bool
    change: Callable[[float], Change]
    parameters: Callable[[float], dict[str, Any]]
    sizes: tuple[float, float]
    joints: tuple[int, ...] = ()
    onset_N: dict[str, float] | None = None


class Unsuited(Exception):
    """This plan gives such an effect nothing to act on; another has to be drawn."""


@dataclass(frozen=True)
class Form:
    """A law by name; `fitted` when a library of textbook forms holds it nearly exactly."""

    name: str
    fitted: bool
    draw: Callable[[Scene, Generator], Drawn]


@dataclass(frozen=True)
class Drawn:
    """What a form draws: an effect without its name."""

    change: Callable[[float], Change]
    parameters: Callable[[float], dict[str, Any]]
    sizes: tuple[float, float]
    joints: tuple[int, ...] = ()
    onset_N: dict[str, float] | None = field(default=None)


def one_joint(joint: int, rad: Array) -> Array:
    """(n, 6) rad: the path of one joint (from 0), the others still."""
    out = np.zeros((len(rad), 6))
    out[:, joint] = rad
    return out


def share_of_joints(scene: Scene) -> Array:
    """(6) largest part of the elastic deflection, over setups, that each joint carries."""
    along = np.einsum("sij,sj->si", scene.levers, scene.unit)
    part = along**2 / scene.plan.springs
    return np.asarray((part / part.sum(axis=1, keepdims=True)).max(axis=0))


def draw_joint(scene: Scene, random: Generator) -> int:
    """A joint (from 0) that carries a fair part of the deflection in some setup."""
    part = share_of_joints(scene)
    able = np.flatnonzero(part > _FAIR_SHARE)
    return int(random.choice(able))


def rounded(values: Any, digits: int = 6) -> Any:
    """JSON-able numbers with `digits` significant ones."""
    if isinstance(values, dict):
        return {str(k): rounded(v, digits) for k, v in values.items()}
    if isinstance(values, (list, tuple, np.ndarray)):
        return [rounded(v, digits) for v in values]
    if isinstance(values, (float, np.floating)):
        return float(f"{float(values):.{digits}g}")
    return int(values) if isinstance(values, np.integer) else values
