"""What becomes of a click: passed on, turned into an answer, or refused in words."""

from __future__ import annotations

from typing import Any

import pytest

from rig.panel.orders import Refused, order


def state(phase: str = "turning", kind: str | None = None, *keys: str) -> dict[str, Any]:
    prompt = None
    if kind is not None:
        prompt = {"id": "q3", "kind": kind, "choices": [{"key": k, "label": k} for k in keys]}
    return {"phase": phase, "prompt": prompt}


PAUSED = state("paused", "paused", "continue", "redo_step", "redo_repetition", "skip", "abort")
MOUNT = state("prompt", "mount", "ok")
REASON = state("prompt", "skip_reason")


@pytest.mark.parametrize("command", ["pause", "redo", "redo_repetition", "skip", "abort"])
def test_without_a_question_commands_are_passed_on(command: str) -> None:
    assert order({"command": command}, state()) == {"command": command}


@pytest.mark.parametrize(
    ("command", "key"),
    [("resume", "continue"), ("redo", "redo_step"), ("skip", "skip"), ("abort", "abort")],
)
def test_where_a_question_offers_the_same_it_is_answered(command: str, key: str) -> None:
    answer = {"command": "answer", "prompt_id": "q3", "key": key}
    assert order({"command": command}, PAUSED) == answer


def test_abort_works_while_a_question_does_not_offer_it() -> None:
    assert order({"command": "abort"}, MOUNT) == {"command": "abort"}


def test_an_answer_goes_to_its_question() -> None:
    wish = {"command": "answer", "prompt_id": "q3", "key": "ok"}
    assert order(wish, MOUNT) == wish


def test_a_free_answer_is_one_line() -> None:
    wish = {"command": "answer", "prompt_id": "q3", "key": "  a\nb\x1b[31m\t<script> "}
    assert order(wish, REASON)["key"] == "a b [31m <script>"


@pytest.mark.parametrize(
    ("wish", "now", "status", "words"),
    [
        ({"command": "explode"}, state(), 400, "A command is one of pause, resume"),
        ({}, state(), 400, "A command is one of"),
        ([1], state(), 400, "A command is one of"),
        ("abort", state(), 400, "A command is one of"),
        ({"command": ["abort"]}, state(), 400, "A command is one of"),
        ({"command": "abort"}, None, 409, "has not begun"),
        ({"command": "abort"}, state("done"), 409, "The measurement is over."),
        ({"command": "resume"}, state(), 409, "not paused"),
        ({"command": "pause"}, MOUNT, 409, "waits for an answer already"),
        ({"command": "redo"}, MOUNT, 409, "Answer the question first."),
        ({"command": "answer", "prompt_id": "q2", "key": "ok"}, MOUNT, 409, "answered already"),
        ({"command": "answer", "prompt_id": "q3", "key": "ok"}, state(), 409, "answered already"),
        ({"command": "answer", "prompt_id": "q3", "key": "no"}, MOUNT, 400, "one of ok"),
        ({"command": "answer", "prompt_id": "q3", "key": 1}, MOUNT, 400, "both text"),
        ({"command": "answer"}, MOUNT, 400, "both text"),
        ({"command": "answer", "prompt_id": "q3", "key": " \n"}, REASON, 400, "1 to 500"),
        ({"command": "answer", "prompt_id": "q3", "key": "x" * 501}, REASON, 400, "1 to 500"),
    ],
)
def test_refusals_say_why(
    wish: object, now: dict[str, Any] | None, status: int, words: str
) -> None:
    with pytest.raises(Refused) as refused:
        order(wish, now)
    assert refused.value.status == status
    assert words in str(refused.value)
