"""Which words explain a case as well as the true one: computed, case by case.

Every word's textbook forms are fitted, beside the nuisances, to the case without its noise. A word
is accepted when what it leaves is at most half the noise, or no more than a tenth above what the
true word's own textbook form leaves, if that explains most of the gap. What is left counts over all
channels that were recorded, in units of their noise, per row of displacement.
"""

from __future__ import annotations

import numpy as np

from rig.arrays import Array
from rig.worlds.arm import place
from rig.worlds.hidden.observed import Bounds, Observed, noise_free_observation, nuisances
from rig.worlds.hidden.scene import Change, Scene
from rig.worlds.hidden.textbook import FORMS, Explanation
from rig.worlds.hidden.words import EFFECTS

WITHIN_NOISE = 0.5
NO_WORSE = 1.1
MOST_LEFT = 0.3
WORTH_MORE = 0.7
NO_CASE = 1.0  # what springs, gains and datum must leave, for there to be a question
_CLOSER_LOOKS = 4  # of the best forms of a word, once bounds are left aside
_OFFSET_M, _ANGLE_RAD = 0.4, 0.12


def left_over(
    scene: Scene, changes: list[Change], noise_mm: float, word: str | None
) -> dict[str, float]:
    """Of every word, and of "none": what its best textbook form leaves, in units of the noise.

    `word` is the true one. What lies above the limit of acceptance is a lower bound.
    """
    seen = noise_free_observation(scene, changes, noise_mm)
    base, bounds = nuisances(seen)
    q = np.array([scene.plan.poses[s.pose] for s in scene.plan.setups])[seen.setup]
    simulated = seen.joints(seen.pushed(seen.force))
    target = seen.stack(seen.displacement, seen.q - q, seen.components) - simulated
    fit = _Fit(seen, base, bounds, target)
    own = fit.best(word, np.inf) if word in EFFECTS else 0.0
    limit = max(WITHIN_NOISE, NO_WORSE * own)
    out = {"none": fit.alone()}
    for rival in EFFECTS:
        out[rival] = own if rival == word else fit.best(rival, limit)
    return out


def accepted(left: dict[str, float], word: str, snr: float) -> set[str]:
    """The true word and its equals. `snr`: the effect's structural gap over the noise, of which a
    word has to explain most: where the true one's textbook form is poor, a poor rival is no
    equal; and a word that explains little beyond springs, gains and datum explains nothing."""
    limit = max(WITHIN_NOISE, min(NO_WORSE * left.get(word, 0.0), MOST_LEFT * snr))
    limit = min(limit, WORTH_MORE * left["none"])
    return {word} | {w for w in EFFECTS if left[w] <= limit}


class _Fit:
    """One case without noise, against every word in turn."""

    def __init__(
        self, seen: Observed, base: list[Array], bounds: list[Bounds], target: Array
    ) -> None:
        self._seen, self._base, self._bounds, self._target = seen, base, bounds, target

    def alone(self) -> float:
        """What the nuisances leave."""
        return self._root(_fitted(self._base, self._bounds, self._target, 1)[0])

    def best(self, word: str | None, limit: float) -> float:
        """What the word leaves; the bounds are looked at only where it could pass the limit."""
        if word == "pose_error":
            return self._root(_posed(self._seen, self._base, self._bounds, self._target))
        forms = FORMS[str(word)](self._seen)
        return self._chosen(forms, limit) if forms else float("inf")

    def _root(self, squares: float) -> float:
        return float(np.sqrt(max(squares, 0.0) / len(self._seen.rows)))

    def _chosen(self, forms: list[Explanation], limit: float) -> float:
        pool = [c for form in forms for c in form.columns]
        matrix = np.column_stack([*self._base, *pool, self._target])
        gram = matrix.T @ matrix
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scale[-1] = 1.0
        gram = gram / np.outer(scale, scale)
        picks, at = [], len(self._base)
        for form in forms:
            picks.append([*range(len(self._base)), *range(at, at + len(form.columns))])
            at += len(form.columns)
        loose = np.array([_loose(gram, pick) for pick in picks])
        order = np.argsort(loose)
        if self._root(loose[order[0]]) > limit:
            return self._root(loose[order[0]])
        best = np.inf
        for k in order[:_CLOSER_LOOKS]:
            limits = np.array([*self._bounds, *forms[k].bounds]).T * scale[picks[k]]
            best = min(best, _bounded(gram, picks[k], limits))
        return self._root(best)


