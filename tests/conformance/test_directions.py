"""Rigs without an arm that are pushed along several directions, each on a part of its own: the same
trouble in all of them is one word, two troubles in two of them are two."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from identification.gap.answer.result import GapResult
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import TOP_N, Array, Design, imported, meta, noisy
from tests.explained import explained

RIG = Design(repetitions=2, hold=3, arm=False)
META = meta(RIG).replace("{x: 95.0}", "{x: 95.0, y: 92.0}")
STROKE = {d: top / 9.3e4 for d, top in TOP_N.items()}  # m
# rows, and their share of the load -> share of the stroke
Part = Callable[[pd.DataFrame, Array], Array]


def diagnosed(only: str = "xy", **parts: Part) -> GapResult:
    """parts: direction -> what is added along it. only: directions that were measured."""

    def law(rows: pd.DataFrame, _: Array) -> tuple[Array, Array]:
        more = np.zeros(len(rows))
        for d, part in parts.items():
            mine = (rows.direction == d).to_numpy()
            share = rows["force_N"].to_numpy()[mine] / TOP_N[d]
            more[mine] = STROKE[d] * part(rows[mine], share)
        return more, np.zeros((len(rows), 6))

    rows = noisy(RIG, law)
    return explained(gap_data(imported(rows[rows.direction.isin(list(only))], META)))


def softens(_: pd.DataFrame, share: Array) -> Array:
    return np.asarray(0.5 * (np.tan(0.8 * share) / 0.8 - share))


def rubs(_: pd.DataFrame, share: Array) -> Array:
    """Holds back, and leaves the turns as an exponential; from run to run as it was left."""
    out, z, at = np.zeros(len(share)), 0.0, 0.0
    for i, x in enumerate(share.tolist()):
        z += (np.sign(x - at) - z) * (1 - np.exp(-abs(x - at) / 0.15))
        out[i], at = -0.03 * z, x
    return out


def creeps(rows: pd.DataFrame, share: Array) -> Array:
    """Two times, 8 and 60 s."""
    out, time = np.zeros(len(share)), rows["session_s"].to_numpy()
    for part, T in ((0.03, 8.0), (0.05, 60.0)):
        z, at = 0.0, time[0]
        for i, t in enumerate(time):
            z += (share[i] - z) * (1 - np.exp(-(t - at) / T))
            out[i] += part * z
            at = t
    return out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "word"),
    [
        pytest.param(softens, "joint_nonlinear_stiffness", marks=pytest.mark.slow),
        (rubs, "joint_hysteresis"),
    ],
)
def test_the_same_trouble_in_every_direction_is_one_word(part: Part, word: str) -> None:
    found = diagnosed(x=part, y=part)
    assert found.verdict == word
    assert [e.name for e in found.effects] == [word, word]
    assert {place for e in found.effects for place in e.places} == {"direction x", "direction y"}
    assert found.where.directions == ("x", "y")
    assert found.after < 1.2 * found.noise


@pytest.mark.slow
def test_two_troubles_in_two_directions_are_two() -> None:
    found = diagnosed(x=softens, y=creeps)
    assert {e.name: set(e.places) for e in found.effects} == {
        "joint_nonlinear_stiffness": {"direction x"},
        "joint_creep": {"direction y"},
    }
    assert found.after < 1.2 * found.noise


def test_what_one_direction_shows_is_not_said_of_the_other() -> None:
    found = diagnosed(y=softens)
    assert [e.name for e in found.effects] == ["joint_nonlinear_stiffness"]
    assert found.effects[0].places == {"direction y": pytest.approx(1)}
    assert found.where.directions == ("y",)


def test_a_direction_that_was_never_measured_is_no_place() -> None:
    found = diagnosed(only="x", x=softens)
    assert [e.name for e in found.effects] == ["joint_nonlinear_stiffness"]
    assert found.effects[0].places == {}  # there is but one
