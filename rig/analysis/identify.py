"""`rig identify`: the six joint stiffnesses that data sets tell of, and what they do not tell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from identification.arm import JOINTS, Arm, tool_offset
from identification.joints import Gains, JointFit, Observation, Prior
from identification.joints import identify as estimate
from identification.next_poses import Criterion, Plan, Proposal, propose
from identification.slips import slip
from rig import schemas
from rig.analysis.joint_observations import observations_of
from rig.contradictions import refuse_contradictions
from rig.dataset import Dataset, load_each
from rig.errors import InputError
from rig.models.model import load_model
from rig.models.robot import load_robot
from rig.protocol_before import limits_before
from rig.protocolfile import Limits
from rig.storage.files import legible
from rig.units import MM_PER_M


@dataclass(frozen=True, eq=False)
class IdentifyResult:
    """Fit, the observations behind it, and the proposed next poses with their load. doubts: what
    makes the fit doubtful; limits: what was watched in the data sets."""

    datasets: tuple[str, ...]
    arm: Arm
    fit: JointFit
    observations: tuple[Observation, ...]
    proposals: tuple[Proposal, ...]
    tool_xyz: tuple[float, float, float]
    doubts: tuple[str, ...]
    notes: tuple[str, ...]
    banners: tuple[str, ...] = ()
    made_from: str = ""
    limits: Limits = field(default_factory=Limits)

    @property
    def emulated(self) -> bool:
        """Whether any of the data came from simulated devices."""
        return any(banner.startswith("EMULATED") for banner in self.banners)

    def to_json(self) -> dict[str, Any]:
        """`rig.joints/1`, with further keys."""
        fit, ci = self.fit, self.fit.ci95
        return {
            "schema": schemas.JOINTS,
            "datasets": list(self.datasets),
            "banners": list(self.banners),
            "joint_stiffness_Nm_per_rad": [
                {
                    "value": float(fit.stiffness[j]),
                    "standard_uncertainty": float(fit.stiffness[j] * fit.relative_sd[j]),
                    "ci95": [float(ci[j, 0]), float(ci[j, 1])],
                }
                for j in range(JOINTS)
            ],
            "rank": fit.rank,
            "null_dimension": JOINTS - fit.rank,
            "identified": [bool(i) for i in fit.identified],
            "share_of_data": [float(s) for s in fit.data_share],
            "lower_bound_Nm_per_rad": [float(b) for b in fit.lower_bound],
            # infinite with a null space: JSON knows no such number
            "condition_number": _finite(fit.condition_number),
            "prior": {
                "joint_stiffness_Nm_per_rad": [float(v) for v in fit.prior.stiffness],
                "relative_sd": [float(v) for v in fit.prior.relative_sd],
                "source": fit.prior.source,
            },
            "prior_conflict": _conflict(fit),
            "null_space": fit.null_space.T.tolist(),
            "next_poses": [
                {
                    "q_rad": [float(v) for v in p.q],
                    "direction": [float(v) for v in p.direction],
                    "why": p.why,
                    "force_N": p.force,
                    "expected_relative_uncertainty": [float(v) for v in p.expected],
                }
                for p in self.proposals
            ],
            "notes": [*self.doubts, *self.notes],
        }

    def to_text(self) -> str:
        """Tables for a terminal."""
        from rig.analysis.identify_text import text

        return text(self)


def identify(
    paths: Sequence[str | Path],
    *,
    prior: Prior | None = None,
    joint_readings: bool = True,
    proposals: int = 6,
    seed: int = 0,
    criterion: Criterion = "A",
) -> IdentifyResult:
    """Joint stiffnesses from one or many data sets.

    prior: by default the robot file's stiffnesses and relative sd. joint_readings False: the laser
    alone. proposals: how many next poses are looked for, and by which criterion
    (`identification.next_poses`). Raises InputError.
    """
    if not paths:
        raise InputError("rig identify: give at least one data set.")
    datasets = load_each([Path(p) for p in paths])
    names = [legible(p) for p in paths]
    arm = _arm(datasets, names)
    prior = prior or Prior(
        arm.joint_stiffness, arm.joint_stiffness_relative_sd, f"data/models/{arm.name}.yaml"
    )
    _check_new(datasets, names, prior)
    observations: list[Observation] = []
    notes: list[str] = []
    for setup, (dataset, name) in enumerate(zip(datasets, names, strict=True)):
        found, said = observations_of(dataset, name, setup, joint_readings)
        observations += found
        notes += said
    gains = [_gains(d) for d in datasets]
    try:
        fit = estimate(arm, observations, gains, prior)
        planned = _plan(datasets[0], gains[0])
        next_poses = _propose(arm, fit, planned, proposals, seed, criterion)
    except ValueError as error:
        raise InputError(f"{', '.join(names)}: {error}.") from error
    notes += _blind_joints(arm, observations, fit)
    first = next(iter(datasets[0].meta.poses.values()))
    return IdentifyResult(
        datasets=tuple(names),
        arm=arm.with_stiffness(fit.stiffness, fit.relative_sd),
        fit=fit,
        observations=tuple(observations),
        proposals=tuple(next_poses),
        tool_xyz=first.tcp_xyz_mm,
        doubts=tuple(_contradiction(fit)),
        notes=tuple(notes),
        banners=tuple(dict.fromkeys(b for d in datasets for b in d.banners())),
        made_from=_made_from(datasets, prior),
        limits=limits_before(datasets),
    )


def _check_new(datasets: Sequence[Dataset], names: Sequence[str], prior: Prior) -> None:
    for dataset, name in zip(datasets, names, strict=True):
        if dataset.uuid in prior.made_from:
            raise InputError(
                f"{prior.source}: was made from {name}; every measurement counts once. Leave out "
                "the data set, or take a model that it is not part of."
            )


def _made_from(datasets: Sequence[Dataset], prior: Prior) -> str:
    """Which data sets are behind the stiffnesses, those behind the prior included."""
    mine = f"Identified from {', '.join(d.uuid for d in datasets)}."
    return f"{mine} Prior: {prior.made_from}" if prior.made_from else mine


def _propose(
    arm: Arm, fit: JointFit, planned: Plan, count: int, seed: int, criterion: Criterion
) -> list[Proposal]:
    if count == 0:
        return []
    return propose(arm, fit, planned, count, seed, criterion=criterion)


def prior_of(model: str | Path) -> Prior:
    """The joint stiffnesses of a model file, with their stated uncertainties, as a prior.

    Raises InputError where the file states none: a prior without spread leaves nothing to learn.
    """
    read = load_model(model)
    arm = read.arm
    if not (arm.joint_stiffness_relative_sd > 0).all():
        raise InputError(
            f"{model}: as a prior it needs joint_stiffness_relative_sd (or joint_stiffness_sd) "
            "above 0 for all six joints."
        )
    return Prior(arm.joint_stiffness, arm.joint_stiffness_relative_sd, str(model), read.note)


def _arm(datasets: Sequence[Dataset], names: Sequence[str]) -> Arm:
    robots = [d.meta.robot for d in datasets]
    for dataset in datasets:
        refuse_contradictions(dataset)
    for name, robot in zip(names, robots, strict=True):
        if robot == "none":
            raise InputError(f"{name}: robot: none; joint stiffnesses need an arm.")
        if robot != robots[0]:
            raise InputError(
                f"{name} is of a {robot}, {names[0]} of a {robots[0]}; "
                "give data sets of one robot together."
            )
    return load_robot(robots[0])


def _gains(dataset: Dataset) -> Gains:
    instruments = dataset.meta.instruments
    return Gains(instruments.force.gain_relative_sd, instruments.displacement.gain_relative_sd)


def _plan(dataset: Dataset, gains: Gains) -> Plan:
    """The next measurement with the same instruments and tool."""
    instruments = dataset.meta.instruments
    tcp = next(iter(dataset.meta.poses.values())).tcp_xyz_mm
    return Plan(
        u_force=instruments.force.standard_uncertainty_N,
        u_displacement=instruments.displacement.standard_uncertainty_mm / MM_PER_M,
        gains=gains,
        tool=tool_offset(np.array(tcp) / MM_PER_M),
    )


def _blind_joints(arm: Arm, observations: Sequence[Observation], fit: JointFit) -> list[str]:
    levers = np.array([one.levers(arm) for one in observations])
    notes = [
        f"Joint {j + 1} has no lever in any of these poses and directions: it repeats the prior."
        for j in range(JOINTS)
        if np.abs(levers[:, j]).max() < 1e-6
    ]
    if np.abs(levers[:, 5]).max() < 1e-6:
        notes.append(
            "Joint 6 is seen only when the point of load lies beside axis 6: mount a tool that "
            "is offset sideways (tcp_xyz_mm)."
        )
    if fit.birge > 1:
        notes.append(
            f"The six springs do not explain these data within their uncertainties; those were "
            f"enlarged {fit.birge:.2g} times. rig diagnose looks for what is missing."
        )
    return notes


def _contradiction(fit: JointFit) -> Iterator[str]:
    """Of data and prior, in words."""
    found = fit.conflict
    if found is None:
        return
    if found.log_factor is None:
        j = int(np.argmax(np.abs(found.away)))
        yield (
            f"Data and prior contradict each other: they agree best if joint {j + 1} is "
            f"{fit.stiffness[j] / fit.prior.stiffness[j]:.3g} times as stiff as the prior has it, "
            f"{abs(found.away[j]):.2g} of its standard deviations away. The prior was taken as "
            f"{found.enlarged:.2g} times as uncertain as stated. See to tool, pose, units and the "
            "prior; rig diagnose looks for what else gives way."
        )
        return
    units = slip(found.log_factor, found.u_log_factor)
    smells = "See to units, tool and the prior." if units is None else f"Are these {units}?"
    yield (
        "Data and prior contradict each other: they agree if all joints are "
        f"{np.exp(found.log_factor):.3g} times as stiff as the prior has them, "
        f"{np.abs(found.away).max():.2g} of its standard deviations away. {smells} The joints were "
        "taken with that factor, those that repeat the prior, too."
    )


def _conflict(fit: JointFit) -> dict[str, Any] | None:
    """How far data and prior are apart, and what became of the prior."""
    found = fit.conflict
    if found is None:
        return None
    factor = None if found.log_factor is None else float(np.exp(found.log_factor))
    return {
        "common_factor": factor,
        "away_in_prior_sd": [float(v) for v in found.away],
        "prior_sd_enlarged": found.enlarged,
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
