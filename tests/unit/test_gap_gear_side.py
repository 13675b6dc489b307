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
        ("output", np.pi / 180, ["fault"]),
        ("output", -1.0, ["fault"]),
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
    said = read_elsewhere(bench)
    assert [n.kind for n in said] == kinds
    asks = {0.0: "before the gear?", np.pi / 180: "unit", -1.0: "signs"}.get(share, "")
    assert all(asks in n.text for n in said)
    loosely = replace(data, q=q, compliance_relative_sd=np.full(6, 20.0))  # springs of any size
    assert share in (0.0, -1.0) or not any(
        n.kind == "fault" for n in read_elsewhere(make_bench(loosely))
    )


def test_little_load_tells_no_side() -> None:
    data = arm_data()
    noise = 1e-3 * np.random.default_rng(0).standard_normal((len(data.force), data.joints))
    assert not read_elsewhere(make_bench(replace(data, q=noise)))
    assert not read_elsewhere(make_bench(replace(data, q=None)))
