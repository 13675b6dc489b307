"""Settings of dynamometer, charge amplifier and NI DAQ in the station file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Interval, MinLen

Row = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PerAxis:
    """One value for each of the sensor's axes."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    x: float
    y: float
    z: float


@dataclass(frozen=True, kw_only=True)
class KistlerSettings:
    """The calibration sheet decides over every default here.

    `full_scale_N`: force that 10 V at the amplifier's output stand for, per axis (of the single
    channel with 8 channels, of the sum with 3). `axes_in_base`: rows are the sensor's x, y, z axes
    in the robot's base frame.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    driver: Literal["kistler9257b"]
    device: Annotated[str, MinLen(1)]
    grpc_server: str | None = None
    channels: Literal[3, 8] = 8
    first_channel: Annotated[str, MinLen(1)] = "ai0"
    terminal: Literal["rse", "nrse", "differential", "pseudo_differential"] = "rse"
    sample_rate_Hz: Annotated[float, Interval(ge=100, le=100_000)] = 1000.0
    full_scale_N: PerAxis
    sensitivity_pC_per_N: PerAxis = PerAxis(x=-7.5, y=-7.5, z=-3.7)
    a_mm: Annotated[float, Gt(0)] = 30.0
    b_mm: Annotated[float, Gt(0)] = 57.5
    az0_mm: float = 0.0
    axes_in_base: tuple[Row, Row, Row] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    force_on_robot_sign: Literal[1, -1] = 1
    reset_line: str | None = "port0/line0"
    reset_active_high: bool = True
    reset_settle_s: Annotated[float, Ge(0)] = 2.0
    operate_settle_s: Annotated[float, Ge(0)] = 2.0
    overload_V: Annotated[float, Interval(gt=0, le=10)] = 9.9
    connect_deadline_s: Annotated[float, Gt(0)] = 5.0
    stale_after_s: Annotated[float, Gt(0)] = 1.0
    standard_uncertainty_N: Annotated[float, Gt(0)] = 0.1
    gain_relative_sd: Annotated[float, Ge(0)] = 0.005
