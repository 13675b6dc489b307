"""Data sets of arms with chosen springs, measured by the simulated rig: a world that shares no code
with the identification, read through reduction and storage as any measurement is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.dataset import Dataset, write
from rig.measured_meta import measured_meta
from rig.protocol import MeasurementProtocol, parse_protocol
from rig.station import load_station
from rig.worlds.direct import sample_protocol
from rig.worlds.laws import Spring
from rig.worlds.linear import REFERENCE_Q_RAD
from rig.worlds.world import Design, World, joint_element

Array = NDArray[np.float64]
HOME = Path(__file__).parents[2]
REFERENCE_Q = np.array(REFERENCE_Q_RAD)
PAPER_C = np.array([37201.0, 56946, 18110, 7108, 7533, 8000])
OFFSET_MM = (80.0, 0.0, 100.0)  # beside axis 6, so that joint 6 is seen
AXES = ("x", "y", "z")
RICH_Q = np.deg2rad(
    [
        [13, -100, -108, -62, 90, -77],
        [40, -70, -90, -20, 60, 30],
        [-60, -120, -60, -100, -70, 100],
        [90, -45, -120, 60, 40, -140],
        [150, -90, 90, -30, 120, 10],
        [-120, -60, 100, -120, -45, 60],
    ]
)
_TAIL = """
repetitions: 3
branches: loading
order: by_run
sampling: {rate_Hz: 1, samples_per_step: 3}
hold_s: 0
force_band: {absolute_N: 0.5, relative: 0.01}
settle: {window_s: 4, force_slope_N_per_s: 0.05, force_spread_N: 0.3,
         displacement_slope_mm_per_s: 0.002, displacement_spread_mm: 0.01, deadline_s: 60,
         at_deadline: record}
step_deadline_s: 300
zero: {before_s: 6, after_s: 6}
rest_s: 10
rated_load_N: null
limits:
  force_N: {max: 240, at: stop}
  displacement_mm: {max: 9, at: stop}
  joint_deviation_deg: {max: 5, at: stop}
  joint_temperature_C: {max: 60, at: stop}
"""


def protocol(
    poses: Array,
    runs: list[tuple[int, str, float]],
    tcp_mm: tuple[float, float, float] = OFFSET_MM,
    encoder: str = "output",
    levels: int = 8,
) -> MeasurementProtocol:
    """Poses (n, 6) rad; runs: pose, axis, greatest force N, in evenly spaced levels."""
    text = "schema: rig.protocol/1\ntitle: emulated\nstation: emulated\nrobot: ur10e\nposes:\n"
    for i, q in enumerate(poses):
        angles = ", ".join(f"{v:.9f}" for v in q)
        text += f"  P{i}: {{q_rad: [{angles}], tcp_xyz_mm: {list(tcp_mm)}, program: null}}\n"
    text += f"move_arm: false\njoint_encoder: {encoder}\n"
    text += "directions: {x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1]}\nruns:\n"
    for pose, axis, force in runs:
        forces = ", ".join(f"{force * k / levels:.4g}" for k in range(1, levels + 1))
        text += f"  - {{pose: P{pose}, direction: {axis}, steps_N: [{forces}]}}\n"
    return parse_protocol(text + _TAIL, Path("emulated.yaml"))


def rich(force: float = 50.0, encoder: str = "motor") -> MeasurementProtocol:
    """Six poses, all axes; motor encoders do not see the deflection: the laser decides alone."""
    runs = [(p, axis, force) for p in range(len(RICH_Q)) for axis in AXES]
    return protocol(RICH_Q, runs, encoder=encoder)


def arm_world(stiffness: Array, seed: int) -> World:
    """Six springs (Nm/rad) that settle within seconds; gains of the instruments drawn by seed."""

    def elements() -> tuple[object, ...]:
        springs = [Spring(float(c), delayed=0.02, delay_s=1.0) for c in stiffness]
        return tuple(joint_element(j, spring) for j, spring in enumerate(springs))

    design = Design("springs", "springs", REFERENCE_Q_RAD, elements)  # type: ignore[arg-type]
    return World(design, seed)


def measure(
    measured: MeasurementProtocol,
    stiffness: Array,
    seed: int,
    path: Path | None = None,
    origin: str = "emulated",
    complete: bool = True,
) -> Dataset:
    """The data set of one session; written to `path` if given."""
    columns = dict(sample_protocol(arm_world(stiffness, seed), measured, seed))
    columns["discarded"] = np.zeros(len(columns["force_N"]), dtype=bool)
    meta = measured_meta(measured, load_station("emulated"))
    made = Dataset(
        path=path,
        uuid=f"00000000-0000-0000-0000-{seed:012d}",
        created="2026-03-01T10:00:00+01:00",
        origin=origin,  # type: ignore[arg-type]
        complete=complete,
        meta=meta,
        columns=columns,
        units={},
        long_names={},
        texts={"protocol": measured.text, "meta": meta.model_dump_json(exclude_none=True)},
        stop_reason="" if complete else "stopped by the operator",
    )
    if path is not None:
        write(made, path)
    return made
