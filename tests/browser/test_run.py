"""Whole emulated measurements with the operator's page, driven by its buttons."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rig import dataset
from tests.browser.feed import Feed
from tests.browser.viewer import Viewer
from tests.wire.short import HOME, write_files

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = pytest.mark.browser
LINK = re.compile(r"http://127\.0\.0\.1:\d+/\?token=\S+")
START_S, RUN_S = 30.0, 90.0


class Measurement:
    """`rig measure --panel` in a folder of its own; stopped in any case."""

    def __init__(self, folder: Path, **wanted: Any) -> None:
        self.folder = folder
        self._log = folder / "log.txt"
        words = [sys.executable, "-m", "rig", *write_files(folder, **wanted), "--panel"]
        with self._log.open("w") as log:
            self._process = subprocess.Popen(
                words,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONPATH": str(HOME)},
            )

    @property
    def said(self) -> str:
        """Everything on the terminal so far."""
        return self._log.read_text(encoding="utf-8")

    def link(self) -> str:
        """The operator's, as the terminal says it."""
        end = time.monotonic() + START_S
        while (found := LINK.search(self.said)) is None:
            assert self.running, self.said
            assert time.monotonic() < end, self.said
            time.sleep(0.05)
        return found.group()

    @property
    def running(self) -> bool:
        """Whether the measurement goes on."""
        return self._process.poll() is None

    def status(self) -> int:
        """Exit status, once it is over."""
        return self._process.wait(RUN_S)

    def stop(self) -> None:
        """Ends it, if it still runs."""
        if self.running:
            self._process.terminate()
            try:
                self._process.wait(15)
            except subprocess.TimeoutExpired:
                self._process.kill()


@pytest.fixture
def measurement(driver: Chrome, tmp_path: Path) -> Iterator[Measurement]:
    """A short one at 20 times real time, which a page keeps up with on a busy machine; the browser
    first, because it may skip."""
    running = Measurement(tmp_path, steps_N=(20, 40), speed=20)
    yield running
    running.stop()


CARRY_ON = """
const [until, press, deadlineMs, done] = arguments;
const cue = document.getElementById("cue-word");
const look = () => {
  document.querySelector("#prompt-choices .first")?.click();
  if (cue.textContent !== until) return;
  watcher.disconnect();
  if (press) document.getElementById(press).click();
  done(true);
};
const watcher = new MutationObserver(look);
const all = {attributes: true, childList: true, characterData: true, subtree: true};
watcher.observe(document.body, all);
setTimeout(() => { watcher.disconnect(); done(false); }, deadlineMs);
look();
"""


def carry_on(page: Viewer, until: str, press: str = "") -> None:
    """Answers questions by their first button until `until` is the word to the operator, then
    presses the button `press`. The page does it by itself: on a busy machine who asks it from
    outside may not see a whole repetition."""
    driver = page.here()
    driver.set_script_timeout(RUN_S + 10)
    reached = driver.execute_async_script(CARRY_ON, until, press, 1000 * RUN_S)
    assert reached, f"never {until!r}: {page.text_of_all()}"


def step(page: Viewer) -> int:
    """The step under way, 0 between them."""
    return int(page.text("step").split(" of ")[0].replace("–", "0"))


def test_whole_run_by_the_buttons(driver: Chrome, measurement: Measurement) -> None:
    page = Viewer(driver, measurement.link())
    page.wait_for("prompt-text", "Bring the arm to pose P1")
    assert page.text("emulated").startswith("EMULATED")
    carry_on(page, until="Tighten", press="pause")
    page.wait_for("prompt-text", "Paused.")
    again = step(page) > 0  # a browser may be slower than a step
    page.click("pause")
    carry_on(page, until="Tighten", press="redo")
    page.reload()
    page.wait(lambda: page.seen("controls"), "still the operator after the reload")
    carry_on(page, until="Done")
    page.wait_for("alarms", "The values are from ")
    assert page.looks_old("force")
    assert "repetition 2: " in page.attribute("curve", "aria-label")
    assert measurement.status() == 0, measurement.said
    run = dataset.load(measurement.folder / "run.h5")
    kinds = [event["kind"] for event in run.events]
    assert run.complete
    assert kinds.count("repetition_done") == 2
    assert "pause" in kinds
    # Going on after a pause and redoing measure the step under way from its start.
    redone = "No step is under way" not in measurement.said
    assert kinds.count("step_start") - kinds.count("step_done") == again + redone
    assert page.errors() == []


