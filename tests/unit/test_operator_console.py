"""The console: what it shows, what keys do, and that the terminal is given back."""

from __future__ import annotations

import math
import os
import pty
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from drivers.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import LimitLevel, LiveView, Prompt
from drivers.operator.console import ConsoleOperator
from drivers.operator.screen import bar, hint, large, number, plain, screen
from drivers.operator.settings import OperatorSettings
from tests.unit.test_operator_hand import view

PITCH_MM = 0.5
LEVELS = (
    LimitLevel("force", 60.0, 240.0, "N", "stop"),
    LimitLevel("displacement", 8.1, 9.0, "mm", "stop"),
    LimitLevel("unlimited", 1.0, 0.0, "mm", "warn"),
    LimitLevel("not read yet", float("nan"), 9.0, "mm", "warn"),
)


def known(force_N: float, target_N: float, **changes: object) -> LiveView:
    return replace(view(force_N, target_N), stiffness_N_per_mm=57.0, **changes)  # type: ignore[arg-type]


def shown(live: LiveView | None, size: tuple[int, int] = (100, 40), **changes: object) -> str:
    """The screen on a terminal of so many columns and lines."""
    options = {"pitch_mm": PITCH_MM, "age_s": 0.0, "stale_s": {}, "notices": [], **changes}
    console = Console(file=StringIO(), width=size[0], height=size[1], force_terminal=False)
    console.print(screen(live, **options))  # type: ignore[arg-type]
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize(
    ("live", "word", "far"),
    [
        (known(40.0, 60.0), "TIGHTEN", "20.0 N to go, about 0.70 turns"),
        (known(80.0, 60.0), "LOOSEN", "20.0 N to go, about 0.70 turns"),
        (known(59.8, 60.0), "HOLD", "in the band"),
        (known(-40.0, -60.0), "TIGHTEN", "20.0 N to go, about 0.70 turns"),
        (known(30.0, 0.0), "LOOSEN", "30.0 N to go, about 1.05 turns"),
        (view(40.0, 60.0), "TIGHTEN", "20.0 N to go"),
        (known(60.0, 60.0, phase="sampling"), "HANDS OFF - sampling", ""),
        (known(float("nan"), 60.0), "WAIT", "no force to go by"),
    ],
)
def test_hint(live: LiveView, word: str, far: str) -> None:
    assert hint(live, PITCH_MM) == (word, far)


def test_bar_shows_force_and_band() -> None:
    text = bar(known(30.0, 60.0, band_N=6.0), width=76).plain  # 1 N a column
    assert text[30] == "█"
    assert text.index("▒") == 54
    assert text.rindex("▒") == 66
    assert len(text) == 76
    assert "█" in bar(known(500.0, 60.0)).plain, "beyond the end it stays at the end"
    assert "█" not in bar(known(float("nan"), 60.0)).plain
    assert "█" in bar(known(30.0, 60.0, band_N=float("nan"))).plain, "a view without a band yet"


def test_large_digits_are_three_lines_of_equal_width() -> None:
    lines = large("-123.4 N")
    assert len(lines) == 3
    assert len({len(line) for line in lines}) == 1
    assert len({tuple(large(d)) for d in "0123456789"}) == 10


def test_screen_tells_where_we_are_and_what_to_do() -> None:
    text = shown(known(40.0, 60.0, displacement_mm=0.123, samples=2))
    for words in ("repetition 1 of 1", "TIGHTEN", "target 60.0 N ± 0.6 N", "0.123 mm", "2 of 5"):
        assert words in text
    assert "p pause" in text


def test_old_values_do_not_look_live() -> None:
    text = shown(known(40.0, 60.0), stale_s={"laser": 2.5})
    assert "laser: no fresh value for 2.5 s" in text
    assert "TIGHTEN" not in text
    assert "STOP" in text
    assert "the values are 3 s old" in shown(known(40.0, 60.0), age_s=3.0)
    # The view may be new and its values old all the same.
    old = shown(known(40.0, 60.0, force_age_s=0.9), age_s=0.2)
    assert "STOP" in old
    assert "values are old" in old
    assert "STOP" in shown(known(40.0, 60.0, displacement_age_s=1.1))
    assert "STOP" not in shown(known(40.0, 60.0, force_age_s=0.7), age_s=0.2)


def test_while_the_rig_is_set_up_no_value_is_missed() -> None:
    mount = Prompt("mount", "Bring the arm to pose P1.")
    text = shown(known(float("nan"), float("nan")), age_s=40.0, prompt=mount)
    assert "SET UP" in text
    assert "STOP" not in text
    assert "s old" not in text
    assert "STOP" in shown(known(40.0, 60.0), stale_s={"laser": 2.5}, prompt=mount)
    assert "STOP" in shown(known(40.0, 60.0), age_s=40.0, prompt=Prompt("paused", "Paused."))


