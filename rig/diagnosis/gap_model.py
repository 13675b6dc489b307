"""What a diagnosis found, as a model file: the simulation with its effects."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.answer.forms import Form, describe, lasting
from identification.gap.answer.found_notes import joints_missed
from identification.gap.answer.result import EffectFound, GapResult
from rig.dataset import Dataset
from rig.diagnosis.diagnose import Diagnosis
from rig.diagnosis.diagnose_text import meanings
from rig.diagnosis.gap_forms import to_entry
from rig.diagnosis.gap_keys import CONTAINED, SEEN_TO, SPRINGS
from rig.digits import likely
from rig.errors import InputError
from rig.models.model_write import arm_lines, coupling_lines, flow
from rig.storage.files import in_place_of

OF_THIS_SESSION = "of the measured session: rig simulate and rig diagnose --model leave it out"
_LEAST = 0.02  # of a joint's compliance that a fit may leave of it


def write_model(diagnosis: Diagnosis, dataset: Dataset, path: Path) -> None:
    """Writes `model_text`; what rig simulate, rig couple and rig diagnose --model read. InputError
    if there is nothing to write, or the folder refuses."""
    text = model_text(diagnosis, dataset)
    with in_place_of(path) as temporary:
        temporary.write_text(text, "utf-8")


def model_text(diagnosis: Diagnosis, dataset: Dataset) -> str:
    """The simulation as the data correct it: springs after the fit, effects in absolute units.

    Raises InputError for a rig without an arm (a model file holds an arm), and for a diagnosis
    against another simulator's curves (its springs are not ours to correct).
    """
    meta, result = dataset.meta, diagnosis.result
    check_writable(dataset, others=result.bench.data.curves is not None)
    pose = meta.poses[result.bench.data.setups[0].pose]
    made = f"Springs and effects of the diagnosis of {dataset.uuid}."
    if result.verdict == "unknown":  # nothing of the data set is in it, so it is not named here
        made = "Nothing explains the measured gap: the springs are those that were given."
    given = diagnosis.model.note if diagnosis.model is not None else ""
    note = " ".join([*diagnosis.banners, made, *([f"Given: {given}"] if given else [])])
    sure = likely(result.probabilities[result.verdict])
    found = {
        "none": f"in which rig diagnose found nothing missing ({sure})",
        "unknown": f"in which something is missing, and what is unknown ({sure})",
    }.get(result.verdict, f"with what rig diagnose found missing in it: {result.verdict} ({sure})")
    gone = "; left out as it is not in the data: " + " and ".join(result.gone)
    means = ", ".join(str(j + 1) for j in joints_missed(result.engine, result.fit))
    mean = [f"# A mean over the measured loads, of which it shows more: joint {means}."]
    lines = [
        f"# The simulation {found}{gone if result.gone else ''}.",
        f"# Data set: {dataset.uuid}",
        *(mean if means else []),
        f"note: {json.dumps(note)}",
        *arm_lines(meta.robot, pose.q_rad, pose.tcp_xyz_mm, *_believed(result)),
        *_outside(diagnosis),
        *_effects(diagnosis, dataset),
        *coupling_lines(),
    ]
    return "\n".join(lines) + "\n"


def check_writable(dataset: Dataset, *, others: bool) -> None:
    """Before the diagnosis; InputError where it can't become a model. others: it is made against
    another simulator's curves."""
    where = str(dataset.path or "data set")
    if dataset.meta.robot == "none":
        raise InputError(
            f"{where}: robot: none. A model file holds an arm; write the diagnosis with --json."
        )
    if others:
        raise InputError(
            f"{where}: diagnosed against another simulator's curves; --write-model corrects the "
            "springs of META or --model. Leave --simulation out."
        )


def _believed(result: GapResult) -> tuple[Array, Array]:
    """Joint stiffnesses and their standard deviations (m,) Nm/rad: as fitted; as stated where the
    gap is unknown, since what springs take of such a gap says nothing of springs."""
    if result.verdict != "unknown":
        return springs(result)
    stated = 1 / result.bench.data.compliance
    return stated, stated * result.bench.data.compliance_relative_sd


