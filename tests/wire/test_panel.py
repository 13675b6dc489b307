"""The page's process over real HTTP, and measurements that are led from the page."""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from math import nan
from pathlib import Path
from typing import Any

import psutil
import pytest

from rig.dataset import load
from rig.panel.child import listen
from rig.panel.link import DEFAULT_HOST, Links, PanelLink, PanelOptions, PanelUnavailable
from rig.panel.onlooker import Onlooker
from rig.panel.panel import start_panel
from rig.panel.picture import Moment, Setting, state_of
from rig.panel.state import Slots, State
from rig.protocol import load_protocol
from rig.station import load_station
from tests.wire.panel_client import PanelClient
from tests.wire.short import HOME, write_files

SETTING = Setting(load_protocol(HOME / "protocols" / "paper_xy.yaml"), True, 1.0, 0.5)


def state(message: str = "") -> State:
    return state_of(SETTING, Moment(None, 0.0, 0.0, None, "", (), Slots(0, nan), message=message))


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind((DEFAULT_HOST, 0))
        port: int = probe.getsockname()[1]
        return port


class Served:
    """The page's process without a measurement behind it."""

    def __init__(self, host: str = DEFAULT_HOST) -> None:
        self.received: list[Mapping[str, Any]] = []
        self.link = PanelLink(self.received.append)
        self.links: Links = self.link.start(PanelOptions(host, free_port()))
        self.link.show(state())

    def client(self, word: str = "client-one", *, looks: bool = False) -> PanelClient:
        client = PanelClient(self.links.viewer if looks else self.links.operator, word).connect()
        client.wait(lambda me: me.states)
        return client

    def commands(self) -> list[Mapping[str, Any]]:
        return [message["command"] for message in self.received if "command" in message]


@pytest.fixture(scope="module")
def shared() -> Iterator[Served]:
    """One server for all questions that leave nothing behind."""
    served = Served()
    yield served
    served.link.finish("done", "the end")


@pytest.fixture
def served() -> Iterator[Served]:
    own = Served()
    yield own
    own.link.finish("done", "the end")


def test_the_page_and_its_headers(shared: Served) -> None:
    client = PanelClient(shared.links.viewer)
    status, body, headers = client.get("/")
    assert status == 200
    assert b"<html" in body
    assert headers["content-type"] == "text/html; charset=utf-8"
    assert headers["cache-control"] == "no-store"
    assert headers["x-frame-options"] == "DENY"
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "server" not in headers
    assert "access-control-allow-origin" not in headers
    assert client.get("/panel.css")[2]["content-type"] == "text/css; charset=utf-8"


@pytest.mark.parametrize(
    "path",
    [
        "/../state.py",
        "/..%2fstate.py",
        "/%2e%2e/state.py",
        "/page/../../state.py",
        "//etc/passwd",
        "/%2fetc%2fpasswd",
        "/..\\state.py",
        "/index.html/",
        "/index.html%00.css",
        "/state.py",
        "/nothing.js",
        "/?/../../pyproject.toml/..",
    ],
)
def test_nothing_but_the_pages_own_files_is_served(shared: Served, path: str) -> None:
    status, body, headers = PanelClient(shared.links.viewer).get(path)
    assert b"import" not in body
    assert b"root:" not in body
    own_page = path.startswith("/?")
    assert status == (200 if own_page else 404)
    assert "content-security-policy" in headers


def test_a_name_that_was_made_to_point_here_is_refused(shared: Served) -> None:
    client = PanelClient(shared.links.operator)
    for path in ("/", "/events?client=client-one", "/panel.css"):
        assert client.get(path, Host=f"evil.example:{client.port}")[0] == 403
    assert client.post({"command": "abort"}, Host=f"evil.example:{client.port}")[0] == 403