def test_limits_show_how_much_is_left_the_closest_first() -> None:
    text = shown(known(40.0, 60.0, limits=LEVELS))
    assert "left of the limits: displacement 10 %   force 75 %" in text
    assert "nan" not in text
    assert "left of the limits" not in shown(known(40.0, 60.0))


def test_limits_of_which_as_much_is_left_stay_in_their_order() -> None:
    for force in (60.0, 60.1, 59.9):
        levels = tuple(
            LimitLevel(name, value, 240.0, "N", "stop")
            for name, value in (("force", force), ("force rate", 60.0))
        )
        assert "force 75 %   force rate 75 %" in shown(known(40.0, 60.0, limits=levels))


def test_the_screen_says_what_it_is_not() -> None:
    assert "Software monitoring is no safety function." in shown(known(40.0, 60.0))
    assert "EMULATED: no real arm" in shown(known(40.0, 60.0), emulated=True)
    assert "EMULATED" not in shown(known(40.0, 60.0))


@pytest.mark.parametrize("size", [(60, 20), (80, 24), (40, 8)])
def test_on_a_small_terminal_what_must_be_answered_stays(size: tuple[int, int]) -> None:
    text = shown(
        known(40.0, 60.0, limits=LEVELS),
        size,
        prompt=Prompt("interrupt", "Stop the measurement?", ("abort", "continue")),
        typed="ab",
        complaint="'pc' is no answer",
        notices=[("warning", "step 3 has not settled " * 4), ("warning", "Ctrl-C was heard " * 4)],
        emulated=True,
    )
    lines = text.splitlines()
    assert len(lines) <= size[1]
    assert max(map(len, lines)) <= size[0]
    for words in ("Stop the measurement?", "ab▏", "'pc' is no answer"):
        assert words in text
    assert "Software monitoring is" in text
    assert "EMULATED" in lines[-1]
    if size[1] >= 20:
        for words in ("HANDS OFF", "Ctrl-C was heard"):
            assert words in text


def test_on_a_small_terminal_the_older_notices_give_way_first() -> None:
    notices = [("warning", f"notice {i}") for i in range(4)]
    assert "notice 0" in shown(known(40.0, 60.0), notices=notices)
    text = shown(known(40.0, 60.0, limits=LEVELS), (60, 14), notices=notices)
    assert [i for i in range(4) if f"notice {i}" in text] == [2, 3]
    assert "left of the limits" not in text


def test_the_bar_is_as_wide_as_the_terminal_lets_it() -> None:
    for columns in (40, 60, 100):
        lines = shown(known(40.0, 60.0), (columns, 40)).splitlines()
        assert len([line for line in lines if "·" in line or "─█" in line]) == 1


def test_an_answer_from_elsewhere_ends_the_question(
    terminal: Terminal, operator: ConsoleOperator
) -> None:
    operator.answer("nobody has asked")
    answers: list[str] = []
    prompt = Prompt("paused", "Paused.", ("continue", "abort"))
    thread = threading.Thread(target=lambda: answers.append(operator.ask(prompt)))
    thread.start()
    while thread.is_alive():
        operator.answer("continue")
        thread.join(0.05)
    assert answers == ["continue"]


def test_a_question_comes_before_turning() -> None:
    prompt = Prompt("paused", "Paused.", ("continue", "abort"))
    text = shown(known(40.0, 60.0), prompt=prompt, typed="co")
    assert "TIGHTEN" not in text
    assert "continue / abort" in text
    assert "co▏" in text
    assert "LOOSEN" in shown(known(40.0, 0.0), prompt=Prompt("unload", "Turn back."))


def test_where_nothing_is_to_choose_enter_is_asked_for() -> None:
    text = shown(known(40.0, 0.0), prompt=Prompt("unload", "Turn back.", ("ok",)))
    assert "Press Enter: ▏" in text
    assert "Type" not in text


def test_without_a_step_under_way_none_is_counted() -> None:
    assert "step 0" not in shown(known(0.0, 0.0, step=0))
    assert "step 3 of" in shown(known(0.0, 0.0, step=3))
    assert "±" not in shown(known(0.0, 0.0, step=0, band_N=0.0))


def test_without_a_force_the_touch_counts() -> None:
    unload = Prompt("unload", "Turn back.", ("ok",))
    assert "until the force no longer answers" in shown(known(5.0, 0.0), prompt=unload)
    assert "until the screw no longer touches" in shown(known(math.nan, 0.0), prompt=unload)


def test_nothing_is_less_than_nothing() -> None:
    assert number(-0.0004, ".3f", "mm") == "0.000 mm"
    assert number(-0.0006, ".3f", "mm") == "-0.001 mm"
    assert number(math.nan, ".3f", "mm") == "- mm"


