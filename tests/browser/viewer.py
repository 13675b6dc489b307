"""Somebody who looks at the page and presses its buttons; every wait has a deadline."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from selenium.webdriver import Chrome
    from selenium.webdriver.remote.webelement import WebElement

DEADLINE_S = 20.0


class Viewer:
    """A tab of the browser with the page in it; a new one hides those of its window."""

    def __init__(self, driver: Chrome, url: str, *, new: Literal["tab", "window", ""] = "") -> None:
        self._driver = driver
        if new:
            driver.switch_to.new_window(new)
        driver.get(url)
        self._tab = driver.current_window_handle

    def here(self) -> Chrome:
        """The driver, looking at this tab, which comes to the front."""
        if self._driver.current_window_handle != self._tab:
            self._driver.switch_to.window(self._tab)
        return self._driver

    def reload(self) -> None:
        """As by F5."""
        self.here().refresh()

    def element(self, name: str) -> WebElement:
        """By id."""
        return self.here().find_element("id", name)

    def text(self, name: str) -> str:
        """What can be seen of an element; empty while it is hidden."""
        # One call: between two the page may have drawn anew.
        return str(self.script("return document.getElementById(arguments[0]).innerText", name))

    def seen(self, name: str) -> bool:
        """Whether the element takes room on the page."""
        code = "return document.getElementById(arguments[0]).checkVisibility()"
        return bool(self.script(code, name))

    def script(self, code: str, *arguments: object) -> Any:
        """What JavaScript returns in the page."""
        return self.here().execute_script(code, *arguments)

    def click(self, name: str) -> None:
        """A press of the mouse."""
        self.element(name).click()

    def press(self, keys: str) -> None:
        """Keys to whatever has the focus."""
        from selenium.webdriver import ActionChains

        ActionChains(self.here()).send_keys(keys).perform()

    def focused(self) -> str:
        """Id or text of what has the focus."""
        code = "const e = document.activeElement; return e.id || e.innerText || e.tagName"
        return str(self.script(code))

    def attribute(self, name: str, attribute: str) -> str:
        """An attribute of an element; empty where there is none."""
        return self.element(name).get_attribute(attribute) or ""

    def looks_old(self, name: str) -> bool:
        """Whether a value is shown as one that is not live."""
        return "old" in self.attribute(name, "class").split()

    def wait(self, until: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
        """Until something is true; fails with `what` was awaited."""
        end = time.monotonic() + deadline_s
        while not until():
            if time.monotonic() > end:
                raise AssertionError(f"not within {deadline_s:g} s: {what}\n{self.text_of_all()}")
            time.sleep(0.03)

    def wait_for(self, name: str, words: str) -> None:
        """Until an element shows the words."""
        self.wait(lambda: words in self.text(name), f"{words!r} in #{name}")

    def text_of_all(self) -> str:
        """For messages of failed tests."""
        return str(self.script("return document.body.innerText"))[:2000]

    def errors(self) -> list[str]:
        """What scripts complain of; that a request failed is the test's own doing."""
        everything = self.here().get_log("browser")  # type: ignore[no-untyped-call]
        log = [e for e in everything if e["level"] == "SEVERE"]
        return [e["message"] for e in log if "Failed to load resource" not in e["message"]]
