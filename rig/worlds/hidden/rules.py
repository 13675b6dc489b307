"""Which other words explain a case as well."""

from __future__ import annotations

from rig.worlds.hidden.effect import Effect
from rig.worlds.hidden.scene import Scene

_LINEAR = (
    "link_flexibility",
    "base_compliance",
    "load_misalignment",
    "force_scale",
    "displacement_scale",
    "pose_error",
    "joint_stiffness_error",
)


def accepted(scene: Scene, effect: Effect) -> set[str]:
    """The true word, and those that such a design cannot tell from it."""
    word, recorded = effect.word, scene.plan.recorded
    out = {word}
    if recorded.q and recorded.encoder == "output":
        return out
    if word in _LINEAR and not recorded.components:
        out |= set(_LINEAR)
    elif word in _LINEAR and word != "load_misalignment":
        out |= set(_LINEAR) - {"load_misalignment"}
    if word in ("joint_yield", "base_slip") and 1 in (effect.joints or (1,)):
        out |= {"joint_yield", "base_slip"}
    return out
