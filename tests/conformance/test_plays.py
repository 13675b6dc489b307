"""How wide a play is: ends that differ, narrow valleys, a laser that reads wrong, ends not reached.

The joint hangs under weights of its own; what a load brings passes zero net torque on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identification.gap.answer.parameters import parameters
from identification.gap.answer.result import GapResult
from identification.gap.effects import joint_backlash, library
from identification.gap.evidence.parts import Part
from identification.gap.laws.interval import Parameter
from identification.gap.model.bench import Bench, make_bench
from identification.gap.model.variants import Variant
from rig.diagnosis.gap_data import gap_data
from rig.worlds.arm import place
from rig.worlds.hidden.memory import play
from tests.conformance.gap_designs import DESIGNS, Array, Design, Q, imported, linear, meta, noisy
from tests.explained import explained

JOINT, WIDTH_RAD = 3, 1.2e-3
RICH = DESIGNS["rich"]
Place = Callable[[Array], Array]


def uneven(x: Array) -> Array:
    """Place in the play, -1/2 to 1/2: one end three times as soft as the other."""
    return np.where(x > 0, -np.expm1(-np.maximum(x, 0) / 0.6), np.expm1(np.minimum(x, 0) / 1.8)) / 2


def rubbed(x: Array) -> Array:
    """A gap with friction: what was pushed stays until the torque has turned."""
    start = np.zeros(len(x))
    return np.clip(play(x, 0.83, start) / 0.83, -1, 1) / 2


def diagnosed(shape: Place, design: Design = RICH, gain: float = 1.0) -> GapResult:
    own = {p: float(place(np.array(q)).gravity_torques()[JOINT]) for p, q in Q.items()}

    def law(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
        weight = np.array([own[str(p)] for p in rows["pose"]])
        out = np.zeros((len(rows), 6))
        out[:, JOINT] = WIDTH_RAD * shape(lever[:, JOINT] * rows["force_N"].to_numpy() + weight)
        return np.zeros(len(rows)), out

    table = noisy(design, law)
    table["displacement_mm"] *= gain
    return explained(gap_data(imported(table, meta(design))))


@pytest.mark.slow
@pytest.mark.parametrize("shape", [pytest.param(uneven, marks=pytest.mark.slow), rubbed])
def test_width_of_a_play_whatever_its_ends_are(shape: Place) -> None:
    found = diagnosed(shape)
    assert [e.name for e in found.effects] == ["joint_backlash"]
    low, high = found.effects[0].parameters["width"].ci90
    assert low < WIDTH_RAD < high
    assert high - low < 0.15 * WIDTH_RAD
    assert found.after < 1.1 * found.noise


@pytest.mark.slow
def test_a_play_that_only_a_wrong_laser_saw() -> None:
    found = diagnosed(lambda x: np.tanh(x / 0.5) / 2, replace(RICH, readings=False), gain=0.8)
    gained = {"joint_backlash", "force_scale"}, {"joint_backlash", "displacement_scale"}
    assert {e.name for e in found.effects} in gained
    width = next(e for e in found.effects if e.name == "joint_backlash").parameters["width"]
    low, high = width.ci90
    assert low < WIDTH_RAD < high  # read 0.8 of it, to 2 %: the gain has to be counted in


@pytest.mark.parametrize(
    ("kind", "zone", "left"),
    [
        ("free", 0.01, (0.0, 0.01)),  # both ends
        ("slow", 0.1, (0.05, 0.4)),  # near to them only
        ("kept", 0.01, (0.0, 0.01)),
    ],
)
def test_what_no_load_took_up_of_a_play(kind: str, zone: float, left: tuple[float, float]) -> None:
    assert left[0] <= unreached(kind, zone, 1.0) <= left[1]


def test_a_play_that_was_pushed_to_one_side_only() -> None:
    """From the middle: half of it nobody saw. A free one may have lain at the other end."""
    assert unreached("kept", 0.01, 0.0) == pytest.approx(0.5, abs=0.01)
    assert unreached("free", 0.01, 0.0) == pytest.approx(0.0, abs=0.01)


def test_half_a_play_that_nobody_saw_is_in_the_interval() -> None:
    bench, found = pushed("kept", 0.01, 0.0)
    k = len(found.columns)
    width = parameters(bench, Part(found, 1.0), 1e-3 * np.eye(k)[0], np.zeros((k, k)))["width"]
    assert width.value == 1e-3
    assert width.sd == pytest.approx(0.5e-3 / 3**0.5, rel=0.05)


def unreached(kind: str, zone: float, both: float) -> float:
    return joint_backlash.unreached(*pushed(kind, zone, both))


def pushed(kind: str, zone: float, both: float) -> tuple[Bench, Variant]:
    """A play in joint 1 that no weight acts on; zone: of the range; both: share of the load that
    pushes the other way."""
    bench = make_bench(linear("medium"))
    torque = bench.torque[:, 0]
    load = np.where(torque < 0, both, 1.0) * bench.load
    bench = replace(bench, load=load)
    found = next(
        v for v in library(bench, ["joint_backlash"]) if v.label.startswith("joint 1 load kept")
    )
    info = found.info | {"kind": kind, "zone_Nm": zone * bench.reach_of(bench.torque[:, 0])}
    return bench, replace(found, info=info)


def test_a_parameter_over_a_factor() -> None:
    whole = Parameter(2.0, 1.8, 2.2, "rad").over(Parameter(0.8, 0.72, 0.88, "1"))
    assert whole.value == pytest.approx(2.5)
    assert whole.high - whole.value == pytest.approx(2.5 * 2**0.5 * 0.1)
    low, high = Parameter(2.0, 1.8, 2.2, "rad", (1.9, 2.1)).over(Parameter(1, 1, 1, "1")).ci90
    assert (low, high) == (pytest.approx(1.9), pytest.approx(2.1))
