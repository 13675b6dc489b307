"""The command line: statuses, one message for wrong input, nothing heavy at start."""

from __future__ import annotations

import errno
import json
import os
import random
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from identification.estimate import WEIGHTINGS
from rig import cli
from rig.software import software_version
from tests.unit.runner_bench import PROTOCOL

HOME = Path(__file__).parents[2]
META = """\
robot: none
directions: {x: [1, 0, 0]}
instruments: {force: {standard_uncertainty_N: 0.1}, displacement: {standard_uncertainty_mm: 0.002}}
simulation: {stiffness_N_per_mm: {x: 95.0}, stiffness_relative_sd: 0.1}
"""
TABLE = "time_s,repetition,branch,step,force_N,displacement_mm\n" + "".join(
    f"{10 * r + s},{r},{'zero' if s == 0 else 'loading'},{s},{20 * s},{0.2 * s + 0.001 * r}\n"
    for r in (1, 2, 3)
    for s in range(6)
)

Rig = Callable[..., tuple[int, str, str]]


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Rig:
    """Runs `rig WORDS` in this process, in a folder of its own: status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["rig", *words])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
        out, err = capsys.readouterr()
        code = ending.value.code
        return (code if isinstance(code, int) else 0), out, err

    return run


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "m.yaml").write_text(META)
    (tmp_path / "t.csv").write_text(TABLE)
    (tmp_path / "p.yaml").write_text(PROTOCOL)
    return tmp_path


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


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["measure"], "give a PROTOCOL.yaml, or --resume DATASET.h5"),
        (["measure", "p.yaml", "--resume", "d.h5"], "give a PROTOCOL.yaml, or --resume"),
        (["measure", "none.yaml"], "none.yaml"),
        (["measure", "p.yaml", "--station", "emulate"], 'Did you mean "emulated"?'),
        (["measure", "p.yaml", "--station", "emulated", "-o", "no/such/run.h5"], "does not exist"),
        (["measure", "--resume", "never.h5"], "nothing to resume. Nor is that file there"),
        (["measure", "--resume", "t.csv"], "nothing to resume. A complete measurement"),
        (["check", "m.yaml"], "m.yaml"),
        (["analyze", "t.csv"], "t.csv"),
        (["analyze", "missing.h5"], "missing.h5"),
        (["analyze", "."], "."),
        (["import", "t.csv", "t.csv", "-o", "x.h5"], "t.csv"),
        (["import", "m.yaml", "m.yaml", "-o", "x.h5"], "m.yaml"),
        (["import", "t.csv", "m.yaml", "-o", "no/such/x.h5"], "no/such"),
        (["export", "missing.h5", "-o", "x.csv"], "missing.h5"),
        (["emulate", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_bad_input_is_status_2_and_one_message(
    rig: Rig, files: Path, words: list[str], says: str
) -> None:
    status, out, err = rig(*words)
    assert status == 2
    assert says in err
    assert out == ""
    assert "Traceback" not in err
    assert not list(files.glob("*.journal"))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("analyze no.h5 --json no/such/r.json",
         "--json no/such/r.json: the folder no/such does not exist. Create it"),
        ("analyze no.h5 --json .",
         "--json .: is a folder. Give the name of a file, or - for stdout."),
        ("analyze no.h5 --json shut/r.json",
         "--json shut/r.json: nothing may be written into the folder shut."),
        ("diagnose no.h5 --figures m.yaml", "--figures m.yaml: m.yaml is a file, no folder."),
        ("diagnose no.h5 --figures m.yaml/f", "--figures m.yaml/f: m.yaml is a file, no folder."),
        ("diagnose no.h5 --figures shut/f", "--figures shut/f: nothing may be written into the"),
        ("diagnose no.h5 --write-model no/m.yaml", "--write-model no/m.yaml: the folder no does"),
        ("report no.h5 --pdf no/r.pdf", "--pdf no/r.pdf: the folder no does not exist."),
        ("export no.h5 -o .", "--output .: is a folder. Give the name of a file."),
        ("export no.h5 -o -", "--output -: this one goes to a file only. Give its name."),
    ],
)  # fmt: skip
def test_places_that_could_not_be_written_to_are_said_before_the_work(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch, words: str, says: str
) -> None:
    (files / "shut").mkdir()
    monkeypatch.setattr(os, "access", lambda folder, _mode: folder != "shut")
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err.startswith(says)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("analyze d.h5 --json d.h5", "--json d.h5: is read by this command"),
        ("diagnose d.h5 --write-model ./d.h5", "--write-model d.h5: is read by this command"),
        ("analyze d.h5 --json other.h5", "--json other.h5: is a data set;"),
        ("list . --json d.h5", "--json d.h5: is a data set;"),
        ("export d.h5 -o d.h5", "--output d.h5: is read by this command"),
        ("import t.csv m.yaml -o m.yaml", "--output m.yaml: is read by this command"),
        ("check p.yaml --json p.yaml", "--json p.yaml: is read by this command"),
        ("simulate model.yaml p.yaml --csv p.yaml", "--csv p.yaml: is read by this command"),
    ],
)
def test_no_result_takes_the_place_of_an_input_or_a_measurement(
    rig: Rig, files: Path, words: str, says: str
) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    assert rig("import", "t.csv", "m.yaml", "-o", "other.h5")[0] == 0
    before = {p.name: p.read_bytes() for p in files.iterdir()}
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err.startswith(says)
    assert "Give another name." in err
    assert {p.name: p.read_bytes() for p in files.iterdir()} == before


def test_a_result_may_replace_an_older_result(rig: Rig, files: Path) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    (files / "r.json").write_text("{}")
    assert rig("analyze", "d.h5", "--json", "r.json")[0] == 0
    assert json.loads((files / "r.json").read_text())["schema"] == "rig.analysis/1"
    status, _, err = rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    assert status == 0
    assert "d.h5: replaced; an earlier import stood there" in err.splitlines()
    assert "replaced" not in rig("import", "t.csv", "m.yaml", "-o", "new.h5")[2]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("measure --resume d.h5 --station nope", "--station nope: a measurement that is resumed"),
        ("measure --resume d.h5 -o e.h5", "-o e.h5: a measurement that is resumed"),
        ("diagnose d.h5 --add joint_yield --withhold joint_yield",
         "--add joint_yield, --withhold joint_yield: exclude each other."),
        ("diagnose d.h5 --add joint_yeld",
         '--add: "joint_yeld" is no effect. Did you mean "joint_yield"?'),
        ("diagnose d.h5 --withhold time_lag --withhold zeroshift",
         '--withhold: "zeroshift" is no effect. Did you mean "zero_shift"?'),
        ("diagnose d.h5 --add xyz", '--add: "xyz" is no effect. Known: base_compliance, base_slip'),
    ],
)  # fmt: skip
def test_options_that_contradict_each_other_are_refused(
    rig: Rig, files: Path, words: str, says: str
) -> None:
    assert rig("import", "t.csv", "m.yaml", "-o", "d.h5")[0] == 0
    status, _, err = rig(*words.split())
    assert status == 2
    assert err.startswith(says)


def test_the_list_of_commands_cuts_no_sentence(rig: Rig) -> None:
    status, out, _ = rig("--help")
    assert status == 0
    assert "..." not in out.partition("Commands:")[2]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("words", [[], ["--json", "-"]])
def test_a_full_disk_behind_standard_output_is_no_bug(
    rig: Rig, files: Path, words: list[str]
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "rig", "analyze", "d.h5", *words], cwd=files, stdout=full,
            stderr=subprocess.PIPE, text=True, check=False,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        )  # fmt: skip
    said = f"standard output: cannot be written: {os.strerror(errno.ENOSPC)}.\n"
    assert (ended.returncode, ended.stderr) == (2, said)


def test_json_that_cannot_be_written_costs_no_result(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    (files / "r.json").write_text("older")

    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    status, out, err = rig("analyze", "d.h5", "--json", "r.json")
    assert status == 2
    assert "N/mm" in out
    assert err.startswith("r.json: cannot be written: No space left on device.")
    assert (files / "r.json").read_text() == "older"
    (files / "link.json").symlink_to("r.json")
    status, _, err = rig("analyze", "d.h5", "--json", "link.json")
    assert (status, err) == (2, "link.json: cannot be written: No space left on device.\n")


def test_json_goes_into_a_pipe_and_through_a_link(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    (files / "link.json").symlink_to("real.json")
    (files / "real.json").write_text("older")
    os.mkfifo("pipe.json")
    pipe = os.open("pipe.json", os.O_RDONLY | os.O_NONBLOCK)
    for place in ("pipe.json", "link.json"):
        assert rig("analyze", "d.h5", "--json", place)[0] == 0
    assert os.read(pipe, 60_000).startswith(b'{\n  "schema": "rig.analysis/1"')
    os.close(pipe)
    assert (files / "link.json").is_symlink()
    assert json.loads((files / "real.json").read_text())["schema"] == "rig.analysis/1"


@pytest.mark.parametrize("words", [["frobnicate"], ["measure", "--stations", "x"], ["analyze"]])
def test_wrong_words_are_status_2(rig: Rig, words: list[str]) -> None:
    status, _, err = rig(*words)
    assert status == 2
    assert "Traceback" not in err


def test_a_mistyped_command_is_told_the_one_that_was_meant(rig: Rig) -> None:
    status, _, err = rig("diagnos", "d.h5")
    assert status == 2
    assert "No such command 'diagnos'. Did you mean 'diagnose'?" in err


def test_an_unknown_weighting_names_the_known_ones(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, _, err = rig("analyze", "d.h5", "--weighting", "propotional")
    assert status == 2
    assert "proportional" in err


def _damaged(raw: bytes, rng: random.Random) -> bytes:
    kind = rng.randrange(4)
    if kind == 0:
        return raw[: rng.randrange(len(raw))]
    if kind == 1:
        at = rng.randrange(len(raw))
        return raw[:at] + rng.randbytes(rng.randint(1, 40)) + raw[at:]
    if kind == 2:
        lines = raw.splitlines(keepends=True)
        del lines[rng.randrange(len(lines))]
        return b"".join(lines)
    flipped = bytearray(raw)
    for _ in range(rng.randint(1, 20)):
        flipped[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


@pytest.mark.parametrize("seed", range(60))
def test_damaged_files_end_with_0_or_2_and_never_a_traceback(
    rig: Rig, files: Path, seed: int
) -> None:
    rng = random.Random(seed)
    if seed % 3 == 2:
        rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    name, words = {
        0: ("t.csv", ["import", "t.csv", "m.yaml", "-o", "x.h5"]),
        1: ("m.yaml", ["import", "t.csv", "m.yaml", "-o", "x.h5"]),
        2: ("d.h5", ["analyze", "d.h5"]),
    }[seed % 3]
    path = files / name
    path.write_bytes(_damaged(path.read_bytes(), rng))
    status, _, err = rig(*words)
    assert status in (0, 2)
    assert "Traceback" not in err
    if status == 2:
        assert name in err
    elif name == "d.h5":
        pytest.fail("a damaged HDF5 file was read as if it were whole")


def test_a_bug_is_status_1_and_a_file_for_the_report(tmp_path: Path) -> None:
    code = (
        "import rig.check, sys\n"
        "def boom(*_): raise RuntimeError('unforeseen')\n"
        "rig.check.check = boom\n"
        "sys.argv = ['rig', 'check', 'p.yaml']\n"
        "from rig.cli import main; main()\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={"PYTHONPATH": str(HOME), "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    assert "This is a bug in rig (RuntimeError: unforeseen)" in result.stderr
    reports = list(tmp_path.glob("rig-bug-*.txt"))
    assert len(reports) == 1
    assert "unforeseen" in reports[0].read_text()


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; sys.argv = ['rig', '--help']\n"
        "from rig.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'pandas', 'h5py', 'scipy', 'matplotlib', 'pydantic', 'nidaqmx'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=HOME, capture_output=True, text=True, check=True
    )
    assert "HEAVY []" in result.stdout
    for command in ("measure", "check", "analyze", "import", "export", "emulate"):
        assert command in result.stdout


@pytest.mark.parametrize("wanted", [None, "2"])
def test_linear_algebra_has_one_thread_unless_the_user_says_otherwise(wanted: str | None) -> None:
    code = (
        "import os, sys; sys.argv = ['rig', '--help']\n"
        "from rig.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "print('THREADS', os.environ['OPENBLAS_NUM_THREADS'])\n"
    )
    env = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    env |= {} if wanted is None else {"OPENBLAS_NUM_THREADS": wanted}
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=HOME, capture_output=True, text=True, check=True, env=env
    )
    assert f"THREADS {wanted or 1}" in result.stdout


def test_packages_of_other_distributions_are_noticed(tmp_path: Path) -> None:
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "__init__.py").write_text("")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); sys.path.insert(1, {str(HOME)!r})\n"
    code += "sys.argv = ['rig', 'check', 'x']\nfrom rig.cli import main; main()\n"
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 2, result.stderr
    assert "the package drivers comes from" in result.stderr


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


def test_simulate_writes_the_curves_that_diagnose_reads(rig: Rig, files: Path) -> None:
    model = str(HOME / "data" / "models" / "F1.yaml")
    status, out, _ = rig("simulate", model, "p.yaml", "--csv", "c.csv")
    assert status == 0
    assert "95.96 N/mm" in out
    lines = (files / "c.csv").read_text().splitlines()
    header = next(line for line in lines if not line.startswith("#"))
    assert header == "pose,direction,force_N,displacement_mm"


@pytest.mark.parametrize("words", [["couple", "m.yaml"], ["simulate", "m.yaml", "p.yaml"],
                                   ["identify", "t.csv"], ["identify", "gone.h5"]])  # fmt: skip
def test_wrong_models_and_data_are_refused_by_name(rig: Rig, files: Path, words: list[str]) -> None:
    status, _, err = rig(*words)
    assert status == 2
    assert words[1] in err
    assert "Traceback" not in err


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


def test_version(rig: Rig) -> None:
    status, out, err = rig("--version")
    assert (status, err) == (0, "")
    assert out == f"{software_version()}\n"
    assert re.fullmatch(r"stiffness-rig \d+\.\d+\.\d+\n", out)
    assert "How stiff is this arm, and why" in rig("--help")[1]


def test_the_help_names_every_weighting(rig: Rig) -> None:
    said = " ".join(rig("analyze", "--help")[1].split()).replace("- ", "-")  # wrapped lines
    for word in WEIGHTINGS:
        assert word in said.split("how the points are weighted")[0]


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


def test_what_cannot_become_a_model_is_said_before_the_work(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, out, err = rig("diagnose", "d.h5", "--write-model", "found.yaml")
    assert (status, out) == (2, "")  # no result: nothing was diagnosed
    assert err == (
        "d.h5: robot: none. A model file holds an arm; write the diagnosis with --json.\n"
    )


def test_what_cannot_become_a_protocol_is_said_before_the_work(rig: Rig, files: Path) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, out, err = rig("diagnose", "d.h5", "--next", "next.yaml")
    assert (status, out) == (2, "")  # no result: nothing was diagnosed
    assert err == (
        "d.h5: robot: none. A protocol file is for an arm; leave --next out, and the diagnosis "
        "itself says what to measure next.\n"
    )


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
