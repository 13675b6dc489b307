"""A screw that is turned, or an arm that is touched, while a level is sampled."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.interfaces import LiveView
from rig.procedure.touched import Touched
from rig.protocol import parse_protocol
from tests.unit.runner_bench import ALL, PROTOCOL, Bench, at

LONG = PROTOCOL.replace("hold_s: 0", "hold_s: 20")
SETTLE = parse_protocol(PROTOCOL, Path("test.yaml")).settle  # rest: 0.01 mm; seconds: 2
BAND_N = 0.5


def first_word(path: list[tuple[float, float, float]]) -> str:
    touched = Touched(SETTLE, BAND_N)
    return next((text for point in path if (text := touched.look(*point))), "")


def ramp(force_N_per_s: float, mm_per_s: float, seconds: float) -> list[tuple[float, float, float]]:
    times = [0.1 * i for i in range(int(10 * seconds))]
    return [(t, 40 + force_N_per_s * t, 0.4 + mm_per_s * t) for t in times]


@pytest.mark.parametrize(
    ("force_N_per_s", "mm_per_s", "seconds"),
    [
        (-5.0, 0.05, 30),  # creeps or gives way: the force relaxes
        (5.0, -0.05, 30),  # comes back after unloading
        (0.01, 0.001, 600),  # drifts of the amplifier and of the laser
        (5.0, 0.001, 5),  # the force alone: no screw does that
        (0.2, 0.05, 20),  # the displacement alone
    ],
)
def test_what_a_resting_screw_allows_is_data(
    force_N_per_s: float, mm_per_s: float, seconds: float
) -> None:
    assert not first_word(ramp(force_N_per_s, mm_per_s, seconds))


def test_force_and_displacement_that_go_the_same_way_were_moved() -> None:
    up = first_word(ramp(5.0, 0.05, 5))
    assert up == "the force rose from 40 to 41.5 N, and the displacement with it by 0.015 mm"
    down = first_word(ramp(-100.0, -1.0, 1))
    assert down == "the force fell from 40 to 30 N, and the displacement with it by 0.1 mm"


def test_a_screw_that_is_turned_while_a_level_is_sampled_costs_the_level(tmp_path: Path) -> None:
    bench = Bench(tmp_path, LONG)

    def turn() -> None:
        bench.arm.u += 0.05

    at(bench, 2, turn, samples=5)
    bench.run()
    assert bench.steps() == ALL
    rows = [r for r in bench.good() if r["step"] == 2 and r["values"]["settled"]]
    assert len(rows) == 2 * 20
    assert [r["values"]["force_N"] for r in rows] == pytest.approx([40.0] * 40, abs=0.5)
    (event,) = bench.events("touched")
    assert event["text"] == (
        "loading to 40 N: while it was sampled the force rose from 40 to 45 N, and the "
        "displacement with it by 0.05 mm"
    )
    assert [text for text in bench.loader.said if text.startswith(event["text"])]
    (discard,) = bench.events("discard")
    assert discard["reason"] == "screw or arm were moved while it was sampled"


def test_an_arm_that_gives_way_while_it_is_sampled_is_data(tmp_path: Path) -> None:
    bench = Bench(tmp_path, LONG)

    def yields(view: LiveView) -> None:
        if (view.step, view.phase) == (2, "sampling"):
            bench.arm.yield_N = max(30.0, min(bench.arm.yield_N, 40.5) - 0.2)
            bench.arm.u += 0.001
        else:
            bench.arm.yield_N = 1e9

    bench.loader.script = yields
    bench.run()
    rows = [r for r in bench.good() if r["step"] == 2 and r["values"]["settled"]]
    assert min(r["values"]["force_N"] for r in rows) < 35.0
    assert not bench.events("touched")
    assert not bench.events("discard")


def test_a_screw_that_is_let_go_in_unloading_is_not_tightened_again(tmp_path: Path) -> None:
    text = PROTOCOL.replace("branches: loading\n", "branches: loading-unloading\n")
    bench = Bench(tmp_path, text.replace("repetitions: 2", "repetitions: 1"))

    def let_go() -> None:
        bench.arm.u = -0.5

    at(bench, 4, let_go, phase="settling", samples=0)
    bench.run()
    assert bench.steps() == [(1, "loading", step) for step in (1, 2, 3)]
    assert len(bench.events("step_left_out")) == 2
