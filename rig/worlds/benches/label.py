"""The answers to a bench case, with the keys that all generators share."""

from __future__ import annotations

from typing import Any

import numpy as np

from rig.arrays import Array
from rig.worlds.benches.rig import Rig
from rig.worlds.benches.trial import SCALES

WITHIN_SD = 3.0  # what springs and gains may take of a gap
LARGE_SPRING = 0.5  # of the effect's own gap: from here on a wrong spring may be the main cause
_AS_LIKELY = 0.3  # of the largest stated sd: a scale that may be off as well


def structural(rig: Rig) -> Array:
    """(n,) mm: the response without noise, less the best line within three stated standard
    deviations of the simulated one."""
    y, x = rig.response(rig.force, rig.displacement), rig.simulated()
    y, x = y - y.mean(), x - x.mean()
    power, sd = float(x @ x), rig.stated.slope_sd
    slope = float(x @ y) / power if power > 0 else 1.0
    slope = float(np.clip(slope, max(1 - WITHIN_SD * sd, 0.05), 1 + WITHIN_SD * sd))
    return np.asarray(y - slope * x)


def accepted(word: str, rig: Rig) -> set[str]:
    """The word, what its law shares with others, and a wrong spring where that is much of the gap.

    On a straight spring gains and spring are one number, whatever is true: those may be named
    whose stated sd is not small beside the largest.
    """
    if word == "none":
        return {"none"}
    out = {word} | rig.trial.accept
    stated = rig.stated
    if word in SCALES:
        sds = {
            "force_scale": stated.force_gain_sd,
            "displacement_scale": stated.displacement_gain_sd,
            "joint_stiffness_error": stated.relative_sd,
        }
        return out | {w for w, sd in sds.items() if sd > _AS_LIKELY * max(sds.values())}
    if rig.mean_slope > 0 and _spring_part(rig) > LARGE_SPRING:
        out.add("joint_stiffness_error")
    return out


def _spring_part(rig: Rig) -> float:
    """rms of what the spring's error beyond its stated range does, over that of all that departs
    from the specimen's first slope."""
    k, stated = rig.stiffness, rig.stated
    near = np.clip(
        k,
        stated.stiffness * max(1 - WITHIN_SD * stated.relative_sd, 0.02),
        stated.stiffness * (1 + WITHIN_SD * stated.relative_sd),
    )
    if rig.by_force:
        wrong = (1 / k - 1 / near) * rig.force
        rest = rig.displacement - rig.force / k
    else:
        wrong = (k - near) * rig.displacement
        rest = rig.force - k * rig.displacement
    return float(wrong.std() / max(rest.std(), 1e-300))


def answers(word: str, form: str, rig: Rig, noise_mm: float, samples: int) -> dict[str, Any]:
    """JSON-able."""
    gap = float(np.sqrt(np.mean(structural(rig) ** 2)))
    before = rig.response(rig.force, rig.displacement) - rig.simulated()
    accept = sorted(accepted(word, rig))
    effect = word != "none"
    driven = "force" if rig.by_force else "displacement"
    return {
        "truth": [word],
        "verdict": word,
        "accept": accept,
        "accept_each": [accept],
        "forms": [form] if effect else [],
        "laws": ["foreign"] if effect else [],
        "parameters": [_parameters(word, rig)] if effect else [],
        "snr": gap / noise_mm if effect else 0.0,
        "snr_each": [gap / noise_mm] if effect else [],
        "noise_rms_mm": noise_mm,
        "structural_rms_mm": gap,
        "gap_before_rms_mm": float(before.std()),
        "design": f"bench, {driven} driven",
        "samples": samples,
        "directions": ["x"],
        "true_stiffness_N_per_mm": rig.stiffness,
        "imposed": driven,
        "where": {
            "directions": ["x"],
            "main_direction": "x",
            "poses": [],
            "joints": [],
            "seen_by_encoders": None,
        }
        if effect
        else None,
    }


def _parameters(word: str, rig: Rig) -> dict[str, Any]:
    """What the law was drawn with; lengths and forces of a trial's own units carry no unit.

    Shared with a diagnosis: the factor of a gain, the lag in seconds.
    """
    out = dict(rig.trial.parameters)
    if "lag_share" in out:
        out["lag_s"] = out["lag_share"] * float(rig.time[-1])
    if word in SCALES:
        out["factor"] = 1 + rig.off[word]
    return out