def springs(result: GapResult) -> tuple[Array, Array]:
    """Joint stiffnesses (m,) Nm/rad after the fit and their standard deviations (m,), an effect
    `joint_stiffness_error` included: compliance times (1 + sum of the coefficients). A joint that
    turns otherwise than its spring is no better known than by as much."""
    bench, fitted = result.bench, result.fit
    sums = np.zeros((bench.data.joints, len(fitted.joint_covariance)))
    for i, name in enumerate(result.engine.base.names):
        if name.startswith("spring"):
            sums[int(name.removeprefix("spring")) - 1, i] = 1.0
    at = len(fitted.base)
    for part in fitted.parts:
        if part.word == "joint_stiffness_error":
            for k, j in enumerate(part.variant.joints):
                sums[j, at + k] = 1.0
        at += len(part.variant.columns)
    factor = np.maximum(1 + sums @ np.append(fitted.base, fitted.coefficients), _LEAST)
    variance = np.maximum(np.einsum("ij,jk,ik->i", sums, fitted.joint_covariance, sums), 0.0)
    unseen = ~sums.any(axis=1)
    variance[unseen] = bench.data.compliance_relative_sd[unseen] ** 2
    stiffness, relative = 1 / (bench.compliance * factor), np.sqrt(variance) / factor
    for j, missed in joints_missed(result.engine, fitted).items():
        relative[j] = np.hypot(relative[j], missed.share)  # a mean over these loads
    return stiffness, stiffness * relative


def forms(result: GapResult) -> list[Form]:
    """The chosen explanation's effects in absolute units, largest first."""
    return [
        describe(result.bench, part, *result.fit.of(i)) for i, part in enumerate(result.fit.parts)
    ]


def _outside(diagnosis: Diagnosis) -> list[str]:
    """Links and mounting of the model that was given: part of the simulation that is corrected."""
    written = {} if diagnosis.model is None else diagnosis.model.written_outside
    return [f"{key}: {flow(value)}" for key, value in written.items()]


def _effects(diagnosis: Diagnosis, dataset: Dataset) -> list[str]:
    entries = list(diagnosis.known_effects)
    comments = ["of the model that was given"] * len(entries)
    words = meanings(arm=diagnosis.result.bench.data.arm)
    for effect, form in zip(diagnosis.result.effects, forms(diagnosis.result), strict=True):
        entries.append(to_entry(form, _about(effect, dataset)))
        own = "" if lasting(form).law.terms else f"; {OF_THIS_SESSION}"
        comments.append(_comment(effect, words[effect.name]) + own)
    if not entries:
        return ["effects: []"]
    lines = ["effects:"]
    for entry, comment in zip(entries, comments, strict=True):
        lines += [f"  # {comment}", *_entry_lines(entry)]
    return lines


def _about(effect: EffectFound, dataset: Dataset) -> dict[str, Any]:
    out: dict[str, Any] = {
        "name": effect.name,
        "form": effect.label,
        "dataset": dataset.uuid,
        "emulated": dataset.origin == "emulated",
        "probability": round(effect.probability, 4),
        "share_of_gap": round(effect.share_of_gap, 4),
        SEEN_TO: _greatest(dataset),
        "parameters": {
            name: {"value": p.value, "ci95": [p.low, p.high], "unit": p.unit}
            for name, p in effect.parameters.items()
        },
    }
    if effect.name == "joint_stiffness_error":
        out[CONTAINED] = SPRINGS
    return out


def _greatest(dataset: Dataset) -> dict[str, float]:
    """Direction -> greatest force N, either way, that counts."""
    columns = dataset.columns
    force = np.abs(columns["force_N"])
    used = ~columns["discarded"]
    rows = {d: used & (columns["direction"] == d) for d in dataset.meta.directions}
    return {d: round(float(force[mine].max()), 2) for d, mine in rows.items() if mine.any()}


def _comment(effect: EffectFound, meaning: str) -> str:
    text = f"{meaning}; {100 * effect.share_of_gap:.0f} % of the gap"
    if len(effect.places) > 1:
        text += f"; it may sit at {', '.join(effect.places)}"
    if effect.indistinguishable_from:
        text += f"; not told apart from {', '.join(effect.indistinguishable_from)}"
    return text


def _entry_lines(entry: Mapping[str, Any]) -> list[str]:
    lines: list[str] = []
    for key, value in entry.items():
        mark = "  - " if not lines else "    "
        if key in ("terms", "covariance") and isinstance(value, list):
            lines.append(f"{mark}{key}:")
            lines += [f"      - {flow(one)}" for one in value]
        elif key == "parameters" and isinstance(value, Mapping) and value:
            lines.append(f"{mark}{key}:")
            lines += [f"      {name}: {flow(one)}" for name, one in value.items()]
        else:
            lines.append(f"{mark}{key}: {flow(value)}")
    return lines
