"""What a data set says of stiffness: curves, k, pointwise k, knee, anisotropy; as JSON and text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, Protocol

from identification import stiffness as st
from identification.estimate import WEIGHTINGS, Weighting
from identification.uncertainty import Contribution, Quantity
from rig import schemas
from rig.analysis.coverage import Coverage, coverage
from rig.analysis.doubts import doubts
from rig.analysis.quality import Recorded
from rig.errors import InputError, close_to
from rig.protocol_before import protocol_before
from rig.reduce import curves
from rig.storage.files import legible
from rig.units import MM_PER_M, N_PER_MM

AUTO: Literal["auto"] = "auto"


@dataclass(frozen=True)
class Options:
    """weighting "auto": what suits the data (`identification.stiffness.default_choice`);
    intercept None: likewise. errors_in_variables goes with weighting "auto" only."""

    weighting: Weighting | Literal["auto"] = AUTO
    intercept: bool | None = None
    errors_in_variables: bool = False
    keep_after_knee: bool = False

    def estimator(self) -> st.Options:
        """The same for the identification; InputError where two wishes contradict each other."""
        weighting = None if self.weighting == AUTO else self.weighting
        if self.errors_in_variables:
            if weighting not in (None, "errors-in-variables"):
                raise InputError(
                    f"--weighting {weighting} and --errors-in-variables exclude each other: "
                    "errors in variables weight by the uncertainties of force and displacement. "
                    "Leave one of the two out."
                )
            weighting = "errors-in-variables"
        return st.Options(weighting, self.intercept, self.keep_after_knee)


def weighting(word: str) -> Weighting | Literal["auto"]:
    """The weighting that a word of the command line names; InputError for an unknown one."""
    if word == AUTO:
        return AUTO
    for known in WEIGHTINGS:
        if word == known:
            return known
    allowed = ", ".join((AUTO, *WEIGHTINGS))
    raise InputError(
        f'--weighting: "{word}" is not known.{close_to(word, (AUTO, *WEIGHTINGS))} '
        f"Allowed: {allowed}."
    )


class Source(Recorded, Protocol):
    """What is asked of a data set; `rig.dataset.Dataset` has it."""

    @property
    def uuid(self) -> str:
        """Of the data set."""

    @property
    def path(self) -> Any:
        """Where it lies, or None."""

    @property
    def texts(self) -> dict[str, str]:
        """`protocol` and others, as they were given."""

    @property
    def origin(self) -> str:
        """measured, emulated or imported."""

    @property
    def complete(self) -> bool:
        """Whether the measurement reached its end."""

    def banners(self) -> tuple[str, ...]:
        """What has to be said before anything else."""


@dataclass(frozen=True)
class Direction:
    """One pose and direction; pose "" without an arm. levels: what k rests on, None without k."""

    pose: str
    direction: str
    result: st.Stiffness
    levels: Coverage | None = None


@dataclass(frozen=True)
class Analysis:
    """directions: by the direction's name, or `pose/direction` where several poses have it.
    anisotropy: (a, b), two such names within a pose -> ratio of their k.
    notes: what makes the numbers doubtful, of the recording as a whole."""

    uuid: str
    name: str
    origin: str
    complete: bool
    banners: tuple[str, ...]
    directions: dict[str, Direction]
    anisotropy: dict[tuple[str, str], Quantity]
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Schema rig.analysis/1: units in the keys, null for what is not defined."""
        return {
            "schema": schemas.ANALYSIS,
            "dataset": self.uuid,
            "origin": self.origin,
            "complete": self.complete,
            "notes": list(self.notes),
            "directions": {key: _direction(d) for key, d in self.directions.items()},
            "anisotropy": {f"{a}/{b}": quantity(q) for (a, b), q in self.anisotropy.items()},
        }

    def to_text(self) -> str:
        """Banners, the answer in one sentence, then tables."""
        from rig.analysis.analyze_text import text

        return text(self)


def analyze(dataset: Source, options: Options | None = None) -> Analysis:
    """Everything at once. Data that define no stiffness give a status, not an error."""
    estimator = (options or Options()).estimator()
    results = {
        setup: st.analyze_curve(curve, estimator) for setup, curve in curves(dataset).items()
    }
    levels = coverage(dataset, protocol_before(dataset), results)
    found = {s: Direction(*s, result, levels.get(s)) for s, result in results.items()}
    keys = _keys(list(found))
    directions = {keys[setup]: d for setup, d in found.items()}
    anisotropy = {}
    for (key_a, a), (key_b, b) in combinations(directions.items(), 2):
        if a.pose == b.pose:
            ratio = st.ratio(a.result, b.result)
            if ratio is not None:
                anisotropy[key_a, key_b] = ratio
    name = legible(dataset.path.name) if dataset.path is not None else dataset.uuid
    return Analysis(
        dataset.uuid,
        name,
        dataset.origin,
        dataset.complete,
        dataset.banners(),
        directions,
        anisotropy,
        (*_partial(directions), *doubts(dataset)),
    )