def test_a_foreign_page_can_not_press_abort(served: Served) -> None:
    client = served.client()
    foreign: list[dict[str, str | None]] = [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": None},  # no browser leaves it out
        {"Origin": f"http://127.0.0.1:{client.port + 1}"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
        {"X_Panel_Token": None},
        {"X_Panel_Token": "guess"},
        {"X_Panel_Token": PanelClient(served.links.viewer).token},
    ]
    for headers in foreign:
        assert client.post({"command": "abort"}, **headers)[0] == 403, headers
    # What a form of another page can send without being asked first.
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data", None):
        assert client.post({"command": "abort"}, Content_Type=kind)[0] in (403, 415), kind
    assert client.post({"command": "abort"}, X_Panel_Client="client-two")[0] == 409
    assert served.commands() == []
    preflight = client.request("OPTIONS", "/command", b"", {"Origin": "http://evil.example"})
    assert preflight[0] == 403
    assert client.post({"command": "abort"})[0] == 200
    client.wait(lambda _: served.commands() == [{"command": "abort"}])


def test_a_foreign_page_can_not_read_the_stream(shared: Served) -> None:
    client = PanelClient(shared.links.operator)
    path = f"/events?client=client-one&token={client.token}"
    assert client.get(path, Origin="http://evil.example")[0] == 403
    assert client.get(path, Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="empty")[0] == 403
    # A link on a foreign page may open the page itself: it shows there, and tells nobody.
    assert client.get("/", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="document")[0] == 200


def test_requests_that_make_no_sense_are_refused_in_words(shared: Served) -> None:
    client = shared.client()
    wrong = {"Content-Type": "application/json", "Origin": client.origin}
    head = {**wrong, "X-Panel-Token": client.token, "X-Panel-Client": client.client}
    for body in (b"{", b"", b"\xff", b"[" * 4000):
        status, reply, _ = client.request("POST", "/command", body, head)
        assert (status, reply) == (400, b'{"ok":false,"error":"The command is no JSON."}')
    assert client.request("POST", "/command", b" " * 5000, head)[0] == 413
    assert client.post({"command": "pause"}, X_Panel_Client="x")[0] == 400
    assert client.get("/events?client=x")[0] == 400
    assert client.get("/command")[0] == 404  # only files are got
    assert client.request("POST", "/", b"", wrong)[0] == 405
    client.disconnect()


def test_over_a_network_everything_needs_a_token() -> None:
    served = Served("0.0.0.0")
    try:
        port = PanelClient(served.links.viewer).port
        stranger = PanelClient(f"http://127.0.0.1:{port}/")
        for path in ("/", "/panel.css", "/events?client=client-one", "/?token=guess"):
            assert stranger.get(path)[0] == 403, path
        viewer = PanelClient(served.links.viewer)
        assert len(viewer.token) >= 32
        status, _, headers = stranger.get(f"/?token={viewer.token}")
        assert status == 200
        cookie = headers["set-cookie"]
        assert {"HttpOnly", "SameSite=strict"} <= set(cookie.split("; "))
        assert stranger.get("/panel.css", Cookie=cookie.split(";")[0])[0] == 200
        assert stranger.post({"command": "abort"}, Cookie=cookie.split(";")[0])[0] == 403
        operator = PanelClient(served.links.operator)
        assert operator.token not in cookie
    finally:
        served.link.finish("done", "the end")


def test_a_busy_port_is_a_reason_not_a_crash() -> None:
    with socket.socket() as busy:
        busy.bind((DEFAULT_HOST, 0))
        busy.listen()
        port = busy.getsockname()[1]
        words = f"no page can be served on 127.0.0.1, port {port}: Address already in use"
        with pytest.raises(PanelUnavailable, match=words):
            PanelLink(lambda _: None).start(PanelOptions(DEFAULT_HOST, port))


def test_viewers_who_come_back_miss_nothing(served: Served) -> None:
    for row in range(1500):
        served.link.add({"sample": {"row": row}})
    client = served.client()
    client.wait(lambda me: len(me.items) == 1500)
    client.disconnect()
    for row in range(1500, 1600):
        served.link.add({"sample": {"row": row}})
    client.connect(client.last_id)
    client.wait(lambda me: len(me.items) == 1600)
    assert [sample["row"] for sample in client.samples()] == list(range(1600))
    assert len(client.resets) == 1
    late = served.client("client-two", looks=True)
    late.wait(lambda me: len(me.items) == 1600)
    late.disconnect()
    served.link.add({"sample": {"row": 1600}})
    late.connect(late.last_id, in_address=True)  # as a page that let go of its stream
    late.wait(lambda me: len(me.items) == 1601)
    assert len(late.resets) == 1


def test_who_never_reads_holds_up_nobody(served: Served) -> None:
    with socket.create_connection((DEFAULT_HOST, PanelClient(served.links.viewer).port)) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        request = f"GET /events?client=client-deaf HTTP/1.1\r\nHost: {DEFAULT_HOST}"
        deaf.sendall(f"{request}:{deaf.getpeername()[1]}\r\n\r\n".encode())
        client = served.client()
        for row in range(20_000):  # far more than the buffers between the two hold
            served.link.add({"sample": {"row": row, "fill": "x" * 200}})
        served.link.show(state("the newest"))
        client.wait_state(lambda newest: newest["message"] == "the newest")
        client.wait(lambda me: len(me.items) == 20_000)


def test_values_of_a_process_that_hangs_turn_stale(served: Served) -> None:
    """The measuring process says nothing any more: the server itself lets the values age."""
    client = served.client()
    count = len(client.states)
    client.wait(lambda me: len(me.states) > count + 2)
    assert client.states[-1]["t_s"] - client.states[-2]["t_s"] < 1.0
    assert client.states[-1]["force"]["stale"]


def test_take_over(served: Served) -> None:
    first, second = served.client("client-one"), served.client("client-two")
    looker = served.client("client-three", looks=True)
    assert first.states[-1]["operator"]["you"]
    assert second.states[-1]["operator"] == {"you": False, "taken": True, "may_take": True}
    assert second.command("pause")[0] == 409
    assert second.command("take_over") == (200, {"ok": True})
    second.wait_state(lambda newest: newest["operator"]["you"])
    first.wait_state(lambda newest: not newest["operator"]["you"])
    assert first.command("pause")[0] == 409
    assert second.command("pause")[0] == 200
    first.disconnect()
    assert first.command("take_over") == (200, {"ok": True}), "lets go of its stream to say so"
    assert first.command("pause")[0] == 200
    status, reply = looker.command("take_over")
    assert (status, reply["error"]) == (
        403,
        "This page only looks. Commands need the operator's link.",
    )


def test_when_the_measuring_process_dies_viewers_hear_of_it(tmp_path: Path) -> None:
    program = (
        "import os, sys; from rig.panel.link import *; from tests.wire.test_panel import state\n"
        "link = PanelLink(print); print(link.start(PanelOptions(port=None)).viewer, flush=True)\n"
        "link.show(state()); sys.stdin.readline(); os._exit(9)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=HOME,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    client = PanelClient(process.stdout.readline().strip()).connect()
    client.wait(lambda me: me.states)
    (server,) = psutil.Process(process.pid).children()
    process.stdin.write("\n")
    process.stdin.flush()
    client.wait(lambda me: me.end)
    assert client.end is not None
    assert client.end["phase"] == "fault"
    assert "ended without a word" in client.end["text"]
    assert psutil.wait_procs([server], timeout=10)[1] == []
    process.communicate()


def test_the_links_end_is_quick_though_somebody_never_reads(served: Served) -> None:
    with socket.create_connection((DEFAULT_HOST, PanelClient(served.links.viewer).port)):
        client = served.client()
        served.link.finish("done", "all runs done")
        client.wait(lambda me: me.closed.is_set(), 5)
        assert client.end == {"phase": "done", "text": "all runs done"}
        with pytest.raises(OSError, match=r"refused|reset"):
            http.client.HTTPConnection(client.host, client.port).request("GET", "/")


class Measurement:
    """`rig measure --panel` in the background, and its operator."""

    def __init__(self, folder: Path, repetitions: int = 1, **changes: Any) -> None:
        words = [*write_files(folder, repetitions=repetitions, **changes), "--panel"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rig", *words],
            cwd=folder,
            stderr=subprocess.PIPE,
            text=True,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": str(HOME)},
        )
        assert self.process.stderr is not None
        self.lines: list[str] = [self.process.stderr.readline()]
        found = re.search(r"Operator's page: (http\S+)", self.lines[0])
        assert found, self.lines
        self.operator = PanelClient(found[1]).connect()

    def answer(self, kind: str, key: str = "ok") -> None:
        """Waits for a question of this kind, and answers it on the page."""
        me = self.operator
        me.wait_state(lambda s: s["prompt"] is not None and s["prompt"]["kind"] == kind)
        prompt_id = me.states[-1]["prompt"]["id"]
        assert me.command("answer", prompt_id=prompt_id, key=key) == (200, {"ok": True})
        me.wait(lambda m: m.end or (m.states[-1]["prompt"] or {}).get("id") != prompt_id)

    def ended(self) -> tuple[int, str]:
        """Exit status and everything that was said."""
        _, rest = self.process.communicate(timeout=60)
        return self.process.returncode, "".join(self.lines) + rest


@pytest.fixture
def measurement(tmp_path: Path) -> Iterator[Measurement]:
    running = Measurement(tmp_path)
    yield running
    if running.process.poll() is None:
        running.process.kill()
        running.process.communicate()


def test_a_whole_run_from_the_page(tmp_path: Path) -> None:
    # A second of sampling in each step, so that there is something to redo when the click comes.
    measurement = Measurement(tmp_path, repetitions=2, steps_N=(20, 40), samples=40, speed=40)
    me = measurement.operator
    measurement.answer("mount")
    measurement.answer("unload")
    me.wait(lambda v: any(s["step"] == 1 and s["settled"] for s in v.samples()))
    assert me.command("redo") == (200, {"ok": True})
    me.wait(lambda v: any("discard" in item for item in v.items))
    late = PanelClient(me.origin + "/", "client-late").connect()  # in mid-run
    assert me.command("pause") == (200, {"ok": True})
    me.wait_state(lambda s: s["phase"] == "paused")
    assert me.command("resume") == (200, {"ok": True})
    for kind in ("unload", "unload", "unload"):  # after the first repetition, about the second
        measurement.answer(kind)
    status, said = measurement.ended()
    assert status == 0, said
    dataset = load(tmp_path / "run.h5")
    assert dataset.complete
    for viewer in (me, late):
        viewer.wait(lambda v: v.end)
        assert viewer.end == {"phase": "done", "text": "all runs done"}
        assert viewer.states[-1]["banner"].startswith("EMULATED")
        shown = [sample["force_N"] for sample in viewer.samples()]
        assert shown == pytest.approx(dataset.columns["force_N"].tolist(), abs=1e-6)
        discards = [item["discard"] for item in viewer.items if "discard" in item]
        marked = {row for d in discards for row in range(d["first"], d["last"] + 1)}
        assert marked == set(dataset.columns["discarded"].nonzero()[0])
    assert {"P1|x"} == set(next(i["prediction"] for i in me.items if "prediction" in i))


def test_abort_from_the_page_while_a_question_is_open(
    measurement: Measurement, tmp_path: Path
) -> None:
    me = measurement.operator
    me.wait_state(lambda s: s["prompt"] is not None)
    assert me.command("abort") == (200, {"ok": True})
    status, said = measurement.ended()
    assert status == 4
    assert "the operator ended the measurement" in said
    assert me.end is not None
    assert me.end["phase"] == "aborted"
    assert not load(tmp_path / "run.h5").complete


@pytest.mark.slow
def test_a_failing_device_is_named_with_its_remedy(tmp_path: Path) -> None:
    fault = "[{device: laser, kind: silence, after_s: 60}]"
    running = Measurement(tmp_path, faults=fault)
    running.answer("mount")
    running.answer("unload")
    status, said = running.ended()
    assert status == 3, said
    last = running.operator.states[-1]
    assert last["phase"] == "fault"
    lamp = next(d for d in last["devices"] if d["name"] == "laser")
    assert lamp["state"] == "fault"
    assert lamp["reason"] in said
    assert lamp["remedy"] in said


def test_the_measurement_goes_on_when_the_page_dies(
    measurement: Measurement, tmp_path: Path
) -> None:
    measurement.answer("mount")
    measurement.answer("unload")
    (server,) = [
        p for p in psutil.Process(measurement.process.pid).children() if "rig.panel" in p.cmdline()
    ]
    server.send_signal(signal.SIGKILL)
    status, said = measurement.ended()
    assert status == 0, said
    assert said.count("The operator's page is gone: its process has ended, status -9") == 1
    assert load(tmp_path / "run.h5").complete


def test_where_the_port_is_busy_nobody_looks_on(tmp_path: Path) -> None:
    said: list[str] = []
    station = load_station("emulated")
    with socket.socket() as busy:
        busy.bind((DEFAULT_HOST, 0))
        busy.listen()
        options = PanelOptions(DEFAULT_HOST, busy.getsockname()[1])
        nobody = start_panel(SETTING.protocol, station, options, said.append)
    assert type(nobody) is Onlooker
    assert said == [
        f"There is no operator's page: no page can be served on 127.0.0.1, port {options.port}: "
        "Address already in use. The measurement goes on without it."
    ]


def test_the_usual_port_gives_way_to_a_free_one() -> None:
    with socket.socket() as busy:
        busy.bind((DEFAULT_HOST, 0))
        busy.listen()
        taken = busy.getsockname()[1]
        with listen(DEFAULT_HOST, taken, or_any=True) as other:
            assert other.getsockname()[1] not in (0, taken)


@pytest.mark.slow
def test_a_resumed_run_shows_what_was_measured_before(tmp_path: Path) -> None:
    running = Measurement(tmp_path)
    running.answer("mount")
    running.answer("unload")
    running.operator.wait(lambda me: len(me.samples()) > 5)
    assert running.operator.command("abort")[0] == 200
    assert running.ended()[0] == 4
    shown = running.operator.samples()
    process = subprocess.Popen(
        [sys.executable, "-m", "rig", "measure", "--resume", "run.h5", "--panel"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        stdin=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(HOME)},
    )
    assert process.stderr is not None
    found = re.search(r"(http\S+)", process.stderr.readline())
    assert found
    again = PanelClient(found[1]).connect()
    again.wait(lambda me: len(me.samples()) >= len(shown))
    assert again.samples()[: len(shown)] == shown
    again.wait_state(lambda s: s["prompt"] is not None)
    again.command("abort")
    process.communicate(timeout=60)
