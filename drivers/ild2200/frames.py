"""From bytes to millimetres: three-byte frames, error values, plausibility.

A value travels as three bytes whose two top bits are a tag: 00 for the low six bits of the value,
01 for the middle six, 10 for the high six. Whatever breaks this order is skipped; the next intact
frame is found again because tags cannot be mistaken for each other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int32]
Bytes = NDArray[np.uint8]

LARGEST_MEASUREMENT = 65519  # raw values above it are error values
_TAGS = np.array([0x00, 0x40, 0x80], dtype=np.uint8)

ERROR_NAMES = {
    65522: "no object",
    65524: "target before the range",
    65526: "target beyond the range",
    65528: "poor target",
    65530: "laser off",
}


def error_name(raw: int) -> str:
    """What an error value means, with its number; unknown ones by number alone."""
    name = ERROR_NAMES.get(raw, "unknown error value")
    return f"{name} ({raw})"


def measurements(raw: Integers) -> Integers:
    """The raw values that are no error values."""
    if len(raw) == 0 or int(raw.max()) <= LARGEST_MEASUREMENT:
        return raw
    return raw[raw <= LARGEST_MEASUREMENT]


def to_mm(raw: Integers, range_mm: float) -> Floats:
    """Distance in the measuring range, mm, of raw values up to `LARGEST_MEASUREMENT`.

    The straight line through the manual's points (643 is the start of the range, 32760 its middle,
    64876 its end), which it meets within two digits, 0.003 % of the range.
    """
    distance = np.multiply(raw, 1.02 / 65520 * range_mm, dtype=np.float64)
    distance -= 0.01 * range_mm
    return distance


def to_raw(distance_mm: Floats, range_mm: float) -> Integers:
    """The digits nearest to a distance: inverse of `to_mm`, not limited to the range."""
    return np.rint((distance_mm / range_mm + 0.01) * (65520 / 1.02)).astype(np.int32)


def encode(raw: Integers) -> bytes:
    """The frames of raw values (n,), 3 n bytes."""
    frames = np.empty((len(raw), 3), dtype=np.uint8)
    frames[:, 0] = raw & 0x3F
    frames[:, 1] = raw >> 6 & 0x3F | 0x40
    frames[:, 2] = raw >> 12 & 0x3F | 0x80
    return frames.tobytes()


class FrameDecoder:
    """Decodes a byte stream that arrives in chunks of any length.

    The values do not depend on where the chunks are cut. `feed` also counts values that were
    lost: every stretch of bytes without an intact frame counts as one per three bytes begun.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._skipped = 0  # bytes of the present stretch that are not yet counted
        self._joined = False  # the first bytes may be the end of a frame that began before us

    def feed(self, data: bytes) -> tuple[Integers, int]:
        """Raw values (n,) that `data` completes, and the number of values lost."""
        data = self._rest + data
        whole = len(data) - len(data) % 3
        stream = np.frombuffer(data, dtype=np.uint8)
        if self._joined and not self._skipped and whole:
            # Nothing is broken almost always, and then nothing need be searched.
            table = stream[:whole].reshape(-1, 3)
            rest = len(data) - whole
            if ((table & 0xC0) == _TAGS).all() and _unfinished(_tags(stream[whole:])) == rest:
                self._rest = data[whole:]
                return _assemble(table[:, 0], table[:, 1], table[:, 2]), 0
        return self._search(stream)

    def _search(self, stream: Bytes) -> tuple[Integers, int]:
        tags = _tags(stream)
        at = np.flatnonzero((tags[:-2] == 0) & (tags[1:-1] == 1) & (tags[2:] == 2))
        end = int(at[-1]) + 3 if len(at) else 0
        keep = _unfinished(tags[end:])
        lost = self._count_lost(at, len(stream) - keep - end)
        self._rest = stream[len(stream) - keep :].tobytes()
        return _assemble(stream[at], stream[at + 1], stream[at + 2]), lost

    def _count_lost(self, at: NDArray[np.intp], trailing: int) -> int:
        lost = 0
        if len(at):
            gaps = np.diff(at, prepend=-3) - 3
            gaps[0] += self._skipped
            if not self._joined and gaps[0] < 3:
                gaps[0] = 0
            lost = int(np.sum(-(-gaps // 3)))
            self._joined, self._skipped = True, 0
        self._skipped += trailing
        # Garbage without end must be counted while it lasts; thirds counted early change no sum.
        lost += self._skipped // 3
        if self._skipped >= 3:
            self._joined = True
        self._skipped %= 3
        return lost


def _tags(stream: Bytes) -> Bytes:
    return np.right_shift(stream, 6, dtype=np.uint8)


def _assemble(low: Bytes, middle: Bytes, high: Bytes) -> Integers:
    raw = high.astype(np.int32) & 0x3F
    raw <<= 6
    raw |= middle & 0x3F
    raw <<= 6
    raw |= low & 0x3F
    return raw


def _unfinished(tags: Bytes) -> int:
    """How many of the last bytes may be the beginning of a frame: 0, 1 or 2."""
    if len(tags) >= 2 and tags[-2] == 0 and tags[-1] == 1:
        return 2
    return 1 if len(tags) and tags[-1] == 0 else 0


class StepFilter:
    """Sorts out single values that lie further than `max_step_mm` from the median around them.

    The median runs over a value and `REACH` neighbours on each side, so single flipped bits go
    and a real jump stays (it is reported: nothing that stands on an arm jumps). The last `REACH`
    values wait for their neighbours; the result does not depend on the chunks.
    """

    REACH = 4

    def __init__(self, max_step_mm: float) -> None:
        self._max_step_mm = max_step_mm
        self.reset()

    def reset(self) -> None:
        """Forgets what came before: after a gap neighbours are none."""
        self._held: Floats = np.empty(0)
        self._judged = 0  # how many of the held values are only there as neighbours
        self._last: float | None = None

    def feed(self, distance_mm: Floats) -> tuple[Floats, int, float]:
        """Accepted values (m,), number of rejected ones, largest jump between accepted ones (0
        when none exceeds `max_step_mm`), mm."""
        x = np.concatenate((self._held, distance_mm))
        reach = self.REACH
        if len(x) < 2 * reach + 1:
            self._held = x
            return np.empty(0), 0, 0.0
        candidates = x[self._judged : len(x) - reach]
        accepted = candidates
        quiet = float(x.max() - x.min()) <= self._max_step_mm
        if not quiet:
            accepted = candidates[self._plausible(x)]
        self._held = x[len(x) - 2 * reach :]
        self._judged = reach
        jump = self._jump(accepted[:1] if quiet else accepted)
        if len(accepted):
            self._last = float(accepted[-1])
        return accepted, len(candidates) - len(accepted), jump

    def _plausible(self, x: Floats) -> NDArray[np.bool_]:
        windows = np.lib.stride_tricks.sliding_window_view(x, 2 * self.REACH + 1)
        medians = np.median(windows, axis=1)
        index = np.arange(self._judged, len(x) - self.REACH)
        nearest = np.maximum(index - self.REACH, 0)
        return np.asarray(np.abs(x[index] - medians[nearest]) <= self._max_step_mm)

    def _jump(self, accepted: Floats) -> float:
        if len(accepted) == 0:
            return 0.0
        before = accepted[0] if self._last is None else self._last
        steps = np.diff(accepted, prepend=before)
        largest = float(steps[np.argmax(np.abs(steps))])
        return largest if abs(largest) > self._max_step_mm else 0.0
