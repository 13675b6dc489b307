"""Makes docs/pictures/panel.png: the operator's page in the third repetition of an emulated run.

    .venv/bin/python docs/build_panel.py
    .venv/bin/python docs/build_panel.py --all FOLDER

With --all, every scene of the browser tests in every size and both themes, to be looked at.
Needs Chromium, chromedriver and selenium.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.browser import scenes
from tests.browser.browser import chromium, missing, resize, theme
from tests.browser.feed import Feed
from tests.browser.viewer import Viewer

HOME = Path(__file__).resolve().parent.parent
PICTURE = HOME / "docs" / "pictures" / "panel.png"
SIZES = {"screen": (1920, 1080), "tablet": (1024, 768), "phone": (390, 844)}
SCENES = {
    "turning": scenes.turning(),
    "settling": scenes.settling(),
    "question": scenes.prompting(scenes.MOUNT),
    "paused": scenes.prompting(scenes.PAUSED),
    "fault": scenes.laser_failed(),
}
DEADLINE_S = 180.0


def from_a_run() -> None:
    """Waits for the third repetition along x, well above the middle of its steps."""
    with tempfile.TemporaryDirectory() as folder, chromium(1920, 1080) as driver:
        output = Path(folder) / "run.h5"
        words = ["measure", str(HOME / "protocols" / "paper_xy.yaml"), "--station", "emulated"]
        words += ["--speed", "10"]  # so that no slot is missed, with a browser beside it
        run = subprocess.Popen(
            [sys.executable, "-m", "rig", *words, "--panel", "-o", str(output)],
            cwd=HOME,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            page = Viewer(driver, _link(run))
            _answer_until(page, lambda: _is_worth_a_picture(page))
            driver.save_screenshot(str(PICTURE))
        finally:
            run.terminate()
            run.wait(30)


def _link(run: subprocess.Popen[str]) -> str:
    assert run.stdout is not None
    for line in run.stdout:
        if found := re.search(r"http://\S+\?token=\S+", line):
            return found.group()
    raise SystemExit("rig measure ended without a link")


def _answer_until(page: Viewer, until: Callable[[], bool]) -> None:
    end = time.monotonic() + DEADLINE_S
    while not until():
        if time.monotonic() > end:
            raise SystemExit(f"nothing worth a picture within {DEADLINE_S:g} s")
        page.script("document.querySelector('#prompt-choices .first')?.click()")
        time.sleep(0.05)


def _is_worth_a_picture(page: Viewer) -> bool:
    step = page.text("step").split(" of ")[0]
    third = page.text("repetition") == "3 of 3" and page.text("direction") == "+x"
    return third and step in ("8", "9", "10") and page.text("cue-word") == "Tighten"


def every_scene(folder: Path) -> None:
    """One file a scene, size and theme."""
    folder.mkdir(parents=True, exist_ok=True)
    run = [scenes.plan(), scenes.prediction(), *scenes.samples(165, up_to=0.6)]
    feed = Feed(scenes.turning(), run)
    with chromium() as driver:
        page = Viewer(driver, feed.url)
        for size, (width, height) in SIZES.items():
            resize(driver, width, height)
            for colours in ("light", "dark"):
                theme(driver, colours)
                for name, state in SCENES.items():
                    feed.state = state
                    page.wait(lambda s=state: page.seen("prompt") == bool(s.prompt), name)  # type: ignore[misc]
                    time.sleep(0.5)  # bars glide
                    driver.save_screenshot(str(folder / f"{size}-{name}-{colours}.png"))
    feed.close()


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--all", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    if reason := missing():
        sys.exit(reason)
    if args.all:
        every_scene(args.all)
    else:
        from_a_run()


if __name__ == "__main__":
    main()
