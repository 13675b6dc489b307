"""A drawn case and the ordinary data set that is made of it; the answers stay outside."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.errors import InputError, did_you_mean

EMULATED = "# EMULATED: drawn by a simulated rig for a blind check; nothing was measured."
GENERATORS = ("hidden", "benches", "mujoco", "mujoco-small-turns")


class Case(Protocol):
    """What a generator draws: columns and meta as `rig import` takes them, and the
    answers."""

    @property
    def name(self) -> str:
        """For people: seed and number; stays outside the data set."""

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Of the table, each (n,)."""

    @property
    def meta(self) -> dict[str, Any]:
        """What META.yaml would hold."""

    @property
    def label(self) -> dict[str, Any]:
        """The answers."""


class Draw(Protocol):
    """Draws case `number` of a seed; `word`: the single effect that it must hold."""

    def __call__(self, seed: int, number: int, *, word: str | None = None) -> Case:
        """The same case for the same seed and number."""


def generator(name: str) -> tuple[Draw, tuple[str, ...]]:
    """The function that draws, and the words it can draw.

    InputError for an unknown name or where the engine is not installed.
    """
    if name == "hidden":
        from rig.worlds.hidden import draw

        return draw.draw_case, tuple(w for w in draw.WORDS if w not in ("none", "unknown"))
    if name == "benches":
        from rig.worlds.benches import draw as benches

        return benches.draw_case, benches.EFFECTS
    if name in ("mujoco", "mujoco-small-turns"):
        try:
            from rig.blind import mujoco_rig
        except ImportError:
            raise InputError(
                f"--generator {name} needs the engine MuJoCo, which is not installed: "
                'install it with `pip install mujoco`. The generators "hidden" and "benches" need '
                "nothing."
            ) from None
        if name == "mujoco":
            return mujoco_rig.draw_case, mujoco_rig.EFFECTS
        return mujoco_rig.draw_small_turns, mujoco_rig.EFFECTS
    raise InputError(f'--generator: "{name}" is not known.{did_you_mean(name, GENERATORS)}')


def write_dataset(case: Case, path: Path) -> None:
    """Writes the HDF5 file by way of a table and META, as a measurement that someone brings in.

    Name, seed and answers do not enter it; it is marked as emulated. InputError if a column or
    META is not as the table's format wants it.
    """
    from rig.tables import import_table

    with tempfile.TemporaryDirectory(prefix="rig-blind-") as folder:
        table, meta = Path(folder) / "samples.csv", Path(folder) / "meta.yaml"
        table.write_text(_table(case.columns), encoding="utf-8")
        meta.write_text(json.dumps(plain(case.meta), indent=1), encoding="utf-8")  # YAML holds JSON
        import_table(table, meta, path)


def _table(columns: Mapping[str, NDArray[Any]]) -> str:
    """CSV in which every float reads back as the same float."""
    cells = [_cells(np.asarray(column)) for column in columns.values()]
    rows = map(",".join, zip(*cells, strict=True))
    return "\n".join([EMULATED, ",".join(columns), *rows]) + "\n"


def _cells(column: NDArray[Any]) -> list[str]:
    values = column.tolist()
    if column.dtype.kind == "f":
        return [repr(v) if np.isfinite(v) else "" for v in values]
    return [str(v) for v in values]


def plain(value: Any) -> Any:
    """The value as JSON can hold it: numpy types as Python's, what is not finite as None."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.bool_ | bool):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
