"""Noise of the channels: measured within holds where there are enough samples, stated elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.data import GapData
from identification.gap.model.driven import steepness
from identification.gap.model.encoders import readings_of
from identification.gap.recording.digits import in_one_number, left_of, quantization_step
from identification.gap.recording.holds import (
    hold_ids,
    rest_ids,
    scatter_of_three,
    scatter_within,
    swing_within,
)
from identification.gap.recording.rows import Rows
from identification.gap.recording.white import LEAST_SAMPLES, white_noise

# The stated uncertainty of one sample includes what is common to a hold (vibration, linearity) and
# to a run (datum); a fifth and a third of it leave nine tenths for the single sample.
HOLD_SHARE = 0.2
RUN_SHARE = 0.33
# What is stated of a bench's instruments is known to a factor of two (GUM G.4.2: a type B estimate
# is worth few degrees of freedom): what is left below twice that is no structure.
UNSURE = 3**0.5  # of it, beyond it in quadrature
# Readings that scatter so many times more than stated are not explained by what was stated, nor
# such that swing by more than that at rest.
NOISY, SWINGS = 3.0, 1.0


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations of what is random in the channels. m joints."""

    response: Array  # (n,) m of a row, divided by the root of its weight already
    q: Array  # (m,) rad of a sample
    q_hold: Array  # (m, holds) rad: what the digits leave of a hold's mean
    force: float  # N of a sample
    hold: Array  # (n,) m common to a hold
    run: float  # m common to a run
    stated: float  # m of a sample of the response, as stated
    raised: float = 1.0  # times that readings scatter more than stated, at least 1
    sure: bool = True  # what is stated holds; else it is known to a factor UNSURE
    swings: float = 0.0  # how far an arm goes to and fro while nothing changes, in what is stated
    slow: float = 0.0  # share of what is stated that may differ from hold to hold
    # m of a sample, as a rig without an arm showed it; 0: every level was read once
    seen: float = 0.0
    q_run: float = 0.0  # rad common to a joint's readings in a run
    q_setup: float = 0.0  # rad common to a joint's readings in a setup

    @property
    def misjudged(self) -> bool:
        """Whether what was stated does not explain what the readings do while nothing changes."""
        known = 1.0 if self.sure else float(np.hypot(1.0, UNSURE))
        return self.raised > NOISY * known or self.swings > SWINGS


