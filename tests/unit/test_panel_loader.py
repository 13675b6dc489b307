"""The page beside the loader: who answers, what is passed on, and what a dead page costs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from drivers.clock import Clock
from drivers.errors import DeviceError
from drivers.interfaces import WITHDRAWN, Command, Prompt
from drivers.operator.console import ConsoleOperator
from drivers.operator.settings import OperatorSettings
from rig.errors import MeasurementStopped
from rig.panel import loader as loaders
from rig.panel.link import PanelLink
from rig.panel.loader import PanelLoader
from rig.panel.panel import Panel
from rig.panel.state import State
from rig.protocol import load_protocol
from rig.station import load_station
from tests.unit.fake_rig import Arm, FakeLoader, JumpClock
from tests.unit.test_panel_picture import VIEW

HOME = Path(__file__).resolve().parents[2]
ASK = Prompt("step_deadline", "What now?", ("record", "continue", "abort"))
MOUNT = Prompt("mount", "Set up.", ("ok",), {"q_rad": [0.0] * 6, "direction": [1, 0, 0]})


class DeafLink(PanelLink):
    """Keeps what the page would be told; starts nothing."""

    def __init__(self, receive: Callable[[Mapping[str, Any]], None]) -> None:
        super().__init__(receive)
        self.states: list[State] = []
        self.items: list[Mapping[str, Any]] = []

    def show(self, state: State) -> None:
        self.states.append(state)

    def add(self, item: Mapping[str, object]) -> None:
        self.items.append(item)


class Page(Panel):
    """A panel without a process; `say` is what the page would send."""

    def __init__(self) -> None:
        protocol = load_protocol(HOME / "protocols" / "paper_xy.yaml")
        super().__init__(protocol, load_station("emulated"))
        self.link = self._link = DeafLink(self._receive)

    def say(self, command: str, **more: str) -> None:
        self._receive({"command": {"command": command, **more}})

    def question(self) -> str:
        """Waits for a question on the page; its id."""
        deadline = time.monotonic() + 10
        while not (self.link.states and self.link.states[-1].prompt):
            assert time.monotonic() < deadline
            time.sleep(0.002)
        prompt = self.link.states[-1].prompt
        assert prompt is not None
        return prompt.id


class Asking:
    """`ask` in a thread, as the procedure does it."""

    def __init__(self, loader: PanelLoader, prompt: Prompt) -> None:
        self.result: list[object] = []
        self._thread = threading.Thread(target=self._ask, args=(loader, prompt), daemon=True)
        self._thread.start()

    def _ask(self, loader: PanelLoader, prompt: Prompt) -> None:
        try:
            self.result.append(loader.ask(prompt))
        except (DeviceError, MeasurementStopped) as error:
            self.result.append(error)

    def outcome(self) -> object:
        self._thread.join(10)
        assert self.result, "no answer yet"
        return self.result[0]


@pytest.fixture
def page() -> Page:
    return Page()


@pytest.fixture
def hand() -> FakeLoader:
    return FakeLoader(Arm(JumpClock()))


def beside(page: Page, loader: Any, *, scripted: bool = True) -> PanelLoader:
    return PanelLoader(loader, page, scripted=scripted)


def test_with_nobody_on_the_page_the_scripted_hand_answers(page: Page, hand: FakeLoader) -> None:
    assert beside(page, hand).ask(ASK) == "record"
    assert page.link.states[-1].prompt is None


def test_with_an_operator_on_the_page_he_answers(page: Page, hand: FakeLoader) -> None:
    page.attended = True
    asking = Asking(beside(page, hand), ASK)
    question = page.question()
    page.say("answer", prompt_id="q0", key="record")  # a late click on an earlier question
    assert page._question is not None
    assert not page._question.done.is_set()
    page.say("answer", prompt_id=question, key="continue")
    assert asking.outcome() == "continue"
    assert hand.asked == []


def test_what_he_confirms_is_still_carried_out_in_the_scene(page: Page, hand: FakeLoader) -> None:
    page.attended = True
    asking = Asking(beside(page, hand), MOUNT)
    page.say("answer", prompt_id=page.question(), key="ok")
    assert asking.outcome() == "ok"
    assert hand.asked == [MOUNT]


def test_the_first_question_waits_for_somebody(
    page: Page, hand: FakeLoader, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loaders, "JOIN_S", 0.3)
    loader = beside(page, hand)
    begin = time.monotonic()
    loader.open()
    assert loader.ask(ASK) == "record"
    assert time.monotonic() - begin >= 0.3
    assert "waits 0.3 s for somebody to open the operator's page" in hand.said[0]


def test_when_the_operator_leaves_the_hand_goes_on(page: Page, hand: FakeLoader) -> None:
    page.attended = True
    asking = Asking(beside(page, hand), ASK)
    page.question()
    assert asking.result == []
    page._receive({"operator": False})
    assert asking.outcome() == "record"


def test_abort_ends_a_question_that_does_not_offer_it(page: Page, hand: FakeLoader) -> None:
    page.attended = True
    asking = Asking(beside(page, hand), MOUNT)
    page.question()
    page.say("abort")
    error = asking.outcome()
    assert isinstance(error, MeasurementStopped)
    assert "the operator ended the measurement. Turn the screw back" in str(error)


def test_wishes_come_in_order_and_are_bounded(page: Page, hand: FakeLoader) -> None:
    loader = beside(page, hand)
    hand.commands.append("skip")
    wanted: list[Command] = ["skip", "pause", "redo_step", "redo_repetition", "skip", "abort"]
    for word in ("pause", "redo", "redo_repetition", "skip", "abort"):
        page.say(word)
    assert [loader.command() for _ in range(7)] == [*wanted, None]
    for _ in range(100):
        page.say("pause")
    heard = 0
    while loader.command():
        heard += 1
    assert heard == 8


def test_a_dead_page_is_said_once(page: Page, hand: FakeLoader) -> None:
    loader = beside(page, hand)
    loader.guide(VIEW)
    assert hand.said == []
    page.link.trouble = "its process has ended, status -9"
    loader.guide(VIEW)
    loader.guide(VIEW)
    assert hand.said == [
        "The operator's page is gone: its process has ended, status -9. "
        "The measurement goes on without it."
    ]
    assert len(hand.views) == 3
    page.attended = True
    assert loader.ask(ASK) == "record"  # nobody waits for a page that is gone


def console(available: bool) -> ConsoleOperator:
    operator = ConsoleOperator(OperatorSettings(driver="console"), Clock())

    class _Keys:
        def start(self) -> None: ...
        def stop(self) -> None: ...

    keys = _Keys()
    keys.available = available  # type: ignore[attr-defined]
    operator._keys = keys  # type: ignore[assignment]
    return operator


def test_a_question_that_is_taken_back_leaves_console_and_page(page: Page) -> None:
    operator = console(available=True)
    loader = beside(page, operator, scripted=False)
    loader.withdraw()  # without a question nothing happens
    asking = Asking(loader, ASK)
    page.question()
    loader.withdraw()
    assert asking.outcome() == WITHDRAWN
    assert page.link.states[-1].prompt is None
    assert operator._question is None


def test_a_question_that_is_taken_back_is_not_carried_out(page: Page, hand: FakeLoader) -> None:
    page.attended = True
    loader = beside(page, hand)
    asking = Asking(loader, MOUNT)
    page.question()
    loader.withdraw()
    assert asking.outcome() == WITHDRAWN
    assert hand.asked == []


def test_a_question_stands_at_console_and_page(page: Page) -> None:
    operator = console(available=True)
    loader = beside(page, operator, scripted=False)
    asking = Asking(loader, ASK)
    page.say("answer", prompt_id=page.question(), key="continue")
    assert asking.outcome() == "continue"
    assert operator._question is None  # the console asks no longer
    asking = Asking(loader, ASK)
    page.question()
    while operator._question is None:
        time.sleep(0.002)
    for key in "rec\r":
        operator._on_key(key)
    assert asking.outcome() == "record"
    assert page.link.states[-1].prompt is None


def test_without_a_terminal_the_page_alone_answers(page: Page) -> None:
    loader = beside(page, console(available=False), scripted=False)
    asking = Asking(loader, ASK)
    page.say("answer", prompt_id=page.question(), key="record")
    assert asking.outcome() == "record"
    asking = Asking(loader, ASK)
    page.question()
    page.link.trouble = "its process has ended"
    error = asking.outcome()
    assert isinstance(error, DeviceError)
    assert "standard input is no terminal" in str(error)


def test_closing_ends_an_open_question(page: Page) -> None:
    loader = beside(page, console(available=True), scripted=False)
    asking = Asking(loader, ASK)
    page.question()
    loader.close()
    assert isinstance(asking.outcome(), DeviceError)


def sample(row: int, **changes: Any) -> dict[str, Any]:
    values = {"force_N": 10.0, "displacement_mm": 0.1, "settled": 1.0, "slots_missed": 1.0}
    usual = {
        "pose": "P1",
        "direction": "x",
        "repetition": 1,
        "step": 1,
        "branch": "loading",
        "time_s": 3.0 + row,
        "session_s": 30.0 + row,
        "lateness_s": 0.002,
        "values": values,
        "invalid": {"robot": 0, "dynamometer": 0, "laser": 0},
    }
    return usual | changes


def test_records_become_samples_discards_and_lines(page: Page) -> None:
    page.record("sample", sample(0))
    page.record("sample", sample(1))
    discard = {"kind": "discard", "text": "rows 0 to 1 discarded", "first": 0, "last": 1}
    page.record("event", {**discard, "reason": "redo step", "session_s": 33.0})
    page.record("event", {"kind": "step_start", "text": "nothing to say", "session_s": 34.0})
    page.record("stop", {"reason": "all runs done", "complete": True})
    rows = [item["sample"].row for item in page.link.items if "sample" in item]
    assert rows == [0, 1]
    (told,) = [item["discard"] for item in page.link.items if "discard" in item]
    assert (told.first, told.last, told.reason) == (0, 1, "redo step")
    (line,) = [item["log"] for item in page.link.items if "log" in item]
    assert (line.session_s, line.text) == (33.0, "rows 0 to 1 discarded")
    page.look(VIEW)
    assert page.link.states[-1].slots.missed == 2
    assert page.link.states[-1].slots.late_ms == pytest.approx(2.0)


def test_lamps(page: Page) -> None:
    def lamp(name: str) -> tuple[str, str]:
        found = next(d for d in page.link.states[-1].devices if d.name == name)
        return found.state, found.reason

    page.device("laser")
    assert lamp("laser") == ("ok", "")
    assert lamp("robot") == ("off", "not opened yet")
    page.record("sample", sample(0, invalid={"robot": 0, "dynamometer": 0, "laser": 3}))
    page.look(VIEW)
    assert lamp("laser") == ("warn", "3 invalid values in the last slot")
    page.record("sample", sample(1))
    page.look(VIEW)
    assert lamp("laser") == ("ok", "")
    page.device("laser", DeviceError("laser", "has fallen silent", "Check the cable."))
    page.record("sample", sample(2))
    page.look(VIEW)
    assert lamp("laser") == ("fault", "has fallen silent")
