"""The columns of a data set: names, units, what they mean, how a table gives them.

Names, units and meanings of the first ones are fixed by the table format; further columns (the
signals of the devices, or whatever a table brought along) are described where they come from.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Values = NDArray[Any]
Kind = Literal["number", "count", "word", "flag"]

BRANCHES = ("zero", "loading", "unloading", "cycle")
SAMPLE_NUMBER = "number of the sample; no time was recorded"  # in place of what time_s means
# Far beyond any rig (the largest machines reach some 1e7 N): what lies there is in another unit.
LARGEST_N = 1e7
LARGEST_MM = 1e5
# Joints of an arm work from some -10 to 80; a specimen of a rig without an arm may glow.
JOINT_C, SPECIMEN_C = (-60.0, 200.0), (-273.15, 3000.0)
NO_STEP = -1  # in the column `step`: a continuous measurement, not held at any level
AXES = ("x", "y", "z")
JOINTS = range(1, 7)


@dataclass(frozen=True, slots=True)
class Column:
    """Kind: "number" float64, "count" int64, "word" text, "flag" bool.

    `required`: a table must have it; `finite`: a cell that is empty or not finite is refused;
    `largest`: numbers beyond it, either way, are refused.
    """

    name: str
    unit: str
    long_name: str
    kind: Kind = "number"
    required: bool = False
    finite: bool = False
    largest: float = math.inf


def _all_columns() -> list[Column]:
    time = [
        Column("time_s", "s", "time since the start of the run", finite=True),
        Column("session_s", "s", "time since the start of the session", finite=True),
    ]
    place = [
        Column("pose", "", "pose", "word"),
        Column("direction", "", "direction of force and displacement", "word"),
        Column("repetition", "", "repetition of the run", "count"),
        Column("branch", "", "branch of the load cycle", "word"),
        Column("step", "", "force step, 0 for zero load, -1 for continuous", "count"),
    ]
    measured = [
        Column(
            "force_N",
            "N",
            "force along the direction",
            required=True,
            finite=True,
            largest=LARGEST_N,
        ),
        *(
            Column(f"force_{a}_N", "N", f"force along {a} of the base frame", largest=LARGEST_N)
            for a in AXES
        ),
        Column(
            "displacement_mm",
            "mm",
            "displacement along the direction",
            required=True,
            finite=True,
            largest=LARGEST_MM,
        ),
    ]
    arm = [
        *(Column(f"q{j}_rad", "rad", f"position of joint {j}") for j in JOINTS),
        *(Column(f"temperature{j}_C", "degC", f"temperature of joint {j}") for j in JOINTS),
    ]
    bookkeeping = [
        Column("target_N", "N", "force that was aimed at"),
        Column("segment", "", "number of the taring that the force counts from", "count"),
        Column("number", "", "number of the sampling slot in the session", "count"),
        Column("lateness_s", "s", "how late the sampling slot was"),
        Column("discarded", "", "1: not to be used, measured again or taken back", "flag"),
    ]
    return [*time, *place, *measured, *arm, *bookkeeping]


KNOWN: dict[str, Column] = {c.name: c for c in _all_columns()}
TABLE_COLUMNS = tuple(n for n in KNOWN if n not in ("target_N", "segment", "number", "lateness_s"))

_UNITS = (
    "N",
    "Nm",
    "m",
    "mm",
    "um",
    "s",
    "ms",
    "Hz",
    "rad",
    "deg",
    "C",
    "K",
    "V",
    "A",
    "Pa",
    "MPa",
)
_UNIT = re.compile(r"_(?P<first>{0})(?:_per_(?P<second>{0}))?$".format("|".join(_UNITS)))


def unit_of(name: str) -> str:
    """Unit that a column's name states, in the spelling of UDUNITS: `N/s` for `..._N_per_s`."""
    if name in KNOWN:
        return KNOWN[name].unit
    match = _UNIT.search(name.removesuffix("_errors"))
    if match is None:
        return ""
    units = ["degC" if u == "C" else u for u in match.groups() if u]
    return "/".join(units)


def empty(kind: Kind, rows: int) -> Values:
    """What stands where nothing is known: nan, -1, no text, False; shape (rows,)."""
    if kind == "word":
        return np.zeros(rows, dtype="U1")
    if kind == "flag":
        return np.zeros(rows, dtype=np.bool_)
    return np.full(rows, -1, np.int64) if kind == "count" else np.full(rows, np.nan)