def estimate_noise(data: GapData, rows: Rows, slope: Array, imposed: bool) -> Noise:
    """Noise of the rows; slope (n,) m/N turns noise of the force into that of the response."""
    meter = data.instruments
    fallback = np.hypot(meter.displacement, slope * meter.force)
    hold = rest_ids(data, hold_ids(data))
    steep = slope if imposed or rows.continuous else np.maximum(slope, tangent(rows, meter.force))
    of_force = meter.force / np.sqrt(rows.hold_weight)
    step = 0.0 if rows.continuous else quantization_step(data, "force")
    if step > 0 and in_one_number(data.force, hold):
        means = rows.hold_means(rows.measured_force)
        of_force = np.maximum(of_force, left_of(means, rows.setup[rows.edges], step)[rows.hold])
    common = np.where(rows.steady, steep * of_force, 0.0)
    whites = _whites(data) if rows.continuous else (0.0, 0.0)
    if rows.continuous:
        per_sample, common = _running(data, rows, slope, imposed, whites), np.zeros(rows.n)
    elif imposed:  # the force answers
        answer = _scatter(data, data.force, hold) or meter.force
        per_sample = np.hypot(
            slope * max(answer, 0.33 * meter.force), np.where(rows.rests, 0.0, meter.displacement)
        )
        common = np.where(rows.rests, meter.displacement / np.sqrt(rows.hold_weight), 0.0)
    else:
        alone = np.where(rows.steady, meter.displacement, fallback)
        per_sample = _white(data, rows, alone, slope, hold)
    if not rows.continuous:
        moving = np.hypot(np.maximum(per_sample, fallback), _apart(rows))
        per_sample = np.where(rows.in_ramp, moving, per_sample)
    weight = np.ones(rows.n) if rows.continuous else rows.weight
    stated = meter.displacement
    if rows.continuous or imposed:
        stated = float(np.median(per_sample if rows.continuous else fallback))
    white = stated if rows.continuous else _scatter(data, data.displacement, hold) or 0.0
    raised = 1.0
    if rows.continuous:
        raised = _raised(data, whites)
    elif not imposed:
        less = data.displacement - float(np.median(slope)) * data.force
        follows = _scatter(data, less, hold)
        raised = max(1.0, min(white, follows or 0.0) / meter.displacement)
    rounded = 0.0 if rows.continuous or imposed else _rounded(data, hold)
    readings = readings_of(data, rows, hold)
    per_sample = np.maximum(per_sample, rounded)  # next to an edge, one is a whole step off
    return Noise(
        response=per_sample / np.sqrt(weight),
        q=readings.one,
        q_hold=readings.hold,
        q_run=readings.run,
        q_setup=readings.setup,
        force=meter.force,
        hold=np.hypot(max(HOLD_SHARE * stated, rounded), common),
        run=RUN_SHARE * stated,
        stated=stated,
        raised=raised,
        swings=_swings(data, rows, hold),
        slow=_slow(data, rows, float(np.median(slope)), hold),
        sure=data.arm or (rows.continuous and _shown(data, imposed, whites)),
        seen=0.0 if data.arm and not rows.continuous else min(white, stated),
    )


def _shown(data: GapData, imposed: bool, whites: tuple[float, float]) -> bool:
    """Whether a running recording leaves no room for noise beyond what is stated of what answers:
    where second differences show less than that, the rest is not white, and may be as wrong as
    anything stated."""
    (force, displacement), meter = whites, data.instruments
    white, stated = (force, meter.force) if imposed else (displacement, meter.displacement)
    return len(data.force) >= LEAST_SAMPLES and not 0 < white < _WHITE * stated


_WHITE = 0.85  # of what is stated: so closely a few hundred second differences tell


def _apart(rows: Rows) -> Array:
    """(n,) m that the arm moves while one channel was read and the other not yet: channels of their
    own clocks are together to a share of the time between two samples."""
    time, way = np.diff(rows.time), np.abs(np.diff(rows.displacement))
    speed = np.divide(way, time, out=np.zeros(len(way)), where=(time > 0) & ~rows.hold_starts[1:])
    either_side = np.maximum(np.append(speed, 0.0), np.append(0.0, speed))
    return np.asarray(_TOGETHER * rows.sample_time * either_side)


_TOGETHER = 0.02


_LITTLE = 2.0  # times what is stated: what scatters more was misjudged


def _rounded(data: GapData, hold: Ints) -> float:
    """What all readings of a hold are off by together (m) because the sensor rounds them, and
    scatters by less than its step: taking more of them tells no more (GUM F.2.2.1). No more than is
    stated of one; 0 where they scatter."""
    u = data.displacement
    if not in_one_number(u, hold):
        return 0.0
    steps = np.diff(np.unique(u))
    real = steps[steps > _SAME * float(np.ptp(u))]
    return min(float(real.min(initial=np.inf)) / 12**0.5, data.instruments.displacement)


_SAME = 1e-9  # of the range: digits that a conversion of units leaves


def _swings(data: GapData, rows: Rows, hold: Ints) -> float:
    """What an arm's displacement swings about its holds, over what is stated; 0 where it runs."""
    if rows.continuous or not data.arm:
        return 0.0
    return swing_within(data.displacement, hold) / data.instruments.displacement


