"""One Chromium for all tests of the page, and a measurement that each test plays itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.browser import scenes
from tests.browser.browser import chromium, missing, resize, theme
from tests.browser.feed import Feed
from tests.browser.viewer import Viewer

if TYPE_CHECKING:
    from selenium.webdriver import Chrome


@pytest.fixture(scope="session")
def chrome() -> Iterator[Chrome]:
    """Skips, with the reason, where no browser can be driven."""
    if reason := missing():
        pytest.skip(reason)
    with chromium() as driver:
        yield driver


@pytest.fixture
def driver(chrome: Chrome) -> Iterator[Chrome]:
    """The browser with one empty tab. What pages keep is per port: other tests don't see it."""
    theme(chrome, "light")
    resize(chrome, 1920, 1080)
    chrome.get_log("browser")  # type: ignore[no-untyped-call]
    yield chrome
    # now, not before the next test: a page that is left open keeps a processor busy until then
    for handle in chrome.window_handles[1:]:
        chrome.switch_to.window(handle)
        chrome.close()
    chrome.switch_to.window(chrome.window_handles[0])
    chrome.get("about:blank")


@pytest.fixture
def feed(driver: Chrome) -> Iterator[Feed]:
    """A run in its third repetition, turning towards 140 N. The browser first: it may skip."""
    run = [scenes.plan(), scenes.prediction(), *scenes.samples(165, up_to=0.6)]
    feed = Feed(scenes.turning(), run)
    yield feed
    feed.close()


@pytest.fixture
def page(driver: Chrome, feed: Feed) -> Iterator[Viewer]:
    """The operator's page of `feed`, with its first values; must end without a script error."""
    viewer = Viewer(driver, feed.url)
    viewer.wait_for("force-number", "126.4")
    yield viewer
    assert viewer.errors() == []
