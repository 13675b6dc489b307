"""In which joint a mechanism is likelier: troubles are a share of what a joint gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identification.gap.effects import library
from identification.gap.evidence.compare import log_prior_of_joint, score
from identification.gap.evidence.engine import Engine
from identification.gap.model.base import base_columns
from identification.gap.model.bench import Bench, make_bench
from tests.conformance.gap_designs import linear


@pytest.fixture(scope="module")
def bench() -> Bench:
    return make_bench(linear("medium"))


def test_a_joint_that_gives_more_is_likelier_by_the_root_of_it(bench: Bench) -> None:
    gives = np.abs(bench.lever * bench.elastic).max(axis=0)
    nats, moving = bench.joint_log_priors, bench.moving_joints()
    a, b, *_ = sorted(moving, key=lambda j: -gives[j])
    assert nats[a] - nats[b] == pytest.approx(0.5 * np.log(gives[a] / gives[b]))
    assert np.exp(nats[moving]).mean() == pytest.approx(1.0)  # no word is likelier for it
    still = [j for j in range(bench.data.joints) if j not in moving]
    assert nats[still].tolist() == [0.0] * len(still)


def test_of_a_rig_without_an_arm_no_direction_is_likelier(bench: Bench) -> None:
    without = replace(bench, data=replace(bench.data, arm=False))
    assert not without.joint_log_priors.any()


def test_it_is_part_of_the_score_of_mechanisms_of_one_joint(bench: Bench) -> None:
    """Where nothing is measured shapes differ by their priors, and by that."""
    words = ("joint_nonlinear_stiffness", "joint_stiffness_error")
    variants = library(bench, words)
    engine = Engine(bench, base_columns(bench), np.zeros(bench.layout.size), np.array([0.0, 3e-6]))
    counted = {v: log_prior_of_joint(engine, v) for v in variants}
    assert all(counted[v] == 0.0 for v in variants if v.word == words[1])
    assert any(counted[v] < 0 for v in variants)
    assert any(counted[v] > 0 for v in variants)
    even = replace(bench, data=bench.data)
    object.__setattr__(even, "joint_log_priors", np.zeros(bench.data.joints))
    plain = Engine(even, base_columns(bench), engine.target, engine.etas)
    for one, other in zip(
        score(engine, engine.levels, variants), score(plain, plain.levels, variants), strict=True
    ):
        more = one.log_evidence - other.log_evidence
        assert more == pytest.approx(counted[one.variant], abs=1e-9)
