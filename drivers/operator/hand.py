"""How a careful person turns the screw: decides from what can be seen, remembers what it did."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

from drivers.interfaces import LiveView, Phase

LARGEST_TURN_MM = 0.3
SMALLEST_TURN_MM = 0.001
GENTLE_TURN_MM = 0.1
LONGEST_SEARCH_MM = 20.0  # free travel without contact after which turning makes no sense
LARGEST_LOOSENING_MM = 0.5  # to zero load nothing can be overshot
FIRST_GUESS_N_PER_MM = 150.0  # stiffer than the arm: first turns come out too small, not too large
SEARCH_GUESS_N_PER_MM = 100.0
GAVE_WAY = 0.3  # of the stiffest: below it the arm gives way, above it it is merely soft
HAND_MM_PER_S = 1.0
STANDS_BY: tuple[Phase, ...] = ("idle", "mounting", "settling", "sampling", "paused")
PATIENCE_S, PATIENCE_WALL_S = 5.0, 0.5


@dataclass
class _Turn:
    """A turn whose effect is awaited; `forces` are the different readings since."""

    advance_mm: float
    force_before_N: float
    searching: bool  # without contact: nothing can be learnt from it
    expected_N: float
    at_s: float
    at_wall: float
    forces: list[float] = field(default_factory=list)


class Hand:
    """Decides about turns from live views alone.

    Goes to a target from one side in a few turns that get smaller, by the stiffness that its own
    turns have shown; waits after each until the force stands; keeps turning in bounded steps when
    the arm gives way and the force stalls; loosens until the force no longer answers for a target
    of zero. Never turns while the arm settles, while sampling or paused, or when a value is stale.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Everything is set up anew: nothing that was learnt holds."""
        self._turn: _Turn | None = None
        self._stiffness = self._stiffest = FIRST_GUESS_N_PER_MM
        self._known = False
        self._released = False
        self._free_force_N = 0.0
        self._gap_mm = 0.0  # loosened beyond the last contact
        self._searched_mm = 0.0
        self._net_mm = self._contact_mm = 0.0  # turned since the set-up: now, and at contact
        self._last = (0.0, 0.0)  # advance mm and change of force N of the last turn
        self._target_N: float | None = None
        self._sense = 0.0
        self._loading = 1.0

    @property
    def released(self) -> bool:
        """Whether the screw is known not to touch the arm."""
        return self._released

    def decide(self, view: LiveView, now_s: float) -> float | None:
        """The advance to turn now, mm (negative loosens), or None. `now_s`: the clock's."""
        if view.stale or view.phase in STANDS_BY:
            return None
        if not (math.isfinite(view.force_N) and math.isfinite(view.target_N)):
            return None
        if not self._at_rest(view, now_s):
            return None
        if view.target_N != self._target_N:
            self._new_target(view)
        advance = self._release(view) if view.target_N == 0 else self._approach(view)
        if advance is None or abs(advance) < SMALLEST_TURN_MM:
            return None
        largest = LARGEST_TURN_MM if view.target_N else LARGEST_LOOSENING_MM
        advance = max(-largest, min(largest, advance))
        free = self._is_free(view)
        expected = 0.0 if free else self._stiffness * advance
        self._net_mm += advance
        self._turn = _Turn(advance, view.force_N, free, expected, now_s, time.monotonic())
        return advance

    def turned_back(self, way_mm: float) -> None:
        """Told that the screw was turned back by so much, to where it touches nothing.

        The next contact is expected where the last one began, no earlier.
        """
        self._turn = None
        self._target_N = 0.0
        self._released = True
        self._free_force_N = 0.0
        self._net_mm -= way_mm
        self._gap_mm = max(0.0, self._contact_mm - self._net_mm)

    def _at_rest(self, view: LiveView, now_s: float) -> bool:
        turn = self._turn
        if turn is None:
            return True
        if not turn.forces or turn.forces[-1] != view.force_N:
            turn.forces.append(view.force_N)
        moved_s = now_s - turn.at_s
        waited_s = time.monotonic() - turn.at_wall
        impatient = moved_s > PATIENCE_S and waited_s > PATIENCE_WALL_S
        if not impatient and not self._stands(turn, moved_s, _noise_N(view)):
            return False
        change = view.force_N - turn.force_before_N
        self._last = (turn.advance_mm, change)
        if not turn.searching and self._target_N != 0:
            self._learn(turn.advance_mm, change)
        self._turn = None
        return True

    @staticmethod
    def _stands(turn: _Turn, moved_s: float, noise_N: float) -> bool:
        # Readings lag behind the hand by one or two of their own periods, whose length is not
        # known here; so different readings are counted, more of them while no answer is seen.
        forces = turn.forces
        change = abs(forces[-1] - turn.force_before_N)
        answered = change > 0.4 * abs(turn.expected_N) + noise_N
        wanted = 3 if answered else 4 if turn.searching else 5
        if moved_s < abs(turn.advance_mm) / HAND_MM_PER_S + 0.2 or len(forces) < wanted:
            return False
        return abs(forces[-1] - forces[-2]) < noise_N

    def _learn(self, advance_mm: float, change_N: float) -> None:
        if abs(advance_mm) < 0.02 and abs(change_N) < 1.0:
            return  # noise would decide
        shown = max(0.1, change_N / advance_mm)
        if self._known:
            # Stiffer is believed at once, softer by half: errors make turns too small.
            self._stiffness = max(shown, 0.5 * (self._stiffness + shown))
            self._stiffest = max(self._stiffest, self._stiffness)
        else:
            self._known = True
            self._stiffness = self._stiffest = shown

    def _new_target(self, view: LiveView) -> None:
        sense = math.copysign(1.0, view.target_N - view.force_N)
        # Where the arm gave way it may stand firm again, and after a turn of the tide it does.
        if sense != self._sense or self._stiffness < GAVE_WAY * self._stiffest:
            self._stiffness = self._stiffest
        self._sense = sense
        if self._released:
            self._free_force_N = view.force_N  # taring has moved it
        self._target_N = view.target_N
        self._last = (0.0, 0.0)
        if view.target_N != 0:
            self._loading = math.copysign(1.0, view.target_N)
            self._released = False

    def _is_free(self, view: LiveView) -> bool:
        return abs(view.force_N - self._free_force_N) < max(1.0, 2 * _noise_N(view))

    def _approach(self, view: LiveView) -> float | None:
        need = view.target_N - view.force_N
        overshot = need * self._sense < 0
        tolerated = view.band_N if overshot else 0.5 * view.band_N
        if abs(need) <= tolerated:
            return None
        if overshot:
            return 0.7 * need / self._stiffest
        if self._is_free(view) and need * self._loading > 0:
            return self._search(view)
        if self._searched_mm:
            self._contact_mm = self._net_mm
        self._searched_mm = self._gap_mm = 0.0
        share = 0.9 if abs(need) > 3 * view.band_N else 1.0
        return share * need / self._stiffness

    def _search(self, view: LiveView) -> float | None:
        if self._searched_mm > LONGEST_SEARCH_MM:
            return None
        stiffness = self._stiffest if self._known else SEARCH_GUESS_N_PER_MM
        step = min(GENTLE_TURN_MM, 0.6 * abs(view.target_N) / stiffness)
        if self._gap_mm > 0:
            step = max(step, min(0.8 * self._gap_mm, LARGEST_TURN_MM))
        self._gap_mm = max(0.0, self._gap_mm - step)
        if self._gap_mm < 0.02:
            self._gap_mm = 0.0
        self._searched_mm += step
        return math.copysign(step, self._loading)

    def _release(self, view: LiveView) -> float | None:
        last, change = self._last
        if self._released:
            # The arm may creep back to the screw. (After a tare it only looks so; a little more
            # clearance does no harm.)
            if self._is_free(view):
                return None
            self._released = False
        elif last * self._loading < 0 and abs(change) < _noise_N(view):
            self._gap_mm += abs(last)
            # Drift may leave a force without contact: near zero one turn without an answer is
            # enough, elsewhere two.
            if abs(view.force_N) < 1.0 or self._gap_mm > 1.5 * GENTLE_TURN_MM:
                self._released = True
                self._free_force_N = view.force_N
                return None
        else:
            self._gap_mm = 0.0
        if abs(change) < _noise_N(view) and last:
            return -self._loading * GENTLE_TURN_MM
        loosen = abs(view.force_N) / self._stiffest + 0.03
        return -self._loading * max(GENTLE_TURN_MM, loosen)


def _noise_N(view: LiveView) -> float:
    return max(0.2, view.band_N / 3)
