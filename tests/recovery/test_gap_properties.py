"""What must not matter does not: names, order, origins and units; noise lowers confidence.

And thin data, at the command line: no crash, and a line for everything that they can't decide.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from identification.gap.answer.result import GapResult
from identification.gap.data import GapData
from identification.gap.explanations.verdict import ARMLESS_DOUBT
from rig import cli
from rig.diagnosis.gap_data import gap_data
from tests.conformance.gap_designs import DESIGNS, STATED, Design, imported, meta, noisy
from tests.explained import explained
from tests.slow import slow_ones

Array = NDArray[np.float64]
ARM = Design(repetitions=2, steps=6, hold=3)
BENCH = DESIGNS["bench"]
SAME = 1e-6  # probabilities: rounding is carried through sums and factorisations


def seating(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """30 um of seating, arctangent of the force."""
    force = rows["force_N"].to_numpy(float)
    return 3e-5 * 2 / np.pi * np.arctan(force / 12.0), np.zeros_like(lever)


def creeping(rows: pd.DataFrame, lever: Array) -> tuple[Array, Array]:
    """A tenth of the bench's deflection comes late, with 15 s."""
    u, z = np.zeros(len(rows)), 0.0
    force, t = rows["force_N"].to_numpy(float), rows["session_s"].to_numpy(float)
    for i in range(1, len(rows)):
        z += (force[i] - z) * (1 - np.exp(-(t[i] - t[i - 1]) / 15.0))
        u[i] = 0.1 * z / 9.3e4
    return u, np.zeros_like(lever)


@cache
def table(arm: bool = True, law: str = "seating") -> pd.DataFrame:
    return noisy(ARM if arm else BENCH, {"seating": seating, "creep": creeping}[law], seed=3)


def data_of(rows: pd.DataFrame, text: str) -> GapData:
    return gap_data(imported(rows, text))


@cache
def arm_result() -> GapResult:
    return explained(data_of(table(), meta(ARM)))


@cache
def bench_data(law: str = "seating") -> GapData:
    return data_of(table(arm=False, law=law), meta(BENCH))


@cache
def bench_result(law: str = "seating") -> GapResult:
    return explained(bench_data(law))


def alike(one: GapResult, other: GapResult, within: float = SAME) -> None:
    assert one.verdict == other.verdict
    assert one.probabilities == pytest.approx(other.probabilities, abs=within)


# --- what must not matter ----------------------------------------------------------------------


def test_same_data_same_answer_to_the_last_bit() -> None:
    again = explained(data_of(table().copy(), meta(ARM)))
    one = arm_result()
    assert again.probabilities == one.probabilities
    assert [(e.name, e.parameters, e.size) for e in again.effects] == [
        (e.name, e.parameters, e.size) for e in one.effects
    ]
    assert again.held_out[0].ci95 == one.held_out[0].ci95
    assert (again.before, again.after, again.noise) == (one.before, one.after, one.noise)
    assert vars(again.where) == vars(one.where)


def test_names_of_poses_and_directions_do_not_matter() -> None:
    rows = table().copy()
    rows["pose"], rows["direction"] = "Z9", rows["direction"].map({"x": "out", "y": "a side"})
    text = (
        meta(ARM).replace("P1:", "Z9:").replace("x: [1", "out: [1").replace("y: [0", "a side: [0")
    )
    renamed = explained(data_of(rows, text))
    assert renamed.probabilities == arm_result().probabilities
    names = {"x": "out", "y": "a side"}
    assert renamed.where.directions == tuple(names[d] for d in arm_result().where.directions)


def test_order_of_directions_in_meta_does_not_matter() -> None:
    text = meta(ARM).replace("{x: [1, 0, 0], y: [0, 1, 0]}", "{y: [0, 1, 0], x: [1, 0, 0]}")
    for one, other in zip(
        astuple(data_of(table(), text)), astuple(data_of(table(), meta(ARM))), strict=True
    ):
        np.testing.assert_equal(one, other)


