"""Forces across that go by no law, on an arm whose dynamometer read them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.arrays import Array
from identification.gap.data import GapData
from identification.gap.effects import library
from identification.gap.evidence.compare import Scored, marginal, score
from identification.gap.evidence.engine import Engine, eta_levels
from identification.gap.evidence.parts import Part
from identification.gap.explanations.explanation import explain, up_to_likeliest
from identification.gap.model.base import base_columns, prediction
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from tests.explained import explained
from tests.unit.test_gap_forms import arm_data

NOISE_N, NOISE_M = 0.1, 1e-6
SCALES = (0.03, 0.1, 0.25)  # of tangents, as the word has them


def eccentric(force: Array) -> Array:
    """(n, 2): the tip of a screw that is bent pulls another way with every part of a turn."""
    turn = 2 * np.pi * force / 61.0
    return np.column_stack([0.06 + 0.05 * np.sin(turn), 0.03 - 0.06 * np.cos(turn)])


def pushed(shares: Array) -> GapData:
    """Under a force across of shares (n, 2) of that along."""
    data = arm_data()
    lever = np.stack([s.lever for s in data.setups])[data.setup]
    sideways = np.stack([s.tangent_lever for s in data.setups])[data.setup]  # (n, 2, m)
    across = shares * data.force[:, None]
    torque = lever * data.force[:, None] + np.einsum("nk,nkm->nm", across, sideways)
    rng = np.random.default_rng(5)
    return replace(
        data,
        displacement=np.sum(lever * data.compliance * torque, axis=1)
        + rng.normal(0, NOISE_M, len(data.force)),
        q=None,
        tangential=across + rng.normal(0, NOISE_N, across.shape),
    )


def engine_of(data: GapData) -> tuple[Engine, list[Variant]]:
    bench = make_bench(data)
    base, target = base_columns(bench), bench.observed - prediction(bench)
    variants = library(bench, ["load_misalignment", "joint_stiffness_error"])
    return Engine(bench, base, target, eta_levels(bench, base, target)), variants


def as_read(variants: list[Variant]) -> Variant:
    return next(v for v in variants if v.info.get("as_read"))


def test_a_tip_that_goes_round_is_followed_as_it_was_read() -> None:
    data = pushed(eccentric(arm_data().force))
    found = explained(data)
    assert found.verdict == "load_misalignment"
    assert found.fit.parts[0].variant.info.get("as_read")
    assert found.after < 1.2 * found.noise
    top = np.abs(data.force) > 0.9 * np.abs(data.force).max()
    for name, given in found.effects[0].parameters.items():
        _, direction, k = name.split("_")
        mine = top & np.array([s.direction == direction for s in data.setups])[data.setup]
        assert given.value == pytest.approx(
            eccentric(data.force[mine])[:, int(k) - 1].mean(), abs=0.01
        )
        assert given.high - given.low < 0.05


def test_what_goes_by_a_law_is_said_by_it() -> None:
    """So many free loads cost more than a few tangents."""
    found = explained(pushed(np.tile([0.08, -0.05], (len(arm_data().force), 1))))
    assert found.verdict == "load_misalignment"
    assert not found.fit.parts[0].variant.info.get("as_read")


def test_its_cost_is_that_of_a_load_of_its_own_for_every_hold() -> None:
    engine, variants = engine_of(pushed(eccentric(arm_data().force)))
    bench: Bench = engine.bench
    assert bench.rows.tangential is not None
    read = bench.rows.hold_means(bench.rows.tangential)
    load = np.abs(bench.rows.hold_means(bench.load))[:, None]
    sd = (bench.noise.force / np.sqrt(bench.rows.hold_weight[bench.rows.edges]))[:, None]
    each = []
    for scale in SCALES:  # log of N(read; 0, sd^2 + (scale load)^2) over N(0; 0, sd^2)
        wide = np.hypot(sd, scale * load)
        each.append(float(np.sum(-((read / wide) ** 2) / 2 - np.log(wide / sd))))
    expected = -np.log(np.mean(np.exp(np.array(each) - max(each)))) - max(each)
    assert as_read(variants).cost == pytest.approx(expected)
    assert expected > 100


def test_the_cost_is_paid_beside_another_effect_whichever_comes_first() -> None:
    engine, variants = engine_of(pushed(eccentric(arm_data().force)))
    askew = as_read(variants)
    springs = next(v for v in variants if v.word == "joint_stiffness_error")

    def weight(first: Variant, second: Variant) -> float:
        levels, energy = up_to_likeliest(engine, (Part(first, first.scales[0]),))
        scored: list[Scored] = score(
            engine, levels, [replace(second, scales=second.scales[:1])], energy
        )
        parts = (Part(first, first.scales[0]), Part(second, second.scales[0]))
        return explain(engine, parts, marginal(scored), energy).log_weight

    assert weight(askew, springs) == pytest.approx(weight(springs, askew), abs=1.0)


@pytest.mark.parametrize("softer", [0.92, 1.08])
def test_a_tangent_is_known_as_well_as_the_springs_that_it_is_seen_through(softer: float) -> None:
    """Pushed along x, joint 1 is turned by what goes across alone: the softer it is, the further,
    and the dynamometer knows that only as well as it keeps its axes apart."""
    data = only_first_setup(arm_data())
    (setup,) = data.setups
    push = np.array([0.07, -0.04])
    true = data.compliance * np.array([softer, *np.ones(data.joints - 1)])
    torque = data.force[:, None] * (setup.lever + push @ setup.tangent_lever)
    rng = np.random.default_rng(5)
    found = explained(
        replace(
            data,
            displacement=torque * true @ setup.lever + rng.normal(0, NOISE_M, len(torque)),
            q=true * torque + rng.normal(0, 5e-6, torque.shape),
            tangential=push * data.force[:, None] + rng.normal(0, NOISE_N, (len(torque), 2)),
        )
    )
    assert found.verdict == "load_misalignment"
    parameters = found.effects[0].parameters
    for name, truth in zip(("tangent_x_1", "tangent_x_2"), push.tolist(), strict=True):
        assert parameters[name].low < truth < parameters[name].high


def only_first_setup(data: GapData) -> GapData:
    mine = data.setup == 0
    names = ("time", "run", "setup", "repetition", "branch", "step", "force", "displacement")
    session = None if data.session is None else data.session[mine]
    return replace(
        data,
        setups=data.setups[:1],
        session=session,
        **{name: getattr(data, name)[mine] for name in names},
    )
