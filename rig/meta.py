"""META.yaml: what a table of measurements does not say itself (robot, poses, instruments ...)."""

from __future__ import annotations

from math import pi, sqrt
from typing import Annotated, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PositiveFloat,
    field_validator,
    model_validator,
)

from rig.errors import did_you_mean

ROBOTS = ("ur10e", "ur5e", "ur16e", "none")

Vector3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Angles = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Stiffnesses = tuple[
    PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat
]
RelativeSd = Annotated[float, Field(ge=0, le=1)]
# A simulated spring may be off several times; beyond that a percentage is meant.
SpringSd = Annotated[float, Field(ge=0, le=5)]
PositiveFinite = Annotated[float, Field(gt=0, allow_inf_nan=False)]

# Joints of the arm turn by one full turn to either side; more is an angle in degrees.
_FULL_TURN = 2 * pi + 0.01
# Vectors typed with four digits pass; a wrong component does not.
_UNIT_TOLERANCE = 1e-3


def _name(word: str) -> str:
    """Names stand in CSV cells, in messages and on axes."""
    if (
        not word
        or word != word.strip()
        or any(c in word for c in ',;"#\n\r\t/\0')
        or len(word) > 60
    ):
        raise ValueError(
            f'the name "{word[:60]}" is not allowed; wanted: 1 to 60 characters without '
            "comma, semicolon, slash, quotes or # and without spaces at its ends."
        )
    return word


Name = Annotated[str, AfterValidator(_name)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class MetaPose(_Part):
    """Commanded joint angles without load (rad), and the point of load in the flange frame (mm)."""

    q_rad: Angles
    tcp_xyz_mm: Vector3 = (0.0, 0.0, 0.0)

    @field_validator("q_rad")
    @classmethod
    def _angles(cls, q: Angles) -> Angles:
        for joint, angle in enumerate(q, start=1):
            if abs(angle) > _FULL_TURN:
                raise ValueError(
                    f"joint {joint} stands at {angle:g} rad; wanted: -6.283 to 6.283 rad. "
                    "Are these degrees?"
                )
        return q


class ForceInstrument(_Part):
    """Uncertainty of one sample of force, and of the gain that all samples share.

    A gain that is not stated counts as 0.5 %, the usual class of a dynamometer.
    """

    standard_uncertainty_N: PositiveFinite
    gain_relative_sd: RelativeSd = 0.005


class DisplacementInstrument(_Part):
    """Uncertainty of one sample of displacement, and of the gain that all samples share.

    A gain that is not stated counts as 0.3 %, the usual class of a triangulating laser.
    """

    standard_uncertainty_mm: PositiveFinite
    gain_relative_sd: RelativeSd = 0.003


class Instruments(_Part):
    """The two instruments that every measurement has."""

    force: ForceInstrument
    displacement: DisplacementInstrument


class Simulation(_Part):
    """What the simulator believed before the measurement: six joints, or a spring a direction."""

    joint_stiffness_Nm_per_rad: Stiffnesses | None = None
    joint_stiffness_relative_sd: SpringSd = 0.1
    stiffness_N_per_mm: dict[Name, PositiveFinite] | None = None
    stiffness_relative_sd: SpringSd = 0.1


class Meta(_Part):
    """The whole file. `directions` come out as exact unit vectors, force and displacement count
    along them; `robot` "none" is a rig without an arm: no poses, one spring a direction."""

    robot: str
    poses: dict[Name, MetaPose] = Field(default_factory=dict)
    directions: dict[Name, Vector3]
    joint_encoder: Literal["output", "motor"] = "output"
    datum: Literal["setup", "repetition"] = "setup"
    imposed: Literal["force", "displacement"] | None = None
    tare: Literal["session", "run"] = "session"
    instruments: Instruments
    simulation: Simulation | None = None

    @field_validator("robot")
    @classmethod
    def _known_robot(cls, robot: str) -> str:
        if robot not in ROBOTS:
            raise ValueError(f'the robot "{robot}" is not known.{did_you_mean(robot, ROBOTS)}')
        return robot

    @field_validator("directions")
    @classmethod
    def _unit_vectors(cls, directions: dict[str, Vector3]) -> dict[str, Vector3]:
        if not directions:
            raise ValueError("names no direction; wanted: at least one, as x: [1, 0, 0].")
        return {name: _unit(name, vector) for name, vector in directions.items()}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.robot == "none" and self.poses:
            raise ValueError("poses are given, but robot is none; remove them or name the robot.")
        if self.robot != "none" and not self.poses:
            raise ValueError(f"poses are missing; the robot {self.robot} needs at least one.")
        if self.simulation is not None:
            _check_simulation(self.simulation, self.robot, self.directions)
        return self


def _unit(name: str, vector: Vector3) -> Vector3:
    length = sqrt(sum(c * c for c in vector))
    if length == 0:
        raise ValueError(f"{name} is [0, 0, 0], which points nowhere; wanted: a unit vector.")
    unit = (vector[0] / length, vector[1] / length, vector[2] / length)
    if abs(length - 1) > _UNIT_TOLERANCE:
        suggestion = ", ".join(f"{c:.6g}" for c in unit)
        raise ValueError(
            f"{name} has the length {length:g}; wanted: a unit vector. Did you mean [{suggestion}]?"
        )
    return unit


def _check_simulation(simulation: Simulation, robot: str, directions: dict[str, Vector3]) -> None:
    joints, springs = simulation.joint_stiffness_Nm_per_rad, simulation.stiffness_N_per_mm
    if robot != "none":
        if joints is None or springs is not None:
            raise ValueError(
                f"the simulation of {robot} wants joint_stiffness_Nm_per_rad (6 numbers); "
                "stiffness_N_per_mm belongs to robot: none."
            )
        return
    if springs is None or joints is not None:
        raise ValueError(
            "the simulation of robot: none wants stiffness_N_per_mm, one number a direction; "
            "joint_stiffness_Nm_per_rad belongs to an arm."
        )
    for name in springs:
        if name not in directions:
            raise ValueError(
                f'simulation.stiffness_N_per_mm names the direction "{name}", which is not among '
                f"the directions.{did_you_mean(name, directions)}"
            )
    missing = [name for name in directions if name not in springs]
    if missing:
        raise ValueError(
            f'simulation.stiffness_N_per_mm lacks the direction "{missing[0]}"; wanted: one '
            "number for each direction."
        )
