"""Volts of the amplifier's channels to force and moment, and what is uncertain about them.

The piezo crystals of a 9257B stand at the four corners, at x = +-a and y = +-b. Its connector
carries eight charges, of which the shear pairs are already joined:
fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4. Amplifiers that sum give Fx, Fy, Fz instead.
All linear, so one matrix holds the whole calibration. Sums and lever arms: Kistler's instruction
manual of the 9257B.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.arrays import Array
from drivers.kistler.settings import KistlerSettings, PerAxis

AXES_OF_CHANNELS = {3: "xyz", 8: "xxyyzzzz"}
CHARGE_DRIFT_pC_PER_S = 0.05  # most that the makers of charge amplifiers allow for one channel
AMPLIFIER_SPAN_V = 10.0


@dataclass(frozen=True)
class Calibration:
    """Linear map from channel volts to force N and moment Nm on the robot in its base frame.

    `matrix` (components, channels) takes volts to the components: Fx, Fy, Fz, and, with eight
    channels, Mx, My, Mz about the point at height az0 over the sensor's origin.
    """

    matrix: Array

    @classmethod
    def from_settings(cls, settings: KistlerSettings) -> Calibration:
        """The calibration that the station file describes."""
        scale = full_scale_N(settings) / AMPLIFIER_SPAN_V
        rotation = np.array(settings.axes_in_base).T * settings.force_on_robot_sign
        sums = channel_sums(settings)
        blocks = [rotation @ sums[i : i + 3] for i in range(0, len(sums), 3)]
        return cls(matrix=np.vstack(blocks) * scale)

    def components(self, volts: Array) -> Array:
        """Force N and moment Nm (n, 3 or 6) of channel volts (n, channels)."""
        return volts @ self.matrix.T


def full_scale_N(settings: KistlerSettings) -> Array:
    """Force (channels,) in N at which each channel's amplifier gives 10 V."""
    return per_channel(settings.full_scale_N, settings.channels)


def per_channel(values: PerAxis, channels: int) -> Array:
    """An axis' value for each of the channels (channels,)."""
    return np.array([getattr(values, axis) for axis in AXES_OF_CHANNELS[channels]], dtype=float)


def channel_sums(settings: KistlerSettings) -> Array:
    """Matrix (3 or 6, channels) from channel forces N to Fx, Fy, Fz N, Mx, My, Mz Nm, sensor frame.

    The crystals measure moments about the sensor's origin; az0 moves them up to the load's line of
    action: Mx + az0 Fy, My - az0 Fx (M_P = M_O - r x F with r = (0, 0, az0)).
    """
    if settings.channels == 3:
        return np.eye(3)
    a, b, h = (1e-3 * v for v in (settings.a_mm, settings.b_mm, settings.az0_mm))
    fx = np.array([1, 1, 0, 0, 0, 0, 0, 0], dtype=float)
    fy = np.array([0, 0, 1, 1, 0, 0, 0, 0], dtype=float)
    fz = np.array([0, 0, 0, 0, 1, 1, 1, 1], dtype=float)
    mx = b * np.array([0, 0, 0, 0, 1, 1, -1, -1], dtype=float) + h * fy
    my = a * np.array([0, 0, 0, 0, -1, 1, 1, -1], dtype=float) - h * fx
    mz = np.array([-b, b, a, -a, 0, 0, 0, 0])
    return np.vstack([fx, fy, fz, mx, my, mz])


def channel_forces(wrench: Array, settings: KistlerSettings) -> Array:
    """Channel forces N (n, channels) of a wrench (n, 6) at the az0 point, sensor frame.

    Eight channels for six components leave two self-stresses of the clamped plate free: those
    that no outer load makes are taken as zero (least norm).
    """
    if settings.channels == 3:
        return wrench[:, :3].copy()
    result: Array = wrench @ np.linalg.pinv(channel_sums(settings)).T
    return result


def volts_of(force_on_robot: Array, settings: KistlerSettings) -> Array:
    """Channel volts (n, channels) for forces N (n, 3) on the robot in its base frame.

    The load acts at the az0 point on the sensor's z axis, so that there is no moment about it.
    """
    axes = np.array(settings.axes_in_base) * settings.force_on_robot_sign
    wrench = np.zeros((len(force_on_robot), 6))
    wrench[:, :3] = force_on_robot @ axes.T
    volts: Array = channel_forces(wrench, settings) * AMPLIFIER_SPAN_V / full_scale_N(settings)
    return volts


def drift_bound_N_per_s(settings: KistlerSettings) -> Array:
    """Fastest drift (3,) of Fx, Fy, Fz in N/s, base frame, if every channel drifts alike.

    A charge drift over the sensitivity is a force drift; the drifts of the channels in a sum add,
    and those of the sensor's axes add into a base axis by their direction cosines' moduli. The
    amplifier's full scale is in N, so this is the only use of the charge sensitivity.
    """
    sensitivity = np.abs(per_channel(settings.sensitivity_pC_per_N, settings.channels))
    sensor = np.abs(channel_sums(settings)[:3]) @ (CHARGE_DRIFT_pC_PER_S / sensitivity)
    result: Array = np.abs(np.array(settings.axes_in_base)).T @ sensor
    return result


def u_type_a(sd: float, count: int) -> float:
    """Standard uncertainty of a mean of `count` values with standard deviation `sd` (GUM 4.2.3).

    Holds for values that scatter independently. Mains hum cancels in the mean over whole periods
    but widens `sd`, and so does a force on the move: the figure then errs to the large side.
    Slow noise and drift are not in it; the zero lines before and after a run carry these.
    """
    return sd / math.sqrt(count) if count > 1 else math.nan
