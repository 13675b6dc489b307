"""The procedure that a data set was measured by, for whoever writes the next one: limits that
somebody set for a rig are loosened by nothing that is written here."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any, Protocol

from rig.errors import InputError
from rig.protocol import MeasurementProtocol, parse_protocol
from rig.protocolfile import Limit, Limits

_STRICTEST = ("stop", "pause", "warn")


class Recorded(Protocol):
    """What is asked of a data set; `rig.dataset.Dataset` has it."""

    @property
    def texts(self) -> dict[str, str]:
        """`protocol` and others, as they were given."""

    @property
    def path(self) -> Any:
        """Where it lies, or None."""


def protocol_before(dataset: Recorded) -> MeasurementProtocol | None:
    """The protocol that a data set was measured by; None for an imported table."""
    text = dataset.texts.get("protocol", "")
    if not text:
        return None
    try:
        return parse_protocol(text, dataset.path or Path("data set"))
    except InputError:
        return None


def limits_before(datasets: Iterable[Recorded]) -> Limits:
    """Of everything that was watched in any of the data sets the least that was allowed, and the
    strictest that then happened."""
    known = [p.limits for d in datasets if (p := protocol_before(d)) is not None]
    return Limits(**{f.name: _least(getattr(one, f.name) for one in known) for f in fields(Limits)})


def _least(each: Iterable[Limit | None]) -> Limit | None:
    known = [limit for limit in each if limit is not None]
    if not known:
        return None
    at = min((limit.at for limit in known), key=_STRICTEST.index)
    return Limit(max=min(limit.max for limit in known), at=at)
