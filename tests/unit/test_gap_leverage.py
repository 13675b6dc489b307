"""Where arm and tool stand, when they are so far off that the squares of the levers decide."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identification.arm import tool_offset
from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.effects.pose_error import refined
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.explanations import several
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import make_bench
from rig.models.robot import load_robot
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data

POSES = {
    "P1": [0.256, -1.664, -1.684, -1.365, 1.571, -1.336],
    "P2": [0.554, -1.480, -1.948, -1.284, 1.371, -1.036],
}
TCP = np.array([0.0, 0.0, 0.1])
NOISE_M, NOISE_RAD = 2e-6, 2e-5
SOFTER = np.array([0.12, -0.08, 0.05, 0.15, -0.07, 0.0])  # compliance, over what is simulated
TOOL = np.array([0.107, 0.035, 0.045])
JOINT = np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])
TURN = np.array([0.05, -0.1, 0.14])


def with_dwell_means(tool: Array, joints: Array, turn: Array) -> GapData:
    """Pushed where its tool, its joints and its base really are, exact in the levers; the readings
    show where the joints stand."""
    data, arm = arm_data(), load_robot("ur10e")
    angle = float(np.linalg.norm(turn)) or 1.0
    E = np.cross(turn / angle, np.eye(3)).T
    back = np.eye(3) - np.sin(angle) * E + (1 - np.cos(angle)) * E @ E
    back = back if turn.any() else np.eye(3)
    lever = np.stack(
        [
            arm.jacobian(np.array(POSES[s.pose]) + joints, tool_offset(TCP + tool))[:3].T
            @ back
            @ s.unit_vector
            for s in data.setups
        ]
    )[data.setup]
    q = data.compliance * (1 + SOFTER) * lever * data.force[:, None]
    rng, n = np.random.default_rng(8), len(data.force)
    return replace(
        data,
        displacement=np.sum(lever * q, axis=1) + rng.normal(0, NOISE_M, n),
        q=q + joints + rng.normal(0, NOISE_RAD, q.shape),
        tangential=None,
        compliance_relative_sd=np.full(6, 0.1),
    )


@pytest.mark.parametrize(
    ("label", "at"),
    [
        ("tool 40 mm", (TOOL, JOINT * 0, TURN * 0)),
        ("tool 150 mm", (-2 * TOOL, JOINT * 0, TURN * 0)),
        ("tool 150 mm, joints 0.05 rad", (-2 * TOOL, JOINT, TURN * 0)),
        ("joints 0.06 rad", (TOOL * 0, JOINT, TURN * 0)),
        ("base 0.17 rad", (TOOL * 0, JOINT * 0, TURN)),
    ],
)
def test_what_is_far_off_is_found_where_it_is(label: str, at: tuple[Array, Array, Array]) -> None:
    bench = make_bench(with_dwell_means(*at))
    base, target = base_columns(bench), bench.observed - prediction(bench)
    engine = Engine(bench, base, target, eta_levels(bench, base, target))
    start = next(v for v in library(bench, ["pose_error"]) if v.label == label)
    found = refined(engine, start)
    assert found.label == f"{label}, as they are"
    np.testing.assert_allclose(found.info["offset_m"], at[0], atol=4e-3)
    np.testing.assert_allclose(found.info["angles_rad"], at[1], atol=1e-3)
    np.testing.assert_allclose(found.info["turn_rad"], at[2], atol=6e-3)
    softer = found.info["compliance"] / bench.compliance - 1
    np.testing.assert_allclose(softer[:5], SOFTER[:5], atol=0.03)


@pytest.mark.slow
def test_a_tool_far_off_asks_nothing_of_springs_and_gains() -> None:
    found = explained(with_dwell_means(TOOL, JOINT * 0, TURN * 0))
    assert found.verdict == "pose_error"
    assert found.after < 1.1 * found.noise
    pulls = found.fit.pulls[: len(found.engine.base.names)]
    assert np.abs(pulls).max() < 3
    given = found.effects[0].parameters
    assert [given[f"offset_{a}"].value for a in "xyz"] == pytest.approx(TOOL * 1e3, abs=3)


def test_every_part_is_polished_whatever_order_better_ones_stand_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def family(_: Any, word: str, __: Any) -> str:
        asked.append(word)
        return word

    def better(_: Any, rest: tuple[Any, ...], word: str, *__: Any) -> Any:
        parts = SimpleNamespace(word=word), *rest[::-1]
        return SimpleNamespace(parts=parts, log_weight=float(len(asked)))

    for name, does in {
        "up_to_likeliest": lambda *_: ([], 0.0),
        "family_of": family,
        "score": lambda engine, levels, word, energy: word,
        "joined": better,
    }.items():
        monkeypatch.setattr(several, name, does)
    start: Any = SimpleNamespace(
        parts=tuple(SimpleNamespace(word=w) for w in "abc"), log_weight=0.0
    )
    several.polished(None, (), start)  # type: ignore[arg-type]
    assert asked == ["a", "b", "c"]