def _slow(data: GapData, rows: Rows, slope: float, hold: Ints) -> float:
    """Share of what is stated by which an arm's readings may differ from hold to hold: by what is
    stated of both channels and their holds don't show. 0 where these can't tell."""
    meter, slow = data.instruments, []
    for values, stated in ((data.displacement, meter.displacement), (data.force, meter.force)):
        white = scatter_within(values, hold)
        if rows.continuous or not data.arm or white is None:
            return 0.0
        slow.append(max(stated**2 - white**2, 0.0) ** 0.5)
    return min(float(np.hypot(slow[0], slope * slow[1])) / meter.displacement, 1.0)


def _raised(data: GapData, whites: tuple[float, float]) -> float:
    """The larger ratio of what a channel scatters to what is stated of it, at least 1."""
    force, displacement = whites
    return max(1.0, force / data.instruments.force, displacement / data.instruments.displacement)


def _whites(data: GapData) -> tuple[float, float]:
    """Noise of one sample of force (N) and displacement (m) in a running recording."""
    force, displacement = data.force, data.displacement
    return white_noise(force, displacement), white_noise(displacement, force)


def _running(
    data: GapData, rows: Rows, slope: Array, imposed: bool, whites: tuple[float, float]
) -> Array:
    """Noise of one sample's response (n,) in a running recording, m: that of what answers, and
    that of what is driven times how steeply the answer follows it there. On a plateau of friction,
    or of a metal that flows, a displacement that is driven adds nothing."""
    meter = data.instruments
    force, displacement = whites
    force, displacement = max(meter.force, force), max(meter.displacement, displacement)
    if imposed:
        stiff = steepness(rows, rows.displacement, rows.measured_force, displacement, 1 / slope)
        return np.asarray(slope * np.hypot(force, stiff * displacement))
    soft = steepness(rows, rows.measured_force, rows.displacement, force, slope)
    return np.hypot(displacement, soft * force)


def tangent(rows: Rows, force_sd: float) -> Array:
    """(n,) m/N: how steep the measured curve is at a row's hold, the steeper side counting.

    Where a joint yields, the force hardly rises while the displacement runs: there an error of the
    force, multiplied by this slope, is an error of the displacement. Steps of force below three
    standard deviations count as that much.
    """
    f, u = rows.hold_means(rows.measured_force), rows.hold_means(rows.displacement)
    run = rows.run[rows.edges]
    least = 3 * force_sd
    step = np.abs(np.diff(u)) / np.maximum(np.abs(np.diff(f)), least)
    step[(run[1:] != run[:-1]) | (np.abs(np.diff(f)) < least)] = 0.0
    sides = np.concatenate([[0.0], step]), np.concatenate([step, [0.0]])
    return np.asarray(np.maximum(*sides)[rows.hold])


def _scatter(data: GapData, values: Array, hold: Ints) -> float | None:
    """What values (n,) scatter in holds, which the force tells how they were come to. Of an arm,
    whose instruments are known, by holds that are long enough."""
    found = scatter_within(values, hold, data.force)
    return scatter_of_three(values, hold) if found is None and not data.arm else found


def _white(data: GapData, rows: Rows, alone: Array, slope: Array, hold: Ints) -> Array:
    """Noise of one sample in every row (n,): measured where holds are long enough, else `alone`."""
    if float(rows.weight @ rows.steady) < 0.5 * float(rows.weight.sum()):
        less = data.displacement - float(np.median(slope)) * data.force
        measured = _scatter(data, less, hold)
        least = 0.0 if data.arm else 0.33 * data.instruments.displacement
        return alone if measured is None else np.full(rows.n, max(measured, least))
    measured = _scatter(data, data.displacement, hold)
    if measured is None and data.arm:  # short holds tell of a little more than is stated
        stated, three = data.instruments.displacement, scatter_of_three(data.displacement, hold)
        measured = three if three and stated < three < _LITTLE * stated else None
    if measured is None:
        return alone
    # never less than a third of what is stated: second differences can't see everything
    white = max(measured, 0.33 * data.instruments.displacement)
    return np.where(rows.steady, white, np.hypot(white, slope * data.instruments.force))
