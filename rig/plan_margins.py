"""How far a plan stays from what joints, laser, dynamometer and the protocol's own limits allow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from identification.arm import Arm
from rig.protocol import MeasurementProtocol
from rig.station import Station
from rig.yaml.yamlnodes import Key

if TYPE_CHECKING:
    from rig.plan import PlannedRun

# A margin smaller than this share of what is allowed is worth a warning.
MARGIN = 0.2
# A charge amplifier's drift is taken as a straight line; longer than this it is none.
QUASI_STATIC_S = 1000.0


def shares(
    protocol: MeasurementProtocol, run: PlannedRun, arm: Arm, station: Station | None
) -> Iterator[tuple[float, float, str, str]]:
    """(share of what is allowed, share from which on it is refused, in words, what to do then)."""
    for i in range(6):
        hold, limit = abs(run.hold_torque_Nm[i]), run.torque_limit_Nm[i]
        what = f"joint {i + 1} holds {hold:.0f} Nm at {run.forces_N[-1]:g} N, allowed {limit:g} Nm"
        yield hold / limit, 1.0, what, "Lower the top force, or choose a pose with a shorter lever."
    yield from _displacement_shares(protocol, run, arm, station)
    for axis, part, allowed in _full_scales(run, station):
        force = part * run.forces_N[-1]
        what = f"the dynamometer's {axis} carries {force:.4g} N, full scale {allowed:g} N"
        yield force / allowed, 1.0, what, "Set a larger range at the amplifier and in the station."


def _full_scales(run: PlannedRun, station: Station | None) -> Iterator[tuple[str, float, float]]:
    """Axis of the dynamometer, the share of a run's force that it carries, its full scale N."""
    if station is None or station.dynamometer is None:
        return
    sensor = station.dynamometer
    for axis, row in zip("xyz", sensor.axes_in_base, strict=True):
        # Eight channels: two carry a shear force, four the normal one.
        channels = (4 if axis == "z" else 2) if sensor.channels == 8 else 1
        part = abs(float(np.dot(row, run.unit_vector)))
        yield axis, part, getattr(sensor.full_scale_N, axis) * channels


def limit_warnings(
    protocol: MeasurementProtocol, run: PlannedRun, station: Station | None
) -> Iterator[str]:
    """A limit that no reading can reach."""
    force = protocol.limits.force_N
    reach = min(
        (allowed / part for _, part, allowed in _full_scales(run, station) if part > 0),
        default=np.inf,
    )
    if force is not None and force.max > reach:
        yield (
            f"{name_of(run)}: limits.force_N.max is {force.max:g} N, but the dynamometer's full "
            f"scale ends at {reach:.4g} N: no reading reaches the limit. Set it below."
        )


def soft_warnings(
    protocol: MeasurementProtocol, number: int, run: PlannedRun, arm: Arm, station: Station | None
) -> Iterator[str]:
    """What an arm that is softer than nominal, by the stated standard deviation, would not keep;
    number: of the run in the protocol. Nothing where the nominal arm is warned of already."""
    sd = float(np.max(arm.joint_stiffness_relative_sd))
    stop = protocol.runs[number].stop_at_displacement_mm
    soft = run.forces_N[-1] / run.stiffness_N_per_mm * (1 + sd)
    soft = soft if stop is None else min(soft, stop)
    for name, allowed in _displacement_limits(protocol, station):
        if run.displacement_mm <= (1 - MARGIN) * allowed and soft > allowed:
            yield (
                f"{name_of(run)}: {run.displacement_mm:.3g} mm +- {100 * sd:.0f} % expected at "
                f"{run.forces_N[-1]:g} N, so it may be {soft:.3g} mm; {name} is {allowed:g} mm. "
                "Lower the top force, or give stop_at_displacement_mm."
            )


def _displacement_shares(
    protocol: MeasurementProtocol, run: PlannedRun, arm: Arm, station: Station | None
) -> Iterator[tuple[float, float, str, str]]:
    u = run.displacement_mm
    stiffer = 1 + 2 * float(np.max(arm.joint_stiffness_relative_sd))
    for name, allowed in _displacement_limits(protocol, station):
        what = f"about {u:.2g} mm expected at {run.forces_N[-1]:g} N, {name} is {allowed:g} mm"
        # Nominal springs are uncertain: only what even a much stiffer arm exceeds is an error.
        yield u / allowed, stiffer, what, "Lower the top force, or give stop_at_displacement_mm."


def _displacement_limits(
    protocol: MeasurementProtocol, station: Station | None
) -> Iterator[tuple[str, float]]:
    if station is not None and station.laser is not None:
        yield "the laser's range", station.laser.range_mm
    if protocol.limits.displacement_mm is not None:
        yield "limits.displacement_mm.max", protocol.limits.displacement_mm.max


def beyond_joints(protocol: MeasurementProtocol, arm: Arm) -> Iterator[tuple[Key, str]]:
    """Place in the protocol and what is wrong there: poses that the joints cannot take."""
    for name, pose in protocol.poses.items():
        q, low, high = (np.rad2deg(v) for v in (pose.q_rad, arm.q_min, arm.q_max))
        for i in np.flatnonzero((q < low - 1e-6) | (q > high + 1e-6)):
            allowed = f"allowed: {low[i]:g} to {high[i]:g} deg"
            yield ("poses", name), f"joint {i + 1} at {q[i]:.2f} deg; {allowed}."


def unit_warnings(protocol: MeasurementProtocol) -> Iterator[str]:
    """Poses whose angles may have been meant otherwise."""
    for name, pose in protocol.poses.items():
        if doubt := may_be_radians(np.rad2deg(pose.q_rad).tolist()):
            yield f"pose {name}: {doubt}"


def may_be_radians(q_deg: Sequence[float]) -> str:
    """Of joint positions in deg; "" where there is no doubt. Radians in their place put the arm
    near its zero, stretched out, where nobody measures."""
    most = max(map(abs, q_deg), default=0.0)
    if not 0 < most <= 2 * np.pi:
        return ""
    return (
        f"all joints within {most:.2f} deg of zero, the arm stretched out. "
        "If these are radians, write q_rad."
    )


def time_warnings(protocol: MeasurementProtocol, runs: Sequence[PlannedRun]) -> Iterator[str]:
    """What takes longer than an amplifier stays quiet, and limits that do not stop it."""
    for run in runs:
        if run.duration_s > QUASI_STATIC_S:
            yield (
                f"{name_of(run)}: {run.duration_s:.0f} s between two resets of the charge "
                f"amplifier; its drift stays a straight line for about {QUASI_STATIC_S:g} s. "
                "Fewer steps or shorter holds."
            )
    unwatched = [
        key
        for key in ("force_N", "displacement_mm")
        if (limit := getattr(protocol.limits, key)) is None or limit.at != "stop"
    ]
    for key in unwatched:
        yield f"limits.{key} does not stop the measurement."


def name_of(run: PlannedRun) -> str:
    """For messages."""
    return f"pose {run.pose}, direction {run.direction}"
