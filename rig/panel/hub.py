"""What the server knows of the run: the newest state, the history, and who sits at the controls."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from rig.panel.recent import Recent
from rig.panel.state import STALE_S, to_json

KEPT_ITEMS = 50_000  # fourteen hours at 1 Hz; older ones are in the data set alone
BATCH = 500
HEARTBEAT_S = 0.5  # a state that does not change is sent again so often, with its true age
SEAT_GRACE_S = 10.0  # a page that reloads must not lose its operator
PINNED = ("plan", "prediction")

Clock = Callable[[], float]


@dataclass
class Viewer:
    """One open stream. `seen`: number of the last item sent, None before the first message;
    `recalled`: whether it has been told the last minutes."""

    client: str
    may_take: bool
    seen: int | None = None
    pinned: int = 0
    state: int = 0
    at: float = 0.0
    recalled: bool = False
    ended: bool = False


@dataclass
class Seat:
    """One operator at a time: the first with the operator's link, then who takes over."""

    now: Clock
    _holder: str | None = None
    _streams: dict[str, int] = field(default_factory=dict)
    _left_at: float = 0.0

    @property
    def holder(self) -> str | None:
        """Client word of the operator; None when there is none, or he has been gone for long."""
        if self._holder is None or self._holder in self._streams:
            return self._holder
        return self._holder if self.now() - self._left_at < SEAT_GRACE_S else None

    @property
    def empty(self) -> bool:
        """Whether no stream is open at all."""
        return not self._streams

    def join(self, viewer: Viewer) -> None:
        """A stream was opened."""
        if viewer.may_take and self.holder is None:
            self._holder = viewer.client
        self._streams[viewer.client] = self._streams.get(viewer.client, 0) + 1

    def leave(self, viewer: Viewer) -> None:
        """A stream was closed."""
        left = self._streams.pop(viewer.client) - 1
        if left:
            self._streams[viewer.client] = left
        elif viewer.client == self._holder:
            self._left_at = self.now()

    def take(self, client: str) -> None:
        """Makes the client the operator. His stream may be closed: a page whose browser has no
        other connection free lets go of it to send this, and comes back like one that reloads."""
        self._holder = client
        self._left_at = self.now()


class Hub:
    """History and state for all viewers; nothing is queued for a single one.

    A viewer that reads slowly is given the state of the moment in which it reads, and the items
    that it misses; so neither costs memory, and nobody waits for anybody.
    """

    def __init__(self, run: str, now: Clock = time.monotonic) -> None:
        self.run = run
        self.seat = Seat(now)
        self.state: dict[str, Any] | None = None
        self.end: Mapping[str, Any] | None = None
        self._now = now
        self._at = 0.0
        self._recent = Recent()
        self._version = 0  # of state and seat
        self._sequence = 0
        self._items: deque[bytes] = deque(maxlen=KEPT_ITEMS)
        self._count = 0
        self._pinned: dict[str, bytes] = {}
        self._pins = 0
        self._changed = asyncio.Event()

    def set_state(self, state: dict[str, Any], at: float) -> None:
        """`at`: monotonic s of the moment in which the measuring process made it."""
        self.state, self._at = state, at
        self._recent.add(state, at)
        self.touch()

    def add(self, item: Mapping[str, Any]) -> None:
        """One item for everybody, now and later."""
        kind = next(iter(item))
        if kind in PINNED:
            self._pinned[kind] = to_json(item)
            self._pins += 1
        else:
            self._items.append(to_json(item))
            self._count += 1
        self._wake()

    def finish(self, end: Mapping[str, Any]) -> None:
        """Nothing comes after this; viewers are sent what they lack, then the end."""
        if self.end is None:
            self.end = end
            self._wake()

    def touch(self) -> None:
        """State or seat has changed: everybody is to hear of it."""
        self._version += 1
        self._wake()

    def first_seen(self, last_event_id: str | None) -> int | None:
        """Number of the last item that a returning viewer holds; None if he must start anew."""
        run, _, number = (last_event_id or "").rpartition(":")
        if run != self.run or not (number.isdecimal() and number.isascii()):
            return None
        seen = int(number[:18])
        return seen if self._count - len(self._items) <= seen <= self._count else None

    async def changed(self) -> None:
        """Returns at the next change, or at the next heartbeat."""
        try:
            await asyncio.wait_for(self._changed.wait(), HEARTBEAT_S)
        except TimeoutError:
            return

    def lacks(self, viewer: Viewer) -> bool:
        """Whether there is more for the viewer at once: a long history goes in several parts, and
        things change while the viewer is being sent others."""
        return (
            viewer.seen != self._count
            or viewer.pinned != self._pins
            or (self.state is not None and viewer.state != self._version)
            or (self.end is not None and not viewer.ended)
        )

    def news(self, viewer: Viewer) -> bytes:
        """All that the viewer lacks, as server-sent events; empty if nothing."""
        return b"".join(self._news(viewer))

    def _news(self, viewer: Viewer) -> Iterator[bytes]:
        if viewer.seen is None or viewer.seen < self._count - len(self._items):
            viewer.seen, viewer.pinned = self._count - len(self._items), 0
            yield _event(to_json({"reset": self.run}), f"{self.run}:{viewer.seen}")
        if viewer.pinned != self._pins:
            viewer.pinned = self._pins
            yield self._batch(list(self._pinned.values()), viewer.seen)
        skipped = viewer.seen - (self._count - len(self._items))
        if items := list(islice(self._items, skipped, skipped + BATCH)):
            viewer.seen += len(items)
            yield self._batch(items, viewer.seen)
        if not viewer.recalled and (rows := self._recent.rows()):
            yield _event(to_json({"recent": rows}))
        viewer.recalled = True  # what comes from now on is told by the states
        now = self._now()
        if self.state is not None and (
            viewer.state != self._version or now - viewer.at >= HEARTBEAT_S
        ):
            viewer.state, viewer.at = self._version, now
            yield _event(self._state_for(viewer, now))
        if self.end is not None and viewer.seen == self._count and not viewer.ended:
            viewer.ended = True
            yield _event(to_json({"end": self.end}))

    def _state_for(self, viewer: Viewer, now: float) -> bytes:
        assert self.state is not None
        self._sequence += 1
        holder = self.seat.holder
        operator = {
            "you": viewer.may_take and holder == viewer.client,
            "taken": holder is not None,
            "may_take": viewer.may_take,
        }
        aged = {name: _aged(self.state[name], now - self._at) for name in ("force", "displacement")}
        head = {"seq": self._sequence, "t_s": now}
        return to_json({**head, **self.state, **aged, "operator": operator})

    def _batch(self, items: list[bytes], last: int) -> bytes:
        return _event(b'{"batch":[' + b",".join(items) + b"]}", f"{self.run}:{last}")

    def _wake(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()


def _aged(value: Mapping[str, Any], passed_s: float) -> dict[str, Any]:
    """A value as it is so many seconds after it was given: a null age means there is none."""
    age_s = value["age_s"]
    if age_s is None:
        return {**value, "stale": True}
    age_s += max(0.0, passed_s)
    return {**value, "age_s": round(age_s, 3), "stale": value["stale"] or age_s > STALE_S}


def _event(data: bytes, last_id: str | None = None) -> bytes:
    """One server-sent event. JSON has no line breaks, so one data line holds it."""
    head = b"" if last_id is None else f"id: {last_id}\n".encode()
    return head + b"data: " + data + b"\n\n"
