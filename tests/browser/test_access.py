"""axe-core finds no serious fault of accessibility, in any scene and either theme."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rig.panel.state import State
from tests.browser import scenes
from tests.browser.browser import theme
from tests.browser.feed import Feed
from tests.browser.get_axe import AXE
from tests.browser.viewer import Viewer

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not AXE.exists(), reason="no axe-core: python tests/browser/get_axe.py"),
]
SCENES = {
    "turning": scenes.turning(),
    "question": scenes.prompting(scenes.PAUSED),
    "fault": scenes.laser_failed(),
}


def serious(driver: Chrome) -> list[dict[str, Any]]:
    """Violations that hinder people, with the places where they are."""
    code = "axe.run().then(arguments[0])"
    found = driver.execute_async_script(code)["violations"]
    return [
        {"rule": v["id"], "what": v["help"], "where": [n["html"][:120] for n in v["nodes"]]}
        for v in found
        if v["impact"] in ("serious", "critical")
    ]


@pytest.mark.parametrize("colours", ["light", "dark"])
@pytest.mark.parametrize("scene", SCENES)
def test_no_serious_fault(page: Viewer, feed: Feed, scene: str, colours: str) -> None:
    state: State = SCENES[scene]
    driver = page.here()
    theme(driver, colours)
    feed.state = state
    page.wait(lambda: page.seen("prompt") == bool(state.prompt), scene)
    page.wait(lambda: ("FAULT" in page.text("devices")) == (scene == "fault"), scene)
    # The page's own policy forbids other scripts; the debugger may bring one in.
    page.here().execute_cdp_cmd("Runtime.evaluate", {"expression": AXE.read_text("utf-8")})
    assert serious(driver) == []


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_no_serious_fault_when_the_connection_is_lost(
    page: Viewer, feed: Feed, colours: str
) -> None:
    theme(page.here(), colours)
    feed.silent = True
    page.wait_for("alarms", "No values arrive")
    page.here().execute_cdp_cmd("Runtime.evaluate", {"expression": AXE.read_text("utf-8")})
    assert serious(page.here()) == []
