"""Settings of dynamometer, charge amplifier and NI DAQ in the station file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import combinations_with_replacement
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

    def __post_init__(self) -> None:
        """Checks what no single field's type can; raises ValueError with a full message."""
        _check_axes(self.axes_in_base)
        for axis in "xyz":
            if not getattr(self.full_scale_N, axis) > 0:
                raise ValueError(
                    f"full_scale_N {axis} is {getattr(self.full_scale_N, axis)} N; it must be above"
                    " 0 N: the force that 10 V stand for at the amplifier"
                )
            if getattr(self.sensitivity_pC_per_N, axis) == 0:
                raise ValueError(
                    f"sensitivity_pC_per_N {axis} is 0 pC/N; take it from the calibration sheet"
                )
        if not re.fullmatch(r"ai\d+", self.first_channel):
            raise ValueError(
                f'first_channel is "{self.first_channel}"; it must be "ai" and a number, as ai0'
            )
        if self.grpc_server is not None and not _is_address(self.grpc_server):
            raise ValueError(
                f'grpc_server is "{self.grpc_server}"; it must be address:port,'
                " as 192.168.0.7:31763, or null for the local NI driver"
            )


def _check_axes(axes: tuple[Row, Row, Row]) -> None:
    """A wrong sign or a copied row would turn every force without any other sign of it."""
    for i, j in combinations_with_replacement(range(3), 2):
        product = sum(p * q for p, q in zip(axes[i], axes[j], strict=True))
        if not abs(product - (i == j)) < 1e-3:
            raise ValueError(
                f"axes_in_base: rows {i + 1} and {j + 1} have the scalar product {product:.4g}; it"
                f" must be {int(i == j)} within 0.001: the rows are the sensor's unit axes"
            )
    (a, b, c), (d, e, f), (g, h, i_) = axes
    if a * (e * i_ - f * h) - b * (d * i_ - f * g) + c * (d * h - e * g) < 0:
        raise ValueError(
            "axes_in_base: the rows form a left-handed frame; turn the sign of one row"
            " (a force that counts the other way is force_on_robot_sign: -1)"
        )


def _is_address(text: str) -> bool:
    """True for address:port with a port from 1 to 65535, and for the emulated station's word."""
    host, _, port = text.rpartition(":")
    numeric = port.isascii() and port.isdigit() and 0 < int(port) < 65536
    return text == "emulated" or (bool(host) and numeric)
