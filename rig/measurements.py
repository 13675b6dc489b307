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


class Stated(Protocol):
    """META, as far as it counts here; `rig.meta.Meta` has it."""

    @property
    def robot(self) -> str:
        """Its name; none for a rig without an arm."""

    @property
    def poses(self) -> Any:
        """Name -> `rig.meta.MetaPose`."""

    @property
    def simulation(self) -> Any:
        """`rig.meta.Simulation`, or None."""

    @property
    def directions(self) -> Any:
        """Name -> unit vector."""

    @property
    def instruments(self) -> _Instruments:
        """Of force and displacement."""

    @property
    def datum(self) -> str:
        """Once a setup or before each repetition."""


class Measurements(Protocol):
    """Columns, and of META what a curve needs."""

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Name -> (n,)."""

    @property
    def events(self) -> list[dict[str, Any]]:
        """What happened, each with `kind` and the number of samples before it."""

    @property
    def meta(self) -> Stated:
        """Directions, instruments, datum, simulation."""
