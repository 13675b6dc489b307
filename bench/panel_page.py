"""How fast the operator's page draws: frames a second with a long run, and value to screen.

    .venv/bin/python bench/panel_page.py [--samples 10000] [--seconds 8]

Headless Chromium without a graphics card, 1920 x 1080. "as it runs": the run comes at once, then
states ten times a second and a sample each second; "all anew": besides, both plots draw the whole
run from its first sample in every frame. Value to screen counts from a value's change beside the
server (which looks ten times a second) to the frame after the page has written it.
"""

from __future__ import annotations

import argparse
import random
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.browser import scenes
from tests.browser.browser import chromium, missing
from tests.browser.feed import Feed
from tests.browser.viewer import Viewer

FRAMES = """
(async function () {
const [seconds, anew, samples, state, done] = arguments;
const at = [];
let draw = () => {};
if (anew) {
  const load = (name) => import(new URL(name, location.href));
  const [{ CurvePlot }, { TimePlot }, { Store }] = await Promise.all(
    ["curve.js", "timeline.js", "store.js"].map(load));
  const [store, curve, time] = [new Store(), new CurvePlot(), new TimePlot(() => {})];
  samples.forEach((item) => store.add(item));
  time.wholeRun = true;
  draw = () => {
    curve.key = time.key = null;
    curve.draw(store, state, false);
    time.draw(store, false);
  };
}
function frame(now) {
  at.push(now);
  draw();
  if (now - at[0] < 1000 * seconds) requestAnimationFrame(frame);
  else done(at);
}
requestAnimationFrame(frame);
}).apply(null, arguments);
"""
WATCH = """
window.delays = [];
new MutationObserver(() => {
  const tenths = Math.round(10 * parseFloat(document.getElementById("force-number").textContent));
  requestAnimationFrame(() => window.delays.push((Date.now() % 100000 - tenths + 100000) % 100000));
}).observe(document.getElementById("force-number"),
  {childList: true, characterData: true, subtree: true});
"""


def frames(page: Viewer, feed: Feed, seconds: float, *, anew: bool) -> str:
    """Frames a second: mean, and of the slowest hundredth of the frames."""
    samples = [item for item in feed.items if "sample" in item] if anew else []
    page.here().set_script_timeout(seconds + 30)
    at = page.here().execute_async_script(FRAMES, seconds, anew, samples, feed.message(0, "bench"))
    spans = np.diff(at) / 1000
    return (
        f"{1 / spans.mean():5.1f} frames/s, slowest 1 % below {1 / np.quantile(spans, 0.99):5.1f}"
    )


def delays(page: Viewer, feed: Feed, count: int = 60) -> str:
    """Value to screen in ms. The force shown is the time of day: 0.1 N for each ms."""
    page.script(WATCH)
    for _ in range(count):
        now = feed.state.force
        feed.show(force=replace(now, N=(1000 * time.time()) % 100_000 / 10))
        time.sleep(random.uniform(0.2, 0.3))
    found = np.array(page.script("return window.delays"), float)
    middle, most = np.median(found), np.quantile(found, 0.95)
    return f"median {middle:.0f} ms, 95 % {most:.0f} ms, largest {found.max():.0f} ms"


def live(feed: Feed, stop: threading.Event) -> None:
    """Values that move, and a sample each second."""
    last = cast("dict[str, Any]", feed.items[-1]["sample"])
    tick = 0
    while not stop.wait(0.1):
        tick += 1
        force = 120 + 20 * np.sin(tick / 10)
        feed.show(force=replace(feed.state.force, N=float(force)))
        if tick % 10 == 0:
            sample = {**last, "row": last["row"] + tick, "session_s": last["session_s"] + tick}
            feed.items.append({"sample": sample})


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--seconds", type=float, default=8.0)
    args = parser.parse_args()
    if reason := missing():
        sys.exit(reason)
    run = [scenes.plan(), scenes.prediction(), *scenes.samples(args.samples)]
    feed, stop = Feed(scenes.turning(), run), threading.Event()
    with chromium() as driver:
        page = Viewer(driver, feed.url)
        page.click("span-run")
        wanted = f"{len(run) - 2} samples"
        page.wait(lambda: wanted in page.attribute("time", "aria-label"), wanted)
        print(f"value to screen   {delays(page, feed)}")
        mover = threading.Thread(target=live, args=(feed, stop), daemon=True)
        mover.start()
        print(f"{wanted}, as it runs  {frames(page, feed, args.seconds, anew=False)}")
        print(f"{wanted}, all anew    {frames(page, feed, args.seconds, anew=True)}")
        stop.set()
        mover.join()
    feed.close()


if __name__ == "__main__":
    main()
