"""The types that flow between the application and the identification: samples become curves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Point:
    """One level of one run (pose, direction, repetition, branch, step) after settling.

    force N, displacement m: means of the `n` second values of the level, zero line subtracted.
    u_force, u_displacement: standard uncertainty of these means (type A and instrument resolution;
    gains, common to all points, are not in them).
    """

    repetition: int
    branch: str  # "zero", "loading", "unloading", "cycle"
    step: int
    force: float
    displacement: float
    u_force: float
    u_displacement: float
    n: int


@dataclass(frozen=True)
class Curve:
    """All points of one pose and direction, in the order of measurement.

    gain_sd_force, gain_sd_displacement: relative standard uncertainties of the two gains, common
    to every point.
    origin: force and displacement count from an unloaded state that was measured, so that a line
    through (0, 0) is a statement of the data. held: the points are levels that were held; False:
    bins of a continuous recording. ends: steps on whose way a limit of the displacement ended
    loading; they were held wherever the force stood. notes: what was assumed on the way here, in
    sentences.
    """

    pose: str
    direction: str
    unit_vector: tuple[float, float, float]
    points: tuple[Point, ...]
    gain_sd_force: float
    gain_sd_displacement: float
    origin: bool = True
    held: bool = True
    ends: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()
