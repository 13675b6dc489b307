"""The Python interface: numbers of the commands, tables that print well, an example that runs."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

import rig
from rig import cli
from rig.dataset import load, write
from rig.listing import list_folder
from rig.showing import MOST_ROWS, Table
from tests.unit.example_data import write_journal

HOME = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def builder() -> ModuleType:
    spec = importlib.util.spec_from_file_location("build_example", HOME / "docs/build_example.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def measured(builder: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "paper_xy.h5"
    builder.measured(path)
    return path


def test_the_page_says_how_to_get_the_data_set_that_it_loads(
    builder: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (HOME / "docs/example.md").read_text("utf-8")
    command = f"python docs/build_example.py {builder.DATA}"
    assert page.index(f"`{command}`") < page.index(f'rig.load("{builder.DATA}")')
    assert f'rig.find("{builder.DATA.parent}"' in page
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", command.split()[1:])
    builder.main()
    assert rig.load(builder.DATA).analyze().stiffness["direction"] == ["x", "y"]


def test_importing_rig_pulls_nothing_in() -> None:
    code = "import rig, sys; print([m for m in ('numpy', 'h5py', 'pandas') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert {"load", "find", "Run", "Table"} <= set(dir(rig))
    with pytest.raises(AttributeError, match="'rig' has no attribute 'nothing'"):
        rig.nothing  # noqa: B018


def test_analysis_has_the_numbers_of_the_command(measured: Path) -> None:
    run = rig.load(measured)
    answer = run.analyze()
    out = CliRunner().invoke(cli.app, ["analyze", str(measured), "--json", "-"]).output
    assert answer.json == json.loads(out)
    k = answer.stiffness
    assert k["direction"] == ["x", "y"]
    truth = answer.json["directions"]["y"]["stiffness_N_per_mm"]
    assert k["k_N_per_mm"][1] == truth["value"]
    assert (k["ci95_low"][1], k["ci95_high"][1]) == tuple(truth["ci95"])
    assert len(run.curves()) == sum(len(d["curve"]) for d in answer.json["directions"].values())
    assert answer.uncertainty.names[0] == "direction"
    with pytest.raises(rig_error(), match="is not known"):
        run.analyze(weighting="heavy")


def rig_error() -> type[Exception]:
    from rig.errors import InputError

    return InputError


def test_whatever_is_printed_says_emulated_first(measured: Path) -> None:
    run = rig.load(str(measured))
    answer = run.analyze()
    shown = [repr(run), repr(answer), repr(run.curves()), repr(rig.find(measured.parent))]
    assert all(text.startswith("EMULATED: ") for text in shown)
    for page in (run._repr_html_(), answer._repr_html_(), run.curves()._repr_html_()):
        assert page.startswith("<p><b>EMULATED: ")
        assert page.count("EMULATED") == 1 + page.count("EMULATED: Static")


def test_incomplete_runs_say_so(tmp_path: Path) -> None:
    write_journal(tmp_path / "cut.h5", 4)
    assert "INCOMPLETE: " in repr(rig.load(tmp_path / "cut.h5"))


def test_diagnosis_and_joints_have_tables_and_are_remembered(
    measured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RIG_CACHE", str(tmp_path / "cache"))
    run = rig.load(measured)
    joints = run.identify(proposals=0)
    q = joints.json["joint_stiffness_Nm_per_rad"]
    assert joints.joints["c_Nm_per_rad"].tolist() == [j["value"] for j in q]
    assert np.all(joints.joints["share_of_data"] >= 0)
    assert list_folder(measured.parent).entries[0].verdict is None
    gap = run.diagnose()
    verdict = gap.json["verdict"]
    assert gap.probabilities["word"][0] == verdict
    assert gap.effects["effect"][0] == verdict
    assert gap.gap["after_rms_mm"][0] == pytest.approx(gap.json["gap"]["after_rms_mm"])
    assert gap.headline.startswith(verdict)
    found = rig.find(measured.parent)
    assert found["verdict"] == [verdict]
    assert "effects" in dir(gap)
    with pytest.raises(AttributeError, match="no_table; tables here: probabilities, effects, gap"):
        gap.no_table  # noqa: B018


def test_samples_are_those_in_use(measured: Path) -> None:
    run = rig.load(measured)
    run.dataset.columns["discarded"][:7] = True
    assert len(run.samples()) == run.dataset.rows - 7
    assert "410 in use of 417" in repr(run)


def test_text_of_a_table_word_for_word() -> None:
    table = Table(
        {"name": ["a", "long"], "force_N": [1.0, None], "n": [3, 12], "clear": [True, False]},
        title="Two rows",
        banners=["EMULATED: no."],
    )
    assert repr(table) == (
        "EMULATED: no.\nTwo rows\n"
        "name  force_N   n  clear\n"
        "a       1.000   3    yes\n"
        "long        -  12     no"
    )
    assert table["force_N"].tolist()[0] == 1.0
    assert np.isnan(table["force_N"][1])
    assert list(table)[1] == {"name": "long", "force_N": None, "n": 12, "clear": False}
    assert table.to_pandas()["n"].sum() == 15


def test_dangerous_names_are_text_in_notebooks(measured: Path, tmp_path: Path) -> None:
    bad = "<script>alert(1)</script>"
    page = Table({bad: [bad]}, title=bad, banners=[bad])._repr_html_()
    assert "<script>" not in page
    assert page.count("&lt;script&gt;") == 4
    write(replace(load(measured), title=bad), tmp_path / "x.h5")
    assert "<script>" not in rig.load(tmp_path / "x.h5")._repr_html_()


def test_long_tables_are_cut_only_where_shown() -> None:
    table = Table({"i": list(range(MOST_ROWS + 5))})
    assert repr(table).splitlines()[-1] == "... 5 more rows"
    assert table._repr_html_().count("<tr>") == MOST_ROWS + 1
    assert len(table) == MOST_ROWS + 5
    assert repr(Table({"i": [], "j": []})) == "i  j"
    with pytest.raises(ValueError, match=r"columns of different lengths: \[1, 2\]"):
        Table({"i": [1], "j": [1, 2]})
    with pytest.raises(KeyError, match="no column k; there are i"):
        table["k"]


@pytest.mark.slow
def test_the_example_runs(builder: ModuleType) -> None:
    built = builder.build(builder.SOURCE.read_text("utf-8"), None)
    assert built.count("```text") == builder.PAGE.read_text("utf-8").count("```text")
    assert "Traceback" not in built


def test_the_page_of_the_example_is_its_source(builder: ModuleType) -> None:
    page = builder.PAGE.read_text("utf-8")
    cells = builder._CELL.findall(builder.SOURCE.read_text("utf-8"))
    assert len(cells) >= 8
    for cell in cells:
        assert f"```python\n{cell}```\n" in page
    for line in page.splitlines():
        if line.startswith("!["):
            assert (builder.PAGE.parent / line.split("(")[-1].rstrip(")")).exists()


def test_a_cell_shows_its_last_value(builder: ModuleType) -> None:
    space: dict[str, object] = {}
    assert builder.run_cell("a = 2\nprint('x')\na + 1\n", space) == "x\n3\n"
    assert builder.run_cell("b = a\n", space) == ""
    assert builder.run_cell("None\n", space) == ""
