"""What a model with effects predicts along the path of a procedure: loads, holds, rests, poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.arrays import Array, Ints
from identification.gap.answer.forms import Form, realise, where_it_acts
from identification.gap.data import BRANCH_NAMES, GapData, Instruments, Setup
from identification.gap.effects import EFFECTS
from identification.gap.laws.law import along, in_pose
from identification.gap.model.bench import Bench, make_bench
from identification.times import MOUNT_S, SCREW_S, UNLOAD_S
from rig.diagnosis.gap_data import arm_setup
from rig.models.model import ArmModel
from rig.plan import AMPLIFIER_S, TARE_S
from rig.protocol import MeasurementProtocol, Run
from rig.units import MM_PER_M

# Act on what the instruments see of everything else: realised last.
_LAST = ("displacement_scale", "time_lag")
_LEAST_GAIN = 0.05  # true over shown
_HALVINGS = 60  # to the last digit
# Samples of instruments that nothing here depends on: a prediction has no noise.
_ANY = Instruments(0.1, 2e-6, 0.005, 0.003)


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """n holds in the order of measurement: setup (n,) index of the run, repetition, branch, step;
    force N, session s (n,); displacement (n,) m with the effects, `springs` (n,) m without; mean of
    the hold, from the first value of its pose and direction on."""

    setup: Ints
    repetition: Ints
    branch: tuple[str, ...]
    step: Ints
    session: Array
    force: Array
    springs: Array
    displacement: Array


def predict(
    model: ArmModel, forms: Sequence[Form], procedure: MeasurementProtocol, compliance: Array
) -> tuple[PlannedPath, tuple[str, ...]]:
    """The path with its predicted displacements, and where a law is stretched. forms: what lasts
    of each; compliance (runs,) m/N: of the model's springs, links and mounting along each run's
    direction."""
    data = planned_data(model, procedure)
    bench = make_bench(replace(data, displacement=data.force * compliance[data.setup]))
    moved = bench.rows.displacement.copy()
    for f in forms:
        if f.word not in _LAST:
            moved += realise(bench, f, forms)[: bench.rows.n]
    gains = [f for f in forms if f.word == "displacement_scale"]
    if gains:
        moved = _shown(bench, gains, moved)
    seen = replace(bench, response=moved)
    for f in forms:
        if f.word == "time_lag":
            moved = moved + realise(seen, f)[: bench.rows.n]
    return _by_hold(bench, moved), _beyond(bench, forms)


def _shown(bench: Bench, gains: Sequence[Form], true: Array) -> Array:
    """(n,) m: what the laser shows of a motion `true` (n,) m. A gain is fitted as what of the
    reading is too much, in proportion to it, to its square, or to what lies above a range:
    shown = true + excess(shown), row by row; found by bisection, since excess may grow anyhow."""
    low, high = np.zeros(len(true)), true / _LEAST_GAIN
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        seen = replace(bench, moves=middle)
        excess = sum(realise(seen, f)[: bench.rows.n] for f in gains)
        beyond = np.sign(true) * (middle - excess) > np.abs(true)
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    return (low + high) / 2


def _by_hold(bench: Bench, moved: Array) -> PlannedPath:
    rows = bench.rows
    edges = np.flatnonzero(rows.hold_starts)

    def mean(values: Array) -> Array:
        total = np.add.reduceat(rows.weight, edges)
        return np.asarray(np.add.reduceat(values * rows.weight, edges) / total)

    datum = np.array([moved[int(np.argmax(rows.setup == s))] for s in np.unique(rows.setup)])
    return PlannedPath(
        setup=rows.setup[edges],
        repetition=rows.repetition[edges],
        branch=tuple(BRANCH_NAMES[b] for b in rows.branch[edges]),
        step=rows.step[edges],
        session=mean(rows.session),
        force=mean(rows.force),
        springs=mean(rows.displacement),
        displacement=mean(moved - datum[rows.setup]),
    )


def planned_data(model: ArmModel, procedure: MeasurementProtocol) -> GapData:
    """The samples that the procedure will take, without displacement: as `rig.plan` times them
    (turning, settling, holds, plateaus, rests, mounting), each force exactly its target."""
    walk = _Walk(procedure)
    setup, repetition, branch, step, force, time, session = (np.array(c) for c in walk.columns())
    whole = np.int64
    new = np.append(True, (np.diff(setup) != 0) | (np.diff(repetition) != 0))
    poses = procedure.poses
    setups = tuple(
        arm_setup(
            model.arm,
            run.pose,
            np.array(poses[run.pose].q_rad),
            np.array(poses[run.pose].tcp_xyz_mm) / MM_PER_M,
            run.direction,
            np.array(procedure.directions[run.direction]),
            model,
        )
        for run in procedure.runs
    )
    return GapData(
        arm=True,
        setups=setups,
        time=time,
        session=session,
        run=np.cumsum(new).astype(whole) - 1,
        setup=setup.astype(whole),
        repetition=repetition.astype(whole),
        branch=branch.astype(whole),
        step=step.astype(whole),
        force=force.astype(float),
        displacement=np.zeros(len(force)),
        compliance=1 / model.arm.joint_stiffness,
        compliance_relative_sd=model.arm.joint_stiffness_relative_sd,
        instruments=_ANY,
        output_encoder=procedure.joint_encoder == "output",
        tare="run",
        imposed="force",
    )


class _Walk:
    """One walk through a procedure on the clock of its plan."""

    def __init__(self, procedure: MeasurementProtocol) -> None:
        self._procedure = procedure
        self._now = self._start = 0.0
        self._rows: list[tuple[float, ...]] = []

    def columns(self) -> list[tuple[float, ...]]:
        """Setup, repetition, branch, step, force, time, session of every sample."""
        before: tuple[str, str] | None = None
        for index, run, repetition in self._procedure.sequence():
            if before is not None and before != (run.pose, run.direction):
                self._now += MOUNT_S
            before = (run.pose, run.direction)
            self._repetition(index, run, repetition)
        return list(zip(*self._rows, strict=True))

    def _repetition(self, index: int, run: Run, repetition: int) -> None:
        procedure = self._procedure
        sampling = procedure.sampling
        count = procedure.samples_of_step
        self._now += AMPLIFIER_S + TARE_S
        self._start = self._now
        place = (float(index), float(repetition))
        self._hold((*place, 0.0, 0.0, 0.0), round(procedure.zero.before_s * sampling.rate_Hz))
        for step in procedure.steps(run):
            self._now += SCREW_S + procedure.settle.window_s
            branch = float(BRANCH_NAMES.index(step.branch))
            self._hold((*place, branch, float(step.number), step.target_N), count)
        self._now += UNLOAD_S
        self._hold((*place, 0.0, 0.0, 0.0), round(procedure.zero.after_s * sampling.rate_Hz))
        self._now += procedure.rest_s

    def _hold(self, row: tuple[float, ...], samples: int) -> None:
        for _ in range(samples):
            self._now += 1 / self._procedure.sampling.rate_Hz
            self._rows.append((*row, self._now - self._start, self._now))


# --- what a prediction leaves out ----------------------------------------------------------------

_CHANCE = {
    "place": "where the joint lies in its play while unloaded",
    "rest": "where it lies in its play when it is sent to a pose",
    "as_read": "the force across as it was read",
}
_OF_RUNS = "what single runs had to themselves"
_OF_SESSIONS = {
    "zero_shift": "jumps of the datum",
    "force_drift": "how the amplifier drifted",
    "thermal_drift": "how it drifted with time and temperature",
}


def left_out(forms: Sequence[Form]) -> tuple[str, ...]:
    """What of these is no prediction, because it was the measured session's: a line each."""
    out = []
    for f in forms:
        laws = EFFECTS[f.word].laws
        if not laws.lasts:
            whats = [_OF_SESSIONS[f.word]]
        else:
            chance = [t.coefficient for t in f.law.terms if t.coefficient in laws.of_session]
            whats = [_CHANCE[coefficient] for coefficient in chance]
            whats += [_OF_RUNS for t in f.law.terms if "run" in t.shape]
        out += [f"{f.word}: {w} belongs to the measured session; left out." for w in whats]
    return tuple(dict.fromkeys(out))