def _partial(directions: dict[str, Direction]) -> tuple[str, ...]:
    """A sentence on every k that is not that of a whole curve."""
    told = (d.levels.doubt(key) for key, d in directions.items() if d.levels is not None)
    return tuple(filter(None, told))


def _keys(setups: Sequence[tuple[str, str]]) -> dict[tuple[str, str], str]:
    """The direction's name where it occurs in a single pose, else `pose/direction`."""
    names = [direction for _, direction in setups]
    return {
        (pose, direction): direction if names.count(direction) == 1 else f"{pose}/{direction}"
        for pose, direction in setups
    }


def quantity(q: Quantity | None, scale: float = 1.0) -> dict[str, Any]:
    """`{"value", "standard_uncertainty", "ci95"}`; nulls for what is undefined."""
    if q is None:
        return {"value": None, "standard_uncertainty": None, "ci95": [None, None]}
    return {
        "value": _number(q.value * scale),
        "standard_uncertainty": _number(q.u * scale),
        "ci95": [_number(edge * scale) for edge in q.interval],
        "degrees_of_freedom": _number(q.dof),
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _direction(d: Direction) -> dict[str, Any]:
    r = d.result
    return {
        "pose": d.pose or None,
        "direction": d.direction,
        "status": r.status,
        "status_text": r.sentence,
        "stiffness_N_per_mm": quantity(r.k, N_PER_MM),
        "levels": None if d.levels is None else d.levels.to_json(),
        "weighting": r.choice.label,
        "weighting_reason": r.choice_reason,
        "intercept_mm": _number(r.intercept * MM_PER_M),
        "by_repetition_N_per_mm": [_number(k * N_PER_MM) for k in r.by_repetition],
        "curve": [
            {
                "force_N": _number(p.force),
                "displacement_mm": _number(p.displacement * MM_PER_M),
                "sd_mm": _number(p.sd * MM_PER_M),
                "n": p.n,
                "branch": p.branch,
                "step": p.step,
            }
            for p in r.levels
        ],
        "pointwise": [
            {
                "force_N": _number(p.force),
                "stiffness_N_per_mm": _number(p.stiffness * N_PER_MM),
                "sd_N_per_mm": _number(p.sd * N_PER_MM),
                "n": p.n,
            }
            for p in r.pointwise
        ],
        "excluded": [
            {"step": e.step, "reason": e.reason, "repetition": e.repetition} for e in r.excluded
        ],
        "knee": _knee(r.knee),
        "hysteresis": _hysteresis(r),
        "budget": [_contribution(c) for c in r.budget],
        "alternatives": [
            {
                "weighting": a.choice.label,
                "steps": "all, also after the knee" if a.after_knee else "as counted",
                "stiffness_N_per_mm": _number(a.value * N_PER_MM),
                "standard_uncertainty_N_per_mm": _number(a.u * N_PER_MM),
            }
            for a in r.alternatives
        ],
        "notes": list(r.notes),
    }


def _knee(knee: st.Knee | None) -> dict[str, Any] | None:
    if knee is None:
        return None
    return {
        "force_N": quantity(knee.force),
        "displacement_mm": quantity(knee.displacement, MM_PER_M),
        "slope_before_N_per_mm": _number(knee.k_before * N_PER_MM),
        "slope_after_N_per_mm": _number(knee.k_after * N_PER_MM),
        "evidence_bic": _number(knee.evidence),
    }


def _hysteresis(r: st.Stiffness) -> dict[str, Any] | None:
    loop = r.hysteresis
    if loop is None:
        return None
    return {
        "area_N_mm": _number(loop.area * MM_PER_M),
        "sd_N_mm": _number(loop.sd * MM_PER_M),
        "share_of_work": _number(loop.relative),
        "remaining_mm": _number(loop.remaining * MM_PER_M),
        "n": loop.n,
    }


def _contribution(c: Contribution) -> dict[str, Any]:
    return {
        "name": c.name,
        "type": c.kind,
        "standard_uncertainty_N_per_mm": _number(c.u * N_PER_MM),
        "degrees_of_freedom": _number(c.dof),
        "counted": c.counted,
    }
