"""Volumes that one arm reaches, and that two mirrored arms reach together, above the base plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.arm import JOINTS, Arm
from identification.arrays import Array

_MOST_A_SIDE = 500  # cells: with 180 azimuths, 45 MB
_CHUNK = 50_000  # rows that stay in the processor's cache


@dataclass(frozen=True)
class Workspace:
    """single, coupled: m^3; definition: in words, because volumes of different ones differ.

    thin: share of the single volume in cells that one sample alone fell into; about as much may be
    missing in cells that none has found (first-order jackknife), 0 where nothing is sampled.
    """

    single: float
    coupled: float
    definition: str
    thin: float = 0.0

    @property
    def ratio(self) -> float:
        """Share of the single arm's volume in which both arms can meet."""
        return self.coupled / self.single


def analytic(reach: float, distance: float) -> Workspace:
    """Half ball of radius `reach` about the base, and half of the lens that two such balls share
    (m): `V = pi (4 R + D)(2 R - D)^2 / 12` for the whole lens (spherical caps, height R - D/2).

    Raises ValueError when a length is not above 0.
    """
    if not (reach > 0 and distance > 0):
        raise ValueError(f"reach {reach:g} m and base distance {distance:g} m must be above 0 m")
    single = 2 / 3 * np.pi * reach**3
    lens = 0.0
    if distance < 2 * reach:
        lens = np.pi * (4 * reach + distance) * (2 * reach - distance) ** 2 / 12
    return Workspace(
        float(single),
        float(lens / 2),
        f"reach model: ball of {reach:g} m about each base, upper half; "
        f"coupled where both balls overlap, bases {distance:g} m apart",
    )


def flange_points(arm: Arm, q: ArrayLike) -> Array:
    """Positions (n, 3) m of the flange for q (n, 6): the last column of `fk`, without the rest."""
    angles = np.asarray(q, dtype=float)
    x, y, z = np.zeros((3, 1))
    for i in range(JOINTS - 1, -1, -1):
        c, s = np.cos(angles[:, i]), np.sin(angles[:, i])
        ca, sa = np.cos(arm.alpha[i]), np.sin(arm.alpha[i])
        along, across = x + arm.a[i], ca * y - sa * z
        x, y, z = c * along - s * across, s * along + c * across, sa * y + ca * z + arm.d[i]
    return np.stack([x, y, z], axis=-1)


@dataclass(frozen=True, eq=False)
class Reached:
    """Cells (radius, height, azimuth) about axis 1 that samples fell into; edges of size `cell`.

    One azimuth where joint 1 turns all the way round. once: cells with a single sample.
    """

    cells: NDArray[np.bool_]
    cell: float
    once: NDArray[np.bool_]

    def contains(self, x: Array, y: Array, z: Array) -> NDArray[np.bool_]:
        """Whether points (same shapes, m, base frame) lie in a reached cell."""
        radius = (np.hypot(x, y) / self.cell).astype(int)
        height = np.floor(z / self.cell).astype(int)
        sectors = self.cells.shape[2]
        azimuth = np.zeros_like(radius)
        if sectors > 1:
            turn = np.arctan2(y, x) / (2 * np.pi) % 1.0
            azimuth = np.minimum((turn * sectors).astype(int), sectors - 1)
        inside = (radius < self.cells.shape[0]) & (height >= 0) & (height < self.cells.shape[1])
        out = np.zeros(radius.shape, dtype=bool)
        at = radius[inside], height[inside], azimuth[inside]
        out[inside] = self.cells[at]
        return out

    def volume(self) -> float:
        """Volume of all reached cells in m^3."""
        return self._volume(self.cells)

    def thin(self) -> float:
        """Share of that volume in cells with a single sample."""
        whole = self.volume()
        return float(self._volume(self.once) / whole) if whole > 0 else 0.0

    def _volume(self, cells: NDArray[np.bool_]) -> float:
        rings = np.pi * self.cell**2 * (2 * np.arange(cells.shape[0]) + 1)
        filled = cells.sum(axis=(1, 2)) / cells.shape[2]
        return float(rings @ filled) * self.cell


