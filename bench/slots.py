"""Punctuality of the 1 Hz slots with all emulators at full data rate, next to a plain loop.

    .venv/bin/python bench/slots.py [--minutes 10]

Both sides talk to the same kind of emulated station in real time (laser 10 000 values/s, DAQ
8 x 1000 values/s, RTDE 125 messages/s). Ours is `rig measure`. The plain loop is what a user would
write first: open the three client libraries, `time.sleep(1)`, read what is there, decode the
laser's bytes in a Python loop, write a CSV row. The emulators run in a process of their own and
are not counted.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import psutil

HOME = Path(__file__).resolve().parent.parent

PROTOCOL = """\
schema: rig.protocol/1
title: punctuality
station: bench
robot: ur10e
poses: {{P1: {{q_deg: [13.43, -99.84, -108.10, -62.06, 90.0, -76.57], tcp_xyz_mm: [0, 0, 0]}}}}
move_arm: false
joint_encoder: output
directions: {{x: [1, 0, 0]}}
runs: [{{pose: P1, direction: x, steps_N: [20]}}]
repetitions: 1
branches: loading
order: by_run
sampling: {{rate_Hz: 1, samples_per_step: {samples}}}
hold_s: 0
force_band: {{absolute_N: 1.0, relative: 0.01}}
settle: {{window_s: 4, force_slope_N_per_s: 0.05, force_spread_N: 0.3,
  displacement_slope_mm_per_s: 0.002, displacement_spread_mm: 0.01, deadline_s: 60,
  at_deadline: record}}
