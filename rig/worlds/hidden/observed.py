"""What an analyst would hold of a case without its noise: channels in units of their noise.

The rows are the first, second and last sample of every hold. Displacement is zeroed as
the instrument does it; the force component along the direction drives every explanation, except
at zero load, where it is known to be zero and thus a channel itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array
from rig.worlds.hidden.gap import SPRING_BOUND, zeroed
from rig.worlds.hidden.noise import CROSSTALK, GAIN_BOUND, Q_NOISE_RAD
from rig.worlds.hidden.scene import Change, History, Index, Reading, Scene, observe_path

Bounds = tuple[float, float]
_ALMOST_ZERO_N = 1e-9


@dataclass(frozen=True)
class Observed:
    """rows (k) among the samples and instants (k) of the history; force (n) N along the direction
    as measured at every instant; displacement (k) mm, q (k, 6) rad, components (k, 3) N; weights
    1 / sd, zero where a channel was not recorded."""

    scene: Scene
    rows: Index
    instants: Index
    force: Array
    displacement: Array
    q: Array
    components: Array
    weight_displacement: float
    weight_q: float
    weight_components: Array

    @property
    def setup(self) -> Index:
        """(k) setup of every row."""
        return self.scene.history.setup[self.instants]

    @property
    def lever(self) -> Array:
        """(k, 6) m per rad along the direction."""
        along = np.einsum("sij,sj->si", self.scene.levers, self.scene.unit)
        return np.asarray(along[self.setup])

    @property
    def load(self) -> Array:
        """(k) N along the direction as measured."""
        return self.force[self.instants]

    def zeroed(self, displacement_mm: Array) -> Array:
        """(k) mm after the datum, of a displacement (n) at every instant."""
        scene = self.scene
        samples = displacement_mm[scene.history.sample]
        return zeroed(scene, samples, scene.plan.recorded.datum == "repetition")[self.rows]

    def stack(
        self,
        displacement: Array | None = None,
        q: Array | None = None,
        components: Array | None = None,
    ) -> Array:
        """One weighted column: displacement (k) mm, q (k, 6) rad, components (k, 3) N."""
        count = len(self.rows)
        parts = [np.zeros(count) if displacement is None else displacement]
        parts[0] = parts[0] * self.weight_displacement
        if self.weight_q:
            parts.append(np.zeros(6 * count) if q is None else self.weight_q * q.ravel())
        mask = self.weight_components > 0
        if components is None:
            parts.append(np.zeros(int(mask.sum())))
        else:
            parts.append((self.weight_components * components)[mask])
        return np.concatenate(parts)

    def joints(self, rad: Array) -> Array:
        """A column of extra joint deflection (n, 6) rad at every instant."""
        lever = np.einsum("sij,sj->si", self.scene.levers, self.scene.unit)
        moved = 1e3 * np.sum(lever[self.scene.history.setup] * rad, axis=1)
        output = self.scene.plan.recorded.encoder == "output"
        return self.stack(self.zeroed(moved), rad[self.instants] if output else None)

    def joint(self, joint: int, rad: Array) -> Array:
        """The same of one joint alone, from 0, and its path (n) rad."""
        scene = self.scene
        lever = np.einsum("sj,sj->s", scene.levers[:, joint], scene.unit)
        moved = self.zeroed(1e3 * lever[scene.history.setup] * rad)
        if not (self.weight_q and scene.plan.recorded.encoder == "output"):
            return self.stack(moved)
        q = np.zeros((len(self.rows), 6))
        q[:, joint] = rad[self.instants]
        return self.stack(moved, q)

    def outside(self, moved_m: Array) -> Array:
        """A column of displacement (n) m at every instant that no encoder sees."""
        return self.stack(self.zeroed(1e3 * moved_m))

    def pushed(self, force: Array) -> Array:
        """(n, 6) rad that believed springs give under a force (n) N along the direction."""
        lever = np.einsum("sij,sj->si", self.scene.levers, self.scene.unit)
        return np.asarray(
            lever[self.scene.history.setup] * force[:, None] / self.scene.plan.believed
        )


def noise_free_observation(scene: Scene, changes: list[Change], noise_mm: float) -> Observed:
    """The case without noise. `noise_mm`: rms of what is random in the displacement."""
    kept = _kept(scene)
    full = observe_path(scene, changes)
    path = Reading(full.displacement_mm[kept], full.force_N[kept], full.q[kept])
    scene = replace(scene, history=_thinned(scene.history, kept))
    history, recorded = scene.history, scene.plan.recorded
    force = tared_path(scene, path.force_N)
    rows = _representatives(scene)
    instants = history.sample[rows]
    unit = scene.unit[history.setup]
    zero = np.abs(history.load[instants]) < _ALMOST_ZERO_N
    along = np.abs(unit[instants]) > 0.5
    sd = scene.plan.instruments.force_N
    weights = np.where(along, zero[:, None] / sd, float(recorded.components) / sd)
    seen = Observed(
        scene=scene,
        rows=rows,
        instants=instants,
        force=np.sum(force * unit, axis=1),
        displacement=np.zeros(0),
        q=path.q[instants],
        components=force[instants],
        weight_displacement=1.0 / noise_mm,
        weight_q=1.0 / Q_NOISE_RAD if recorded.q else 0.0,
        weight_components=weights,
    )
    object.__setattr__(seen, "displacement", seen.zeroed(path.displacement_mm))
    return seen


def _kept(scene: Scene) -> Index:
    """Instants that an explanation needs: samples, ends and every fourth step of a turn, rests."""
    history = scene.history
    keep = np.zeros(len(history.time), dtype=bool)
    keep[history.sample] = True
    still = np.diff(history.load) == 0.0
    keep[1:] |= still
    keep[:-1] |= still
    keep[::4] = True
    keep[history.run_starts] = True
    return np.flatnonzero(keep)


def _thinned(history: History, kept: Index) -> History:
    return replace(
        history,
        time=history.time[kept],
        load=history.load[kept],
        setup=history.setup[kept],
        run=history.run[kept],
        sample=np.searchsorted(kept, history.sample),
    )


def tared_path(scene: Scene, force: Array) -> Array:
    """(n) or (n, 3) N at every instant: minus the first sample of the session, or of the run."""
    history = scene.history
    if scene.plan.recorded.tare == "session":
        return np.asarray(force - force[history.sample[0]])
    run = history.run[history.sample]
    first = history.sample[np.flatnonzero(np.diff(run, prepend=-1))]
    return np.asarray(force - force[first][history.run])


def _representatives(scene: Scene) -> NDArray[np.int64]:
    history = scene.history
    run = history.run[history.sample]
    key = (run * 3 + history.branch) * 1000 + history.step
    begins = np.flatnonzero(np.diff(key, prepend=-1))
    ends = np.append(begins[1:], len(key))
    chosen = {
        int(i) for b, e in zip(begins, ends, strict=True) for i in (b, min(b + 1, e - 1), e - 1)
    }
    return np.array(sorted(chosen))


def nuisances(seen: Observed) -> tuple[list[Array], list[Bounds]]:
    """Columns that every explanation has, with bounds: springs, gains, datum, cross-talk."""
    plan = seen.scene.plan
    elastic = seen.pushed(seen.force)
    bound = SPRING_BOUND * plan.relative_sd
    columns, bounds = [], []
    for j in range(6):
        columns.append(seen.joints(elastic * (np.arange(6) == j)))
        bounds.append((1 / (1 + bound) - 1, 1 / max(1 - bound, 0.05) - 1))
    gain = GAIN_BOUND * plan.instruments.force_gain
    columns.append(seen.joints(elastic))
    bounds.append((-gain, gain))
    gain = GAIN_BOUND * plan.instruments.displacement_gain
    # of what is expected, not of what was seen: the latter would explain anything
    lever = np.einsum("sij,sj->si", seen.scene.levers, seen.scene.unit)
    moved = np.sum(lever[seen.scene.history.setup] * elastic, axis=1)
    columns.append(seen.outside(moved))
    bounds.append((-gain, gain))
    history = seen.scene.history
    group = history.run if plan.recorded.datum == "repetition" else history.setup
    for g in np.unique(group[seen.instants]):
        columns.append(seen.stack((group[seen.instants] == g).astype(float)))
        bounds.append((-np.inf, np.inf))
    if plan.recorded.components:
        for column in _crosstalk(seen):
            columns.append(column)
            bounds.append((-CROSSTALK, CROSSTALK))
    return columns, bounds


def _crosstalk(seen: Observed) -> list[Array]:
    unit = seen.scene.unit[seen.setup]
    out = []
    for a in range(3):
        for b in range(3):
            if a != b and np.any(np.abs(unit[:, b]) > 0.5):
                into = np.zeros((len(seen.rows), 3))
                into[:, a] = unit[:, b] * seen.load
                out.append(seen.stack(components=into))
    return out
