"""Whoever looks on while a measurement runs. This one is nobody; `rig.panel.panel` is the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from drivers.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import Loader


class Onlooker:
    """What a measurement tells whoever looks on. Every call returns at once and never raises."""

    def device(self, name: str, fault: DeviceError | None = None) -> None:
        """A device is ready, or has failed."""

    def record(self, kind: str, data: Mapping[str, Any]) -> None:
        """A record of the journal is on disk."""

    def operator(self, loader: Loader, clock: Clock, *, scripted: bool) -> Loader:  # noqa: ARG002
        """The loader that the procedure talks to; here the given one itself."""
        return loader

    def finish(self, phase: str, text: str) -> None:
        """The measurement is over: "done", "aborted" or "fault", and in words."""
