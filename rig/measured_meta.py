"""META of a data set that `rig measure` takes: what protocol and station say, in one place."""

from __future__ import annotations

from rig.meta import (
    DisplacementInstrument,
    ForceInstrument,
    Instruments,
    Meta,
    MetaPose,
    Simulation,
)
from rig.models.robot import load_robot
from rig.protocol import MeasurementProtocol
from rig.station import Station, incomplete


def measured_meta(protocol: MeasurementProtocol, station: Station) -> Meta:
    """The simulation is the arm's model file: what was believed before this measurement."""
    if station.dynamometer is None or station.laser is None:
        raise incomplete(station)
    arm = load_robot(protocol.robot)
    force, laser = station.dynamometer, station.laser
    c1, c2, c3, c4, c5, c6 = (float(k) for k in arm.joint_stiffness)
    return Meta(
        robot=protocol.robot,
        poses={
            name: MetaPose(q_rad=p.q_rad, tcp_xyz_mm=p.tcp_xyz_mm)
            for name, p in protocol.poses.items()
        },
        directions=dict(protocol.directions),
        joint_encoder=protocol.joint_encoder,
        datum="setup",
        imposed=None,
        tare="run",
        instruments=Instruments(
            force=ForceInstrument(
                standard_uncertainty_N=force.standard_uncertainty_N,
                gain_relative_sd=force.gain_relative_sd,
            ),
            displacement=DisplacementInstrument(
                standard_uncertainty_mm=laser.standard_uncertainty_mm,
                gain_relative_sd=laser.gain_relative_sd,
            ),
        ),
        simulation=Simulation(
            joint_stiffness_Nm_per_rad=(c1, c2, c3, c4, c5, c6),
            joint_stiffness_relative_sd=float(max(arm.joint_stiffness_relative_sd)),
        ),
    )
