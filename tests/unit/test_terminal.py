"""What a terminal is given beside what a file gets."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from rig.cli.options import say, show
from rig.procedure.progress_bar import Bar
from rig.terminal import folded, folded_for


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_long_lines_go_on_below_deeper_and_no_word_is_torn() -> None:
    text = "one two three four\n  note: five six seven\nshort"
    assert folded(text, 14) == "one two three\nfour\n  note: five\n    six seven\nshort"


def test_columns_that_fit_and_words_without_a_place_stay_as_they_are() -> None:
    table = "  a      b     c\n  1.000  2.00  3"
    assert folded(table, 17) == table
    address = "http://127.0.0.1:8321/?token=0123456789"
    assert folded(f"open {address}", 20) == f"open\n{address}"
    assert folded("             deep line", 20) == "             deep line"


def test_only_a_terminal_gets_folded_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "10")
    assert folded_for(Terminal(), "one two three") == "one two\nthree"
    assert folded_for(io.StringIO(), "one two three") == "one two three"


def test_results_and_messages_of_commands_are_folded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "10")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    show("one two three")
    say("four five six")
    assert capsys.readouterr() == ("one two\nthree\n", "four five\nsix\n")


def test_the_bar_leaves_room_for_what_ctrl_c_shows() -> None:
    console = Console(width=80, file=Terminal(), force_terminal=True)
    bar = Bar(console=console)
    bar.add_task("P1 x 1/3 settling", total=69)
    (line,) = console.render_lines(bar.get_renderable(), pad=False)
    assert 60 < sum(segment.cell_length for segment in line) <= 77