def test_screen_before_the_first_view() -> None:
    assert "waiting for the first values" in shown(None)


def test_plain_line() -> None:
    line = plain(known(40.0, 60.0, stale=("laser",), displacement_mm=0.5), PITCH_MM)
    assert line == (
        "x 1/1 step 1/1 step: 40.0 N of 60.0 N, 0.500 mm - "
        "TIGHTEN, 20.0 N to go, about 0.70 turns STALE: laser"
    )


class Terminal:
    """Standard input is a pseudo terminal; `type` is what the person types."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        self.stdin = os.fdopen(self.slave, "r", closefd=False)

    def type(self, text: str) -> None:
        os.write(self.master, text.encode())

    def modes(self) -> list[object]:
        return termios.tcgetattr(self.slave)


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[Terminal]:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdin", terminal.stdin)
    yield terminal
    terminal.stdin.close()
    os.close(terminal.master)
    os.close(terminal.slave)


@pytest.fixture
def operator() -> Iterator[ConsoleOperator]:
    operator = ConsoleOperator(OperatorSettings(driver="console"), Clock())
    yield operator
    operator.close()
    assert not [t for t in threading.enumerate() if t.name == "keys"]


def until(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.01)
    return False


def asked(operator: ConsoleOperator, prompt: Prompt) -> tuple[threading.Thread, list[object]]:
    answers: list[object] = []

    def ask() -> None:
        try:
            answers.append(operator.ask(prompt))
        except DeviceError as error:
            answers.append(error)

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    assert until(lambda: operator._question is not None or bool(answers))
    return thread, answers


def test_keys_become_commands(terminal: Terminal, operator: ConsoleOperator) -> None:
    operator.open()
    terminal.type("xprRsa")
    seen: list[object] = []

    def all_there() -> bool:
        command = operator.command()
        if command is not None:
            seen.append(command)
        return len(seen) == 5

    assert until(all_there)
    assert seen == ["pause", "redo_step", "redo_repetition", "skip", "abort"]
    assert operator.command() is None


def test_the_terminal_is_given_back(terminal: Terminal, operator: ConsoleOperator) -> None:
    before = terminal.modes()
    operator.open()
    assert terminal.modes() != before
    operator.close()
    assert terminal.modes() == before
    operator.close()


@pytest.mark.parametrize(
    ("answers", "typed", "answer"),
    [
        (("continue", "abort"), "continue\n", "continue"),
        (("continue", "abort"), "a\n", "abort"),
        (("continue", "abort"), "\nno\nx\x7f\x7fab\n", "abort"),
        (("redo_step", "redo_repetition"), "redo\nredo_r\n", "redo_repetition"),
        (("ok",), "\n", "ok"),
        ((), "\nthe target fell\n", "the target fell"),
    ],
)
def test_answers(
    terminal: Terminal,
    operator: ConsoleOperator,
    answers: tuple[str, ...],
    typed: str,
    answer: str,
) -> None:
    operator.open()
    thread, given = asked(operator, Prompt("key", "Question?", answers))
    terminal.type(typed)
    thread.join(10)
    assert given == [answer]
    assert operator.command() is None, "what answers a question is no command"


def test_enter_alone_chooses_nothing_where_there_is_a_choice(
    terminal: Terminal, operator: ConsoleOperator
) -> None:
    operator.open()
    thread, given = asked(operator, Prompt("key", "Move?", ("move", "abort")))
    terminal.type("\n")
    assert until(lambda: bool(operator._question and operator._question.complaint))
    assert given == []
    terminal.type("move\n")
    thread.join(10)
    assert given == ["move"]


def test_closing_ends_a_question(terminal: Terminal, operator: ConsoleOperator) -> None:
    operator.open()
    thread, given = asked(operator, Prompt("key", "Question?", ("yes", "no")))
    operator.close()
    thread.join(10)
    assert isinstance(given[0], DeviceError)


def test_without_a_terminal_to_type_at_asking_fails_at_once(
    monkeypatch: pytest.MonkeyPatch,
    operator: ConsoleOperator,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "stdin", StringIO("yes\n"))
    operator.open()
    with pytest.raises(DeviceError, match=r"standard input is no terminal\. Run the command in a"):
        operator.ask(Prompt("key", "Question?", ("yes", "no")))
    operator.guide(known(40.0, 60.0))
    operator.guide(known(41.0, 60.0))
    operator.notify("the force rate is high", "warning")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2, "a line a step and phase, not ten a second"
    assert lines[0].startswith("x 1/1 step 1/1 step: 40.0 N of 60.0 N")
    assert lines[1] == "warning: the force rate is high"
