"""Whether what takes any path in time goes as drifts do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.fit import Fit
from identification.gap.words import DRIFTS

HEAT = frozenset({"thermal_drift"})
_SLOW, _MOSTLY = 5, 0.6  # degree of what is slow; share of what is not: three times to and fro
# Warm robots move by up to 400 um over hours, lasers by 1 um/K: some hundred times as fast is
# no heat.
FASTEST = 400e-6 / 60  # m/s
# A kilogram of aluminium (900 J/kg/K) in still air (10 W/m^2/K on 0.05 m^2) follows it in half an
# hour, a light stand in some minutes: heat does not come and leave again, most of it, within this.
# Of paths of the blind check those of who leaned on the stand did by two thirds of their range and
# more, others by a quarter at most. (Of sessions beyond some fifty minutes the pieces of a path lie
# too far apart to tell.)
BACK_WITHIN_S, BACK = 200.0, 0.6


def is_implausible_drift(engine: Engine, fitted: Fit) -> bool:
    """Whether a drift of a fit swings, hurries or turns back at once."""
    return _swings(fitted) or _hurries(engine, fitted) or _turns_back(engine, fitted)


def _swings(fitted: Fit) -> bool:
    """Whether a drift comes and goes again and again: warming rigs and leaking charges do not,
    however they wander; air conditioning does, machines next door, and what a law leaves of every
    run."""
    for path in _free_paths(fitted, DRIFTS):
        about = path - path.mean(axis=0)
        slow = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, len(path)), _SLOW)
        rest = about - slow @ np.linalg.lstsq(slow, about, rcond=None)[0]
        if np.sum(rest**2) > _MOSTLY * np.sum(about**2):
            return True
    return False


def _hurries(engine: Engine, fitted: Fit) -> bool:
    """Whether a displacement is said to drift faster than anything warms up: somebody leans on the
    stand, something is moved."""
    return engine.bench.rows.clock and any(
        np.abs(np.diff(path, axis=0)).max() > FASTEST * _step(engine, path)
        for path in _free_paths(fitted, HEAT)
    )


def _turns_back(engine: Engine, fitted: Fit) -> bool:
    """Whether a displacement is said to go most of its way, and back, faster than heat leaves:
    somebody leaned on the stand."""
    if not engine.bench.rows.clock:
        return False
    for path, seen in zip(_free_paths(fitted, HEAT), _seen(engine, fitted), strict=True):
        time = np.arange(len(path)) * _step(engine, path)
        for way, there in zip(path.T, seen.T, strict=True):
            shown = way[there]
            if there.any() and there_and_back(shown, time[there]) > BACK * float(np.ptp(shown)):
                return True
    return False


def _seen(engine: Engine, fitted: Fit) -> Iterator[Flags]:
    """(pieces, paths) of every path of heat: the pieces that rows show."""
    n = engine.bench.rows.n
    for part in fitted.parts:
        if part.word in HEAT and part.variant.free_pieces:
            shown = np.any(engine.columns(part.variant.columns)[:n] != 0, axis=0)
            yield shown.reshape(-1, part.variant.free_pieces).T


def there_and_back(way: Array, time: Array) -> float:
    """How far a path (n,) goes, and comes back, within BACK_WITHIN_S at most; time (n,) s."""
    most = 0.0
    for start in range(len(way)):
        here = way[start : np.searchsorted(time, time[start] + BACK_WITHIN_S, side="right")]
        for turn in range(1, len(here) - 1):
            out = here[turn] - here[0]
            back = np.sign(out) * (here[turn] - here[turn + 1 :])
            most = max(most, float(np.minimum(abs(out), back).max()))
    return most


def _step(engine: Engine, path: Array) -> float:
    """Time (s) between the pieces of a path."""
    return engine.bench.load_history.session_span / (len(path) - 1)


def _free_paths(fitted: Fit, words: frozenset[str]) -> Iterator[Array]:
    """(pieces, paths) of every part of these words that takes any path."""
    for i, part in enumerate(fitted.parts):
        if part.word in words and part.variant.free_pieces:
            yield fitted.of(i)[0].reshape(-1, part.variant.free_pieces).T
