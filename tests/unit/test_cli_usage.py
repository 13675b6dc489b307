"""Wrong words on the command line: each message has the word, and what is allowed there."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.unit.cli_bench import Rig

NUMBER = "allowed: a number, "
WHOLE = "allowed: a whole number, "


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("measure p.yaml --speed 0", f"--speed 0: {NUMBER}0.01 to 1000."),
        ("measure p.yaml --speed fast", f"--speed fast: {NUMBER}0.01 to 1000."),
        ("measure p.yaml --panel-port 99999", f"--panel-port 99999: {NUMBER}1 to 65535."),
        ("measure p.yaml --panel-port=a", f"--panel-port a: {WHOLE}1 to 65535."),
        ("identify d.h5 --proposals -1", f"--proposals -1: {NUMBER}at least 0."),
        ("identify d.h5 --proposals 1.5", f"--proposals 1.5: {WHOLE}at least 0."),
        ("identify d.h5 --criterion Q", "--criterion Q: 'Q' is not one of 'A', 'D', 'E'."),
        ("couple m.yaml --samples 10", f"--samples 10: {NUMBER}at least 1000."),
        ("couple m.yaml --dead-band nan", f"--dead-band nan: {NUMBER}at least 0."),
        ("blind --deadline 0", f"--deadline 0: {NUMBER}at least 1."),
        ("analyze d.h5 --json", "--json: its value is missing. Wanted: --json FILE."),
        ("blind --cases", "--cases: its value is missing. Wanted: --cases N."),
        ("measure p.yaml --speed", "--speed: its value is missing. Wanted: --speed 0.01 to 1000."),
        ("export d.h5", "--output: is missing. Give -o or --output FILE.csv|.parquet."),
        (
            "measure p.yaml --speed 2 --speed 3",
            "--speed 3: --speed is given before, too. Leave one of them out.",
        ),
        (
            "export d.h5 -o a.csv --output b.csv",
            "--output b.csv: --output is given before, too. Leave one of them out.",
        ),
        (
            "analyze d.h5 --intercept --through-origin",
            "--intercept/--through-origin: is given more than once. Leave one out.",
        ),
        (
            "measure p.yaml --resume d.h5",
            "rig measure: p.yaml, --resume d.h5: give a PROTOCOL.yaml, or --resume DATASET.h5.",
        ),
        (
            "simulate m.yaml",
            "rig simulate: PROTOCOL.yaml is missing. Give rig simulate MODEL.yaml PROTOCOL.yaml; "
            "rig simulate -h lists the options.",
        ),
        (
            "analyze",
            "rig analyze: DATASET.h5 is missing. Give rig analyze DATASET.h5; "
            "rig analyze -h lists the options.",
        ),
        (
            "identify",
            "rig identify: DATASET.h5 ... is missing. Give rig identify DATASET.h5 ...; "
            "rig identify -h lists the options.",
        ),
        ("lst", 'rig lst: no such command. Did you mean "list"?'),
        (
            "frobnicate",
            "rig frobnicate: no such command. Known: analyze, blind, check, couple, "
            "diagnose, emulate, export, identify, import, list, measure, report, simulate.",
        ),
    ],
)
def test_says_which_word_and_what_is_allowed(rig: Rig, files: Path, words: str, said: str) -> None:
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err == f"{said}\n"


def test_options_that_may_be_repeated_still_are(rig: Rig, files: Path) -> None:
    status, _, err = rig("diagnose", "d.h5", "--add", "joint_creep", "--add", "time_lag")
    assert (status, "given before" in err) == (2, False)  # d.h5 is not there


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["analyze", "dd.h5"], 'dd.h5: cannot be read: no such file. Did you mean "d.h5"?'),
        (
            ["import", "tt.csv", "m.yaml", "-o", "x.h5"],
            'tt.csv: cannot be read: no such file. Did you mean "t.csv"?',
        ),
    ],
)
def test_of_a_missing_file_its_neighbours_are_told(
    rig: Rig, files: Path, words: list[str], said: str
) -> None:
    rig("import", "t.csv", "m.yaml", "-o", "d.h5")
    status, _, err = rig(*words)
    assert (status, err) == (2, f"{said}\n")


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ("analyze t.csv", "t.csv"),
        ("report p.yaml t.csv", "t.csv"),
        ("diagnose none.h5 --model t.csv", "--model t.csv"),
    ],
)
def test_an_unreadable_file_is_told_with_what_to_do(
    rig: Rig, files: Path, monkeypatch: pytest.MonkeyPatch, words: str, place: str
) -> None:
    monkeypatch.setattr(os, "access", lambda path, _mode: str(path) != "t.csv")
    status, out, err = rig(*words.split())
    assert (status, out) == (2, "")
    assert err == (
        f"{place}: you may not read this file. Change its permissions, or ask whoever owns it.\n"
    )
