"""Results with numbers of our own, to see how they are shown: nothing here is computed, so that
the text is the same on every machine."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from drivers.errors import CannotConnect
from identification.gap.answer.discriminate import NextMeasurement, Option
from identification.gap.answer.locate import Where
from identification.gap.answer.notes import ASIDE, UNDECIDED, Note
from identification.gap.answer.result import EffectFound, GapResult
from identification.gap.explanations.explanation import GapPattern
from identification.gap.judging.heldout import HeldOut
from identification.gap.laws.interval import Parameter
from identification.joints import JointFit, Observation, Prior
from identification.maps import Need, Placement, Stance, Task
from identification.next_poses import Proposal
from identification.when import Schedule
from identification.workspace import Workspace
from rig.analysis.identify import IdentifyResult
from rig.check import Check, DeviceState
from rig.coupling.couple import CouplingResult, Decision
from rig.coupling.coupling_task import TaskResult
from rig.diagnosis.diagnose import Diagnosis
from rig.models.model import ArmModel, CouplingSpec, Requirement
from rig.models.robot import load_robot
from rig.models.simulate import CurvePath, PredictedCurve, Simulation
from rig.plan import Plan, PlannedRun

EMULATED = "EMULATED: these values come from simulated devices; nothing was measured."
NOWHERE: Any = None  # what the text does not look at
Q = np.array([0.2344, -1.7425, -1.8867, -1.0832, 1.5708, -1.3364])
X, Y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


def identified() -> IdentifyResult:
    """Joints that are known, partly seen, bounded and not seen at all."""
    prior = Prior(
        np.array([37e3, 57e3, 18e3, 7.1e3, 7.5e3, 8e3]), np.full(6, 0.1), "data/models/ur10e.yaml"
    )
    fit = JointFit(
        stiffness=np.array([37201.0, 56946.0, 18110.0, 7108.0, 7533.0, 8000.0]),
        covariance=np.diag(np.array([0.004, 0.021, 0.062, 0.093, 0.0995, 0.1]) ** 2),
        data_share=np.array([0.998, 0.956, 0.615, 0.135, 0.01, -1e-9]),
        lower_bound=np.array([36904.0, 54600.0, 15800.0, 2100.0, 310.0, 0.0]),
        rank=5,
        null_space=np.eye(6)[:, 5:],
        condition_number=184.3,
        identified=np.array([True, True, False, False, False, False]),
        residuals=np.zeros(4),
        chi2=3.2,
        dof=4.0,
        birge=1.0,
        prior=prior,
        conflict=None,
    )
    proposals = (
        Proposal(Q, X, "x", 95.4, np.full(6, 0.05), "tells joint 4 (9.3 % to 3.1 %)"),
        Proposal(-Q, Y, "y", 118.0, np.full(6, 0.04), "tells joint 6 (10 % to 4.4 %)"),
    )
    seen = Observation(q=Q, direction=X, tool=None, compliance=1.04e-5, u_compliance=5e-8)
    return IdentifyResult(
        datasets=("a.h5", "b.h5"),
        arm=load_robot("ur10e"),
        fit=fit,
        observations=(seen, replace(seen, direction=Y)),
        proposals=proposals,
        tool_xyz=(0.0, 0.0, 0.0),
        doubts=(),
        notes=("a.h5: pose P1, direction y: 2 steps do not count towards k.",),
        banners=(EMULATED,),
    )


def _gap(verdict: str, p: float, **more: Any) -> GapResult:
    known: dict[str, Any] = {
        "effects": (),
        "where": Where((), (), {}, (), (), (), None, 0.0),
        "noise": 2.02e-6,
        "before": 2.11e-6,
        "after": 2.05e-6,
        "held_out": (),
        "runners_up": {},
        "next_measurement": None,
        "remainder": 0.0,
        "looks_like": None,
        "said": (),
        **more,
    }
    probabilities = {verdict: p, "base_slip": 0.9961 - p, "zero_shift": 0.0039}
    unseen = dict.fromkeys(("engine", "fit", "found"), NOWHERE)
    noise = SimpleNamespace(misjudged=False)
    arm: Any = SimpleNamespace(
        data=SimpleNamespace(arm=True, curves=None), still=False, noise=noise, imposed=False
    )
    return GapResult(verdict=verdict, probabilities=probabilities, bench=arm, **known, **unseen)


def explained() -> Diagnosis:
    """Two effects, one of which another word explains as well."""
    yields = EffectFound(
        "joint_yield",
        "joint 1",
        0.994,
        {
            "threshold_Nm": Parameter(67.31, 66.82, 67.9, "Nm"),
            "stiffness_ratio_above": Parameter(0.0213, 0.0185, 0.0241, "1"),
        },
        {"joint 1": 0.62, "joint 5": 0.38},
        ("base_slip",),
        0.93,
        1.2e-4,
    )
    drifts = EffectFound(
        "force_drift",
        "",
        0.871,
        {"rate": Parameter(-0.002, -0.0031, -0.0009, "N/s")},
        {},
        (),
        0.05,
        4e-6,
    )
    options = (
        Option("poses", "the same in another pose", 12.4, 31.0),
        Option("cycles", "small cycles", 4.1, 12.0),
        Option("slow", "the same, slower", 0.3, 60.0),
    )
    result = _gap(
        "joint_yield",
        0.962,
        effects=(yields, drifts),
        where=Where(
            ("y",),
            ("P1",),
            {"y": (74.8, 82.0)},
            ("loading", "unloading"),
            (1, 2, 3),
            (1,),
            True,
            0.93,
        ),
        before=1.3417e-4,
        after=4.62e-6,
        held_out=(
            HeldOut("repetition", 1.342e-4, 5.71e-6, (18.2, 27.9)),
            HeldOut("direction", 1.342e-4, 3.2e-5, (3.3, 5.2)),
        ),
        runners_up={"base_slip": 2.04e-5},
        next_measurement=NextMeasurement(
            "Measure y in pose P2, loading and unloading.",
            ("joint_yield", "base_slip"),
            "poses",
            12.4,
            31.0,
            options,
        ),
        said=(
            Note(ASIDE, "3 of 240 readings jump off and come back at once: set aside."),
            Note(UNDECIDED, "Nothing was unloaded: lasting and elastic deflection look alike."),
        ),
    )
    return Diagnosis("id", result, (EMULATED,), ({"name": "contact_seating"},))


def without_gap() -> Diagnosis:
    """Nothing beyond what was stated as uncertain."""
    return Diagnosis("id", _gap("none", 0.987))


def without_arm(found: Diagnosis) -> Diagnosis:
    """The same of a rig without an arm."""
    data = SimpleNamespace(arm=False, curves=None)
    bench: Any = SimpleNamespace(data=data, still=False, imposed=False)
    return replace(found, result=replace(found.result, bench=bench))


def unexplained() -> Diagnosis:
    """A gap that no word explains."""
    where = Where(
        ("x", "y"), (), {"x": (-20.0, 40.0), "y": (0.0, 1234.5)}, ("loading",), (2,), (), False, 0.4
    )
    swings = GapPattern("swings", 121.4, -80.0)
    return Diagnosis(
        "id",
        _gap(
            "unknown",
            0.731,
            where=where,
            remainder=3.417e-5,
            before=8e-5,
            after=2.75e-5,
            looks_like=swings,
        ),
    )


SPEC = CouplingSpec(1.5, np.deg2rad(36.5), "mirror", "compliant", None, "beam, steel, 30 mm")


def _model() -> ArmModel:
    needs = (Requirement("x", (1.0, 0.0, 0.0), 150e3), Requirement("y", (0.0, 1.0, 0.0), 90e3))
    return ArmModel("F2.yaml", load_robot("ur10e"), Q, np.eye(4), (), None, (), SPEC, needs, 1.3)


def coupled() -> CouplingResult:
    """The published pair, so that the published numbers stand beside."""
    time = np.array([0.0, 1.0, 2.5, 4.0])
    return CouplingResult(
        model=_model(),
        spec=SPEC,
        workspaces=(
            Workspace(3.4312, 1.0567, "sampled joint positions, cells of 40 mm"),
            Workspace(4.6014, 1.8034, "half balls of the nominal reach"),
        ),
        single=np.array([95.94e3, 57.42e3, 301.2e3]),
        u_single=np.array([3.1e3, 2.04e3, 14.7e3]),
        pair={
            "rigid": np.array([212.3e3, 2950.4e3, 640.0e3]),
            "compliant": np.array([190.1e3, 410.7e3, 512.6e3]),
        },
        u_pair={
            "rigid": np.array([9.0e3, 141.2e3, 30.1e3]),
            "compliant": np.array([8.1e3, 22.0e3, 25.5e3]),
        },
        decisions=(
            Decision("x", 150e3, 95.94e3, 212.3e3, "couple"),
            Decision("y", 5e6, 57.42e3, 2950.4e3, "infeasible"),
        ),
        schedule=Schedule(time, time, time, time, ("single", "couple", "couple", "couple")),
        notes=("the beam's own weight is left out.",),
    )


def placed() -> TaskResult:
    """Where the second arm would stand best."""
    grid = np.array([1.5])
    best = Placement(
        1.62,
        np.deg2rad(41.0),
        Q,
        "shoulder left, elbow up, wrist 1",
        np.array([231e3, 97.2e3]),
        1.08,
        grid,
        grid,
        np.ones((1, 1)),
    )
    task = Task(0.5, Stance(X, np.eye(4)), (Need(X, 150e3), Need(Y, 90e3)))
    return TaskResult(_model(), SPEC, task, best, 0.97, ("found on a grid of 25 mm and 2 deg.",))


def predicted() -> Simulation:
    """One curve of springs, one with effects along its path, one that does not give way."""
    levels = PredictedCurve(
        "P1",
        "x",
        np.array([0.0, 60.0, 220.0]),
        np.array([0.0, 6.2539e-4, 2.29309e-3]),
        95940.0,
        0.0312,
    )
    path = CurvePath(
        repetition=(1, 1, 1, 2, 3, 3),
        branch=("zero", "loading", "unloading", "loading", "loading", "unloading"),
        step=(0, 1, 1, 1, 1, 1),
        session=np.array([0.0, 20.0, 41.0, 120.0, 220.0, 241.0]),
        springs=np.array([0.0, 1.3062e-3, 1.3062e-3, 1.3062e-3, 1.3062e-3, 1.3062e-3]),
    )
    force = np.array([0.0, 75.0, 75.0, 75.0, 75.0, 75.0])
    moved = np.array([0.0, 1.4e-3, 1.55e-3, 1.61e-3, 1.63e-3, 1.7e-3])
    bent = PredictedCurve("P2", "y", force, moved, 57420.0, 0.0355, path)
    stiff = PredictedCurve("P2", "z", np.array([0.0, 10.0]), np.zeros(2), np.inf, 0.0)
    return Simulation(
        "F1.yaml",
        "paper_xy.yaml",
        "Published procedure",
        (levels, bent, stiff),
        ("links are stiff.",),
        ("joint_yield",),
    )


def checked() -> Check:
    """Two devices that are ready, one that is not."""
    run = PlannedRun(
        "P1",
        "x",
        (1.0, 0.0, 0.0),
        (20.0, 40.0),
        2,
        95.9,
        0.417,
        (1.0,) * 6,
        (2.0, 40.0, 20.0, 3.0, 1.0, 0.1),
        (330.0, 330.0, 150.0, 56.0, 56.0, 56.0),
        211.0,
    )
    asked = Plan(
        "Two levels",
        "ur10e",
        "ur10e_lab",
        (run,),
        3,
        1,
        39,
        933.0,
        1.0,
        0.1,
        ("5 min to set up a pose or direction (1 time)",),
        ("joint 4 holds 0.95 of what is allowed.",),
    )
    refused = CannotConnect(
        "laser",
        "nothing answers on /dev/ttyUSB0 within 5 s",
        "Plug the converter in and switch the laser on",
    )
    states = (
        DeviceState("robot", {"model": "UR10e", "serial_number": "20195500001"}),
        DeviceState("dynamometer", {"model": "9257B", "serial_number": "1234567"}),
        DeviceState("laser", {}, refused),
    )
    return Check(asked, "ur10e_lab", False, states)
