"""Single and coupled stiffness against a finite element engine that nobody here wrote.

Two arms of stiff beams and rotational springs, the second mirrored as a body (points and axes
reflected), hold one node; OpenSees assembles and solves. Geometry comes from screws, not from the
DH tables under test.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.coupling import coupled, mirror_axes
from identification.elastic import STEEL, cantilever, tube
from rig.models.model import load_model
from rig.models.robot import MODELS
from tests.recovery.joint_world import place

Array = NDArray[np.float64]
# "Rigid" next to joint springs of 1e4 to 1e5 Nm/rad, and still far from the engine's rounding.
RIGID_EA, RIGID_EI, RIGID_HINGE = 1e12, 1e11, 1e11


class Frame:
    """Nodes and elements of a linear static model; units SI."""

    def __init__(self) -> None:
        self.ops: Any = pytest.importorskip(
            "opensees.openseespy", reason="test extra: pip install --no-deps opensees"
        )
        self.ops.wipe()
        self.ops.model("basic", "-ndm", 3, "-ndf", 6)
        self.tags = iter(range(1, 10_000))
        self.at: dict[int, Array] = {}

    def node(self, point: Array) -> int:
        tag = next(self.tags)
        self.ops.node(tag, *map(float, point))
        self.at[tag] = point
        return tag

    def hinge(self, point: Array, axis: Array, stiffness: float, inner: int) -> int:
        """A new node that turns about `axis` against `inner`, which is at the same point."""
        outer, soft, hard, element = (self.node(point), *(next(self.tags) for _ in range(3)))
        self.ops.uniaxialMaterial("Elastic", soft, float(stiffness))
        self.ops.uniaxialMaterial("Elastic", hard, RIGID_HINGE)
        across = np.eye(3)[np.argmin(np.abs(axis))]
        self.ops.element(
            "zeroLength",
            element,
            inner,
            outer,
            "-mat",
            hard,
            hard,
            hard,
            soft,
            hard,
            hard,
            "-dir",
            1,
            2,
            3,
            4,
            5,
            6,
            "-orient",
            *map(float, axis),
            *map(float, across),
        )
        return outer

    def beam(self, first: int, second: int, EA: float, EI: float, GJ: float) -> None:
        along = self.at[second] - self.at[first]
        if np.linalg.norm(along) < 1e-9:
            self.ops.equalDOF(first, second, 1, 2, 3, 4, 5, 6)
            return
        turn = next(self.tags)
        self.ops.geomTransf("Linear", turn, *map(float, np.eye(3)[np.argmin(np.abs(along))]))
        # E = G = 1: areas and moments carry the stiffness
        self.ops.element(
            "elasticBeamColumn", next(self.tags), first, second, EA, 1.0, 1.0, GJ, EI, EI, turn
        )

    def link(self, first: int, second: int) -> None:
        self.beam(first, second, RIGID_EA, RIGID_EI, RIGID_EI)

    def arm(self, points: Array, axes: Array, stiffness: Array, tool: Array) -> int:
        """Chain from the fixed first axis to the node of the tool, which is returned."""
        inner = self.node(points[0])
        self.ops.fix(inner, 1, 1, 1, 1, 1, 1)
        outer = inner
        for i, (point, axis) in enumerate(zip(points, axes, strict=True)):
            if i:
                inner = self.node(point)
                self.link(outer, inner)
            outer = self.hinge(point, axis, stiffness[i], inner)
        end = self.node(tool)
        self.link(outer, end)
        return end

    def stiffness(self, node: int, directions: Array) -> Array:
        """N/m along unit vectors (n, 3) under a force along each at `node`."""
        ops, out = self.ops, []
        ops.constraints("Transformation")
        ops.numberer("RCM")
        ops.system("FullGeneral")
        ops.test("NormUnbalance", 1e-6, 10)
        ops.algorithm("Linear")
        ops.integrator("LoadControl", 1.0)
        ops.analysis("Static")
        for n in directions:
            series = next(self.tags)
            ops.timeSeries("Constant", series)
            ops.pattern("Plain", series, series)
            ops.load(node, *map(float, n), 0.0, 0.0, 0.0)
            assert ops.analyze(1) == 0
            out.append(1.0 / float(np.dot(n, [ops.nodeDisp(node, i) for i in (1, 2, 3)])))
            ops.remove("loadPattern", series)
        return np.array(out)


@pytest.fixture
def frame() -> Iterator[Frame]:
    built = Frame()
    yield built
    built.ops.wipe()


def geometry(file: str) -> tuple[Any, Array, Array, Array]:
    model = load_model(MODELS / f"{file}.yaml")
    tip, axes, points = place(model.q, model.tool[:3, 3])
    return model, points, axes, tip


@pytest.mark.parametrize("file", ["F1", "F2"])
def test_single_arm(frame: Frame, file: str) -> None:
    model, points, axes, tip = geometry(file)
    end = frame.arm(points, axes, model.arm.joint_stiffness, tip)
    found = frame.stiffness(end, np.eye(3))
    ours = 1 / np.diag(model.compliance())[:3]
    np.testing.assert_allclose(ours, found, rtol=1e-3)


@pytest.mark.parametrize(
    ("file", "beta_deg", "beam"),
    [
        ("F1", 0.0, None),
        ("F1", 36.5, None),
        ("F2", 36.5, None),
        ("F1", 20.0, (0.02, 0.1)),
        ("F2", 36.5, (0.03, 0.05)),
        ("F2", 36.5, (0.02, 0.1)),
    ],
)
def test_coupled_pair(
    frame: Frame, file: str, beta_deg: float, beam: tuple[float, float] | None
) -> None:
    """Rigid: both chains end in the same place, welded. With a beam: each ends where its half
    begins, half a length before the mirror plane, and the halves meet in the node."""
    model, points, axes, tip = geometry(file)
    mirror = mirror_axes(np.deg2rad(beta_deg))
    n = mirror[:, 0]
    M = np.eye(3) - 2 * np.outer(n, n)
    # an axis is a pseudo-vector, but a spring does not mind the sense of its axis
    image = tip + (points - tip) @ M
    length = 0.0 if beam is None else beam[1]
    node = frame.node(tip)
    for side, (where, about) in ((-1, (points, axes)), (1, (image, axes @ M))):
        end = frame.arm(where, about, model.arm.joint_stiffness, tip + side * length * n)
        if beam is None:
            frame.link(node, end)
        else:
            section = tube(STEEL, beam[0])
            frame.beam(end, node, section.axial, section.bending_y, section.torsion)
    directions = np.vstack([mirror.T, np.eye(3)[:2]])
    found = frame.stiffness(node, directions)
    half = None if beam is None else cantilever(tube(STEEL, beam[0]), length)
    C = coupled(
        model.compliance(), np.deg2rad(beta_deg), "rigid" if half is None else "compliant", half
    )
    ours = 1 / np.einsum("ni,ij,nj->n", directions, C[:3, :3], directions)
    np.testing.assert_allclose(ours, found, rtol=5e-3)
