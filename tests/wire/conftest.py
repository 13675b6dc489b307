"""What all tests at wire level share: the record from which the docs' table of faults is made."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

FaultTable = Callable[[str, str, str, str, str], None]


@pytest.fixture
def fault_table() -> FaultTable:
    """Records what became of an injected fault: (device, fault, when, outcome, message).

    `when` is "start" or "mid-run", `outcome` the name of the error class. Appends one JSON
    line to the file that the environment variable RIG_FAULT_TABLE names; without it, nothing.
    """
    target = os.environ.get("RIG_FAULT_TABLE")

    def record(device: str, fault: str, when: str, outcome: str, message: str) -> None:
        if not target:
            return
        row = {
            "device": device,
            "fault": fault,
            "when": when,
            "outcome": outcome,
            "message": message,
        }
        # One write of one line in append mode: workers of pytest-xdist do not cut each other up.
        with Path(target).open("a", encoding="utf-8") as file:
            file.write(json.dumps(row, ensure_ascii=False) + "\n")

    return record
