"""The scene: a world in time, as the emulators sense it."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from rig.arrays import Array
from rig.worlds import make_world
from rig.worlds.arm import tool_poses
from rig.worlds.history import History
from rig.worlds.linear import REFERENCE_Q_RAD
from rig.worlds.scene import IDLE_TICKS, TICK_S, WorldScene
from tests.true_curves import true_curve

Y = [0.0, 1.0, 0.0]
OTHER_Q = (0.0, -1.5, -1.9, -1.3, 1.57, -1.3)
COMMAND_SHOWS_S = IDLE_TICKS * TICK_S


class Time:
    """A clock that goes on when told to."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds


def scene_at_will(seed: int = 4, **options: object) -> tuple[WorldScene, Time]:
    time = Time()
    world = make_world("paper", seed, 0.0, 0.0)
    return WorldScene(world, 1.0, seed, now=time, **options), time  # type: ignore[arg-type]


def loaded(scene: WorldScene, time: Time) -> None:
    """1.5 mm of screw along y, below the knee, and settled."""
    scene.mount(Y)
    scene.turn(1.5e-3)
    time.seconds += 20.0
    scene.force_N(np.array([time.seconds]))


def test_force_and_displacement_lie_on_the_true_curve() -> None:
    scene, time = scene_at_will()
    loaded(scene, time)
    t = np.linspace(time.seconds - 5.0, time.seconds, 400)
    force, moved = scene.force_N(t).mean(axis=0), scene.displacement_m(t).mean()
    assert force[[0, 2]] == pytest.approx([0.0, 0.0])
    assert 65 < force[1] < 72
    # scatter of one loading: half a percent and 3 um
    assert moved == pytest.approx(true_curve(scene.world, Y, [force[1]])[0], rel=0.02)


def test_gains_act_on_what_the_sensors_feel() -> None:
    time, force, moved = Time(), [], []
    for gains in ((0.0, 0.0), (0.05, 0.03)):
        world = make_world("paper", 4, *gains)
        scene = WorldScene(world, 1.0, 4, now=time)
        scene.mount(Y)
        scene.turn(1e-3)
        time.seconds += 10
        t = np.array([time.seconds])
        force.append((scene.force_N(t)[0, 1], world.force_gain))
        moved.append((scene.displacement_m(t)[0], world.displacement_gain))
        time.seconds = 0.0
    assert force[1][0] / force[0][0] == pytest.approx(force[1][1])
    assert moved[1][0] / moved[0][0] == pytest.approx(moved[1][1])
    assert abs(force[1][1] - 1) > 1e-3


def test_output_encoders_see_the_deflection_and_targets_do_not() -> None:
    scene, time = scene_at_will()
    loaded(scene, time)
    arm = scene.arm(np.array([time.seconds]))
    np.testing.assert_allclose(arm.q_target[0], REFERENCE_Q_RAD)
    deflection = arm.q[0] - arm.q_target[0]
    np.testing.assert_allclose(deflection, scene.world.state.joints_rad, atol=1e-12)
    assert abs(arm.q[0, 0] - arm.q_target[0, 0]) > 1e-3
    np.testing.assert_allclose(arm.tcp_pose, tool_poses(arm.q, np.zeros(3)))
    for rows in (arm.current, arm.target_current, arm.temperatures_C):
        assert rows.shape == (1, 6)
    assert np.all((arm.temperatures_C > 20) & (arm.temperatures_C < 40))


def test_joint_displacement_explains_the_laser() -> None:
    scene, time = scene_at_will()
    loaded(scene, time)
    t = np.linspace(time.seconds - 5, time.seconds, 200)
    seen = scene.displacement_m(t).mean()
    poses = scene.arm(t).tcp_pose
    rest = tool_poses(np.array([REFERENCE_Q_RAD]), np.zeros(3))
    # the fixture's scatter is in the laser only; the levers of 1.4 mm are those of the pose
    assert poses[-1, 1] - rest[0, 1] == pytest.approx(seen, abs=15e-6)


def test_the_future_may_not_be_asked_for() -> None:
    scene, time = scene_at_will()
    time.seconds = 2.0
    scene.force_N(np.array([2.0]))
    for ask in (scene.force_N, scene.displacement_m, scene.arm):
        with pytest.raises(ValueError, match="not happened yet"):
            ask(np.array([1.0, 2.001]))


def test_commands_leave_alone_what_has_been_seen() -> None:
    scene, time = scene_at_will()
    loaded(scene, time)
    t = np.linspace(0.0, time.seconds, 333)
    before = (scene.force_N(t), scene.displacement_m(t), scene.arm(t).q)
    scene.turn(-1e-3)
    scene.mount([1.0, 0.0, 0.0])
    scene.move(OTHER_Q)
    time.seconds += 3.0
    after = (scene.force_N(t), scene.displacement_m(t), scene.arm(t).q)
    for was, remains in zip(before, after, strict=True):
        np.testing.assert_allclose(remains, was, atol=1e-12)