def _loose(gram: Array, pick: list[int]) -> float:
    """Squares left by the columns `pick` without bounds."""
    a = gram[np.ix_(pick, pick)] + 1e-11 * np.eye(len(pick))
    b = gram[pick, -1]
    return float(gram[-1, -1] - b @ np.linalg.solve(a, b))


def _bounded(gram: Array, pick: list[int], limits: Array) -> float:
    """Squares left within the limits (2, columns)."""
    from scipy.optimize import lsq_linear

    values, vectors = np.linalg.eigh(gram[np.ix_(pick, pick)])
    keep = values > 1e-13 * values[-1]
    root = np.sqrt(values[keep])
    right = vectors[:, keep].T @ gram[pick, -1] / root
    fit = lsq_linear(root[:, None] * vectors[:, keep].T, right, (limits[0], limits[1]))
    return float(gram[-1, -1] - right @ right + 2.0 * fit.cost)


def _posed(seen: Observed, base: list[Array], bounds: list[Bounds], target: Array) -> float:
    """Tool offset and standing angles together, by Gauss and Newton's steps."""
    offset, turn = np.zeros(3), np.zeros(6)
    best = np.inf
    for _ in range(4):
        now = _standing(seen, offset, turn)
        columns = []
        for k in range(9):
            step = np.zeros(9)
            step[k] = 1e-4
            moved = _standing(seen, offset + step[:3], turn + step[3:])
            columns.append((moved - now) / 1e-4)
        limits = [(-_OFFSET_M - o, _OFFSET_M - o) for o in offset]
        limits += [(-_ANGLE_RAD - a, _ANGLE_RAD - a) for a in turn]
        rest = target - (now - _standing(seen, np.zeros(3), np.zeros(6)))
        squares, found = _fitted([*base, *columns], [*bounds, *limits], rest, 9)
        best = min(best, squares)
        offset, turn = offset + found[:3], turn + found[3:]
    return best


def _fitted(
    columns: list[Array], bounds: list[Bounds], target: Array, last: int
) -> tuple[float, Array]:
    from scipy.optimize import lsq_linear

    matrix = np.column_stack(columns)
    scale = np.sqrt(np.maximum(np.sum(matrix**2, axis=0), 1e-300))
    triangle = np.asarray(
        np.linalg.qr(np.column_stack([matrix / scale, target]), mode="r"), dtype=float
    )
    limits = np.array(bounds).T * scale
    fit = lsq_linear(triangle[:, :-1], triangle[:, -1], (limits[0], limits[1]))
    return 2.0 * float(fit.cost), fit.x[-last:] / scale[-last:]


def _standing(seen: Observed, offset_m: Array, turn_rad: Array) -> Array:
    """What believed springs give when the arm stands turned and the tool is offset."""
    scene = seen.scene
    lever, stands = [], []
    for s, setup in enumerate(scene.plan.setups):
        arm = place(scene.plan.poses[setup.pose] + turn_rad)
        tool = arm.tool(scene.plan.tcp_mm * 1e-3 + offset_m)
        lever.append(arm.levers(tool) @ scene.unit[s])
        stands.append(turn_rad)
    along = np.array(lever)[scene.history.setup]
    rad = along * seen.force[:, None] / scene.plan.believed
    moved = seen.zeroed(1e3 * np.sum(along * rad, axis=1))
    output = scene.plan.recorded.encoder == "output"
    q = np.array(stands)[seen.setup] + (rad[seen.instants] if output else 0.0)
    return seen.stack(moved, q)
