"""What the evaluation asks of a data set; `rig.dataset.Dataset` has it."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray


class _ForceInstrument(Protocol):
    @property
    def standard_uncertainty_N(self) -> float: ...
    @property
    def gain_relative_sd(self) -> float: ...


class _DisplacementInstrument(Protocol):
    @property
    def standard_uncertainty_mm(self) -> float: ...
    @property
    def gain_relative_sd(self) -> float: ...


class _Instruments(Protocol):
    @property
    def force(self) -> _ForceInstrument: ...
    @property
    def displacement(self) -> _DisplacementInstrument: ...


class _Meta(Protocol):
    @property
    def directions(self) -> Any: ...
    @property
    def instruments(self) -> _Instruments: ...
    @property
    def datum(self) -> str: ...


class Measurements(Protocol):
    """Columns, and of META what a curve needs."""

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Name -> (n,)."""

    @property
    def events(self) -> list[dict[str, Any]]:
        """What happened, each with `kind` and the number of samples before it."""

    @property
    def meta(self) -> _Meta:
        """Directions, instruments, datum."""