@pytest.mark.slow
def test_order_in_which_directions_were_measured_does_not_matter() -> None:
    """Without a session clock: with one, it is another history."""
    rows = table().drop(columns="session_s")
    turned = pd.concat([rows[rows.direction == "y"], rows[rows.direction == "x"]])
    one, other = (explained(data_of(r, meta(ARM))) for r in (rows, turned))
    alike(one, other, within=0.02)


def test_origin_of_time_does_not_matter() -> None:
    data = bench_data("creep")
    assert data.session is not None
    moved = replace(data, time=data.time + 4096.0, session=data.session + 65536.0)
    alike(bench_result("creep"), explained(moved), within=1e-4)


@pytest.mark.parametrize("law", ["seating", "creep"])
@pytest.mark.parametrize("unit", [60.0, 1 / 60])
def test_unit_of_time_does_not_matter(law: str, unit: float) -> None:
    data = bench_data(law)
    assert data.session is not None
    other = replace(data, time=data.time * unit, session=data.session * unit)
    found, before = explained(other), bench_result(law)
    alike(found, before, within=0.05)
    if law == "creep":
        time, first = (r.effects[0].parameters["retardation_time"] for r in (found, before))
        assert time.value == pytest.approx(first.value * unit, rel=0.3)


@pytest.mark.parametrize("law", ["seating", "creep"])
@pytest.mark.parametrize("unit", [60.0, 1 / 60])
def test_unit_of_time_does_not_matter_where_levels_were_read_once(law: str, unit: float) -> None:
    rows = table(arm=False, law=law)
    once = rows[rows["step"].diff().shift(-1) != 0]
    data = data_of(once, meta(BENCH))
    assert data.session is not None
    other = replace(data, time=data.time * unit, session=data.session * unit)
    alike(explained(other), explained(data), within=0.01)


def test_units_of_force_and_displacement_do_not_matter() -> None:
    data, a, b = bench_data(), 64.0, 1 / 1024
    meter = replace(
        data.instruments,
        force=data.instruments.force * a,
        displacement=data.instruments.displacement * b,
    )
    other = explained(
        replace(
            data,
            force=data.force * a,
            displacement=data.displacement * b,
            compliance=data.compliance * b / a,
            instruments=meter,
        )
    )
    alike(bench_result(), other)
    assert other.after == pytest.approx(bench_result().after * b, rel=1e-6)
    depth, first = (r.effects[0].parameters["depth"].value for r in (other, bench_result()))
    assert depth == pytest.approx(first * b, rel=1e-6)


# --- noise -------------------------------------------------------------------------------------


def test_noise_lowers_confidence_and_invents_nothing() -> None:
    """The same rig measured ever worse, and META saying so: plain, hardly, drowned."""
    seen = []
    for times in (1.0, 4.0, 64.0):
        rows = noisy(BENCH, seating, seed=3, noise=times)
        text = meta(BENCH).replace("0.05", f"{0.05 * times}").replace("0.002", f"{0.002 * times}")
        found = bench_result() if times == 1 else explained(data_of(rows, text))
        seen.append(found.probabilities["contact_seating"])
        others = {w: p for w, p in found.probabilities.items() if w != "contact_seating"}
        invented = {w: p for w, p in others.items() if w not in ("none", "unknown")}
        assert max(invented.values()) < 0.3, (times, invented)
    assert seen[0] > 1 - ARMLESS_DOUBT - 0.02
    assert seen[0] >= seen[1] >= seen[2]
    assert seen[2] < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_is_no_effect(seed: int) -> None:
    found = explained(data_of(noisy(BENCH, None, seed=seed), meta(BENCH)))
    assert found.verdict == "none"


# --- thin data, at the command line ------------------------------------------------------------

Rig = Callable[[pd.DataFrame, str], tuple[int, str, dict[str, object]]]


