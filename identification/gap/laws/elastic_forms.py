"""Forms of a curved spring: a line and hinges; of a rig without an arm those that lock, a fine one,
and one from level to level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.gap.laws.curves import from_level_to_level, hinge, slopes
from identification.gap.model.bench import Bench
from identification.gap.model.variants import Variant, smooth_root, variant

WORD = "joint_nonlinear_stiffness"
SCALES = (0.05, 0.15, 0.4, 1.0)
# Of a rig without an arm, where rubber locks and foam buckles and is squeezed flat: close together
# at both ends of the range, and up to a hundred times stiffer.
FINE = (
    *(0.01, 0.02, 0.035, 0.05, 0.075),
    *(0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8),
    *(0.86, 0.91, 0.95, 0.98),
)
FINE_SCALES = (0.15, 1.0, 6.0, 40.0)
STEEPER = (2, 3, 5, 9, 17, 33)  # powers of the load
EARLY = (0.01, 0.03, 0.1, 0.3)  # b of `x / (x + b)`, of the range of the load
_STIFFEST = -0.95


def curve(
    bench: Bench,
    joint: int,
    name: str,
    columns: list[int],
    places: Sequence[Any],
    *,
    root: Array | None = None,
    scales: tuple[float, ...] = SCALES,
    **more: Any,
) -> Variant:
    """A joint's line and hinges, columns (k,), at places (k - 1,) as its law has them. root (k, k):
    None: neighbours are alike. more: as `variant` has it."""
    kinds = ("line", *places)
    root = curve_root(len(places)) if root is None else root
    limits = further(bench, slopes(len(places)))
    label, facts = f"joint {joint + 1} {name}", {"joint": joint, "kinds": kinds, **limits, **more}
    return variant(WORD, label, columns, scales, root=root, positive=False, **facts)


def further(bench: Bench, slopes: Array) -> dict[str, Any]:
    """Limits on what a curve's slopes (m, k) have more than the simulated compliance. None of a
    displacement that is imposed: a force may fall on the way (`judging.residual_checks`)."""
    return {} if bench.imposed else {"within": slopes, "floor": _STIFFEST}


def curve_root(hinges: int) -> Array:
    """Prior of a line and hinges."""
    root = np.zeros((hinges + 1,) * 2)
    root[0, 0], root[1:, 1:] = 1.0, smooth_root(hinges, 0.5)
    return root


def level_by_level(bench: Bench, j: int, line: int, top: float) -> list[Variant]:
    """A curve of no simple form, of a table that shows nothing else."""
    if not bench.load_history.only_a_curve:
        return []
    x, c = bench.true_torque[:, j] / top, bench.compliance[j] * top
    levels = np.unique(np.append(np.abs(x), 0.0))
    places, root = levels[1:-1].tolist(), from_level_to_level(levels)
    columns = [line, *(bench.add_joint(j, c * hinge(x, b)) for b in places)]
    name = "curve from level to level"
    return [curve(bench, j, name, columns, places, root=root, prior=0.5, torque=top)]


def fine(bench: Bench, j: int, line: int, top: float) -> Variant:
    """A curve of FINE hinges."""
    places, columns = _finely(bench, j, top)
    exact: dict[str, Any] = {"form": "fine", "torque": top, "hinges": places, "prior": 0.5}
    return curve(bench, j, "fine curve", [line, *columns], places, scales=FINE_SCALES, **exact)


def locks(bench: Bench, j: int, line: int, top: float) -> list[Variant]:
    """Of a single pull, in which a free curve would pass for anything: what only gets stiffer,
    however late and steeply, as nothing that flows does; under a driven force, which finds what is
    soft in its first readings, also however early. Two neighbouring shapes out of FINE hinges."""
    places, columns = _finely(bench, j, top)
    b = np.array(places)
    shapes = {f"locks {p}": p * (p - 1) * b ** (p - 2) for p in STEEPER}
    if not bench.imposed:
        shapes = {f"stops {e:g}": (np.array(FINE) + e) ** -3 for e in EARLY} | shapes
    bends = [shape * np.gradient(b) for shape in shapes.values()]
    bends = [w / (w @ (1 - b)) for w in bends]
    out = []
    for low, high, name in zip(bends, bends[1:], shapes, strict=False):
        both = np.column_stack([low, high])
        root = np.zeros((len(b) + 1,) * 2)
        root[0, 0], root[1:, 1:3] = 1.0, both
        powers = -bench.sense * np.column_stack([np.zeros(2), np.linalg.pinv(both)])
        out.append(
            variant(
                WORD,
                f"joint {j + 1} {name}",
                [line, *columns],
                FINE_SCALES,
                root=root,
                positive=powers.sum(axis=0),
                within=powers,
                prior=(0.25 if "stops" in name else 0.5) / (len(STEEPER) - 1),
                kinds=("line", *places),
                joint=j,
                torque=top,
                hinges=places,
            )
        )
    return out


def _finely(bench: Bench, j: int, top: float) -> tuple[tuple[float, ...], list[int]]:
    """Places of FINE hinges, from where the load begins if it stays on one side, and columns."""
    x, c = bench.true_torque[:, j] / top, bench.compliance[j] * top
    start = float(np.abs(x).min()) if x.min() * x.max() > 0 else 0.0
    places = tuple(round(start + b * (1 - start), 6) for b in FINE)
    return places, [bench.add_joint(j, c * hinge(x, b)) for b in places]