step_deadline_s: 300
zero: {{before_s: 3, after_s: 3}}
rest_s: 1
rated_load_N: null
limits: {{force_N: {{max: 240, at: stop}}}}
prompts: {{}}
"""


def station_text() -> str:
    """The emulated station in real time, with the laser at its full rate."""
    text = (HOME / "protocols/stations/emulated.yaml").read_text(encoding="utf-8")
    return (
        text.replace("name: emulated", "name: bench")
        .replace("speed: 25", "speed: 1")
        .replace("output_rate_Hz: 2500", "output_rate_Hz: 10000")
    )


class Meter:
    """CPU and memory of a process and of its children but the emulators, sampled twice a second."""

    def __init__(self, process: psutil.Process) -> None:
        self.process = process
        self.cpu_s = 0.0
        self.rss_MB: list[float] = []
        self._last: dict[int, float] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._loop, daemon=True)
        self._thread.start()

    def _members(self) -> list[psutil.Process]:
        family = [self.process, *self.process.children(recursive=True)]
        return [p for p in family if not any("rig.emulation.emulated" in w for w in p.cmdline())]

    def _loop(self) -> None:
        while not self._stop.wait(0.5):
            try:
                members = self._members()
                for p in members:
                    times = p.cpu_times()
                    self._last[p.pid] = times.user + times.system
                self.rss_MB.append(sum(p.memory_info().rss for p in members) / 1e6)
            except psutil.Error:
                continue

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()
        self.cpu_s = sum(self._last.values())


def ours(folder: Path, seconds: int) -> tuple[np.ndarray, int, Meter, float]:
    """`rig measure` for so many slots: lateness s, missed slots, meter, wall time s."""
    (folder / "stations").mkdir()
    (folder / "stations" / "bench.yaml").write_text(station_text(), encoding="utf-8")
    protocol = folder / "bench.yaml"
    protocol.write_text(PROTOCOL.format(samples=seconds), encoding="utf-8")
    data = folder / "bench.h5"
    begin = time.monotonic()
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "rig",
            "measure",
            str(protocol),
            "--station",
            str(folder / "stations" / "bench.yaml"),
            "-o",
            str(data),
        ],
        cwd=HOME,
        stderr=subprocess.DEVNULL,
    )
    meter = Meter(psutil.Process(process.pid))
    process.wait()
    meter.stop()
    from rig.dataset import load

    columns = load(data).columns
    return (
        np.asarray(columns["lateness_s"]),
        int(np.sum(columns["slots_missed"])),
        meter,
        time.monotonic() - begin,
    )


def plain_loop(seconds: int, folder: Path) -> int:
    """What a user would write first; prints one lateness per second. Runs in its own process."""
    import grpc
    import nidaqmx
    import serial
    from nidaqmx.constants import AcquisitionType
    from nidaqmx.grpc_session_options import GrpcSessionOptions
    from rtde_receive import RTDEReceiveInterface

    from rig.emulation.emulated import EmulatedRig
    from rig.station import load_station

    station = load_station(str(folder / "stations" / "bench.yaml"), None)
    with EmulatedRig(station, {}, {}) as live:
        assert live.robot is not None
        assert live.laser is not None
        assert live.dynamometer is not None
        server = live.dynamometer.grpc_server
        assert server is not None
        robot = RTDEReceiveInterface(live.robot.host, 125.0, ["timestamp", "actual_q"])
        port = serial.Serial(live.laser.port, live.laser.baud, timeout=0)
        channel = grpc.insecure_channel(server)
        with nidaqmx.Task(grpc_options=GrpcSessionOptions(channel, "")) as task:
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0:7", min_val=-10, max_val=10)
            task.timing.cfg_samp_clk_timing(1000, sample_mode=AcquisitionType.CONTINUOUS)
            task.start()
            start = time.monotonic()
            with open(folder / "plain.csv", "w", encoding="utf-8") as file:
                for k in range(1, seconds + 1):
                    time.sleep(1)
                    late = time.monotonic() - start - k
                    volts = task.read(number_of_samples_per_channel=1000)
                    force = sum(sum(c) for c in volts[:2]) / 1000
                    file.write(
                        f"{force},{_laser(port.read(port.in_waiting))},{robot.getActualQ()}\n"
                    )
                    print(late, flush=True)
    return 0


def _laser(content: bytes) -> float:
    values, i = [], 0
    while i + 2 < len(content):
        low, mid, high = content[i : i + 3]
        if low >> 6 == 0 and mid >> 6 == 1 and high >> 6 == 2:
            raw = (low & 63) | (mid & 63) << 6 | (high & 63) << 12
            values.append((raw * 1.02 / 65520 - 0.01) * 10)
            i += 3
        else:
            i += 1
    return sum(values) / max(1, len(values))


def report(name: str, late: np.ndarray, missed: int, meter: Meter, wall: float) -> None:
    """One line; memory at a tenth and at nine tenths of the run, and its peak (the file's end)."""
    ms = 1000 * np.abs(late)
    n = len(meter.rss_MB)
    early, late_on, peak = meter.rss_MB[n // 10], meter.rss_MB[9 * n // 10], max(meter.rss_MB)
    print(
        f"{name:12} slots {late.size:4} missed {missed:2}  lateness ms: "
        f"median {np.median(ms):8.3f} p99 {np.quantile(ms, 0.99):8.3f} max {ms.max():8.3f}  "
        f"CPU {100 * meter.cpu_s / wall:5.1f} % of a core  "
        f"memory MB: {early:6.1f} -> {late_on:6.1f}, peak {peak:6.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--plain", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    seconds = round(60 * options.minutes)
    if options.plain:
        sys.exit(plain_loop(seconds, options.plain))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        late, missed, meter, wall = ours(folder, seconds)
        report("rig measure", late, missed, meter, wall)
        begin = time.monotonic()
        command = [sys.executable, __file__, "--minutes", str(options.minutes / 5), "--plain", name]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=HOME)
        meter2 = Meter(psutil.Process(process.pid))
        out, _ = process.communicate()
        meter2.stop()
        plain = np.array([float(line) for line in out.split()])
        report("plain loop", plain, 0, meter2, time.monotonic() - begin)
        p99 = [np.quantile(np.abs(x), 0.99) for x in (plain, late)]
        print(f"ratio of p99 lateness, plain loop / rig measure: {p99[0] / p99[1]:.1f}")


if __name__ == "__main__":
    main()