def _beyond(bench: Bench, forms: Sequence[Form]) -> tuple[str, ...]:
    """Where laws are stretched beyond what was seen of them."""
    out = []
    for f in forms:
        seen = f.law.constants.get("measured_to")
        if seen is not None:
            there = where_it_acts(bench, f.law, forms)
            top = float(np.abs(there.torque[:, f.law.constants["joint"]]).max())
            if top > 1.02 * seen:
                out.append(
                    f"{f.word}: seen to {seen:.4g} Nm at joint {f.law.constants['joint'] + 1}, "
                    f"here up to {top:.4g} Nm; the curve goes on as it ended."
                )
        where = {(t.shape["along"], t.shape.get("pose")) for t in f.law.terms if "along" in t.shape}
        if where:
            one_sense = f.word == "load_misalignment"
            sides = [along(bench, v) for v, _ in where]
            known = np.any(
                [
                    ((s > 0) if one_sense else (s != 0)) & in_pose(bench, pose)
                    for s, (_, pose) in zip(sides, where, strict=True)
                ],
                axis=0,
            )
            by_pose = any(pose is not None for _, pose in where)
            blind = sorted(
                {_called(bench.data.setups[s], by_pose) for s in bench.rows.setup[~known]}
            )
            if blind:
                out.append(f"{f.word}: not measured along {', '.join(blind)}; left out there.")
    return tuple(out)


def _called(setup: Setup, by_pose: bool) -> str:
    return f"{setup.direction} in {setup.pose}" if by_pose else setup.direction
