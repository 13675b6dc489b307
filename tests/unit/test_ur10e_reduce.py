"""Blocks as the child makes them: count, mean, squares, modes; rotations near pi."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.stream import Block, pool
from drivers.ur10e.reduce import PLACES, Reduction, nearest_rotation
from drivers.ur10e.signals import SIGNALS, from_row

WIDTH = max(place.stop for place in PLACES.values())
Vector = tuple[float, float, float]


def rows(count: int, seed: int = 3) -> list[tuple[float, ...]]:
    values = np.random.default_rng(seed).normal(1e3, 1e-3, (count, WIDTH))
    values[:, PLACES["actual_TCP_pose"].start + 3 : PLACES["actual_TCP_pose"].stop] -= 1e3
    for name, mode in (("robot_mode", 7), ("safety_mode", 1), ("safety_status_bits", 1)):
        values[:, PLACES[name]] = mode
    values[:, PLACES["runtime_state"]] = 2
    return [tuple(row) for row in values.tolist()]


def reduced(reduction: Reduction) -> dict[str, Any]:
    """As the parent gets it: through JSON."""
    block: dict[str, Any] = json.loads(json.dumps(reduction.take()))["block"]
    return block


def test_mean_and_squares_far_from_zero() -> None:
    """A spread of 1e-3 at 1e3: sums of squares would have lost it."""
    data = rows(50)
    reduction = Reduction()
    for i, row in enumerate(data):
        reduction.add(10.0 + i, row)
    block = reduced(reduction)
    assert (block["start"], block["end"], block["count"]) == (10.0, 59.0, 50)
    assert block["mean"] == pytest.approx(np.mean(data, axis=0), rel=1e-14)
    assert block["m2"] == pytest.approx(np.var(data, axis=0) * 50, rel=1e-6, abs=1e-18)
    assert block["last"] == list(data[-1])
    assert block["modes"] == [[7, 1, 1, 2]]


def test_blocks_pool_to_the_whole() -> None:
    data = rows(30)
    blocks = []
    for part in (data[:7], data[7:8], data[8:]):
        reduction = Reduction()
        for row in part:
            reduction.add(0.0, row)
        b = reduced(reduction)
        blocks.append(Block(0.0, 0.0, b["count"], from_row(b["mean"]), from_row(b["m2"])))
    count, mean, sd = pool(blocks, len(SIGNALS))
    columns = [from_row(row) for row in data]
    assert count == 30
    assert mean == pytest.approx(np.mean(columns, axis=0), rel=1e-13)
    assert sd == pytest.approx(np.std(columns, axis=0, ddof=1), rel=1e-6, abs=1e-12)


def test_every_mode_that_occurred_is_told_even_if_it_lasted_one_value() -> None:
    reduction = Reduction()
    place = PLACES["safety_mode"].start
    for i, row in enumerate(rows(5)):
        reduction.add(0.0, (*row[:place], 3.0 if i == 2 else 1.0, *row[place + 1 :]))
    block = reduced(reduction)
    assert block["modes"] == [[7, 1, 1, 2], [7, 3, 1, 2]]


def test_span_and_emptiness() -> None:
    reduction = Reduction()
    assert reduction.span_s(5.0) == 0.0
    reduction.add(1.0, rows(1)[0])
    assert reduction.span_s(1.5) == 0.5
    reduction.take()
    assert reduction.span_s(9.0) == 0.0


def test_columns_carry_their_units_and_no_velocity() -> None:
    names = [s.name for s in SIGNALS]
    assert len(names) == len(set(names)) == 41
    assert names[:2] == ["controller_time_s", "q1_rad"]
    row = tuple(float(i) for i in range(WIDTH))
    values = dict(zip(names, from_row(row), strict=True))
    assert values["target_q6_rad"] == PLACES["target_q"].start + 5
    assert values["tcp_x_m"] == PLACES["actual_TCP_pose"].start
    assert not set(range(PLACES["actual_qd"].start, PLACES["actual_qd"].stop)) & set(
        values.values()
    )


# -- rotations


def matrix(rotation: tuple[float, ...]) -> np.ndarray:
    """Rodrigues' formula."""
    angle = math.hypot(*rotation)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = (v / angle for v in rotation)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: np.ndarray = np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k
    return turned


vectors = st.tuples(*[st.floats(-3.1, 3.1)] * 3)


@given(vectors, vectors)
def test_the_nearer_vector_is_the_same_attitude_and_never_farther(a: Vector, b: Vector) -> None:
    near = nearest_rotation(a, b)
    assert math.dist(a, near) <= math.dist(a, b)
    assert matrix(near) == pytest.approx(matrix(b), abs=1e-9)


def test_both_signs_of_pi_are_one_attitude() -> None:
    near = nearest_rotation((0.0, math.pi, 0.0), (0.0, -math.pi + 1e-4, 0.0))
    assert near == pytest.approx((0.0, math.pi + 1e-4, 0.0))
