"""Decoding the laser: python bench/laser_decoding.py [seconds]

Vectorised decoding and plausibility next to the loop that one writes first, in chunks as they
come from the port (20 ms at 20 kHz); then the client alone in this process, reading an emulator
in another one at 20 kHz: share of a core, values lost, memory at begin and end.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Literal

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from drivers.clock import Clock
from drivers.ild2200 import frames
from drivers.ild2200.client import Ild2200
from drivers.ild2200.settings import Ild2200Settings

ROOT = Path(__file__).resolve().parents[1]
RATE_HZ: Literal[20000] = 20000
CHUNK = 3 * RATE_HZ // 50 + 1  # never a whole number of frames
SERVE = """
import sys
sys.path[:0] = [sys.argv[1]]
from drivers.ild2200.emulator import Ild2200Emulator
from tests.wire.scene import StillScene
emulator = Ild2200Emulator(StillScene(), output_rate_Hz=int(sys.argv[2]))
print(emulator.start(), flush=True)
sys.stdin.read()
emulator.stop()
"""


def plain_loop(chunks: list[bytes], max_step_mm: float) -> list[float]:
    """Byte by byte with a state, then a median of nine around every value."""
    values: list[float] = []
    held: list[int] = []
    for chunk in chunks:
        for byte in chunk:
            tag = byte >> 6
            if tag == len(held):
                held.append(byte & 0x3F)
            else:
                held = [byte & 0x3F] if tag == 0 else []
            if len(held) == 3:
                raw = held[0] | held[1] << 6 | held[2] << 12
                if raw <= frames.LARGEST_MEASUREMENT:
                    values.append((raw * 1.02 / 65520 - 0.01) * 10)
                held = []
    kept = []
    for i in range(len(values) - 4):
        low = max(0, i - 4)
        around = sorted(values[low : low + 9])
        if abs(values[i] - around[4]) <= max_step_mm:
            kept.append(values[i])
    return kept


def vectorised(chunks: list[bytes], max_step_mm: float) -> list[np.ndarray]:
    decoder, step = frames.FrameDecoder(), frames.StepFilter(max_step_mm)
    kept = []
    for chunk in chunks:
        raw, _ = decoder.feed(chunk)
        kept.append(step.feed(frames.to_mm(frames.measurements(raw), 10.0))[0])
    return kept


def compare(name: str, raw: np.ndarray, chunk: int, max_step_mm: float = 0.5) -> None:
    data = frames.encode(raw)
    chunks = [data[i : i + chunk] for i in range(0, len(data), chunk)]
    begin = time.perf_counter()
    expected = plain_loop(chunks, max_step_mm)
    slow = time.perf_counter() - begin
    fast = float("inf")
    for _ in range(3):
        begin = time.perf_counter()
        found = vectorised(chunks, max_step_mm)
        fast = min(fast, time.perf_counter() - begin)
    same = np.allclose(np.concatenate(found), expected, rtol=0, atol=1e-12)
    share = fast / (len(raw) / RATE_HZ)
    print(
        f"{name:<28} {len(raw)} values: {fast / len(raw) * 1e6:.3f} us a value, plain loop "
        f"{slow / len(raw) * 1e6:.3f} us, ratio {slow / fast:.0f}, same values: {same}, "
        f"{share:.2%} of a core at {RATE_HZ / 1000:g} kHz"
    )


def client(seconds: float) -> None:
    command = [sys.executable, "-c", SERVE, str(ROOT), str(RATE_HZ)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdout is not None
        port = server.stdout.readline().strip()
        settings = Ild2200Settings(driver="ild2200", port=port, output_rate_Hz=RATE_HZ)
        laser = Ild2200(settings, Clock(), emulated=True)
        laser.open()
        laser.collect()
        process = psutil.Process()
        memory, cpu, begin = process.memory_info().rss, time.process_time(), time.monotonic()
        count = invalid = 0
        while time.monotonic() - begin < seconds:
            time.sleep(1.0)
            reading = laser.collect()
            count, invalid = count + reading.count, invalid + reading.invalid
        wall = time.monotonic() - begin
        share = (time.process_time() - cpu) / wall
        growth = (process.memory_info().rss - memory) / 2**20
        laser.close()
        server.communicate("")
    print(
        f"client over the pseudo terminal {wall:.0f} s: {count / wall:.0f} values/s, {invalid} "
        f"invalid, {share:.1%} of a core, {memory / 2**20:.0f} MB, grew by {growth:.2f} MB"
    )


def main() -> None:
    random = np.random.default_rng(1)
    smooth = 5.0 + 0.5 * np.sin(np.arange(400_000) / 4e4) + random.normal(0, 1e-3, 400_000)
    raw = frames.to_raw(smooth, 10.0)
    compare("clean, 20 ms chunks", raw, CHUNK)
    compare("clean, 1 s chunks", raw, 50 * CHUNK)
    flipped = raw.copy()
    hit = random.random(len(raw)) < 0.01
    flipped[hit] ^= np.left_shift(1, random.integers(0, 18, hit.sum())).astype(np.int32)
    compare("1 % with a flip, 20 ms chunks", flipped, CHUNK)
    client(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)


if __name__ == "__main__":
    main()
