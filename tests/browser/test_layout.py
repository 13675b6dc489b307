"""What is in sight on screens of all sizes."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from math import nan

import pytest

from rig.panel.state import State, Turn
from tests.browser import scenes
from tests.browser.browser import resize
from tests.browser.feed import Feed
from tests.browser.viewer import Viewer

pytestmark = pytest.mark.browser


def scene_shown(page: Viewer, state: State) -> bool:
    return page.seen("prompt") == bool(state.prompt)


@pytest.mark.parametrize(
    "size", [(1920, 1080), (1366, 768), (1024, 768), (960, 540), (844, 390), (780, 437), (390, 844)]
)
def test_nothing_is_cut_off(page: Viewer, feed: Feed, size: tuple[int, int]) -> None:
    resize(page.here(), *size)
    unload = replace(scenes.prompting(scenes.UNLOAD), turn=Turn("out", nan, nan, nan))
    questions = (scenes.prompting(scenes.MOUNT), scenes.prompting(scenes.PAUSED), unload)
    for state in (scenes.turning(), *questions, scenes.laser_failed()):
        feed.state = state
        page.wait(partial(scene_shown, page, state), "the scene")
        time.sleep(0.3)
        assert page.script(CUT_OFF) == []


# Ids of what is wider than its place or sticks out of the window at the side, and of questions
# that aren't wholly in sight above what stands below them.
CUT_OFF = """
const ids = ["force", "target", "gauge-scale", "cue-word", "cue-far", "displacement", "prompt-text",
  "prompt-choices", "facts", "controls", "safety", "curve-legend", "emulated", "alarms",
  "state-card"];
const top = (element) => element.getBoundingClientRect().top;
const below = [document.getElementById("displacement"), document.querySelector("footer")];
const end = Math.min(...below.map(top));
return ids.filter((id) => {
  const e = document.getElementById(id);
  if (!e.checkVisibility()) return false;
  const box = e.getBoundingClientRect();
  const card = (e.closest(".card") ?? document.body).getBoundingClientRect();
  const cut = id === "prompt-text" && e.scrollHeight > e.clientHeight + 1;
  const under = id.startsWith("prompt") && box.bottom > end + 1;
  return cut || under || e.scrollWidth > e.clientWidth + 1
    || box.right > Math.min(innerWidth, card.right) + 1 || box.bottom > card.bottom + 1
    || box.left < 0;
});
"""


@pytest.mark.parametrize("size", [(1920, 1080), (1024, 768), (960, 540), (844, 390), (780, 437)])
@pytest.mark.parametrize("kind", ["mount", "unload"])
def test_set_up_shows_force_what_to_do_and_the_drawing_at_once(
    page: Viewer, feed: Feed, size: tuple[int, int], kind: str
) -> None:
    resize(page.here(), *size)
    unload = replace(scenes.prompting(scenes.UNLOAD), turn=Turn("out", nan, nan, nan))
    feed.state = scenes.setting_up() if kind == "mount" else unload
    page.wait(partial(scene_shown, page, feed.state), "the scene")
    time.sleep(0.3)
    assert page.script(OUT_OF_SIGHT) == []
    arrow = page.script("return document.querySelector('#arm .push').getBoundingClientRect().width")
    assert arrow > 20


# Selectors of what isn't wholly between the head of the page and the buttons at its foot.
OUT_OF_SIGHT = """
const wanted = ["#force", "#target", "#gauge-scale", "#prompt-text", "#prompt-choices", "#cue",
  "#arm .push", "#arm .push-head", "#arm .link", "#facts", "#displacement"];
const end = document.querySelector("footer").getBoundingClientRect().top;
return wanted.filter((selector) => {
  const e = document.querySelector(selector);
  if (selector === "#cue" && !e.checkVisibility()) return false;
  const box = e.getBoundingClientRect();
  return box.height + box.width === 0 || box.top < 0 || box.bottom > end + 1 || box.left < 0
    || box.right > innerWidth;
});
"""


@pytest.mark.parametrize("size", [(390, 844), (844, 390)])
def test_phone_keeps_controls_in_sight(page: Viewer, size: tuple[int, int]) -> None:
    resize(page.here(), *size)
    page.script("scrollTo(0, document.body.scrollHeight)")
    assert page.script("return scrollY") > 0
    box = page.script("return document.getElementById('abort').getBoundingClientRect().toJSON()")
    assert 0 < box["top"] < box["bottom"] <= size[1]
    assert box["height"] >= 44


def test_names_of_devices_are_not_torn_on_a_tablet(page: Viewer, feed: Feed) -> None:
    resize(page.here(), 1024, 768)
    feed.state = scenes.laser_failed()
    page.wait(lambda: "FAULT" in page.text("devices"), "the fault")
    lines = page.script(
        "return [...document.querySelectorAll('#devices .name')].map(n => n.getClientRects()[0]"
        ".height / parseFloat(getComputedStyle(n).lineHeight))"
    )
    assert lines == pytest.approx([1.0] * len(lines), abs=0.2)
