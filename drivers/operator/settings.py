"""Settings of the operator's place in the station file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Gt


@dataclass(frozen=True, kw_only=True)
class OperatorSettings:
    """`screw`: address:port of the emulated screw, for the scripted operator only."""

    __pydantic_config__: ClassVar[dict[str, str]] = {"extra": "forbid"}

    driver: Literal["console", "scripted"]
    screw_pitch_mm: Annotated[float, Gt(0)] = 0.5
    screw: str | None = None
