"""The answers to a hidden measurement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.effect import Effect, rounded
from rig.worlds.hidden.gap import along, displacement, rms, structural_gap, tared
from rig.worlds.hidden.rivals import NO_CASE, accepted, left_over
from rig.worlds.hidden.scene import BRANCHES, Change, Scene, observe
from rig.worlds.hidden.words import IN_JOINTS, OUTSIDE_JOINTS

_SHOWS = 0.15  # of the largest: from here on an effect counts as showing somewhere


def answers(
    scene: Scene, effects: Sequence[tuple[Effect, float]], noise_mm: float
) -> dict[str, Any] | None:
    """The label, JSON-able. `noise_mm`: rms of what is random.

    None when the case is no fair question: springs, gains and datum within what is stated explain
    an effect, or a word of the library explains what none should.
    """
    changes = [effect.change(size) for effect, size in effects]
    gap_mm = structural_gap(scene, changes)
    each = [rms(structural_gap(scene, [c])) / noise_mm for c in changes]
    words = [effect.word for effect, _ in effects] or ["none"]
    left = [
        left_over(scene, [change], noise_mm, effect.word)
        for (effect, _), change in zip(effects, changes, strict=True)
    ]
    sets = [
        accepted(rest, e.word, snr) for rest, (e, _), snr in zip(left, effects, each, strict=True)
    ]
    if any(_unfair(e.word, rest, s) for (e, _), rest, s in zip(effects, left, sets, strict=True)):
        return None
    recorded = scene.plan.recorded
    return {
        "truth": words,
        "forms": [effect.form for effect, _ in effects],
        "laws": ["fitted" if effect.fitted else "foreign" for effect, _ in effects],
        "parameters": [rounded(effect.parameters(size)) for effect, size in effects],
        "verdict": "mixture" if len(words) > 1 else words[0],
        "accept": sorted(set().union(*sets, words)),
        "accept_each": [sorted(s) for s in sets],
        "snr": rounded(rms(gap_mm) / noise_mm) if effects else 0.0,
        "snr_each": rounded(each),
        "textbook_left_each": [rounded(r.get(w, 0.0)) for r, w in zip(left, words, strict=False)],
        "noise_rms_mm": rounded(noise_mm),
        "structural_rms_mm": rounded(rms(gap_mm)),
        "gap_before_rms_mm": rounded(_before(scene, effects)),
        "design": scene.plan.name,
        "samples": len(scene.history.sample),
        "turned_past": scene.plan.beyond,
        "true_joint_stiffness": rounded(scene.plan.springs),
        "recorded": {
            "q": recorded.q,
            "components": recorded.components,
            "temperature": recorded.temperature,
            "session": recorded.session,
        },
        "where": _where(scene, effects, gap_mm) if effects else None,
    }


def _unfair(word: str, left: dict[str, float], equals: set[str]) -> bool:
    """Nothing at all explains the effect as well, or something explains what nothing should."""
    return left["none"] <= NO_CASE or (word == "unknown" and len(equals) > 1)


def _before(scene: Scene, effects: Sequence[tuple[Effect, float]]) -> float:
    """rms of the ideal displacement minus the simulation as stated, mm."""
    from rig.worlds.hidden.gap import spring_columns

    reading = observe(scene, [effect.change(size) for effect, size in effects])
    force = along(scene, tared(scene, reading.force_N))
    simulated = spring_columns(scene, force) @ (1 / scene.plan.believed)
    return rms(displacement(scene, reading) - simulated)


def _where(scene: Scene, effects: Sequence[tuple[Effect, float]], gap_mm: Array) -> dict[str, Any]:
    history, plan = scene.history, scene.plan
    changes = [effect.change(size) for effect, size in effects]
    plain, changed = observe(scene), observe(scene, changes)
    compliance = scene.elastic[history.sample] * 1e3 / _never_zero(history.load[history.sample])
    force = along(scene, tared(scene, changed.force_N))
    pushed = force - along(scene, tared(scene, plain.force_N))
    part = np.abs(displacement(scene, changed) - displacement(scene, plain) - compliance * pushed)
    setup = history.setup[history.sample]
    direction = np.array([s.direction for s in plan.setups])[setup]
    pose = np.array([s.pose for s in plan.setups])[setup]
    branch = np.array(BRANCHES)[history.branch]
    shows = part > _SHOWS * part.max()
    shown = [_joints(scene, e.joints, c) for (e, _), c in zip(effects, changes, strict=True)]
    return {
        "directions": _places(direction, part),
        "main_direction": max(
            dict.fromkeys(direction.tolist()), key=lambda d: rms(gap_mm[direction == d])
        ),
        "poses": _places(pose, part),
        "branches": [b for b in BRANCHES if bool(np.any(shows & (branch == b)))],
        "joints": sorted(set().union(*shown)),
        "force_N": {
            d: rounded(
                [force[shows & (direction == d)].min(), force[shows & (direction == d)].max()]
            )
            for d in _places(direction, part)
            if np.any(shows & (direction == d))
        },
        "onset_N": _onset(effects),
        "seen_by_encoders": _seen(scene, [effect.word for effect, _ in effects]),
    }


def _joints(scene: Scene, among: Sequence[int], change: Change) -> list[int]:
    """Joints (from 1) in which an effect shows: of six wrong springs some bear no load."""
    setup = scene.history.setup
    softer = 0.0 if change.springs is None else 1 / change.springs - 1
    turned = softer * scene.torque / scene.plan.springs
    turned = turned if change.joints is None else turned + change.joints
    along = np.einsum("sij,sj->si", scene.levers, scene.unit)[setup]
    size = np.sqrt(np.mean((along * turned) ** 2, axis=0))
    return [j for j in among if size[j - 1] > _SHOWS * size.max()]


def _never_zero(load: Array) -> Array:
    return np.where(np.abs(load) > 1e-9, load, np.inf)


def _places(names: Any, part: Array) -> list[str]:
    size = {n: rms(part[names == n]) for n in dict.fromkeys(names.tolist())}
    most = max(size.values())
    return [n for n, s in size.items() if s > _SHOWS * most]


def _onset(effects: Sequence[tuple[Effect, float]]) -> dict[str, float] | None:
    onset = next((e.onset_N for e, _ in effects if e.onset_N), None)
    return None if onset is None else rounded(onset, 5)


def _seen(scene: Scene, words: Sequence[str]) -> bool | None:
    """Whether the joint readings show the effect; None where they cannot tell."""
    recorded = scene.plan.recorded
    if not recorded.q or len(words) != 1:
        return None
    if words[0] in IN_JOINTS:
        return True if recorded.encoder == "output" else None
    if words[0] in OUTSIDE_JOINTS:
        return False
    return None
