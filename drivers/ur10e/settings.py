"""Settings of the UR10e in the station file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt, Interval, MinLen


@dataclass(frozen=True, kw_only=True)
class Ur10eSettings:
    """`host`: address of the controller; the RTDE port 30004 is fixed by the client library."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    driver: Literal["ur10e"]
    host: Annotated[str, MinLen(1)]
    frequency_Hz: Annotated[float, Interval(ge=1, le=500)] = 125.0
    dashboard: bool = True
    connect_deadline_s: Annotated[float, Gt(0)] = 5.0
    stale_after_s: Annotated[float, Gt(0)] = 1.0
