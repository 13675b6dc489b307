"""Loads that are askew by another angle in every pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.model.bench import make_bench
from tests.explained import explained
from tests.slow import slow_ones
from tests.unit.test_gap_forms import arm_data

ANGLES = np.array([[0.1, -0.08], [0.05, 0.12], [-0.13, 0.02], [0.03, -0.1]])  # tangents, by setup


def askew() -> GapData:
    data = arm_data()
    lever = np.stack([s.lever for s in data.setups])[data.setup]
    across = np.stack([t @ s.tangent_lever for t, s in zip(ANGLES, data.setups, strict=True)])
    torque = (lever + across[data.setup]) * data.force[:, None]
    q = data.compliance * torque
    rng = np.random.default_rng(4)
    n = len(data.force)
    return replace(
        data,
        displacement=np.sum(lever * q, axis=1) + rng.normal(0, 1e-6, n),
        q=q + rng.normal(0, 1e-5, q.shape),
        tangential=ANGLES[data.setup] * data.force[:, None] + rng.normal(0, 0.1, (n, 2)),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "recorded",
    slow_ones(("both", "force across", "joint readings"), ("force across", "joint readings")),
)
def test_what_is_set_up_anew_in_every_pose_may_be_askew_otherwise_there(recorded: str) -> None:
    data = askew()
    data = replace(
        data,
        tangential=None if recorded == "joint readings" else data.tangential,
        q=None if recorded == "force across" else data.q,
    )
    found = explained(data)
    assert found.verdict == "load_misalignment"
    assert found.fit.parts[0].variant.label.startswith("each pose")
    given = {name: p.value for name, p in found.effects[0].parameters.items()}
    for k, setup in enumerate(data.setups):
        for i in (0, 1):
            name = f"tangent_{setup.direction}_{setup.pose}_{i + 1}"
            assert given[name] == pytest.approx(ANGLES[k, i], abs=0.02)


def test_of_a_target_alone_nobody_tells_in_which_pose_it_is_askew() -> None:
    data = replace(askew(), tangential=None, q=None)
    labels = [v.label for v in library(make_bench(data), ["load_misalignment"])]
    assert labels
    assert not any("each pose" in label for label in labels)
