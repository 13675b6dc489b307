"""Speed and memory of the arm's bulk work: python bench/arm.py

Each line: what, how many, seconds, a unit's time, peak memory of the process; ratios to engines
that are measured in the same run, where they are installed.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from identification import maps, workspace
from identification.inverse import BRANCHES
from rig.models.robot import load_robot


def timed(what: str, count: int, work: Callable[[], object], repeat: int = 3) -> float:
    best = float("inf")
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{what:<58} {count:>10} {best:8.3f} s {best / count * 1e6:8.3f} us {peak:7.0f} MB")
    return best / count


def pinocchio_seconds(arm, q, count: int = 50_000) -> float | None:  # type: ignore[no-untyped-def]
    try:
        import pinocchio as pin
    except ImportError:
        print("pinocchio is not installed: no ratio")
        return None
    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    for i in range(6):
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{i + 1}")
        c, s = np.cos(arm.alpha[i]), np.sin(arm.alpha[i])
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        place = pin.SE3(turn, np.array([arm.a[i], 0, arm.d[i]]))
    frame = model.addFrame(pin.Frame("flange", parent, 0, place, pin.FrameType.OP_FRAME))
    data, world = model.createData(), pin.LOCAL_WORLD_ALIGNED

    soft = 1 / arm.joint_stiffness

    def jacobian_alone() -> None:
        for row in q[:count]:
            pin.computeFrameJacobian(model, data, row, frame, world)

    def same_work() -> None:
        for row in q[:count]:
            pin.computeJointJacobians(model, data, row)
            pin.updateFramePlacement(model, data, frame)
            J = pin.getFrameJacobian(model, data, frame, world)
            _ = data.oMf[frame], (J * soft) @ J.T

    timed("Pinocchio, Jacobian alone, pose by pose", count, jacobian_alone)
    return timed("Pinocchio, FK + Jacobian + compliance, pose by pose", count, same_work)


def main() -> None:
    arm = load_robot("ur10e")
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (100_000, 6))
    own = timed("FK + Jacobian + compliance", len(q), lambda: arm.compliance(q))
    other = pinocchio_seconds(arm, q)
    if other is not None:
        print(f"  ratio to Pinocchio: {other / own:.1f}")
    T = arm.fk(q)
    ik = timed("inverse kinematics, all branches", len(T), lambda: arm.inverse(T))
    try:
        from ur_analytic_ik import ur10e
    except ImportError:
        print("ur-analytic-ik is not installed: no ratio")
    else:
        theirs = timed(
            "ur-analytic-ik, pose by pose",
            20_000,
            lambda: [ur10e.inverse_kinematics(t) for t in T[:20_000]],
        )
        print(f"  ratio to ur-analytic-ik: {theirs / ik:.2f}")
    points = rng.uniform([-1.2, -1.2, 0.0], [1.2, 1.2, 1.2], (100_000, 3))
    down, pair = np.array([0.0, 0.0, -1.0]), maps.Coupling(0.0)
    for words, branch in (("one branch", BRANCHES[0]), ("best of eight branches", None)):
        stance = maps.Stance(down, np.eye(4), branch=branch)
        for name, coupling in (("single", None), ("coupled", pair)):
            timed(
                f"stiffness map, {name}, {words}, cells",
                len(points),
                partial(maps.stiffness_map, arm, points, stance, [1, 0, 0], coupling),
                repeat=1,
            )
    timed(
        "Monte Carlo workspace, samples",
        10_000_000,
        lambda: workspace.monte_carlo(arm, 1.5, 10_000_000),
        repeat=1,
    )


if __name__ == "__main__":
    main()
