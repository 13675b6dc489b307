"""Elastic bodies in small deflection: sections, beams, compliance moved to another point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array


@dataclass(frozen=True)
class Material:
    """young, shear: moduli in Pa."""

    name: str
    young: float
    shear: float

    def __post_init__(self) -> None:
        """Checks the values."""
        if not (self.young > 0 and self.shear > 0):
            raise ValueError(f"moduli of {self.name} must be above 0 Pa")


# Usual values of structural steel and of 6000-series aluminium (Eurocode 3, Eurocode 9).
STEEL = Material("steel", 210e9, 81e9)
ALUMINIUM = Material("aluminium", 70e9, 27e9)
MATERIALS = {m.name: m for m in (STEEL, ALUMINIUM)}


@dataclass(frozen=True)
class Section:
    """What a cross-section resists: axial N, bending about its y and z axis Nm^2, torsion Nm^2.

    shear: N, of both directions; infinite for a slender (Euler-Bernoulli) beam.
    """

    axial: float
    bending_y: float
    bending_z: float
    torsion: float
    shear: float = np.inf

    def __post_init__(self) -> None:
        """Checks the values."""
        if not min(self.axial, self.bending_y, self.bending_z, self.torsion, self.shear) > 0:
            raise ValueError("every stiffness of a section must be above 0")


def tube(material: Material, diameter: float, wall: float | None = None) -> Section:
    """A round tube of outer `diameter` and `wall` thickness, m; without a wall a solid rod."""
    if not diameter > 0:
        raise ValueError(f"diameter is {diameter} m; it must be above 0 m")
    if wall is not None and not 0 < wall <= diameter / 2:
        raise ValueError(f"wall is {wall} m; it must be above 0 and at most {diameter / 2} m")
    inner = 0.0 if wall is None else diameter - 2 * wall
    area = np.pi / 4 * (diameter**2 - inner**2)
    second_moment = np.pi / 64 * (diameter**4 - inner**4)
    return Section(
        axial=material.young * area,
        bending_y=material.young * second_moment,
        bending_z=material.young * second_moment,
        torsion=material.shear * 2 * second_moment,
    )


@dataclass(frozen=True)
class Beam:
    """A straight elastic segment from `start` to `end` (m), fixed to frame `frame` of the arm.

    Frame 0 is the base, i the link behind joint i. `y_axis`: the section's y axis, in that frame.
    """

    section: Section
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    frame: int
    name: str = ""
    y_axis: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        """Checks the values."""
        if not self.length > 0:
            raise ValueError(f"link segment {self.name!r} has no length")

    @property
    def length(self) -> float:
        """Length in m."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    def axes(self) -> Array:
        """Rotation (3, 3) whose columns are the beam's x (along it), y and z axis."""
        x = np.subtract(self.end, self.start) / self.length
        wish = self.y_axis if self.y_axis is not None else np.eye(3)[np.argmin(np.abs(x))]
        y = np.asarray(wish, dtype=float) - np.dot(wish, x) * x
        if not np.linalg.norm(y) > 1e-9:
            raise ValueError(f"y_axis of link segment {self.name!r} lies along the segment")
        y /= np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])

    def compliance(self) -> Array:
        """Compliance (6, 6) of the end against the clamped start, in the beam's axes."""
        return cantilever(self.section, self.length)


def cantilever(section: Section, length: float) -> Array:
    """Tip compliance (6, 6) of a clamped beam along its x axis (Timoshenko; Przemieniecki 1968).

    Lateral deflection per force is `L^3 / 3EI + L / GA_s`, rotation per moment `L / EI`, and
    `L^2 / 2EI` couples them.
    """
    C = np.zeros((6, 6))
    C[0, 0] = length / section.axial
    C[3, 3] = length / section.torsion
    for shift, turn, bending, sign in (
        (1, 5, section.bending_z, 1.0),
        (2, 4, section.bending_y, -1.0),
    ):
        C[shift, shift] = length**3 / (3 * bending) + length / section.shear
        C[turn, turn] = length / bending
        C[shift, turn] = C[turn, shift] = sign * length**2 / (2 * bending)
    return C


def transport(lever: Array) -> Array:
    """Twist at a point `lever` (..., 3) m away: `v' = v + w x lever`, (..., 6, 6).

    Compliance moves as `A C A^T`, and a wrench at the far point acts at the near one as `A^T W`.
    """
    r = np.asarray(lever, dtype=float)
    A = np.zeros((*r.shape[:-1], 6, 6))
    A[..., range(6), range(6)] = 1.0
    A[..., 0, 4], A[..., 0, 5] = r[..., 2], -r[..., 1]
    A[..., 1, 3], A[..., 1, 5] = -r[..., 2], r[..., 0]
    A[..., 2, 3], A[..., 2, 4] = r[..., 1], -r[..., 0]
    return A
