"""From a request of the page to a command for the measuring process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rig.panel.state import COMMANDS

LONGEST_ANSWER = 500
# What a command means while a question is open: the answer that says the same.
AS_ANSWER = {
    "resume": "continue",
    "redo": "redo_step",
    "redo_repetition": "redo_repetition",
    "skip": "skip",
    "abort": "abort",
}
OVER = ("done", "aborted", "fault")


class Refused(Exception):
    """The command can't be passed on: HTTP status, and words for the operator."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


def order(request: object, state: Mapping[str, Any] | None) -> dict[str, str]:
    """What goes to the measuring process: {"command"} or {"command": "answer", "prompt_id", "key"}.

    Raises Refused. The measuring process checks again: the question may be answered meanwhile.
    """
    command = request.get("command") if isinstance(request, dict) else None
    if not isinstance(request, dict) or not isinstance(command, str) or command not in COMMANDS:
        raise Refused(400, f"A command is one of {', '.join(COMMANDS)}.")
    if state is None:
        raise Refused(409, "The measurement has not begun yet.")
    if state["phase"] in OVER:
        raise Refused(409, "The measurement is over.")
    prompt = state["prompt"]
    if command == "answer":
        return _answer(request, prompt)
    if prompt is None:
        if command == "resume":
            raise Refused(409, "The measurement is not paused.")
        return {"command": command}
    key = AS_ANSWER.get(command)
    if key is not None and any(choice["key"] == key for choice in prompt["choices"]):
        return {"command": "answer", "prompt_id": prompt["id"], "key": key}
    if command == "abort":
        return {"command": "abort"}
    if command == "pause":
        raise Refused(409, "The measurement waits for an answer already.")
    raise Refused(409, "Answer the question first.")


def _answer(request: Mapping[str, Any], prompt: Mapping[str, Any] | None) -> dict[str, str]:
    prompt_id, key = request.get("prompt_id"), request.get("key")
    if not isinstance(prompt_id, str) or not isinstance(key, str):
        raise Refused(400, "An answer needs prompt_id and key, both text.")
    if prompt is None or prompt["id"] != prompt_id:
        raise Refused(409, "This question has been answered already.")
    keys = [choice["key"] for choice in prompt["choices"]]
    if keys and key not in keys:
        raise Refused(400, f"The answer must be one of {', '.join(keys)}.")
    words = " ".join("".join(c if c.isprintable() else " " for c in key).split())
    if not words or len(words) > LONGEST_ANSWER:
        raise Refused(400, f"The answer must have 1 to {LONGEST_ANSWER} characters.")
    return {"command": "answer", "prompt_id": prompt_id, "key": words}
