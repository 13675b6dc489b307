"""The operator's page: does it cost the measurement anything, and how soon does a value arrive?

    .venv/bin/python bench/panel.py [--minutes 3] [--rounds 2]
    .venv/bin/python bench/panel.py --memory 10    # minutes, at 50 times real time

Punctuality: the slots of bench/slots.py (emulated station in real time, full data rates), by turns
without a page and with eleven viewers: ten that read, and one that never does. The viewers live in
this process, which the measurement shares the machine with. Latency: from a value's own time of
measurement to its arrival at a viewer, of every state during the run.
Memory: of the measuring process and of the page's process, at the beginning and at the end.
"""

from __future__ import annotations

import argparse
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil

HOME = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(HOME))

from bench.slots import PROTOCOL, station_text  # noqa: E402
from rig.dataset import load  # noqa: E402
from tests.wire.panel_client import PanelClient  # noqa: E402

READERS = 10


@dataclass
class Watched:
    """One run: lateness s and missed slots, latency s, memory MB over time by process."""

    late_s: np.ndarray
    missed: int
    latency_s: np.ndarray
    gaps_s: np.ndarray
    memory_MB: dict[str, list[float]] = field(default_factory=dict)


def command(folder: Path, samples: int, speed: float, *, page: bool) -> list[str]:
    """`rig measure` with so many slots in one step."""
    folder.mkdir()
    station = station_text()
    if speed != 1.0:  # the full data rates are those of real time
        station = station.replace("output_rate_Hz: 10000", "output_rate_Hz: 2500")
    (folder / "bench-station.yaml").write_text(station, encoding="utf-8")
    (folder / "bench.yaml").write_text(PROTOCOL.format(samples=samples), encoding="utf-8")
    words = [sys.executable, "-m", "rig", "measure", str(folder / "bench.yaml")]
    words += ["--station", str(folder / "bench-station.yaml"), "-o", str(folder / "bench.h5")]
    words += ["--speed", f"{speed:g}"]
    return [*words, *(["--panel"] if page else [])]


class Audience:
    """Ten viewers that read, the first of them with the operator's link; one that never reads."""

    def __init__(self, operator: str, viewer: str) -> None:
        self.clients = [
            PanelClient(viewer if n else operator, f"bench-viewer-{n}") for n in range(READERS)
        ]
        for client in self.clients:
            client.connect()
        first = self.clients[0]
        self.deaf = socket.socket()
        self.deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        self.deaf.connect((first.host, first.port))
        request = f"GET /events?client=bench-deaf-one HTTP/1.1\r\nHost: {first.host}:{first.port}"
        self.deaf.sendall(f"{request}\r\n\r\n".encode())
        threading.Thread(target=self._confirm, daemon=True).start()

    def _confirm(self) -> None:
        """Presses the only button of every question."""
        first, answered = self.clients[0], ""
        while not first.closed.wait(0.02):
            prompt = first.states[-1]["prompt"] if first.states else None
            if prompt and prompt["id"] != answered:
                answered = prompt["id"]
                first.command("answer", prompt_id=answered, key=prompt["choices"][0]["key"])

    def latency_s(self) -> np.ndarray:
        """Age of the force at arrival: server's age plus the way. One clock for all processes."""
        first = self.clients[0]
        ages = [
            state["force"]["age_s"] + (arrived - state["t_s"])
            for state, arrived in zip(first.states, first.arrivals, strict=True)
            if state["phase"] == "sampling" and state["force"]["age_s"] is not None
        ]
        return np.array(ages)

    def gaps_s(self) -> np.ndarray:
        """Between states at the first viewer, while sampling."""
        first = self.clients[0]
        times = [
            arrived
            for state, arrived in zip(first.states, first.arrivals, strict=True)
            if state["phase"] == "sampling"
        ]
        return np.diff(times)


