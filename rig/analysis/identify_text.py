"""The result of `rig identify` in words, as a model file, and as the next protocol."""

from __future__ import annotations

import json
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.digits import number
from rig.errors import InputError
from rig.models.model_write import arm_lines, coupling_lines
from rig.protocol_write import limit_lines, numbers, pose_line, settle_lines
from rig.storage.files import in_place_of
from rig.units import KNM

if TYPE_CHECKING:
    from rig.analysis.identify import IdentifyResult

_LEVELS = 10  # of a proposed run


def text(result: IdentifyResult) -> str:
    """Everything that a terminal shows."""
    fit = result.fit
    lines = [
        *result.banners,
        f"Joint torsional stiffness of the {result.arm.name} from {len(result.observations)} "
        f"poses and directions; rank {fit.rank}, null space of dimension {6 - fit.rank}, "
        f"condition number {_condition(fit.condition_number)}.",
        "  joint  kNm/rad     u    95 % interval    from data  at least",
    ]
    for j in range(6):
        c, u = fit.stiffness[j] * KNM, fit.stiffness[j] * fit.relative_sd[j] * KNM
        low, high = fit.ci95[j] * KNM
        bound = f"{fit.lower_bound[j] * KNM:.2f}" if fit.lower_bound[j] > 1 else "-"
        share = max(0.0, 100 * fit.data_share[j])
        verdict = data_say(bool(fit.identified[j]), share)
        lines.append(
            f"  {j + 1}    {c:9.2f} {number(u, 2):>5}  {low:7.2f} to {high:6.2f}  "
            f"{share:6.1f} %  {bound:>8}  {verdict}"
        )
    prior_sd = dict.fromkeys(f"{100 * sd:.4g}" for sd in fit.prior.relative_sd)
    known = numbers(100 * fit.prior.relative_sd, 4) if len(prior_sd) > 1 else next(iter(prior_sd))
    lines.append(
        f"Prior: {fit.prior.source}, relative sd {known} %. u: standard uncertainty. from data: "
        "share that data tell, not the prior. at least (kNm/rad, 95 %): whatever the other joints "
        "are; -: these data set no bound."
    )
    lines += [f"See to this first: {doubt}" for doubt in result.doubts]
    if result.proposals:
        lines.append("Next poses that would tell most, in this order:")
        for p in result.proposals:
            lines.append(
                f"  q = ({numbers(np.rad2deg(p.q), 4)}) deg, along {p.axis}, "
                f"to {p.force:.0f} N: {p.why}"
            )
    lines += [f"Note: {note}" for note in result.notes]
    return "\n".join(lines)


def _condition(number: float) -> str:
    return f"{number:.3g}" if isfinite(number) else "infinite (without the prior)"


def model_text(result: IdentifyResult) -> str:
    """A model file that holds the identified stiffnesses, in the first measured pose."""
    fit, note = result.fit, " ".join([*result.banners, result.made_from, *result.doubts])
    lines = [
        f"# Identified from {', '.join(Path(d).name for d in result.datasets)}",
        f"note: {json.dumps(note)}",
        *arm_lines(
            result.arm.name,
            result.observations[0].q.tolist(),
            result.tool_xyz,
            fit.stiffness,
            fit.stiffness * fit.relative_sd,
        ),
        "effects: []",
        *coupling_lines(),
    ]
    return "\n".join(lines) + "\n"


def protocol_text(result: IdentifyResult) -> str:
    """A protocol file that measures the proposed poses and directions; on the laboratory's station,
    after emulated data on the emulated one."""
    station = "emulated" if result.emulated else "ur10e_lab"
    if not result.proposals:
        raise InputError("rig identify: no next poses were looked for; there is no protocol.")
    poses, runs = [], []
    for i, p in enumerate(result.proposals, 1):
        poses.append(pose_line(f"N{i}", p.q, result.tool_xyz))
        step = p.force / _LEVELS
        runs.append(
            f"  - {{pose: N{i}, direction: {p.axis}, "
            f"steps_N: [{numbers(step * np.arange(1, _LEVELS + 1), 5)}]}}"
        )
    greatest = max(p.force for p in result.proposals)
    softest = max(
        p.force * float((one**2 / result.fit.stiffness).sum())
        for p, one in ((p, _levers(result, p.q, p.direction)) for p in result.proposals)
    )
    return (
        "# Poses and directions that would tell most about the joints still uncertain.\n"
        "schema: rig.protocol/1\n"
        "title: Next poses for the joint stiffnesses\n"
        f"station: {station}\n\nrobot: {result.arm.name}\nposes:\n" + "\n".join(poses) + "\n"
        "move_arm: false\njoint_encoder: output\n\n"
        "directions:\n  x: [1, 0, 0]\n  y: [0, 1, 0]\n  z: [0, 0, 1]\n\n"
        "runs:\n" + "\n".join(runs) + "\nrepetitions: 3\nbranches: loading\norder: by_run\n\n"
        "sampling: {rate_Hz: 1, samples_per_step: 5}\nhold_s: 0\n"
        "force_band: {absolute_N: 0.5, relative: 0.01}\n"
        + "\n".join(settle_lines())
        + "\nstep_deadline_s: 300\nzero: {before_s: 6, after_s: 6}\nrest_s: 10\n"
        "rated_load_N: null\n\n"
        + "\n".join(limit_lines(greatest, round(min(9.5, 2e3 * softest + 1), 1), result.limits))
        + "\n"
    )


def write_model(result: IdentifyResult, path: Path) -> None:
    """Writes `model_text`; what rig couple, rig simulate and rig diagnose read. InputError if the
    folder refuses."""
    _write(path, model_text(result))


def write_protocol(result: IdentifyResult, path: Path) -> None:
    """Writes `protocol_text`; what rig measure runs. InputError if the folder refuses."""
    _write(path, protocol_text(result))


def _write(path: Path, text: str) -> None:
    with in_place_of(path) as temporary:
        temporary.write_text(text, "utf-8")


def _levers(result: IdentifyResult, q: object, direction: object) -> np.ndarray:
    tool = result.observations[0].tool
    J = result.arm.jacobian(np.asarray(q), tool)
    return np.asarray(np.asarray(direction) @ J[:3])


def data_say(identified: bool, percent: float) -> str:
    """Of a joint's stiffness; percent of it that comes from the data."""
    if identified:
        return "identified"
    if percent < 10:
        return "repeats the prior"
    return "known, not to 5 %" if percent >= 90 else "partly seen"
