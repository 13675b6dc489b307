"""Robot files: YAML into `Arm`, SI inside, every value checked."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from identification.arm import Arm
from identification.elastic import MATERIALS, Beam, Section, tube
from rig.errors import InputError, did_you_mean
from rig.models.model_schema import BeamFile, RobotFile, SegmentFile, TubeFile
from rig.units import MM_PER_M
from rig.yaml.yamlfile import Document, read_document

T = TypeVar("T")

MODELS = Path(__file__).resolve().parents[2] / "data" / "models"


def robot_names() -> list[str]:
    """Robots that data/models holds."""
    return sorted(p.stem for p in MODELS.glob("*.yaml") if "rig.robot/1" in p.read_text("utf-8"))


def load_robot(name_or_path: str | Path) -> Arm:
    """The arm of a robot file: a name (ur10e) or a path.

    Raises InputError when there is no such robot, or its file does not hold one.
    """
    return robot_and_reach(name_or_path)[0]


def robot_and_reach(name_or_path: str | Path) -> tuple[Arm, float]:
    """The arm, and how far it reaches, m."""
    path = Path(name_or_path)
    return _read(path) if path.suffix in (".yaml", ".yml") else _shipped(str(name_or_path))


@cache
def _shipped(name: str) -> tuple[Arm, float]:
    """Of data/models, read once: commands ask for the same robot again and again."""
    known = robot_names()
    if name not in known:
        hint = did_you_mean(name, known)
        raise InputError(f'robot "{name}" is unknown.{hint} Or give a robot file (.yaml).')
    return _read(MODELS / f"{name}.yaml")


def _read(path: Path) -> tuple[Arm, float]:
    document = read_document(path, RobotFile)
    written = document.value
    arm = checked(
        document,
        (),
        lambda: Arm(
            name=written.name,
            d=np.array(written.dh.d_m),
            a=np.array(written.dh.a_m),
            alpha=np.array(written.dh.alpha_rad),
            mass=np.array(written.mass_kg),
            centre=np.array(written.centre_of_mass_m),
            torque_limit=np.array(written.joint_torque_limits_Nm),
            q_min=np.deg2rad(written.joint_limits_deg.min),
            q_max=np.deg2rad(written.joint_limits_deg.max),
            joint_stiffness=np.array(written.joint_stiffness_Nm_per_rad),
            joint_stiffness_relative_sd=np.full(6, written.joint_stiffness_relative_sd),
            payload_limit=written.payload_limit_kg,
            links=segments(document, written.link_segments),
        ),
    )
    return arm, written.reach_mm / MM_PER_M


def segments(document: Document[Any], written: list[SegmentFile]) -> tuple[Beam, ...]:
    """Elastic segments as a file lists them."""
    out = []
    for i, segment in enumerate(written):
        place = ("link_segments", i)
        section = section_of(document, (*place, "tube"), segment.tube)
        build = _beam_of(segment, section)
        out.append(checked(document, place, build))
    return tuple(out)


def _beam_of(segment: SegmentFile, section: Section) -> Callable[[], Beam]:
    return lambda: Beam(section, segment.from_m, segment.to_m, segment.frame, segment.name)


def section_of(
    document: Document[Any], place: tuple[str | int, ...], written: TubeFile | BeamFile
) -> Section:
    """Cross-section of a tube or a beam at `place` of the file."""
    material = MATERIALS.get(written.material)
    if material is None:
        what = f'"{written.material}" is unknown.{did_you_mean(written.material, MATERIALS)}'
        document.refuse([document.problem((*place, "material"), what)])
        raise AssertionError
    wall = None if written.wall_mm is None else written.wall_mm / MM_PER_M
    return checked(document, place, lambda: tube(material, written.diameter_mm / MM_PER_M, wall))


def checked(document: Document[Any], place: tuple[str | int, ...], build: Callable[[], T]) -> T:
    """`build()`, its ValueError told as a problem of the file at `place`."""
    try:
        return build()
    except ValueError as error:
        document.refuse([document.problem(place, f"{error}.")])
        raise
