"""`rig diagnose`: where the simulation misses the measurement, which effect causes it, how far the
gap shrinks once that effect is added."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from identification.gap.answer.forms import Form
from identification.gap.answer.known import NotKnown
from identification.gap.answer.result import EffectFound, GapResult
from identification.gap.data import BRANCH_NAMES, GapData
from identification.gap.diagnose import NotShown, diagnose_gap, explain_gap
from identification.gap.judging.heldout import HeldOut
from identification.gap.laws.interval import Parameter
from identification.gap.words import WORDS
from rig import schemas
from rig.dataset import Dataset
from rig.diagnosis.gap_data import gap_data
from rig.diagnosis.gap_forms import effects_of
from rig.diagnosis.other_setups import elsewhere
from rig.diagnosis.other_simulator import with_curves
from rig.errors import InputError, did_you_mean
from rig.meta import Simulation
from rig.models.model import ArmModel, load_model
from rig.terminal import Progress
from rig.units import MM_PER_M

# As shapes are labelled, whatever their springs are called: joint 1, joints 1 and 2, joints but 3.
_JOINT = re.compile(r"\bjoint(s?(?: but)?)(?: (\d+))?(?: and (\d+))?")


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The result with what it came from; `to_json` is schema rig.diagnosis/1. known_effects: of
    the model that was given, part of the simulation, but for what is gone since; left_behind: words
    of that model which belong to the session that it was made from, and are no part of it; model:
    the model itself."""

    dataset: str
    result: GapResult
    banners: tuple[str, ...] = ()
    known_effects: tuple[dict[str, Any], ...] = ()
    left_behind: tuple[str, ...] = ()
    model: ArmModel | None = None

    def to_json(self) -> dict[str, Any]:
        """The diagnosis as plain values."""
        from rig.diagnosis.diagnose_text import meanings, parameter_meanings

        r = self.result
        return {
            "schema": schemas.DIAGNOSIS,
            "dataset": self.dataset,
            "verdict": r.verdict,
            "nothing_learned": r.learned_nothing,
            "displacement_met": r.met,
            "hidden_by_scatter": r.hidden,
            "probabilities": {w: float(p) for w, p in r.probabilities.items()},
            "meanings": meanings(arm=r.bench.data.arm),
            "effects": [_effect(e, r.bench.data) for e in r.effects],
            "parameter_meanings": parameter_meanings(r),
            "where": _where(r),
            "gap": _gap(r),
            "next_measurement": None
            if r.next_measurement is None
            else {
                "text": r.next_measurement.text,
                "separates": list(r.next_measurement.separates),
                "kind": r.next_measurement.kind,
                "expected_nats": r.next_measurement.expected_nats,
                "minutes": r.next_measurement.minutes,
                "alternatives": [asdict(o) for o in r.next_measurement.alternatives],
            },
            "remainder_mm": r.remainder * MM_PER_M,
            "remainder": _remainder(r),
            "looks_like": _looks_like(r),
            "runners_up": {
                w: {"held_out_after_rms_mm": v * MM_PER_M} for w, v in r.runners_up.items()
            },
            "notes": list(r.notes),
            "note_kinds": [n.kind for n in r.said],
            "known_effects": [e["name"] for e in self.known_effects],
            "known_effects_gone": list(r.gone),
            "banners": list(self.banners),
        }

    def to_text(self) -> str:
        """What the terminal shows."""
        from rig.diagnosis.diagnose_text import render

        names = ", ".join(dict.fromkeys(str(e["name"]) for e in self.known_effects))
        known = [f"The simulation has these effects already: {names}."] if names else []
        if gone := " and ".join(self.result.gone):
            known.append(
                f"Left out of the model: {gone}, which is not in these data as the model has it: "
                "repaired since, gone on, or under a force that was read otherwise. What follows "
                "is about the simulation without."
            )
        if self.left_behind:
            known.append(
                f"Left out of the model: {', '.join(self.left_behind)}, of the session that it was "
                "made from."
            )
        return "\n\n".join([*self.banners, *self._outside(), *known, render(self.result)])

    def _outside(self) -> list[str]:
        """What the simulation has beside springs and effects."""
        if self.model is None or not self.model.written_outside:
            return []
        keys = " and ".join(f"`{key}`" for key in self.model.written_outside)
        return [f"The simulation has the model's {keys}: the gap is what goes beyond them."]


