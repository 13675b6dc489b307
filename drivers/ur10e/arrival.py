"""Whether a program has brought the arm to its reference pose: told by reading, not by asking."""

from __future__ import annotations

import time
from collections.abc import Sequence

from drivers.errors import BadReply
from drivers.readings import RobotState
from drivers.ur10e.words import PLAYING

STILL_RAD_PER_S = 0.002  # the controller's own speed readings scatter by less when it stands
STILL_FOR_S = 0.5


class Arrival:
    """Looks at one state of the arm after the other; the deadline runs from the start on."""

    def __init__(
        self,
        device: str,
        program: str,
        q_rad: Sequence[float],
        tolerance_rad: float,
        deadline_s: float,
    ) -> None:
        self.program = program
        self._device = device
        self._q_rad = q_rad
        self._tolerance_rad = tolerance_rad
        self._deadline_s = deadline_s
        self._deadline = time.monotonic() + deadline_s
        self._still_since: float | None = None
        self._runtime = -1

    def seen_in(self, state: RobotState) -> bool:
        """Whether the arm has arrived: within the tolerance, standing still for half a second with
        the program state steady. Raises BadReply when it never will: ended elsewhere, or too late.
        """
        now = time.monotonic()
        steady = state.runtime_state == self._runtime
        still = state.speed_rad_per_s < STILL_RAD_PER_S and steady
        self._runtime = state.runtime_state
        self._still_since = (self._still_since or now) if still else None
        if self._still_since is not None and now - self._still_since >= STILL_FOR_S:
            where = _farthest(state.q, self._q_rad)
            if where[1] <= self._tolerance_rad:
                return True
            if state.runtime_state != PLAYING:
                raise self._elsewhere("ended", where)
        if now > self._deadline:
            what = f"did not arrive within {self._deadline_s:g} s: the arm stands"
            raise self._elsewhere(what, _farthest(state.q, self._q_rad))
        return False

    def _elsewhere(self, what: str, where: tuple[int, float]) -> BadReply:
        joint, off = where
        fault = (
            f'the program "{self.program}" {what} with joint {joint} {off:.4f} rad away from the '
            f"reference pose (allowed {self._tolerance_rad:.4f} rad)"
        )
        remedy = "Look at the pendant, and compare the program's last waypoint with the protocol."
        return BadReply(self._device, fault, remedy)


def _farthest(q: Sequence[float], q_ref: Sequence[float]) -> tuple[int, float]:
    """Number of the joint that is farthest from the reference (1-6), and by how much, rad."""
    off = [abs(a - b) for a, b in zip(q, q_ref, strict=True)]
    worst = max(range(len(off)), key=off.__getitem__)
    return worst + 1, off[worst]