def test_viewers_a_foreign_page_and_abort(
    driver: Chrome, feed: Feed, measurement: Measurement
) -> None:
    page = Viewer(driver, measurement.link())
    carry_on(page, until="Tighten")
    late_viewers_see_the_whole_run(driver, measurement)
    foreign_page_cannot_abort(driver, feed, measurement)
    # the end of the repetition: the measurement has gone on, and waits
    page.wait_for("prompt-text", "Turn the screw back")
    carry_on(page, until="Tighten", press="abort")
    page.press("\ue007")
    page.wait_for("cue-word", "Stopped")
    assert measurement.status() == 4
    assert "--resume" in measurement.said
    assert not page.seen("controls")


def late_viewers_see_the_whole_run(driver: Chrome, measurement: Measurement) -> None:
    late = Viewer(driver, measurement.link(), new="tab")
    late.wait_for("viewer-text", "somebody else is the operator")
    late.wait(lambda: "repetition 1: " in late.attribute("curve", "aria-label"), "earlier samples")
    assert not late.seen("controls")
    watching = Viewer(driver, measurement.link().split("?")[0], new="tab")
    watching.wait_for("viewer-text", "somebody else is the operator")
    assert not watching.seen("take"), "without the operator's link nobody takes over"


FOREIGN = """
const done = arguments[arguments.length - 1];
const [address, token] = [arguments[0], arguments[1]];
const body = JSON.stringify({command: "abort"});
const own = {"X-Panel-Token": token, "X-Panel-Client": "foreign-page-1"};
const tries = [
  {method: "POST", body, mode: "no-cors"},
  {method: "POST", body, headers: {"Content-Type": "application/json", ...own}},
  {method: "POST", body, headers: {"Content-Type": "text/plain"}, mode: "no-cors"},
];
Promise.allSettled(tries.map((t) => fetch(address + "command?token=" + token, t)))
  .then((all) => done(all.map((r) => r.value?.status ?? "refused")));
"""


def foreign_page_cannot_abort(driver: Chrome, feed: Feed, measurement: Measurement) -> None:
    """The page of another port, with the token even, and without the page's own policy, which
    would stop it before anything is sent."""
    address, token = measurement.link().split("?token=")
    foreign = Viewer(driver, feed.url, new="tab")
    driver.execute_cdp_cmd("Page.setBypassCSP", {"enabled": True})
    foreign.reload()
    driver.set_script_timeout(20)
    answers = foreign.here().execute_async_script(FOREIGN, address, token)
    assert len(answers) == 3
    assert 200 not in answers
    assert measurement.running


@pytest.mark.slow
def test_seven_tabs_of_a_measurement_and_abort(driver: Chrome, measurement: Measurement) -> None:
    """A browser has six connections to a server, and every stream holds one."""
    page = Viewer(driver, measurement.link())
    page.wait_for("prompt-text", "Bring the arm to pose P1")
    for _ in range(6):
        Viewer(driver, measurement.link(), new="tab").wait_for("viewer-text", "You are watching")
    page.wait(lambda: page.seen("controls"), "still the operator")
    # shown again it catches up first
    page.wait(lambda: not page.attribute("abort", "disabled"), "commands to be taken again")
    page.press("a\ue007")
    page.wait_for("cue-word", "Stopped")
    assert measurement.status() == 4, measurement.said


def test_fault_shows_its_remedy_on_the_page(driver: Chrome, tmp_path: Path) -> None:
    running = Measurement(
        tmp_path, faults="[{device: laser, kind: silence, after_s: 40}]", speed=30
    )
    try:
        page = Viewer(driver, running.link())
        carry_on(page, until="Stop")
        page.wait_for("alarms", "The measurement has ended")
        assert running.status() == 3
        remedy = "Check the sensor's power, its cable and the adapter, then go on with --resume."
        assert remedy in running.said
        assert remedy in page.text("alarms")
        assert remedy in page.text("devices")
        assert "FAULT" in page.text("devices")
    finally:
        running.stop()
