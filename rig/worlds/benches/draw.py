"""Draws measurements of single compliances on benches: `draw_case(seed, number)`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.errors import InputError, close_to
from rig.worlds.benches import channels, curves, loops, metals, strange, viscous
from rig.worlds.benches.imperfect import imperfect
from rig.worlds.benches.label import answers, structural
from rig.worlds.benches.rig import Rig, make_rig
from rig.worlds.benches.sensors import columns_of, meta_of, noise_rms_mm, read
from rig.worlds.benches.trial import SCALES, WORDS, Form, log_uniform

__all__ = ["EFFECTS", "FORMS", "WORDS", "BenchCase", "draw_case"]

FORMS: dict[str, tuple[Form, ...]] = (
    metals.FORMS | loops.FORMS | viscous.FORMS | curves.FORMS | channels.FORMS | strange.FORMS
)
EFFECTS = tuple(w for w in WORDS if w not in ("none", "unknown"))
LEAST_SNR = 3.0
_SNR = {"clean": (4.0, 300.0), "bent": (8.0, 9000.0)}  # structural gap over noise
_NOISE_SHARE = (1e-6, 0.02)  # of the response's range
_STRAIGHT_SHARE = (1e-4, 0.01)
_TRIES = 40
# How often each word is drawn: as benches meet them.
_WEIGHTS = {
    "joint_yield": 14,
    "joint_hysteresis": 17,
    "joint_creep": 12,
    "joint_nonlinear_stiffness": 12,
    "joint_backlash": 6,
    "contact_seating": 5,
    "force_drift": 4,
    "thermal_drift": 4,
    "time_lag": 3,
    "zero_shift": 2,
    "force_scale": 1,
    "displacement_scale": 1,
    "joint_stiffness_error": 2,
    "none": 6,
    "unknown": 11,
}


@dataclass(frozen=True)
class BenchCase:
    """A measurement (columns of a table, META) and its answers (`label`, JSON-able)."""

    name: str
    columns: dict[str, NDArray[Any]]
    meta: dict[str, Any]
    label: dict[str, Any]


def draw_case(
    seed: int, number: int, *, word: str | None = None, form: str | None = None
) -> BenchCase:
    """Case `number` of the campaign `seed`; the same arguments give the same case.

    word: one of WORDS; form: one of its laws by name. Laws are drawn anew until the gap is at
    least three times the noise. InputError for a name nobody knows.
    """
    _check(word, form)
    chooser = np.random.default_rng([seed, number, 6])
    if word is None:
        share = np.array([_WEIGHTS[w] for w in WORDS], dtype=float)
        word = str(chooser.choice(WORDS, p=share / share.sum()))
    laws = [f for f in FORMS[word] if form in (None, f.name)]
    if not laws:
        known = ", ".join(f.name for f in FORMS[word])
        raise InputError(f'form: "{form}" is no law of {word}; allowed: {known}.')
    law = laws[int(chooser.integers(len(laws)))]
    for attempt in range(_TRIES):
        random = np.random.default_rng([seed, number, 7, attempt])
        case = _try_case(f"b{seed}-{number:04d}", law, word, random)
        if case is not None:
            return case
    raise InputError(
        f"{law.name}: no gap of {LEAST_SNR:g} times the noise in {_TRIES} draws "
        f"(seed {seed}, number {number}). Take another seed."
    )


def _check(word: str | None, form: str | None) -> None:
    if word is not None and word not in WORDS:
        raise InputError(
            f'word: "{word}" is not known; allowed: {", ".join(WORDS)}.{close_to(word, WORDS)}'
        )
    if form is not None and word is None:
        raise InputError(f'form: "{form}" stands without its word; name the word as well.')


def _try_case(name: str, law: Form, word: str, random: Generator) -> BenchCase | None:
    rig = make_rig(law, word, imperfect(law.draw(random), random), random)
    readings = read(rig, _noise_mm(word, rig, random), random)
    noise = noise_rms_mm(rig, readings)
    columns = columns_of(rig, readings, random)
    label = answers(word, law.name, rig, noise, len(columns["force_N"]))
    if word != "none" and label["snr"] < LEAST_SNR:
        return None
    return BenchCase(name, columns, meta_of(rig, readings, random), label)


def _noise_mm(word: str, rig: Rig, random: Generator) -> float:
    """rms of the noise in the response: the gap over a ratio, within what sensors can do; of a
    straight spring a share of its range."""
    response = rig.response(rig.force, rig.displacement)
    span = float(np.ptp(response))
    if word in SCALES or word == "none":
        return span * log_uniform(random, *_STRAIGHT_SHARE)
    gap = float(np.sqrt(np.mean(structural(rig) ** 2)))
    wanted = gap / log_uniform(random, *_SNR["clean" if rig.trial.clean else "bent"])
    return min(max(wanted, _NOISE_SHARE[0] * span), _NOISE_SHARE[1] * span)
