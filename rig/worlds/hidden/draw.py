"""Draws measurements with hidden effects: `draw_case(seed, number)`.

Gives what an experimenter would have (a table and its META) and, apart from it, the answers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.arrays import Array
from rig.errors import InputError, close_to
from rig.worlds.hidden import channel_laws, joint_laws, label, outer_laws, unmodelled_laws
from rig.worlds.hidden.design import DESIGNS, draw_plan
from rig.worlds.hidden.effect import Drawn, Effect, Form, Unsuited
from rig.worlds.hidden.gap import rms, structural_gap
from rig.worlds.hidden.noise import draw_noise, noise_rms_mm
from rig.worlds.hidden.scene import Scene, make_scene
from rig.worlds.hidden.table import columns_of, meta_of
from rig.worlds.hidden.words import EFFECTS, ON_THE_CLOCK, WORDS

__all__ = ["WORDS", "HiddenCase", "draw_case"]

SNR = (1.5, 60.0)
_SHARE_NONE, _SHARE_UNKNOWN, _SHARE_MIXTURE = 0.1, 0.1, 0.2
_LEAST_MIXTURE = 4.0  # structural gap over noise in which two effects can both be seen
_TRIES = 60  # of plan and effect until the size asked for is physical

FORMS: dict[str, tuple[Form, ...]] = (
    joint_laws.FORMS | outer_laws.FORMS | channel_laws.FORMS | unmodelled_laws.FORMS
)


@dataclass(frozen=True)
class HiddenCase:
    """A measurement (columns of a table, META) and its answers (`label`, JSON-able)."""

    name: str
    columns: dict[str, NDArray[Any]]
    meta: dict[str, Any]
    label: dict[str, Any]


def draw_case(
    seed: int,
    number: int,
    *,
    word: str | None = None,
    design: str | None = None,
    laws: str | None = None,
    second: str | None = None,
    snr: tuple[float, float] | None = None,
) -> HiddenCase:
    """Case `number` of the campaign `seed`; the same arguments give the same case.

    `word` and `second` (a mixture) name the effects, `design` is rich, medium or paper, `laws` is
    "fitted" or "foreign" (a word without such a law takes what it has), `snr` bounds the ratio of
    the structural gap's rms to the noise's. Raises InputError for a name nobody knows.
    """
    _check(word, second, design, laws)
    chooser = np.random.default_rng([seed, number, 0])
    words = _words(chooser, word, second)
    for attempt in range(_TRIES):
        random = np.random.default_rng([seed, number, 1, attempt])
        scene = make_scene(_plan_for(random, design, words), random)
        case = _try_case(scene, random, words, laws, snr or SNR)
        if case is not None:
            columns, answers = case
            return HiddenCase(f"s{seed}-{number:04d}", columns, meta_of(scene), answers)
    raise InputError(
        f"snr: {snr} is out of reach for {' and '.join(words)} within physical sizes; "
        "allowed: about 1.5 to 60. Widen the range."
    )


def _check(word: str | None, second: str | None, design: str | None, laws: str | None) -> None:
    for name, value, allowed in (
        ("word", word, WORDS),
        ("second", second, EFFECTS),
        ("design", design, DESIGNS),
        ("laws", laws, ("fitted", "foreign")),
    ):
        if value is not None and value not in allowed:
            known = ", ".join(allowed)
            raise InputError(
                f'{name}: "{value}" is not known; allowed: {known}.{close_to(value, allowed)}'
            )
    if second is not None and word in ("none", "unknown"):
        raise InputError(
            f'second: "{second}" cannot stand beside the word "{word}"; '
            "name an effect as word, or leave second out."
        )


def _words(random: Generator, word: str | None, second: str | None) -> tuple[str, ...]:
    if word is not None:
        return (word,) if second is None else (word, second)
    if second is not None:
        return (str(random.choice([w for w in EFFECTS if w != second])), second)
    kind = random.random()
    if kind < _SHARE_NONE:
        return ("none",)
    if kind < _SHARE_NONE + _SHARE_UNKNOWN:
        return ("unknown",)
    count = 2 if kind < _SHARE_NONE + _SHARE_UNKNOWN + _SHARE_MIXTURE else 1
    return tuple(str(w) for w in random.choice(EFFECTS, count, replace=False))


def _plan_for(random: Generator, design: str | None, words: tuple[str, ...]) -> Any:
    plan = draw_plan(random, design)
    if ON_THE_CLOCK.intersection(words):
        plan = replace(plan, recorded=replace(plan.recorded, session=True))
    return plan


def _try_case(
    scene: Scene,
    random: Generator,
    words: tuple[str, ...],
    laws: str | None,
    snr: tuple[float, float],
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
    noise = draw_noise(scene, random)
    floor = noise_rms_mm(scene, noise)
    warmth = _warmth(scene, random)
    least = snr[0] if len(words) == 1 else max(snr[0], min(_LEAST_MIXTURE, snr[1] / 1.5))
    wanted = float(np.exp(random.uniform(np.log(least), np.log(snr[1]))))
    effects: list[tuple[Effect, float]] = []
    if words != ("none",):
        try:
            effects = _sized(scene, random, words, laws, wanted * floor)
        except Unsuited:
            return None
    answers = label.answers(scene, effects, floor)
    if answers is None:
        return None
    if effects and not 0.98 * snr[0] <= answers["snr"] <= 1.02 * snr[1]:
        return None
    changes = [effect.change(size) for effect, size in effects]
    return columns_of(scene, changes, noise, warmth), answers


def _sized(
    scene: Scene, random: Generator, words: tuple[str, ...], laws: str | None, gap_mm: float
) -> list[tuple[Effect, float]]:
    """Effects with sizes whose structural gap together is about `gap_mm` rms. What turns the load
    comes first: mechanisms answer to the torques that are there with it."""
    shares = [1.0]
    if len(words) == 2:
        tilt = float(np.exp(random.uniform(np.log(0.5), np.log(2.0))))
        shares = [tilt / np.hypot(1, tilt), 1 / np.hypot(1, tilt)]
    out = []
    for word, share in sorted(zip(words, shares, strict=True), key=lambda one: _answers(one[0])):
        effect = _draw_effect(scene, random, word, laws)
        out.append((effect, _solve(scene, effect, share * gap_mm)))
        if not _answers(word):
            scene = replace(scene, turned=effect.change(out[-1][1]))
    return out


def _answers(word: str) -> bool:
    """Whether it answers to the torques, or goes beside them, rather than turning the load."""
    return word not in ("pose_error", "load_misalignment")


def _draw_effect(scene: Scene, random: Generator, word: str, laws: str | None) -> Effect:
    forms = FORMS[word]
    if laws is not None and word != "unknown":
        forms = tuple(f for f in forms if f.fitted == (laws == "fitted")) or forms
    form = forms[int(random.integers(len(forms)))]
    drawn: Drawn = form.draw(scene, random)
    return Effect(
        word=word,
        form=form.name,
        fitted=form.fitted,
        change=drawn.change,
        parameters=drawn.parameters,
        sizes=drawn.sizes,
        joints=drawn.joints,
        onset_N=drawn.onset_N,
    )


def _solve(scene: Scene, effect: Effect, gap_mm: float) -> float:
    """The size whose gap alone is `gap_mm` rms, by bisection; Unsuited when out of bounds."""

    def size_of(log_size: float) -> float:
        return rms(structural_gap(scene, [effect.change(float(np.exp(log_size)))]))

    low, high = np.log(effect.sizes[0]), np.log(effect.sizes[1])
    if size_of(high) < gap_mm or size_of(low) > gap_mm:
        raise Unsuited
    for _ in range(14):
        middle = 0.5 * (low + high)
        if size_of(middle) < gap_mm:
            low = middle
        else:
            high = middle
    return float(np.exp(0.5 * (low + high)))


def _warmth(scene: Scene, random: Generator) -> Array:
    """(m, 6) joint temperatures deg C: warmed up, or still warming."""
    time = scene.history.time[scene.history.sample]
    rise = random.choice([0.0, random.uniform(0.5, 6.0)])
    warm = 27.0 + 0.7 * np.arange(6) - rise * np.exp(-time / random.uniform(900, 3000))[:, None]
    return np.asarray(np.round(warm + 0.05 * random.standard_normal((len(time), 6)), 2))