def test_a_turn_shows_at_once_and_takes_the_hand_its_time() -> None:
    scene, time = scene_at_will()
    scene.mount(Y)
    time.seconds = 10.0
    scene.turn(2e-3)
    time.seconds = 16.0
    t = np.arange(10.0, 16.0, TICK_S)
    force = scene.force_N(t)[:, 1]
    first = t[np.argmax(force > 0)]
    # 0.3 mm of air at 0.4 mm/s
    assert 10.0 + 0.75 - TICK_S <= first <= 10.0 + 0.75 + COMMAND_SHOWS_S + 2 * TICK_S
    peak = t[np.argmax(force)]
    assert 15.0 - 2 * TICK_S <= peak <= 15.0 + COMMAND_SHOWS_S + 2 * TICK_S


def test_a_move_takes_the_pose_and_its_tool_at_once() -> None:
    poses = [(REFERENCE_Q_RAD, (0.0, 0.0, 0.0)), (OTHER_Q, (0.0, 0.0, 0.15))]
    scene, time = scene_at_will(poses=poses)
    loaded(scene, time)
    scene.move(OTHER_Q)
    time.seconds += 1e-3
    now = np.array([time.seconds])
    np.testing.assert_allclose(scene.arm(now).q_target[0], OTHER_Q)
    assert scene.force_N(now)[0] == pytest.approx([0, 0, 0], abs=1e-9)
    assert scene.world.tcp_m == pytest.approx([0, 0, 0.15])
    scene.move(REFERENCE_Q_RAD)
    assert scene.world.tcp_m == pytest.approx([0, 0, 0])


def test_commands_in_quick_succession() -> None:
    scene, time = scene_at_will()
    time.seconds = 1.0
    for _ in range(5):
        scene.mount(Y)
        scene.move(REFERENCE_Q_RAD)
        scene.turn(1e-4)
    time.seconds = 3.0
    assert np.all(np.isfinite(scene.force_N(np.linspace(0, 3, 100))))


def test_the_same_commands_at_the_same_times_give_the_same_scene() -> None:
    def run(asked: Array) -> Array:
        scene, time = scene_at_will(9)
        scene.mount(Y)
        for step in range(30):
            time.seconds = step * 1.0
            scene.turn(1e-4)
            scene.force_N(asked + time.seconds * 0)
        time.seconds = 40.0
        return scene.force_N(np.linspace(20, 40, 500))

    np.testing.assert_array_equal(run(np.array([0.0])), run(np.empty(0)))


def test_first_command() -> None:
    scene, time = scene_at_will()
    time.seconds = 3.0
    assert scene.first_command_s is None
    scene.mount(Y)
    time.seconds = 4.0
    scene.turn(1e-4)
    assert scene.first_command_s == 3.0


def test_several_threads_may_ask_and_turn() -> None:
    world = make_world("paper", 2, 0.0, 0.0)
    scene = WorldScene(world, 200.0, 2)
    scene.mount(Y)
    problems: list[Exception] = []
    done = threading.Event()

    def ask() -> None:
        try:
            while not done.is_set():
                now = scene.now()
                t = np.linspace(now - 1.0, now, 50)
                assert np.all(np.isfinite(scene.force_N(t)))
                assert np.all(np.isfinite(scene.displacement_m(t)))
                assert np.all(np.isfinite(scene.arm(t[-1:]).q))
        except (AssertionError, ValueError, IndexError) as problem:
            problems.append(problem)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for _ in range(100):
        scene.turn(1e-5)
    done.wait(0.5)
    done.set()
    for thread in threads:
        thread.join(10)
    assert not problems
    assert world.target_m == pytest.approx(1e-3)


def test_a_reader_waits_while_the_world_is_being_changed() -> None:
    scene, _ = scene_at_will()
    reader = threading.Thread(target=scene.force_N, args=(np.array([0.0]),))
    with scene._lock:
        reader.start()
        reader.join(0.1)
        assert reader.is_alive()
    reader.join(10)
    assert not reader.is_alive()


def test_history_reads_between_rows_and_forgets_the_oldest() -> None:
    history = History(2, span_s=10.0, shortest_step_s=1.0)
    for second in range(100):
        history.append(float(second), np.array([second, -2.0 * second]))
    assert history.newest == 99.0
    t = np.array([89.25, 95.5, 99.0])
    np.testing.assert_allclose(history.at(t, slice(None)), np.stack([t, -2 * t], axis=1))
    oldest = history.at(np.array([0.0]), slice(0, 1))[0, 0]
    assert 60 < oldest <= 89  # the oldest row that is kept
    history.cut(97.5)
    assert history.newest == 97.5
    np.testing.assert_allclose(history.at(np.array([97.5]), slice(0, 1)), [[97.5]])