def diagnose(
    dataset: Dataset,
    *,
    model: Path | None = None,
    simulation: Path | None = None,
    withhold: Iterable[str] = (),
    add: Iterable[str] = (),
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnoses a data set. model: a model file whose springs (and links, mounting, effects) stand
    for META's; simulation: CSV with another simulator's curves, instead of a model; withhold: words
    taken out of the library; add: words the explanation must contain. InputError for anything
    wrong."""
    if model is not None and simulation is not None:
        raise InputError(
            f"--model {model}, --simulation {simulation}: each says what was simulated. Leave one "
            "out."
        )
    read = None if model is None else load_model(model)
    given = (
        _SimulationOfModel(gap_data(dataset))
        if read is None
        else _simulation_of_model(dataset, read)
    )
    data = given.data if simulation is None else with_curves(given.data, simulation)
    out, forced = tuple(withhold), tuple(add)
    for option, words in (("--withhold", out), ("--add", forced)):
        for word in words:
            if word not in WORDS:
                raise InputError(f'{option}: "{word}" is no effect.{did_you_mean(word, WORDS)}')
    for word in (w for w in forced if w in out):
        raise InputError(f"--add {word}, --withhold {word}: exclude each other. Leave one out.")
    try:
        result = diagnose_gap(
            data,
            withhold=out,
            add=forced,
            known=given.laws,
            others=lambda: elsewhere(dataset, read),
            progress=progress,
        )
    except NotShown as error:
        raise InputError(f"--add: {error}.") from error
    except NotKnown as error:
        raise InputError(f"{model}: effects: {error}. Give a model without effects.") from error
    there = tuple(e for e in given.effects if e["name"] not in result.gone)
    return Diagnosis(dataset.uuid, result, dataset.banners(), there, given.behind, read)


def explain(dataset: Dataset) -> tuple[Diagnosis, Callable[[], Diagnosis]]:
    """The diagnosis but for what to measure next, and what makes it whole. InputError as there."""
    result, whole = explain_gap(gap_data(dataset), others=lambda: elsewhere(dataset))

    def said(found: GapResult) -> Diagnosis:
        return Diagnosis(dataset.uuid, found, dataset.banners())

    return said(result), lambda: said(whole())


class _SimulationOfModel(NamedTuple):
    """The data with springs, links and mounting of a model as their simulation; laws of the effects
    that it has; these effects, as the model writes them; words of it that are left out."""

    data: GapData
    laws: tuple[Form, ...] = ()
    effects: tuple[dict[str, Any], ...] = ()
    behind: tuple[str, ...] = ()


def _simulation_of_model(dataset: Dataset, read: ArmModel) -> _SimulationOfModel:
    """InputError for a model of another robot."""
    effects = effects_of(read)
    if read.arm.name != dataset.meta.robot:
        raise InputError(
            f"{read.name}: the robot is {read.arm.name}, the measurement's is "
            f"{dataset.meta.robot}. Give the model of the measured robot."
        )
    c1, c2, c3, c4, c5, c6 = (float(c) for c in read.arm.joint_stiffness)
    simulation = Simulation(joint_stiffness_Nm_per_rad=(c1, c2, c3, c4, c5, c6))
    believed = dataset.meta.model_copy(update={"simulation": simulation})
    data = replace(
        gap_data(replace(dataset, meta=believed), read),
        compliance_relative_sd=read.arm.joint_stiffness_relative_sd,
    )
    words = {*effects.contained, *(f.word for f in effects.lasting)}
    known = tuple(e for e in read.effects if e["name"] in words)
    return _SimulationOfModel(data, effects.lasting, known, effects.left_behind)


def _looks_like(r: GapResult) -> dict[str, Any] | None:
    """What an unknown gap looks like; None where nothing is plain."""
    from rig.diagnosis.diagnose_text import looks_like

    like = r.looks_like
    if like is None:
        return None
    period = {"swings": "period_s", "waves": "period_mm"}.get(like.kind)
    factor = MM_PER_M if like.kind == "waves" else 1.0
    size = {} if period is None else {period: (like.period or 0.0) * factor}
    return {"kind": like.kind, **size, "text": looks_like(like, arm=r.bench.data.arm)}


def _effect(e: EffectFound, data: GapData) -> dict[str, Any]:
    def direction(found: re.Match[str]) -> str:
        names = [data.spring_name(int(n) - 1) for n in found.groups()[1:] if n]
        return f"direction{found[1]} {' and '.join(names)}".rstrip()

    return {
        "name": e.name,
        "probability": e.probability,
        "parameters": {name: _parameter(p) for name, p in e.parameters.items()},
        "places": dict(e.places),
        "indistinguishable_from": list(e.indistinguishable_from),
        "share_of_gap": e.share_of_gap,
        "rms_mm": e.size * MM_PER_M,
        "form": e.label if data.arm else _JOINT.sub(direction, e.label),
    }


def _parameter(p: Parameter) -> dict[str, Any]:
    out = {"value": p.value, "ci95": [p.low, p.high], "ci90": list(p.ci90), "unit": p.unit}
    return out if p.cut_at is None else {**out, "largest_seen": p.cut_at}


def _where(r: GapResult) -> dict[str, Any]:
    w = r.where
    return {
        "directions": list(w.directions),
        "poses": list(w.poses),
        "force_N": {d: [low, high] for d, (low, high) in w.force.items()},
        "branches": list(w.branches),
        "repetitions": list(w.repetitions),
        "joints": list(w.joints),
        "seen_by_encoders": w.seen_by_encoders,
        "share_of_gap": w.share,
    }


def _gap(r: GapResult) -> dict[str, Any]:
    held = [_held(h, r.noise) for h in r.held_out]
    return {
        "noise_rms_mm": r.noise * MM_PER_M,
        "before_rms_mm": r.before * MM_PER_M,
        "after_rms_mm": r.after * MM_PER_M,
        "after_over_noise": over(r.after, r.noise),
        "shrink_factor": r.before / r.after if min(r.before, r.after) > 0 else 1.0,
        **({} if r.written is None else _written(r, r.written)),
        **({} if r.without_added is None else {"without_added_rms_mm": r.without_added * MM_PER_M}),
        "held_out": held[0] if held else None,
        "held_out_other": held[1:],
    }


def _written(r: GapResult, after: float) -> dict[str, float]:
    """What the file of `--write-model` leaves, m."""
    return {
        "written_after_rms_mm": after * MM_PER_M,
        "written_after_over_noise": over(after, r.noise),
        "written_shrink_factor": r.before / after if min(r.before, after) > 0 else 1.0,
    }


def _remainder(r: GapResult) -> dict[str, Any]:
    """How large what nobody explains is, and where: a flexible curve over what the fit leaves."""
    from identification.gap.answer.remainder import remainder

    rest = remainder(r.engine, r.fit)
    largest = None
    if rest.largest is not None:
        at = rest.largest
        largest = {
            "pose": at.pose,
            "direction": at.direction,
            "branch": BRANCH_NAMES[at.branch],
            "force_N": at.force,
            "mean_mm": at.mean * MM_PER_M,
            "sd_mm": at.sd * MM_PER_M,
        }
    return {
        "rms_mm": rest.rms * MM_PER_M,
        "ci95": [v * MM_PER_M for v in rest.ci95],
        "unrepeated_rms_mm": rest.unrepeated_rms * MM_PER_M,
        "largest": largest,
    }


def over(after: float, noise: float) -> float:
    """What is left in units of the noise; 1 where there is no noise."""
    return after / noise if noise > 0 else 1.0


def _held(h: HeldOut, noise: float) -> dict[str, Any]:
    return {
        "fold": h.fold,
        "before_rms_mm": h.before * MM_PER_M,
        "after_rms_mm": h.after * MM_PER_M,
        "after_over_noise": over(h.after, noise),
        "shrink_factor": h.shrink,
        "ci95": list(h.ci95),
        "own_datum": h.own_datum,
    }
