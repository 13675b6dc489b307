"""Where the gap lies: directions, poses, forces, branches, repetitions, joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array, Flags
from identification.gap.data import BRANCH_NAMES
from identification.gap.evidence.engine import Engine
from identification.gap.explanations.fit import Fit
from identification.gap.model.variants import Variant
from identification.gap.words import IN_JOINTS, INSTRUMENTS, LINEAR, SPRINGS

_SHOWS = 0.15  # an effect shows where it reaches this share of its largest part


@dataclass(frozen=True, eq=False)
class Where:
    """Names, force ranges (N) of directions, joints from 1, share of the gap: `where` in JSON."""

    directions: tuple[str, ...]
    poses: tuple[str, ...]
    force: dict[str, tuple[float, float]]
    branches: tuple[str, ...]
    repetitions: tuple[int, ...]
    joints: tuple[int, ...]
    seen_by_encoders: bool | None
    share: float


NOWHERE = Where((), (), {}, (), (), (), None, 0.0)


def locate(engine: Engine, verdict: str, fit: Fit, sizes: Sequence[float], gap: Array) -> Where:
    """From what the verdict's effect does, in all joints and directions in which it sits; of what
    no effect explains, from the gap (n,) that springs leave. sizes: of the effects, rms m."""
    if verdict == "none":
        return NOWHERE
    bench, n = engine.bench, engine.bench.rows.n
    same = [i for i, p in enumerate(fit.parts) if p.word == verdict]
    main = sum((fit.contribution(engine, i)[:n] for i in same), np.zeros(n)) if same else gap
    moved = bench.rows.about_means(main)
    if same and verdict not in LINEAR:
        moved = _beyond_springs(engine, moved)
    per_setup = _size_per_setup(engine, moved)
    top = per_setup.max()
    if not top > 0:
        return NOWHERE
    shows = per_setup >= _SHOWS * top
    setups = [s for s, yes in zip(bench.data.setups, shows, strict=True) if yes]
    rows = shows[bench.rows.setup] & (np.abs(main) >= _SHOWS * np.abs(main).max())
    square = bench.rows.weight * gap**2  # every sample counts, not every row
    total, inside = float(square.sum()), float(square[shows[bench.rows.setup]].sum())
    return Where(
        directions=tuple(dict.fromkeys(s.direction for s in setups)),
        poses=tuple(dict.fromkeys(s.pose for s in setups if s.pose)),
        force=_ranges(engine, rows),
        branches=tuple(BRANCH_NAMES[b] for b in np.unique(bench.rows.branch[rows])),
        repetitions=tuple(int(r) for r in np.unique(bench.rows.repetition[rows])),
        joints=_joints(engine, verdict, fit, sizes) if same else (),
        seen_by_encoders=_seen(engine, verdict if same else ""),
        share=inside / total if total > 0 else 0.0,
    )


def _seen(engine: Engine, word: str) -> bool | None:
    """Whether readings of the joints show an effect; None where they can't tell. What no joint does
    none of them shows, whichever side of the gear they are on."""
    if engine.bench.data.q is None or not word or word in INSTRUMENTS:
        return None
    if word not in IN_JOINTS | {SPRINGS}:
        return False
    return True if engine.bench.has_q else None


def _beyond_springs(engine: Engine, moved: Array) -> Array:
    """What an effect moves (n,) less what the springs would take over per setup."""
    out, bench = moved.copy(), engine.bench
    load = bench.rows.about_means(bench.load)
    for s in range(len(bench.data.setups)):
        mine = bench.rows.setup == s
        weight, x = bench.rows.weight[mine], load[mine]
        power = float(weight @ x**2)
        if power > 0:
            out[mine] -= x * float(weight @ (x * moved[mine])) / power
    return out


def _size_per_setup(engine: Engine, values: Array) -> Array:
    """(s,) rms of values (n,) in every setup, each sample counted."""
    rows, count = engine.bench.rows, len(engine.bench.data.setups)
    squares = np.bincount(rows.setup, weights=rows.weight * values**2, minlength=count)
    samples = np.bincount(rows.setup, weights=rows.weight, minlength=count)
    return np.asarray(np.sqrt(squares / np.maximum(samples, 1)))


def _ranges(engine: Engine, rows: Flags) -> dict[str, tuple[float, float]]:
    bench = engine.bench
    out: dict[str, tuple[float, float]] = {}
    for s, setup in enumerate(bench.data.setups):
        force = bench.rows.force[rows & (bench.rows.setup == s)]
        if force.size:
            old = out.get(setup.direction, (np.inf, -np.inf))
            low, high = force.min(), force.max()
            nothing = _ROUNDING * max(abs(low), abs(high))  # sums of zeros and their datum
            low, high = (float(v) if abs(v) > nothing else 0.0 for v in (low, high))
            out[setup.direction] = min(old[0], low), max(old[1], high)
    return out


_ROUNDING = 1e-12


def _joints(engine: Engine, verdict: str, fit: Fit, sizes: Sequence[float]) -> tuple[int, ...]:
    """Joints (from 1) in which those joint effects of the explanation sit that matter, by their
    sizes (rms m): the verdict's beside its largest, others beside the largest of all; of a bench,
    none."""
    if not engine.bench.data.arm:
        return ()
    own = max(s for p, s in zip(fit.parts, sizes, strict=True) if p.word == verdict)
    out: list[int] = []
    for i, p in enumerate(fit.parts):
        if sizes[i] < _COUNTS * (own if p.word == verdict else max(sizes)):
            continue
        if p.variant.joint is not None:
            out.append(p.variant.joint + 1)
        elif p.word == SPRINGS:
            w, cov = fit.of(i)
            part = np.abs(w) * _size_of_each(engine, p.variant)
            shows = (np.abs(w) > 2 * np.sqrt(np.diag(cov))) & (part >= _SHOWS * part.max())
            out += [j + 1 for j, s in zip(p.variant.joints, shows, strict=True) if s]
    return tuple(dict.fromkeys(out))


_COUNTS = 0.1  # of the largest effect, a hundredth of its square: there the gap does not lie


def _size_of_each(engine: Engine, variant: Variant) -> Array:
    """(k,) rms of what unit coefficients do to the response, without the datum of each setup."""
    rows = engine.bench.rows
    return np.array([rows.rms(v) for v in rows.about_means(engine.responses(variant.columns)).T])
