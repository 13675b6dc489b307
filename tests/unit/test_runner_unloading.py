"""The procedure on a rig in memory: unloading comes from above, and no higher than loading went."""

from __future__ import annotations

from pathlib import Path

from drivers.interfaces import LiveView
from tests.unit.runner_bench import PROTOCOL, Bench, at

UNLOADING = (
    PROTOCOL.replace("branches: loading\n", "branches: loading-unloading\n")
    .replace("[20, 40, 60]", "[20, 40, 60, 80]")
    .replace("repetitions: 2", "repetitions: 1")
)


def with_top(limit_mm: float) -> str:
    steps = "steps_N: [20, 40, 60, 80]"
    return UNLOADING.replace(steps, f"{steps}, stop_at_displacement_mm: {limit_mm:g}")


def measured(bench: Bench) -> list[tuple[str, int]]:
    return [(branch, step) for _, branch, step in bench.steps()]


def test_unloading_goes_down_the_levels_of_loading(tmp_path: Path) -> None:
    bench = Bench(tmp_path, UNLOADING)
    bench.run()
    up = [("loading", step) for step in (1, 2, 3, 4)]
    assert measured(bench) == [*up, ("unloading", 3), ("unloading", 2), ("unloading", 1)]
    assert not bench.events("step_left_out")


def test_the_operator_sees_which_step_of_all_it_is(tmp_path: Path) -> None:
    bench = Bench(tmp_path, UNLOADING)
    bench.run()
    shown = dict.fromkeys((v.step, v.steps) for v in bench.loader.views if v.phase == "sampling")
    assert list(shown) == [(position, 7) for position in range(1, 8)]


def test_unloading_holds_no_level_that_loading_has_not_reached(tmp_path: Path) -> None:
    bench = Bench(tmp_path, with_top(3))
    bench.arm.yield_N = 50.0
    bench.run()
    up = [("loading", 1), ("loading", 2), ("loading", 3)]
    assert measured(bench) == [*up, ("unloading", 2), ("unloading", 1)]
    (left,) = bench.events("step_left_out")
    assert left["text"] == "unloading to 60 N: left out, the force is 50 N and would have to rise"
    assert left["text"] in bench.loader.said
    told = "loading to 60 N: displacement is above 3 mm; loading ends here, and is recorded"
    assert told in bench.loader.said


def test_unloading_never_pushes_on(tmp_path: Path) -> None:
    """An arm that has given way and relaxes afterwards is not driven on to get back to a level."""
    bench = Bench(tmp_path, with_top(3))
    bench.arm.yield_N = 50.0

    def relax(view: LiveView) -> None:
        if view.branch == "unloading" and view.phase == "settling" and view.target_N == 40.0:
            bench.arm.yield_N = 30.0
            bench.arm.u = 2.6  # as far as the screw has pushed it: 3.1 mm

    bench.loader.script = relax
    bench.run()
    assert measured(bench)[-1] == ("unloading", 1)
    assert ("unloading", 2) not in measured(bench)
    unloading = [v.displacement_mm for v in bench.loader.views if v.branch == "unloading"]
    assert max(unloading) < 3.1 + 0.2 + 1e-9  # the turn of the hand between two looks
    assert [e["branch"] for e in bench.events("top")] == ["loading", "unloading"]


def test_levels_that_were_skipped_are_not_gone_up_to_in_unloading(tmp_path: Path) -> None:
    bench = Bench(tmp_path, UNLOADING)

    def skip(view: LiveView) -> None:
        if view.branch == "loading" and view.step > 2 and view.phase == "approach":
            bench.arm.u = 0.2  # before the hand turns it by 0.2 mm: 40 N
            bench.loader.commands.append("skip")

    bench.loader.script = skip
    bench.run()
    assert measured(bench) == [("loading", 1), ("loading", 2), ("unloading", 2), ("unloading", 1)]


def test_a_screw_that_was_let_go_ends_the_unloading_levels_above(tmp_path: Path) -> None:
    """After a pause with the screw turned back, the rest of the branch would be loading."""
    bench = Bench(tmp_path, UNLOADING)

    def let_go(view: LiveView) -> None:
        if view.branch == "unloading" and view.step == 5 and view.phase == "sampling":
            if view.samples == 1:
                bench.arm.u = -0.5
            elif view.samples == 2 and not bench.events("discard"):
                bench.loader.commands.append("redo_step")

    bench.loader.script = let_go
    bench.run()
    assert measured(bench) == [("loading", step) for step in (1, 2, 3, 4)]
    assert len(bench.events("step_left_out")) == 3


def test_a_step_that_was_loosened_a_little_too_far_can_be_redone(tmp_path: Path) -> None:
    bench = Bench(tmp_path, UNLOADING)

    def too_far() -> None:
        bench.arm.u = 0.55
        bench.loader.commands.append("redo_step")

    at(bench, 5, too_far)
    bench.run()
    assert ("unloading", 3) in measured(bench)
    assert not bench.events("step_left_out")
