"""Small journals, data sets and tables that the tests of storage share."""

from __future__ import annotations

from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from rig.dataset import Dataset, from_records
from rig.journal import Journal, Record, journal_path, replay
from rig.tables import import_table

META = """robot: ur10e
poses: {P1: {q_rad: [0.1, -1.2, 1.3, -0.4, 1.5, 0.6], tcp_xyz_mm: [0, 0, 50]}}
directions: {x: [1, 0, 0], y: [0, 1, 0]}
instruments:
  force: {standard_uncertainty_N: 0.1, gain_relative_sd: 0.005}
  displacement: {standard_uncertainty_mm: 0.002, gain_relative_sd: 0.003}
simulation:
  joint_stiffness_Nm_per_rad: [37000, 57000, 18000, 7100, 7500, 8000]
  joint_stiffness_relative_sd: 0.1
"""
TABLE = """time_s,session_s,pose,direction,repetition,branch,step,force_N,displacement_mm,q1_rad
0.5,1.5,P1,x,1,zero,0,0.02,0,0.1
1.5,2.5,P1,x,1,loading,1,10.1,0.1,0.1001
2.5,3.5,P1,x,1,unloading,1,9.9,0.11,
0.5,60.5,P1,y,2,cycle,,-5e-7,-1e-7,nan
"""
META_SPECIMEN = """robot: none
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
simulation: {stiffness_N_per_mm: {x: 95.0}, stiffness_relative_sd: 0.1}
"""


def start(origin: str = "emulated", uuid: str = "11111111-2222-3333-4444-555555555555") -> Any:
    return {
        "uuid": uuid,
        "created": "2026-03-01T10:00:00+01:00",
        "origin": origin,
        "title": "Steifigkeit längs x",
        "software": "stiffness-rig 0.1.0",
        "protocol": "schema: rig.protocol/1\n# Schraube drehen: °\n",
        "station": "schema: rig.station/1\n",
        "meta": META,
    }


def descriptor() -> Any:
    return {
        "devices": {
            "laser": {"serial": "4711", "source": "emulated+ild2200"},
            "robot": {"controller": "5.12"},
        },
        "signals": [{"name": "laser_mm", "unit": "mm", "long_name": "distance of the target"}],
        "calibration": {"a_mm": 30.0, "axes": [[1, 0, 0]]},
    }


def sample(i: int, **values: float) -> Any:
    numbers = {"force_N": 10.0 * i, "displacement_mm": 0.1 * i, "laser_mm": 5 + 0.1 * i}
    return {
        "number": i + 3,
        "session_s": 3.0 + i,
        "time_s": 0.5 + i,
        "pose": "P1",
        "direction": "x",
        "repetition": 1,
        "branch": "loading" if i else "zero",
        "step": i,
        "target_N": 10.0 * i,
        "recorded": True,
        "lateness_s": 1e-4,
        "segment": 1,
        "values": numbers | values,
        "sd": {"force_N": 0.02, "laser_mm": nan},
        "count": {"laser": 100 + i, "robot": 125},
        "invalid": {"laser": i, "robot": 0},
        "age_s": {"laser": 0.01, "robot": 0.008},
    }


def write_journal(dataset: Path, samples: int, *, stop: bool | None = None, **kw: Any) -> None:
    """A journal beside `dataset`; stop: complete or not, None for a run that was cut off."""
    with Journal.create(journal_path(dataset), start(**kw)) as journal:
        journal.append("descriptor", descriptor())
        for i in range(samples):
            journal.append("sample", sample(i))
        if stop is not None:
            journal.append("stop", {"reason": "all runs done", "complete": stop})


def records(samples: int, *extra: tuple[str, Any]) -> list[Record]:
    kinds = [("start", start()), ("descriptor", descriptor())]
    kinds += [("sample", sample(i)) for i in range(samples)]
    return [Record(n, kind, data) for n, (kind, data) in enumerate([*kinds, *extra])]


def dataset(samples: int = 5, path: Path | None = None) -> Dataset:
    return from_records(records(samples, ("stop", {"reason": "done", "complete": True})), path)


def journal_records(path: Path) -> list[Record]:
    return replay(journal_path(path))


def same_values(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> bool:
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def bring(folder: Path, table: str | bytes, meta: str = META, **kw: Any) -> Dataset:
    raw = table if isinstance(table, bytes) else table.encode()
    (folder / "t.csv").write_bytes(raw)
    (folder / "META.yaml").write_text(meta)
    return import_table(folder / "t.csv", folder / "META.yaml", **kw)
