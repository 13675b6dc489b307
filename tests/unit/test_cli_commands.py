"""The command line: what the commands do, from end to end."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

from drivers.errors import CannotConnect, ReadTimeout
from rig.check import Check, DeviceState
from rig.plan import plan
from rig.protocol import load_protocol
from tests.unit.cli_bench import HOME, Rig
from tests.unit.runner_bench import PROTOCOL


def test_import_analyze_export(rig: Rig, files: Path) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    status, out, _ = rig("analyze", "d.h5", "--json", "-")
    assert status == 0
    result = json.loads(out)
    assert result["schema"] == "rig.analysis/1"
    k = result["directions"]["x"]["stiffness_N_per_mm"]
    assert k["ci95"][0] < 100 < k["ci95"][1]
    assert k["value"] == pytest.approx(100, rel=0.02)
    status, out, _ = rig("analyze", "d.h5", "--json", "r.json", "--figures", "figs")
    assert status == 0
    assert "N/mm" in out
    assert json.loads((files / "r.json").read_text()) == result
    assert sorted(p.name for p in (files / "figs").glob("*.png")) == ["curve.png", "pointwise.png"]
    assert rig("export", "d.h5", "-o", "d.csv")[0] == 0
    assert "force_N" in (files / "d.csv").read_text()


def test_an_unknown_weighting_names_the_known_ones(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, _, err = rig("analyze", "d.h5", "--weighting", "propotional")
    assert status == 2
    assert "proportional" in err


def test_a_load_that_a_joint_cannot_take_is_refused_before_measuring(rig: Rig, files: Path) -> None:
    heavy = PROTOCOL.replace("[20, 40, 60]", "[20, 400, 900]").replace("{max: 100", "{max: 1000")
    (files / "heavy.yaml").write_text(heavy)
    status, _, err = rig("measure", "heavy.yaml", "--station", "emulated", "-o", "run.h5")
    assert status == 2
    assert "heavy.yaml:" in err
    assert "Nm" in err
    assert not list(files.glob("run.h5*"))


def test_couple_gives_figures_exports_and_pure_json(rig: Rig, files: Path) -> None:
    model = str(HOME / "data" / "models" / "F1.yaml")
    words = ["couple", model, "--samples", "20000", "--json", "-", "--figures", "f"]
    status, out, err = rig(*words, "--export-mujoco", "a.xml", "--export-urdf", "a.urdf")
    assert status == 0, err
    result = json.loads(out)
    assert result["schema"] == "rig.coupling/1"
    assert result["single_N_per_mm"]["x"] == pytest.approx(95.94, rel=1e-3)
    assert result["coupled_N_per_mm"]["rigid"]["x"] == pytest.approx(339.5, rel=5e-3)
    assert {p.name for p in files.iterdir()} >= {"a.xml", "a.urdf", "f"}
    assert list((files / "f").glob("*.png"))


@pytest.mark.parametrize("where", ["-", "c.json"])
def test_the_best_placement_stands_in_the_json_too(rig: Rig, files: Path, where: str) -> None:
    model = str(HOME / "data" / "models" / "F1.yaml")
    words = ["couple", model, "--samples", "20000", "--best-placement", "--json", where]
    status, out, err = rig(*words)
    assert status == 0, err
    result = json.loads(out if where == "-" else (files / where).read_text())
    assert result["schema"] == "rig.coupling/1"
    placement = result["placement"]
    assert placement["schema"] == "rig.placement/1"
    assert placement["feasible"] is True
    assert placement["margin"] == pytest.approx(4.28, rel=5e-3)
    assert ("Best place for the second arm: base distance 1015 mm" in out) == (where != "-")


def test_nobody_who_has_not_asked_gets_a_placement(rig: Rig, files: Path) -> None:
    model = str(HOME / "data" / "models" / "F1.yaml")
    status, out, err = rig("couple", model, "--samples", "20000", "--json", "-")
    assert status == 0, err
    assert "placement" not in json.loads(out)


def test_simulate_writes_the_curves_that_diagnose_reads(rig: Rig, files: Path) -> None:
    model = str(HOME / "data" / "models" / "F1.yaml")
    status, out, _ = rig("simulate", model, "p.yaml", "--csv", "c.csv")
    assert status == 0
    assert "95.96 N/mm" in out
    lines = (files / "c.csv").read_text().splitlines()
    header = next(line for line in lines if not line.startswith("#"))
    assert header == "pose,direction,force_N,displacement_mm"


@pytest.mark.parametrize(
    "words",
    [
        ["couple", "m.yaml"],
        ["simulate", "m.yaml", "p.yaml"],
        ["identify", "t.csv"],
        ["identify", "gone.h5"],
    ],
)
def test_wrong_models_and_data_are_refused_by_name(rig: Rig, files: Path, words: list[str]) -> None:
    status, _, err = rig(*words)
    assert status == 2
    assert words[1] in err
    assert "Traceback" not in err


def test_a_protocol_without_proposals_is_refused_before_anything_is_written(
    rig: Rig, files: Path
) -> None:
    status, _, err = rig(
        "identify",
        "d.h5",
        "--proposals",
        "0",
        "--write-model",
        "new.yaml",
        "--write-protocol",
        "next.yaml",
    )
    assert status == 2
    assert err.endswith("Give --proposals 1 or more, or leave --write-protocol out.\n")
    assert not (files / "new.yaml").exists()


def test_diagnose_gives_the_contracts_json(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, out, err = rig("diagnose", "d.h5", "--json", "-")
    assert status == 0, err
    result = json.loads(out)
    assert result["schema"] == "rig.diagnosis/1"
    assert sum(result["probabilities"].values()) == pytest.approx(1.0)
    assert result["verdict"] in result["probabilities"]
    assert {"noise_rms_mm", "before_rms_mm", "after_rms_mm", "shrink_factor", "held_out"} <= set(
        result["gap"]
    )
    status, _, err = rig("diagnose", "d.h5", "--add", "joint_yeild")
    assert status == 2
    assert "joint_yield" in err
    status, _, err = rig("diagnose", "d.h5", "--add", "base_slip")  # there is no arm, and no base
    assert status == 2
    assert err.startswith("--add: base_slip is nothing that these data could show; they could: ")


def test_one_row_is_no_rows(rig: Rig, files: Path) -> None:
    (files / "one.csv").write_text("force_N,displacement_mm\n1,2\n")
    _, _, err = rig("import", "one.csv", "m.yaml", "-o", "d.h5")
    assert "d.h5: 1 row. Next: rig analyze d.h5" in err


def test_a_path_that_is_not_there(rig: Rig, files: Path) -> None:
    model = str(HOME / "data" / "models" / "F1.yaml")
    status, _, err = rig("couple", model, "--path", "gone.csv")
    assert status == 2
    assert err == (
        "gone.csv: cannot be read: No such file or directory. Check the name of the table.\n"
    )


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--write-model", "A model file holds an arm; write the diagnosis with --json."),
        (
            "--next",
            "A protocol file is for an arm; leave --next out, and the diagnosis itself "
            "says what to measure next.",
        ),
    ],
)
def test_what_cannot_become_a_file_is_said_before_the_work(
    rig: Rig, files: Path, option: str, said: str
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, out, err = rig("diagnose", "d.h5", option, "made.yaml")
    assert (status, out) == (2, "")  # no result: nothing was diagnosed
    assert err == f"d.h5: robot: none. {said}\n"


def test_diagnose_takes_the_stiffnesses_of_a_model_of_the_same_robot(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    model = str(HOME / "data" / "models" / "F1.yaml")
    status, _, err = rig("diagnose", "d.h5", "--model", model)
    assert status == 2
    assert "the robot is ur10e, the measurement's is none" in err


def test_diagnose_believes_the_model_it_is_given(rig: Rig, files: Path) -> None:
    stiff = "[74402, 113892, 36220, 14216, 15066, 16000]"  # twice F1's springs
    (files / "arm.yaml").write_text(
        "robot: ur10e\n"
        "poses: {P1: {q_rad: [0.234398, -1.742537, -1.886701, -1.083151, 1.570796, -1.336399]}}\n"
        "directions: {x: [1, 0, 0]}\n"
        "instruments: {force: {standard_uncertainty_N: 0.1},\n"
        "  displacement: {standard_uncertainty_mm: 0.002}}\n"
        f"simulation: {{joint_stiffness_Nm_per_rad: {stiff}}}\n"
    )
    rig("import", "t.csv", "arm.yaml", "-o", "a.h5")
    before = {}
    model = str(HOME / "data" / "models" / "F1.yaml")
    for name, words in {"meta": [], "model": ["--model", model]}.items():
        status, out, err = rig("diagnose", "a.h5", "--json", "-", *words)
        assert status == 0, err
        before[name] = json.loads(out)["gap"]["before_rms_mm"]
    # The table is a spring of 100 N/mm; F1 has 95.96 along x, META's arm twice that.
    assert before["model"] < 0.2 * before["meta"]


def test_check_names_every_device_that_is_not_ready(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Check(
        plan(load_protocol(files / "p.yaml")),
        "ur10e_lab",
        False,
        (
            DeviceState("robot", {}, CannotConnect("robot", "no answer", "Switch it on.")),
            DeviceState("dynamometer", {"model": "9257B"}),
            DeviceState("laser", {}, ReadTimeout("laser", "it is silent", "Check its cable.")),
        ),
    )
    monkeypatch.setattr("rig.check.check", lambda *_: found)
    status, out, err = rig("check", "p.yaml")
    assert status == 3
    assert err == "robot: no answer. Switch it on.\nlaser: it is silent. Check its cable.\n"
    assert "laser        NOT READY" in out
    assert isinstance(found.failure, CannotConnect)  # the first decides over the status


BAD, SHOWN = os.fsdecode(b"bad\xff"), "bad\N{REPLACEMENT CHARACTER}"


@pytest.mark.skipif(sys.platform == "darwin", reason="its file systems refuse such names")
@pytest.mark.parametrize(
    ("words", "shows"),
    [
        ("report {}.h5 --no-gap -o r.html", "r.html"),
        ("analyze {}.h5 --figures f --json r.json", ""),
        ("identify {}.h5 --proposals 0 --write-model m.out", "m.out"),
        ("import {}.csv arm.yaml -o new.h5", "new.h5"),
        ("list .", ""),
        pytest.param("diagnose {}.h5 --figures .", "gap_points.csv", marks=pytest.mark.slow),
    ],
)
def test_a_name_that_is_no_utf_8_is_shown_with_a_replacement_character(
    rig: Rig, arm: Path, monkeypatch: pytest.MonkeyPatch, words: str, shows: str
) -> None:
    (arm / "a.h5").rename(arm / f"{BAD}.h5")
    (arm / "k.csv").rename(arm / f"{BAD}.csv")
    status, out, err = rig(*(w.format(BAD) for w in words.split()))
    assert status == 0, err
    assert words.startswith(("import", "diagnose")) or SHOWN in out
    if shows:
        assert SHOWN.encode() in (arm / shows).read_bytes()


def test_an_unknown_name_that_is_no_utf_8_is_told_as_any(rig: Rig, files: Path) -> None:
    assert rig("analyze", f"{BAD}.h5")[2] == f"{SHOWN}.h5: cannot be read: no such file.\n"
