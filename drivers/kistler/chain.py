"""Crystals, charge amplifier and converter as the emulator plays them: force in, volts out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.arrays import Array
from drivers.kistler.calibration import (
    AMPLIFIER_SPAN_V,
    CHARGE_DRIFT_pC_PER_S,
    full_scale_N,
    per_channel,
    volts_of,
)
from drivers.kistler.settings import KistlerSettings

Force = Callable[[Array], Array]  # times s (n,) -> N (n, 3) on the robot, base frame

JUMP_pC = 2.0  # of the order that charge amplifiers show when they leave Reset
NOISE_V = 0.0005
HUM_V = 0.002
RESIDUAL_V = 0.001
DIGITS = 2**16
SATURATION_V = 1000.0  # a leak this far beyond the span shows as the span


@dataclass(frozen=True)
class _Epoch:
    """Between two turns of the Reset/Operate switch; arrays run over the channels."""

    start: float
    operate: bool
    origin_V: Array  # what the force at `start` would give: the charge that Reset took away
    offset_V: Array
    slope_V_per_s: Array


class ChargeChain:
    """Volts at the converter as a function of time; constant charge drift from Operate to Reset.

    Everything random comes from `seed`: drift and jump in the order of the switchings, noise in
    the order of the samples asked for. Not thread-safe.
    """

    def __init__(
        self, settings: KistlerSettings, force: Force, start: float, seed: int, crosstalk: float
    ) -> None:
        """`crosstalk`: part of every force component that the two others show, 0 to 1."""
        self._settings = settings
        self._force = force
        self._crosstalk = np.eye(3) + crosstalk * (np.ones((3, 3)) - np.eye(3))
        drift, noise = np.random.SeedSequence(seed).spawn(2)
        self._rng_drift = np.random.default_rng(drift)
        self._rng_noise = np.random.default_rng(noise)
        sensitivity = np.abs(per_channel(settings.sensitivity_pC_per_N, settings.channels))
        self._volt_per_pC = AMPLIFIER_SPAN_V / full_scale_N(settings) / sensitivity
        self._phase = self._rng_drift.uniform(0, 2 * np.pi, settings.channels)
        self._leaking: int | None = None
        self._epochs: list[_Epoch] = []
        self.switch(start, operate=True)

    def switch(self, when: float, *, operate: bool) -> None:
        """Turns the amplifier to Operate or Reset; again to the same state changes nothing."""
        if self._epochs and self._epochs[-1].operate == operate:
            return
        size = self._settings.channels
        if operate:
            offset = self._rng_drift.uniform(-JUMP_pC, JUMP_pC, size) * self._volt_per_pC
            charge = self._rng_drift.uniform(-1, 1, size) * CHARGE_DRIFT_pC_PER_S
            slope = charge * self._volt_per_pC
        else:
            offset = self._rng_drift.uniform(-RESIDUAL_V, RESIDUAL_V, size)
            slope = np.zeros(size)
        origin = self._force_volts(np.array([when]))[0]
        self._epochs.append(_Epoch(when, operate, origin, offset, slope))

    def leak(self, channel: int) -> None:
        """From now on `channel` (from 0) saturates whenever the amplifier operates."""
        self._leaking = channel

    @property
    def drift_N_per_s(self) -> Array:
        """True drift (channels,) of the present epoch, in N/s of the single channels."""
        scale: Array = full_scale_N(self._settings) / AMPLIFIER_SPAN_V
        return self._epochs[-1].slope_V_per_s * scale

    def volts(self, t: Array, low: float, high: float) -> Array:
        """Digitised volts (n, channels) at ascending times; the converter's range is low..high."""
        volts = self._amplifier(t)
        volts += self._rng_noise.normal(0, NOISE_V, volts.shape)
        volts += HUM_V * np.sin(2 * np.pi * 50 * t[:, None] + self._phase)
        digit = (high - low) / DIGITS
        clipped = np.clip(volts, -AMPLIFIER_SPAN_V, AMPLIFIER_SPAN_V)
        result: Array = np.clip(np.round(clipped / digit) * digit, low, high - digit)
        return result

    def _amplifier(self, t: Array) -> Array:
        """Noise-free output (n, channels)."""
        force = self._force_volts(t)
        volts = np.empty_like(force)
        starts = [epoch.start for epoch in self._epochs]
        which = np.maximum(np.searchsorted(starts, t, side="right") - 1, 0)
        for index in np.unique(which):
            epoch = self._epochs[index]
            here = which == index
            drift = epoch.slope_V_per_s * (t[here, None] - epoch.start)
            volts[here] = epoch.offset_V + drift
            if epoch.operate:
                volts[here] += force[here] - epoch.origin_V
                if self._leaking is not None:
                    volts[here, self._leaking] = SATURATION_V
        return volts

    def _force_volts(self, t: Array) -> Array:
        return volts_of(self._force(t) @ self._crosstalk.T, self._settings)
