"""The blind check end to end: real processes, ordinary data sets, answers that stay outside."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from rig import cli
from rig.blind import command, text
from rig.blind.campaign import Campaign, Plan, run
from rig.blind.case import generator, plain, write_dataset
from rig.blind.diagnosers import Diagnoser, Reply
from rig.blind.score import report
from rig.dataset import load
from rig.diagnosis.diagnose import diagnose
from rig.errors import InputError
from tests.slow import slow_ones
from tests.unit.blind_cases import EFFECTS, FakeCase, draw


class Instant(Diagnoser):
    """Answers at once, and remembers what it was asked."""

    asked: list[tuple[str, tuple[str, ...]]] = []  # noqa: RUF012

    def diagnose(self, path: Path, withhold: Any) -> Reply:
        self.asked.append((path.name, tuple(withhold)))
        assert path.exists()
        found = {"verdict": "none", "probabilities": {"none": 1.0}, "effects": []}
        return Reply("answered", 0.1, found)


@pytest.fixture(autouse=True)
def forget() -> None:
    Instant.asked.clear()


def instantly(plan: Plan, **more: Any) -> Campaign:
    return run(plan, more.pop("draw", draw), EFFECTS, diagnoser=lambda: Instant(1.0), **more)


def test_end_to_end() -> None:
    out = report(run(Plan(cases=2, seed=11), draw, EFFECTS))
    assert [c["verdict"] for c in out["cases"]] == ["none", "zero_shift"]
    assert out["summary"]["right_all_kinds"]["hits"] == 2
    json.dumps(plain(out), allow_nan=False)


def test_a_withheld_word_is_taken_out_in_the_other_process() -> None:
    out = report(run(Plan(cases=1, seed=12, withhold="zero_shift"), draw, EFFECTS))
    (case,) = out["cases"]
    assert case["answers"]["truth"] == ["zero_shift"]
    assert "zero_shift" not in [e["name"] for e in case["diagnosis"]["effects"]]
    assert case["diagnosis"]["probabilities"].get("zero_shift", 0.0) == 0.0
    assert out["tables"]["by_withheld"]["zero_shift"]["right"]["n"] == 1


def test_withholding_each_word_in_turn() -> None:
    out = instantly(Plan(cases=6, seed=1, withhold="each", jobs=1))
    assert [(o.withheld, o.label["truth"]) for o in out.outcomes] == [
        ("zero_shift", ["zero_shift"]),
        ("zero_shift", ["zero_shift"]),  # drawn by number
        ("force_scale", ["force_scale"]),
        ("force_scale", ["zero_shift"]),
        ("zero_shift", ["zero_shift"]),
        ("zero_shift", ["zero_shift"]),
    ]
    assert Instant.asked[2] == ("0002.h5", ("force_scale",))


def test_one_word_in_every_case_also_taken_out() -> None:
    for withhold, withheld in (("", None), ("force_scale", "force_scale")):
        plan = Plan(cases=3, seed=1, word="force_scale", withhold=withhold)
        out = instantly(plan)
        assert [o.label["truth"] for o in out.outcomes] == [["force_scale"]] * 3
        assert [o.withheld for o in out.outcomes] == [withheld] * 3
        assert ", all of force_scale" in text.head(report(out))
    assert plan.command == "rig blind --cases 3 --seed 1 --word force_scale --withhold force_scale"


def test_a_word_that_is_not_drawn_is_refused() -> None:
    with pytest.raises(InputError) as refused:
        instantly(Plan(cases=1, seed=1, withhold="zero_shit"))
    assert str(refused.value) == (
        '--withhold: "zero_shit" is not drawn by the generator hidden. Did you mean "zero_shift"?'
    )
    with pytest.raises(InputError, match=r'^--word: "each" is not drawn by the generator hidden'):
        instantly(Plan(cases=1, seed=1, word="each"))


def test_what_could_not_be_drawn_is_listed_and_not_scored() -> None:
    def fails_once(seed: int, number: int, *, word: str | None = None) -> FakeCase:
        if number == 1:
            raise InputError("snr: out of reach.")
        return draw(seed, number, word=word)

    out = report(instantly(Plan(cases=3, seed=1), draw=fails_once))
    assert out["undrawn"] == [{"number": 1, "reason": "snr: out of reach."}]
    assert [c["number"] for c in out["cases"]] == [0, 2]
    assert "number 1: snr: out of reach." in text.terminal(out)


def test_the_worlds_of_the_project_end_to_end() -> None:
    made, words = generator("hidden")
    out = report(run(Plan(cases=1, seed=1), made, words))
    assert [c["status"] for c in out["cases"]] == ["answered"]
    assert out["summary"]["right_all_kinds"]["n"] <= 1
    assert {c["answers"]["design"] for c in out["cases"]} <= {"rich", "medium", "paper"}


# ------------------------------------------------------------------------- answers stay outside


def answers(label: Any) -> Iterator[str | float]:
    """Words and numbers that would give a case away; small whole numbers are in every file."""
    if isinstance(label, dict):
        for value in label.values():
            yield from answers(value)
    elif isinstance(label, list | tuple):
        for value in label:
            yield from answers(value)
    elif isinstance(label, str):
        if label not in ("none", "x", "y", "medium"):
            yield label
    elif isinstance(label, float) and len(f"{label:.12g}") > 5:
        yield label


def contents(path: Path) -> bytes:
    """The file's bytes, and behind them every data set and attribute unpacked."""
    parts = [path.read_bytes()]

    def unpack(name: str, item: Any) -> None:
        parts.append(name.encode())
        for key, value in item.attrs.items():
            parts.append(f"{key}={value}".encode())
        if isinstance(item, h5py.Dataset):
            values = item[()]
            parts.append(values.tobytes() if hasattr(values, "tobytes") else bytes(values))
            parts.append(str(values).encode())

    with h5py.File(path) as file:
        file.visititems(unpack)
        parts.append(str(dict(file.attrs)).encode())
    return b"\n".join(parts)


