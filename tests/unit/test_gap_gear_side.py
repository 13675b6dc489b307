"""Joints that are read on the other side of the gear than META states are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.answer.gear_side import read_elsewhere
from identification.gap.model.bench import make_bench
from tests.unit.test_gap_forms import arm_data


@pytest.mark.parametrize(
    ("stated", "share", "kinds"),
    [
        ("output", 1.0, []),
        ("output", 0.5, []),  # springs twice as stiff
        ("output", 4.0, []),  # one that yields
        ("output", 0.0, ["fault"]),
        ("motor", 0.0, []),
        ("motor", 1.0, ["remark"]),
        ("motor", 4.0, ["remark"]),
    ],
)
def test_readings_before_and_behind_the_gear(stated: str, share: float, kinds: list[str]) -> None:
    data = arm_data()
    lever = np.stack([s.lever for s in data.setups])[data.setup]
    turned = share * lever * data.compliance * data.force[:, None]
    q = turned + 1e-5 * np.random.default_rng(0).standard_normal(turned.shape)
    bench = make_bench(replace(data, q=q, output_encoder=stated == "output"))
    assert [n.kind for n in read_elsewhere(bench)] == kinds


def test_little_load_tells_no_side() -> None:
    data = arm_data()
    noise = 1e-3 * np.random.default_rng(0).standard_normal((len(data.force), data.joints))
    assert not read_elsewhere(make_bench(replace(data, q=noise)))
    assert not read_elsewhere(make_bench(replace(data, q=None)))