def sample(
    arm: Arm,
    samples: int,
    seed: int = 0,
    *,
    cell: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Reached:
    """Monte Carlo over the joint space within the joint limits (uniform), above the base plane.

    Joints that turn more than once are sampled over one turn. Memory stays below 100 MB whatever
    the number of samples; `progress` gets the share that is done. cell: m; by default it shrinks
    with the number of samples, so that neither missed cells nor half-filled ones at the rim count,
    and grows with the arm where there would be too many.
    """
    if samples < 1:
        raise ValueError(f"{samples} samples; at least 1 is wanted")
    cell = max(_cell(samples), outermost(arm) / _MOST_A_SIDE) if cell is None else cell
    if not cell > 0:
        raise ValueError(f"cells of {cell:g} m; above 0 m is wanted")
    rng = np.random.default_rng(seed)
    low, span = arm.q_min, np.minimum(arm.q_max - arm.q_min, 2 * np.pi)
    full_turn = bool(span[0] >= 2 * np.pi)
    sectors = 1 if full_turn else 180
    limit = outermost(arm)
    shape = (int(limit / cell) + 2, int((limit + abs(arm.d[0])) / cell) + 2, sectors)
    cells, several = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    for start in range(0, samples, _CHUNK):
        q = low + span * rng.random((min(_CHUNK, samples - start), JOINTS))
        if full_turn:
            q[:, 0] = 0.0  # turning about axis 1 changes neither radius nor height
        p = flange_points(arm, q)
        p = p[p[:, 2] > 0]
        turn = np.arctan2(p[:, 1], p[:, 0]) / (2 * np.pi) % 1.0
        azimuth = np.minimum((turn * sectors).astype(int), sectors - 1)
        radius = (np.hypot(p[:, 0], p[:, 1]) / cell).astype(int)
        at = np.ravel_multi_index((radius, (p[:, 2] / cell).astype(int), azimuth), shape)
        hit, count = np.unique(at, return_counts=True)
        several.flat[hit] |= (count > 1) | cells.flat[hit]
        cells.flat[hit] = True
        if progress is not None:
            progress(min(1.0, (start + _CHUNK) / samples))
    return Reached(cells, cell, cells & ~several)


def monte_carlo(
    arm: Arm,
    distance: float,
    samples: int = 1_000_000,
    seed: int = 0,
    *,
    progress: Callable[[float], None] | None = None,
) -> Workspace:
    """Volumes from `sample`: what one arm reaches, and what it shares with its mirror image whose
    base stands `distance` m away along x."""
    reached = sample(arm, samples, seed, progress=progress)
    return Workspace(
        reached.volume(),
        _shared(reached, distance),
        f"Monte Carlo: {samples} joint positions, uniform within the joint limits; cells of "
        f"{reached.cell * 1e3:.3g} mm about axis 1 that the flange falls into, z > 0; coupled "
        f"where its mirror image, base {distance:g} m away, does too",
        reached.thin(),
    )


def _shared(reached: Reached, distance: float) -> float:
    """Volume in which a point and its mirror image in the plane x = distance / 2 are reached."""
    limit = reached.cells.shape[0] * reached.cell
    step = max(reached.cell, 0.01, limit / 300)  # or the largest arms take half a minute
    half = distance / 2
    if half >= limit:
        return 0.0
    # the shared body is symmetric to the plane: count its half beyond the plane
    x = np.arange(half + step / 2, limit, step)
    y = np.arange(-limit + step / 2, limit, step)
    count = 0
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    for z in np.arange(step / 2, reached.cells.shape[1] * reached.cell, step):
        level = np.full_like(grid_x, z)
        both = reached.contains(grid_x, grid_y, level)
        both &= reached.contains(distance - grid_x, grid_y, level)
        count += int(both.sum())
    return float(2 * count * step**3)


def outermost(arm: Arm) -> float:
    """The flange is no farther from the base than the sum of all lengths."""
    return float(np.hypot(arm.a, arm.d).sum())


def _cell(samples: int) -> float:
    return float(0.01 * (500_000 / samples) ** (1 / 3))
