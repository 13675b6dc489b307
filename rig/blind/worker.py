"""Diagnoses data sets whose paths arrive on standard input; an interpreter of its own.

One JSON object a line: `{"path", "withhold"}` comes in, `{"diagnosis", "seconds"}` or `{"refused"}`
goes out, after a first line `{"ready": true}`. It is given nothing but the path and the words that
are taken out of the library; it ends with its input. A crash ends it, with the traceback on
standard error: whoever started it counts the case as wrong and starts another.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TextIO


def answer(path: Path, withhold: Iterable[str]) -> dict[str, Any]:
    """What the diagnosis says of one HDF5 file, and the wall-clock seconds it took."""
    from rig.dataset import load
    from rig.diagnosis.diagnose import diagnose
    from rig.errors import InputError

    start = time.perf_counter()
    try:
        found = diagnose(load(path), withhold=tuple(withhold))
    except InputError as error:
        return {"refused": str(error)}
    return {"diagnosis": found.to_json(), "seconds": time.perf_counter() - start}


def serve(questions: Iterable[str], replies: TextIO) -> None:
    """Answers line by line until the questions end."""
    import rig.diagnosis.diagnose  # noqa: F401  # loading the libraries is no part of a case's time

    _send({"ready": True}, replies)
    for line in questions:
        question = json.loads(line)
        _send(answer(Path(question["path"]), question["withhold"]), replies)


def _send(reply: dict[str, Any], replies: TextIO) -> None:
    replies.write(json.dumps(reply) + "\n")
    replies.flush()


if __name__ == "__main__":
    # What a library prints must not mix with the replies.
    channel, sys.stdout = sys.stdout, sys.stderr
    serve(sys.stdin, channel)
