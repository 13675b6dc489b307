"""Settings of the ILD2200-10 in the station file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, MinLen


@dataclass(frozen=True, kw_only=True)
class Ild2200Settings:
    """`port`: the serial port. `sign` -1: displacement along the direction shortens the reading."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    driver: Literal["ild2200"]
    port: Annotated[str, MinLen(1)]
    baud: Literal[115200, 691200] = 691200
    range_mm: Annotated[float, Gt(0)] = 10.0
    output_rate_Hz: Literal[2500, 5000, 10000, 20000] = 10000
    averaging: Annotated[int, Ge(1)] = 1
    sign: Literal[1, -1] = 1
    max_step_mm: Annotated[float, Gt(0)] = 0.5
    connect_deadline_s: Annotated[float, Gt(0)] = 5.0
    stale_after_s: Annotated[float, Gt(0)] = 1.0
    standard_uncertainty_mm: Annotated[float, Gt(0)] = 0.002
    gain_relative_sd: Annotated[float, Ge(0)] = 0.003