def run(folder: Path, samples: int, speed: float, *, page: bool) -> Watched:
    """One measurement, watched or not."""
    process = subprocess.Popen(
        command(folder, samples, speed, page=page),
        cwd=HOME,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert process.stderr is not None
    audience = None
    if page:
        links = [re.search(r"http\S+", process.stderr.readline()) for _ in range(2)]
        assert links[0] is not None
        assert links[1] is not None
        audience = Audience(links[0][0], links[1][0])
    memory: dict[str, list[float]] = {}
    said: deque[str] = deque(maxlen=3)  # read throughout, so that the measurement never waits
    threading.Thread(target=said.extend, args=(process.stderr,), daemon=True).start()
    while process.poll() is None:
        _note_memory(process.pid, memory)
        time.sleep(1.0)
    if process.returncode:
        sys.exit(f"rig measure ended with {process.returncode}:\n{''.join(said)}")
    columns = load(folder / "bench.h5").columns
    nothing = np.array([])
    return Watched(
        np.asarray(columns["lateness_s"]),
        int(np.sum(columns["slots_missed"])),
        audience.latency_s() if audience else nothing,
        audience.gaps_s() if audience else nothing,
        memory,
    )


def _note_memory(pid: int, memory: dict[str, list[float]]) -> None:
    try:
        parent = psutil.Process(pid)
        for child in parent.children():
            if "rig.panel" in child.cmdline():
                memory.setdefault("page", []).append(child.memory_info().rss / 1e6)
                memory.setdefault("page CPU s", []).append(sum(child.cpu_times()[:2]))
        memory.setdefault("measurement", []).append(parent.memory_info().rss / 1e6)
    except psutil.Error:
        return


def report(name: str, late_s: np.ndarray, missed: int) -> float:
    """One line about punctuality; returns the median in ms."""
    ms = 1e3 * np.abs(late_s)
    print(
        f"{name:22} slots {ms.size:5} missed {missed:2}  lateness ms: median {np.median(ms):6.3f} "
        f"p95 {np.quantile(ms, 0.95):6.3f} p99 {np.quantile(ms, 0.99):6.3f} max {ms.max():6.3f}"
    )
    return float(np.median(ms))


def punctuality(minutes: float, rounds: int) -> None:
    """By turns, so that what else the machine does falls on both sides alike."""
    seconds = round(60 * minutes)
    runs: dict[bool, list[Watched]] = {False: [], True: []}
    with tempfile.TemporaryDirectory() as name:
        for number in range(rounds):
            for page in (False, True):
                folder = Path(name) / f"{number}-{page}"
                runs[page].append(run(folder, seconds, 1.0, page=page))
    figures = {}
    for page, watched in runs.items():
        late = np.concatenate([w.late_s for w in watched])
        title = "ten read, one does not" if page else "without a page"
        figures[page] = late
        report(title, late, sum(w.missed for w in watched))
    for q in (0.5, 0.95, 0.99):
        with_page, without = (np.quantile(np.abs(figures[p]), q) for p in (True, False))
        print(f"ratio with / without, quantile {q:g}: {with_page / without:.3f}")
    latency = np.concatenate([w.latency_s for w in runs[True]])
    gaps = np.concatenate([w.gaps_s for w in runs[True]])
    print(
        f"value to viewer: {latency.size} states, median {1e3 * np.median(latency):.0f} ms, "
        f"p99 {1e3 * np.quantile(latency, 0.99):.0f} ms, max {1e3 * latency.max():.0f} ms; "
        f"{1 / gaps.mean():.1f} states/s"
    )
    cpu = runs[True][-1].memory_MB["page CPU s"]
    print(f"page's process: {100 * cpu[-1] / len(cpu):.1f} % of a core")


def memory(minutes: float, speed: float = 50.0) -> None:
    """A long run at speed with the whole audience."""
    with tempfile.TemporaryDirectory() as name:
        watched = run(Path(name) / "run", round(60 * minutes * speed), speed, page=True)
    for process in ("measurement", "page"):
        values = watched.memory_MB[process]
        tenths = [values[len(values) * k // 10] for k in range(1, 10)]
        print(f"{process:12} MB at each tenth: " + " ".join(f"{v:.1f}" for v in tenths))
    print(f"slots {watched.late_s.size}, missed {watched.missed}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--memory", type=float, default=0.0, metavar="MINUTES")
    options = parser.parse_args()
    if options.memory:
        memory(options.memory)
    else:
        punctuality(options.minutes, options.rounds)


if __name__ == "__main__":
    main()
