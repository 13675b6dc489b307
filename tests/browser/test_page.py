"""The operator's page in a real browser, with a measurement that the test plays."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from math import nan
from typing import TYPE_CHECKING, Any, cast

import pytest

from rig.panel.picture import BANNER
from rig.panel.state import Displacement, Force, PromptState, Slots, Turn
from tests.browser import scenes
from tests.browser.browser import resize, theme
from tests.browser.feed import Feed
from tests.browser.viewer import Viewer

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = pytest.mark.browser
ENTER, ESCAPE, TAB = "\ue007", "\ue00c", "\ue004"
EVIL = "<script>document.title='evil'</script><img src=x onerror=\"document.title='evil'\">"


def commands(feed: Feed) -> list[str]:
    return [command["command"] for command in feed.commands]


def test_values_are_on_the_page(page: Viewer, feed: Feed) -> None:
    assert page.text("force") == "126.4N"
    assert page.text("target") == "target 140.0 ± 1.4 N"
    assert page.text("displacement-number") == "1.217"
    assert page.text("cue-word") == "Tighten"
    assert page.text("cue-far") == "about 97°\n13.6 N to go"
    assert page.text("step") == "7 of 11"
    assert page.text("repetition") == "3 of 3"
    assert page.text("direction") == "+x"
    assert page.text("emulated") == BANNER
    assert "Software monitoring is no safety function" in page.text("safety")
    assert page.text("limits").splitlines()[:2] == ["▲ joint temperature", "9 of 60 °C → stop"]
    assert "114 of 240 N" in page.text("limits")
    assert page.text("slots") == "Samples: none missed, 3 ms late"
    feed.show(slots=Slots(2, 250.0))
    page.wait_for("slots", "Samples: ▲ 2 missed, 250 ms late")


def test_cue_says_which_way_and_when_to_take_the_hands_off(page: Viewer, feed: Feed) -> None:
    feed.show(turn=Turn("out", 1.5, 540.0, -20.0))
    page.wait_for("cue-word", "Loosen")
    assert page.text("cue-far") == "about 1.5 turns\n20.0 N to go"
    feed.show(force=Force(139.2, 0.0, 140.0, 1.4, stale=False), turn=Turn("hold", 0.0, 0.0, 0.8))
    page.wait_for("cue-word", "Hold")
    assert page.text("gauge-word") == "close-up · ● in the band"
    feed.state = scenes.settling()
    page.wait_for("cue-word", "Hands off")
    assert page.text("countdown-text") == "3 s left"
    feed.show(phase="done", settle=None)
    page.wait_for("cue-word", "Done")
    assert not page.seen("controls")


def test_force_below_and_above_along_a_pull(page: Viewer, feed: Feed) -> None:
    feed.show(force=Force(-150.0, 0.0, -140.0, 1.4, stale=False))
    page.wait_for("gauge-word", "▲ above the band")
    assert page.text("force-number") == "−150.0"
    feed.show(force=Force(-20.0, 0.0, -140.0, 1.4, stale=False))
    page.wait_for("gauge-word", "▼ below the band")


def test_stale_value_is_grey_with_its_age_and_stops_the_hand(page: Viewer, feed: Feed) -> None:
    assert not page.looks_old("force")
    feed.show(force=Force(126.4, 3.2, 140.0, 1.4, stale=True), turn=None)
    page.wait_for("cue-word", "Stop turning")
    assert page.looks_old("force")
    assert page.text("force-age") == "3.2 s old"
    assert not page.looks_old("displacement")


def test_connection_lost_and_back(page: Viewer, feed: Feed) -> None:
    seen_before = page.text("limits")
    port = feed.stop()
    page.wait_for("alarms", "Connection lost: the values are from ")
    assert re.search(r"from \d\d:\d\d:\d\d, \d+ s ago", page.text("alarms"))
    assert page.text("cue-word") == "Stop turning"
    assert page.text("force-number") == "126.4", "the last value stays, grey"
    assert page.looks_old("force")
    assert not page.element("pause").is_enabled()
    assert page.text("limits") == seen_before
    feed.show(force=Force(139.9, 0.0, 140.0, 1.4, stale=False))
    feed.start(port)
    page.wait_for("force-number", "139.9")
    page.wait(lambda: page.text("alarms") == "", "no banner once values come")
    assert not page.looks_old("force")
    assert "repetition 3: 30 samples" in page.attribute("curve", "aria-label")


def test_silent_connection_looks_no_more_alive_than_a_lost_one(page: Viewer, feed: Feed) -> None:
    feed.silent = True
    page.wait_for("alarms", "No values arrive: the values are from ")
    assert page.text("cue-word") == "Stop turning"
    page.wait(lambda: feed.viewers > 1, "another connection in place of the silent one")
    feed.silent = False
    page.wait_for("cue-word", "Tighten")


def test_state_that_was_held_up_on_the_way_is_old(page: Viewer, feed: Feed) -> None:
    time.sleep(0.5)  # some states that came in time, to compare with
    feed.late_s = 2.0
    page.wait_for("alarms", "No values arrive: the values are from ")
    assert page.looks_old("force")


def test_reload_shows_the_whole_run_again(page: Viewer, feed: Feed) -> None:
    label = "repetition 1: 55 samples, repetition 2: 55 samples, repetition 3: 30 samples"
    page.wait(lambda: label in page.attribute("curve", "aria-label"), label)
    operator = feed.operator
    page.reload()
    page.wait(lambda: label in page.attribute("curve", "aria-label"), label)
    assert feed.operator == operator
    page.wait(lambda: page.seen("controls"), "still the operator after the reload")


def test_who_comes_late_sees_the_last_two_minutes(page: Viewer, feed: Feed) -> None:
    def values() -> int:
        return int(page.attribute("time", "aria-label").split(", ")[-1].split()[0])

    now = time.monotonic()
    feed.recent = [(now - 90 + 0.1 * n, 0.1 * n, None) for n in range(900)]
    assert values() < 800
    page.reload()
    page.wait(lambda: "values" in page.attribute("time", "aria-label"), "the chart over time")
    assert 900 < values() < 1000
    feed.start(feed.stop())
    page.wait_for("alarms", "Connection lost")
    page.wait(lambda: page.text("alarms") == "", "another stream")
    assert 900 < values() < 1000, "told anew, and not added"


def test_sample_that_is_told_twice_counts_once(page: Viewer, feed: Feed) -> None:
    last = cast("dict[str, Any]", feed.items[-1]["sample"])
    feed.items += [{"sample": last}, {"sample": {**last, "row": last["row"] + 1}}]
    label = "repetition 3: 31 samples"
    page.wait(lambda: label in page.attribute("curve", "aria-label"), label)
    time.sleep(0.3)  # all of them have come
    assert label in page.attribute("curve", "aria-label")


def test_whole_run_over_time(page: Viewer) -> None:
    page.click("span-run")
    label = "the whole run, 140 samples"
    page.wait(lambda: label in page.attribute("time", "aria-label"), label)
    assert page.attribute("span-run", "aria-pressed") == "true"


# Pixels of the curve in the colour of the repetition under way (light theme).
INKED = """
const c = document.querySelector("#curve canvas");
const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
let n = 0;
for (let i = 0; i < d.length; i += 4) n += d[i] < 60 && d[i + 2] > 150 && d[i + 3] > 200;
return n;
"""


def test_discarded_rows_leave_the_curve(page: Viewer, feed: Feed) -> None:
    page.wait(lambda: page.script(INKED) > 500, "the curve of repetition 3 in its own colour")
    feed.items.append({"discard": {"first": 110, "last": 139, "reason": "repetition redone"}})
    page.wait(lambda: page.script(INKED) == 0, "no curve of repetition 3")
    assert "repetition 3: 0 samples" in page.attribute("curve", "aria-label")


def test_pause_redo_and_abort_by_mouse(page: Viewer, feed: Feed) -> None:
    page.click("pause")
    page.click("redo")
    page.click("abort")
    assert page.seen("confirm"), "abort asks once more"
    assert page.text("force-number") == "126.4", "and hides no value"
    page.wait(lambda: len(feed.commands) == 2, "two commands")
    page.click("confirm-no")
    page.click("abort")
    page.click("confirm-yes")
    page.wait(lambda: len(feed.commands) == 3, "three commands")
    assert commands(feed) == ["pause", "redo", "abort"]
    assert page.seen("controls")


def test_question_is_answered_once_by_its_button(page: Viewer, feed: Feed) -> None:
    feed.state = scenes.prompting(scenes.PAUSED)
    page.wait_for("prompt-text", "Paused. The arm may be under load.")
    assert page.text("pause-word") == "Go on"
    feed.on_command = lambda _: feed.show(phase="turning", prompt=None)
    page.script("const b = document.querySelectorAll('.choice')[2]; b.click(); b.click()")
    page.wait(lambda: not page.seen("prompt"), "the question has gone")
    assert feed.commands == [{"command": "answer", "prompt_id": "7", "key": "redo_repetition"}]


def test_go_on_after_a_pause(page: Viewer, feed: Feed) -> None:
    feed.state = scenes.prompting(scenes.PAUSED)
    page.wait_for("pause-word", "Go on")
    page.click("pause")
    page.wait(lambda: feed.commands, "a command")
    assert commands(feed) == ["resume"]


def test_free_text_is_sent_as_it_was_typed(page: Viewer, feed: Feed) -> None:
    feed.state = scenes.prompting(PromptState("9", "skip_reason", "Why? (one line)", ()))
    page.wait_for("prompt-text", "Why?")
    field = page.here().find_element("css selector", "#prompt-choices input")
    field.send_keys("p a <b> loose screw", ENTER)
    page.wait(lambda: feed.commands, "a command")
    assert feed.commands == [{"command": "answer", "prompt_id": "9", "key": "p a <b> loose screw"}]
    assert not page.seen("confirm"), "letters that are typed press no button"


def test_keyboard_alone(page: Viewer, feed: Feed) -> None:
    page.press("p")
    page.press("r")
    page.press("a")
    assert page.seen("confirm")
    assert page.focused() == "confirm-yes"
    page.press(ESCAPE)
    assert page.focused() == "abort"
    page.press("a" + ENTER)
    page.wait(lambda: len(feed.commands) == 3, "three commands")
    assert commands(feed) == ["pause", "redo", "abort"]
    feed.state = scenes.prompting(scenes.PAUSED)
    page.wait(lambda: page.seen("prompt"), "the question")
    page.press("2")
    page.wait(lambda: len(feed.commands) == 4, "an answer")
    assert feed.commands[3]["key"] == "redo_step"


def test_every_button_is_reached_by_tab_and_shows_the_focus(page: Viewer, feed: Feed) -> None:
    reached = []
    for _ in range(12):
        page.press(TAB)
        reached.append(page.focused())
        code = (
            "const e = document.activeElement; return [e.tagName, getComputedStyle(e).outlineStyle]"
        )
        assert page.script(code) in (["BODY", "none"], ["BUTTON", "solid"], ["SECTION", "solid"])
    wanted = ["theme", "full", "keys", "span-live", "span-run", "pause", "redo", "abort"]
    assert [name for name in reached if name in wanted][: len(wanted)] == wanted
    page.script("document.getElementById('redo').focus()")
    page.press(ENTER)
    page.wait(lambda: feed.commands, "a command")
    assert commands(feed) == ["redo"]


def test_single_keys_can_be_switched_off(page: Viewer, feed: Feed) -> None:
    page.press("?")
    assert page.seen("help")
    assert "pause, go on" in page.text("help-keys")
    page.click("single-keys")
    page.press(ESCAPE)
    page.wait(lambda: not page.seen("help"), "the list has gone")
    page.press("p")
    page.press("a")
    assert not page.seen("confirm")
    assert feed.commands == []


def test_refused_command_says_why(page: Viewer, feed: Feed) -> None:
    feed.refusal = "The measurement is over."
    page.click("pause")
    page.wait_for("alarms", "The measurement is over.")
    feed.refusal = "The answer must be another one."
    feed.state = scenes.prompting(scenes.PAUSED)
    page.wait(lambda: page.seen("prompt"), "the question")
    page.press("1")
    page.wait_for("alarms", "The answer must be another one.")
    page.press("1")
    page.wait(lambda: len(feed.commands) == 3, "it may be given again")


def test_two_viewers_and_one_operator(page: Viewer, feed: Feed) -> None:
    other = Viewer(page.here(), feed.url, new="tab")
    other.wait_for("force-number", "126.4")
    other.wait_for("viewer-text", "somebody else is the operator")
    assert not other.seen("controls")
    other.press("a")
    assert not other.seen("confirm")
    other.click("take")
    other.wait(lambda: other.seen("controls"), "the controls after taking over")
    page.wait(lambda: page.seen("viewer"), "the first viewer only watches now")
    assert commands(feed) == ["take_over"]


def test_device_fault_with_its_remedy(page: Viewer, feed: Feed) -> None:
    feed.state = scenes.laser_failed()
    page.wait_for("alarms", "✖ laser: no value for 1.2 s from /dev/ttyUSB0")
    assert scenes.LASER_FAULT.remedy in page.text("alarms")
    assert "FAULT" in page.text("devices")
    assert scenes.LASER_FAULT.remedy in page.text("devices")
    assert page.text("cue-word") == "Stop turning"
    assert page.looks_old("displacement")
    for size in ((1024, 768), (1920, 1080)):
        resize(page.here(), *size)
        hidden = "const e = arguments[0]; return e.scrollHeight - e.clientHeight"
        assert page.script(hidden, page.element("state-card")) <= 0, size
    feed.state = scenes.turning()
    page.wait(lambda: page.text("alarms") == "", "the band has gone")


def test_end_is_said_and_nothing_looks_live(page: Viewer, feed: Feed) -> None:
    feed.state = replace(scenes.turning(), phase="aborted", turn=None, prompt=None)
    page.wait_for("cue-word", "Stopped")
    feed.end = {"phase": "aborted", "text": "The operator ended the measurement"}
    page.wait_for("alarms", "The operator ended the measurement. The values are from ")
    assert page.looks_old("force")
    page.wait(lambda: feed.viewers == 0, "the page has hung up")


def test_dangerous_names_show_as_text(page: Viewer, feed: Feed) -> None:
    run = replace(feed.state.run, pose=EVIL, direction=EVIL, branch=EVIL)
    device = replace(scenes.LASER_FAULT, name=EVIL, reason=EVIL, remedy=EVIL)
    limit = replace(feed.state.limits[0], name=EVIL, unit=EVIL)
    feed.items.append({"log": {"session_s": 0.0, "level": "info", "text": EVIL}})
    feed.state = replace(
        scenes.prompting(replace(scenes.PAUSED, text=EVIL)),
        protocol=EVIL,
        robot=EVIL,
        banner=EVIL,
        message=EVIL,
        run=run,
        devices=(device,),
        limits=(limit,),
    )
    for name in ("title", "place", "emulated", "alarms", "devices", "limits", "prompt-text", "log"):
        page.wait_for(name, EVIL)
    assert page.script("return document.title") == "Stiffness measurement"
    assert page.script("return document.querySelectorAll('img').length") == 0


def test_nothing_is_said_of_samples_before_there_are_any(driver: Chrome) -> None:
    feed = Feed(scenes.setting_up(), [scenes.plan(), scenes.prediction()])
    page = Viewer(driver, feed.url)
    try:
        page.wait_for("prompt-text", "Set up screw, dynamometer and laser along x")
        assert page.attribute("arm", "aria-label").endswith(
            "the screw pushes it along x +x of the base frame"
        )
        assert page.script("return document.querySelector('#arm .push-head') !== null")
        assert page.text("slots") == ""
        assert page.text("curve-legend") == "simulation"
    finally:
        feed.close()


def test_one_order_at_a_time(page: Viewer, feed: Feed) -> None:
    feed.state = replace(scenes.setting_up(scenes.UNLOAD), turn=Turn("out", nan, nan, nan))
    page.wait_for("prompt-text", "Turn the screw back")
    page.wait(lambda: not page.seen("cue"), "the question alone")
    feed.show(force=Force(12.0, 0.1, 0.0, 0.0, stale=False))
    page.wait_for("cue-word", "Loosen")
    assert page.text("cue-far") == "until the force no longer answers"


def test_unknown_values_are_dashes(page: Viewer, feed: Feed) -> None:
    feed.show(
        force=Force(nan, nan, nan, 0.0, stale=True),
        displacement=Displacement(nan, nan, stale=True),
        turn=None,
        phase="starting",
    )
    page.wait_for("force-number", "–")
    assert page.text("target") == "no target"
    assert page.text("cue-word") == "Wait"


def test_theme_follows_the_system_until_the_button_says_otherwise(page: Viewer) -> None:
    def background() -> str:
        return str(page.script("return getComputedStyle(document.body).backgroundColor"))

    light = background()
    theme(page.here(), "dark")
    page.wait(lambda: background() != light, "dark with the system")
    page.click("theme")
    assert background() == light
    page.reload()
    page.wait_for("force-number", "126.4")
    assert background() == light, "the choice outlives a reload"


def test_foreign_resources_are_not_asked_for(page: Viewer, feed: Feed) -> None:
    code = "return performance.getEntriesByType('resource').map((e) => new URL(e.name).origin)"
    origin = feed.url.split("/?")[0]
    assert set(page.script(code)) == {origin}