def traces(path: Path, case: FakeCase) -> list[str | float]:
    held = contents(path)
    found: list[str | float] = []
    for secret in (case.name, *answers(case.label)):
        if isinstance(secret, str):
            forms = [secret.encode()]
        else:
            forms = [struct.pack("<d", secret), repr(secret).encode(), f"{secret:.6g}".encode()]
        found += [secret] * any(form in held for form in forms)
    return found


def test_the_data_set_holds_no_trace_of_the_answers(tmp_path: Path) -> None:
    case, path = draw(5, 1), tmp_path / "0001.h5"
    write_dataset(case, path)
    assert traces(path, case) == []
    # The search does see answers where they are.
    secret = case.label["parameters"][0]["shift_mm"]
    note = np.full(len(case.columns["force_N"]), secret)
    open_book = FakeCase(case.name, {**case.columns, "note": note}, case.meta, case.label)
    write_dataset(open_book, tmp_path / "open.h5")
    assert secret in traces(tmp_path / "open.h5", open_book)


@pytest.mark.parametrize("number", slow_ones(range(4), range(3)))
def test_the_worlds_of_the_project_leave_no_trace(number: int, tmp_path: Path) -> None:
    case, path = generator("hidden")[0](2, number), tmp_path / "a.h5"
    keys = ("truth", "forms", "parameters", "true_joint_stiffness", "snr", "snr_each")
    secrets = {key: case.label[key] for key in keys}
    for parameters in secrets["parameters"]:
        parameters.pop("session_s", None)  # the last value of a column
    write_dataset(case, path)
    assert traces(path, FakeCase(case.name, {}, {}, secrets)) == []


def test_the_data_set_is_marked_and_keeps_every_digit(tmp_path: Path) -> None:
    case = draw(5, 1)
    write_dataset(case, tmp_path / "a.h5")
    dataset = load(tmp_path / "a.h5")
    assert dataset.origin == "emulated"
    assert dataset.columns["displacement_mm"].tolist() == case.columns["displacement_mm"].tolist()


def test_the_worker_knows_no_world_and_no_generator() -> None:
    code = (
        "import sys, rig.blind.worker, rig.diagnosis.diagnose, rig.dataset\n"
        "print([m for m in sys.modules if m.startswith(('rig.worlds', 'rig.blind.'))])"
    )
    said = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[2],
        timeout=60,
    )
    assert said.stdout.strip() == "['rig.blind.worker']"


def test_the_other_process_says_what_this_one_would(tmp_path: Path) -> None:
    write_dataset(draw(5, 0), tmp_path / "a.h5")
    diagnoser = Diagnoser(60.0)
    try:
        reply = diagnoser.diagnose(tmp_path / "a.h5", ())
    finally:
        diagnoser.close()
    assert reply.diagnosis == plain(diagnose(load(tmp_path / "a.h5")).to_json())


# ------------------------------------------------------------------------------- at the terminal


def test_the_same_seed_draws_the_same_cases(tmp_path: Path) -> None:
    for name in ("a", "b"):
        instantly(Plan(cases=2, seed=7), keep=tmp_path / name)
    first, again = (load(tmp_path / n / "0001.h5").columns for n in ("a", "b"))
    assert first["force_N"].tolist() == again["force_N"].tolist()


def test_keep_takes_no_folder_that_holds_something(tmp_path: Path) -> None:
    (tmp_path / "old.txt").write_text("x")
    with pytest.raises(InputError, match=r"holds old.txt already. Give --keep a new folder."):
        instantly(Plan(cases=1, seed=1), keep=tmp_path)


def test_ctrl_c_reports_what_was_scored_and_ends_with_130(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def interrupted(seed: int, number: int, *, word: str | None = None) -> FakeCase:
        if number == 4:
            raise KeyboardInterrupt
        return draw(seed, number, word=word)

    monkeypatch.setattr(command, "generator", lambda _: (interrupted, EFFECTS))
    monkeypatch.setattr("rig.blind.campaign.Diagnoser", Instant)
    monkeypatch.setattr(
        sys,
        "argv",
        ["rig", "blind", "--cases", "9", "--jobs", "1", "--json", str(tmp_path / "r.json")],
    )
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 130
    out = json.loads((tmp_path / "r.json").read_text())
    assert out["interrupted"]
    assert 1 <= out["cases_done"] <= 4
    assert "(interrupted; 9 were asked for)" in capsys.readouterr().out


def test_an_unknown_generator_is_named() -> None:
    with pytest.raises(InputError) as refused:
        generator("hiden")
    assert str(refused.value) == '--generator: "hiden" is not known. Did you mean "hidden"?'
