"""A fixed plan for tests of the hidden worlds, and effects by word and form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.worlds.hidden.design import Plan, draw_plan
from rig.worlds.hidden.draw import FORMS
from rig.worlds.hidden.effect import Drawn
from rig.worlds.hidden.gap import along, displacement, tared
from rig.worlds.hidden.scene import Scene, make_scene, observe

FORM_NAMES = [(word, form.name) for word, forms in FORMS.items() for form in forms]


def plan_of(design: str, seed: int = 3, **recorded: Any) -> Plan:
    plan = draw_plan(np.random.default_rng(seed), design)
    what = {"q": True, "components": True, "encoder": "output", "tare": "session"}
    what |= {"datum": "setup"} | recorded
    return replace(
        plan,
        recorded=replace(plan.recorded, **what),
        repetitions=3,
        relative_sd=0.05,
        springs=plan.believed * np.array([1.02, 0.99, 0.98, 1.01, 1.02, 0.98]),
    )


def scene_of(design: str, seed: int = 3, **recorded: Any) -> Scene:
    return make_scene(plan_of(design, seed, **recorded), np.random.default_rng(seed))


def effect_of(scene: Scene, word: str, form: str, seed: int = 0) -> Drawn:
    chosen = next(f for f in FORMS[word] if f.name == form)
    return chosen.draw(scene, np.random.default_rng(seed))


def middle(drawn: Drawn) -> float:
    """A size between its bounds."""
    return float(np.sqrt(drawn.sizes[0] * drawn.sizes[1]))


def contribution(scene: Scene, drawn: Drawn, size: float) -> tuple[Array, Array, Array]:
    """(m) mm of displacement, (m) N along the direction, (m, 6) rad that the effect adds."""
    plain, changed = observe(scene), observe(scene, [drawn.change(size)])
    return (
        displacement(scene, changed) - displacement(scene, plain),
        along(scene, tared(scene, changed.force_N)) - along(scene, tared(scene, plain.force_N)),
        changed.q - plain.q,
    )
