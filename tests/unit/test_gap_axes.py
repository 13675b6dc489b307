"""Axes along which a force acts, and springs by number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.gap.effects import force_scale, library
from identification.gap.model.base import Base
from identification.gap.model.bench import make_bench
from tests.unit.test_gap_forms import arm_data


def test_the_last_digit_of_a_direction_says_nothing() -> None:
    data = arm_data()
    off = tuple(replace(s, unit_vector=s.unit_vector + 6e-17) for s in data.setups)
    labels = [
        [v.label for v in force_scale.variants(make_bench(d))]
        for d in (data, replace(data, setups=off))
    ]
    assert labels[0] == labels[1]
    assert "gain of x" in labels[0]


def test_pushes_through_the_axes_of_a_mount_do_not_turn_it() -> None:
    data = arm_data(directions="z")
    through = tuple(replace(s, moment=np.zeros(3)) for s in data.setups)
    assert library(make_bench(data), ["base_compliance"])
    assert not library(make_bench(replace(data, setups=through)), ["base_compliance"])


def test_the_first_spring_is_not_the_tenth() -> None:
    base = Base(np.ones((1, 3)), np.ones(3), ("spring1", "spring10", "tare x"))
    assert base.index("spring1") == [0]
    assert base.index("spring") == [0, 1]