@pytest.fixture
def told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Rig:
    """`rig import` and `rig diagnose` in this process: status, what was said, JSON."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["rig", *words])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        out = capsys.readouterr()
        assert "Traceback" not in out.out + out.err
        code = ending.value.code
        return (code if isinstance(code, int) else 0), out.out + out.err

    def run(rows: pd.DataFrame, text: str) -> tuple[int, str, dict[str, object]]:
        rows.to_csv("t.csv", index=False)
        Path("m.yaml").write_text(text)
        status, said = call("import", "t.csv", "m.yaml", "-o", "d.h5")
        if status:
            return status, said, {}
        status, said = call("diagnose", "d.h5", "--json", "d.json")
        found = json.loads(Path("d.json").read_text()) if Path("d.json").exists() else {}
        return status, " ".join(said.split()), found

    return run


def unloaded(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows.branch != "unloading"]


def one_repetition(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows.repetition == 1]


def without_readings(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.drop(columns=[f"q{j}_rad" for j in range(1, 7)])


def without_clock(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.drop(columns="session_s")


def two_columns(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.loc[rows.direction == "x", ["force_N", "displacement_mm"]]


def all_zero(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(force_N=0.0, displacement_mm=0.0)


def constant(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.assign(force_N=50.0, displacement_mm=0.5)


def once_a_step(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.groupby(["direction", "repetition", "branch", "step"], sort=False).head(1)


THIN: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "no unloading": (unloaded, "Nothing was unloaded"),
    "one repetition": (one_repetition, "One repetition"),
    "no readings": (without_readings, "No joint readings to go by"),
    "no clock": (without_clock, "No session clock"),
    "all zero": (all_zero, "The load does not change"),
    "constant": (constant, "The load does not change"),
    "one sample a step": (once_a_step, ""),
}


@pytest.mark.parametrize("name", slow_ones(THIN, ("constant", "no clock", "one sample a step")))
def test_thin_data_say_what_they_cannot_decide(told: Rig, name: str) -> None:
    thin, note = THIN[name]
    status, said, found = told(thin(table()), meta(ARM))
    assert status == 0, said
    assert note in said
    assert note in " ".join(found["notes"])  # type: ignore[arg-type]
    if name in ("all zero", "constant"):
        assert found["verdict"] in ("none", "unknown")


def test_only_force_and_displacement(told: Rig) -> None:
    text = meta(replace(ARM, directions=("x",)))
    status, said, found = told(two_columns(table()), text)
    assert status == 0, said
    notes = " ".join(found["notes"])  # type: ignore[arg-type]
    for note in ("No joint readings to go by", "No session clock"):
        assert note in notes
    assert found["verdict"] not in ("joint_yield", "base_slip", "joint_creep"), found["verdict"]


def test_gaps_in_the_numbers_are_left_out_or_refused_by_name(told: Rig) -> None:
    """An empty cell among the readings is a sample less, not another answer; or it is bad input."""
    rows = table().copy()
    rows.loc[rows.index[5], "displacement_mm"] = np.nan
    status, said, found = told(rows, meta(ARM))
    if status == 0:
        assert found["verdict"] == arm_result().verdict
    else:
        assert status == 2
        assert "displacement_mm" in said


def test_readings_with_a_gap_are_not_used_and_that_is_said(told: Rig) -> None:
    rows = table().copy()
    rows.loc[rows.index[5:65], "q3_rad"] = np.nan
    status, said, found = told(rows, meta(ARM))
    assert status == 0, said
    note = f"60 of {len(rows)} samples lack joint readings: taken as if none had been recorded."
    assert note in found["notes"]  # type: ignore[operator]


def test_stated_springs_are_those_of_the_design() -> None:
    """The tests' own data: META and table speak of the same rig."""
    assert bench_data().compliance[0] == pytest.approx(1 / 95e3)
    assert data_of(table(), meta(ARM)).compliance == pytest.approx(1 / STATED)
