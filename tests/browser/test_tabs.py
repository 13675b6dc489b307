"""More tabs than a browser has connections to one server: six, and every stream holds one."""

from __future__ import annotations

import time
from functools import partial
from typing import Any, cast

import pytest

from rig.panel.state import Force
from tests.browser.feed import Feed
from tests.browser.test_page import commands
from tests.browser.viewer import Viewer

pytestmark = pytest.mark.browser
CONNECTIONS = 6
ABORT = "a\ue007"  # the key, and Enter to the question whether it is meant
NOTE_WHAT_IS_LEFT_TO_SEE = """
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) return;
  const it = (id) => document.getElementById(id);
  window.left = [it("force").className, it("alarms").innerText, it("abort").disabled];
});
"""


def live(window: Viewer) -> bool:
    return not window.looks_old("force")


def test_the_seventh_tab_loads_and_the_first_one_aborts(page: Viewer, feed: Feed) -> None:
    for _ in range(CONNECTIONS):
        last = Viewer(page.here(), feed.url, new="tab")
        last.wait_for("force-number", "126.4")
    page.wait(lambda: page.seen("controls") and not page.looks_old("force"), "live again")
    page.wait(lambda: feed.viewers == 1, "hidden tabs have let go")
    page.press(ABORT)
    page.wait(lambda: commands(feed) == ["abort"], "the abort")


def test_a_command_finds_a_connection_though_all_are_taken(page: Viewer, feed: Feed) -> None:
    for _ in range(CONNECTIONS - 1):
        last = Viewer(page.here(), feed.url, new="window")
        last.wait_for("viewer-text", "somebody else is the operator")
    page.wait(lambda: feed.viewers == CONNECTIONS, "all streams")
    last.click("take")
    last.wait(lambda: last.seen("controls"), "the controls after taking over")
    last.press(ABORT)
    last.wait(lambda: commands(feed) == ["take_over", "abort"], "both commands")
    last.wait(lambda: last.text("alarms") == "", "live again")
    last.wait(lambda: feed.viewers == CONNECTIONS, "its stream in place of the one let go")


def test_the_seventh_window_in_sight_loads_and_all_stay_live(page: Viewer, feed: Feed) -> None:
    windows = [page]
    for _ in range(CONNECTIONS):
        windows.append(Viewer(page.here(), feed.url, new="window"))
        windows[-1].wait_for("force-number", "126.4")
    feed.show(force=Force(131.0, 0.0, 140.0, 1.4, stale=False))
    for window in windows:
        window.wait_for("force-number", "131.0")
        window.wait(partial(live, window), "live")
    assert feed.clients.count(feed.operator) == 1, "who operates never takes turns"


def test_windows_take_no_turns_while_there_are_connections(page: Viewer, feed: Feed) -> None:
    other = Viewer(page.here(), feed.url, new="window")
    other.wait_for("force-number", "126.4")
    time.sleep(3.0)
    assert len(feed.resumed) == 2


def test_a_hidden_tab_is_not_live_and_then_has_the_whole_run(page: Viewer, feed: Feed) -> None:
    page.script(NOTE_WHAT_IS_LEFT_TO_SEE)
    other = Viewer(page.here(), feed.url, new="tab")
    other.wait_for("force-number", "126.4")
    other.wait(lambda: feed.viewers == 1, "the hidden tab has let go")
    last = cast("dict[str, Any]", feed.items[-1]["sample"])
    feed.items.append({"sample": {**last, "row": last["row"] + 1}})
    feed.show(force=Force(131.0, 0.0, 140.0, 1.4, stale=False))
    page.wait_for("force-number", "131.0")
    page.wait(lambda: not page.looks_old("force"), "live again")
    assert "repetition 3: 31 samples" in page.attribute("curve", "aria-label")
    assert feed.resumed == [0, 0, len(feed.items) - 1], "each item is told once"
    Viewer(page.here(), "about:blank", new="tab")  # hides a page that knows of another
    look, band, locked = page.script("return window.left")
    assert "old" in look.split()
    assert band.startswith("Catching up: the values are from ")
    assert locked


def test_the_only_tab_hears_the_end_though_it_is_hidden(page: Viewer, feed: Feed) -> None:
    blank = Viewer(page.here(), "about:blank", new="tab")
    feed.end = {"phase": "aborted", "text": "The operator ended the measurement"}
    blank.wait(lambda: feed.viewers == 0, "the end has been told")
    feed.stop()
    page.wait_for("alarms", "The operator ended the measurement")


def test_a_command_that_does_not_arrive_names_what_is_left(page: Viewer, feed: Feed) -> None:
    page.script("window.fetch = () => Promise.reject(new TypeError('no connection'))")
    page.press("p")
    words = '"pause" did not reach the measurement: no connection. Ctrl-C in the terminal '
    page.wait_for("alarms", words)
    assert commands(feed) == []
