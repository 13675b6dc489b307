"""The page's own arithmetic, called in the browser module by module."""

from __future__ import annotations

from typing import Any

import pytest

from tests.browser.viewer import Viewer

pytestmark = pytest.mark.browser


def value(page: Viewer, module: str, expression: str) -> Any:
    """Of a JavaScript expression, the module's exports in `m`."""
    code = (
        "const done = arguments[arguments.length - 1];"
        f"import(new URL('{module}', location.href)).then((m) => done({expression}));"
    )
    return page.here().execute_async_script(code)


def test_gauge_shows_the_whole_way_then_the_surroundings_of_the_band(page: Viewer) -> None:
    def gauge(*arguments: str) -> Any:
        return value(page, "readout.js", f"m.gaugeRange({', '.join(arguments)})")

    assert gauge("100", "140", "1.4", "false") == {"from": 0, "to": 175, "fine": False}
    near = gauge("139", "140", "1.4", "false")
    assert near["fine"]
    assert (near["from"], near["to"]) == pytest.approx((128.8, 151.2))
    assert not gauge("130", "140", "1.4", "false")["fine"]
    assert gauge("130", "140", "1.4", "true")["fine"], "no flicker between the two"
    pull = gauge("-100", "-140", "1.4", "false")
    assert (pull["from"], pull["to"]) == (0, -175)


def test_axes_have_round_ticks_and_noise_about_zero_opens_no_step(page: Viewer) -> None:
    assert value(page, "plot.js", "m.ticks(0, 250, 5)") == [0, 50, 100, 150, 200, 250]
    assert value(page, "plot.js", "m.roundRange(-0.3, 219, 10)") == [0, 250]
    assert value(page, "plot.js", "m.roundRange(-30, 219, 10)") == [-50, 250]
    assert value(page, "plot.js", "m.roundRange(5, 5, 10)") == [0, 10]
    assert value(page, "plot.js", "m.roundRange(Infinity, -Infinity, 10)") == [0, 10]


def test_long_lines_are_thinned_to_the_pixels_without_losing_a_peak(page: Viewer) -> None:
    thinned = """(() => {
      const [xs, ys] = [new Float64Array(20000), new Float64Array(20000)];
      for (let i = 0; i < xs.length; i += 1) { xs[i] = i; ys[i] = Math.sin(i); }
      ys[12345] = 50;
      const lane = new m.Lane({left: 0, top: 0, width: 200, height: 100}, [0, 20000], [-50, 50]);
      const drawn = [];
      const context = {beginPath() {}, stroke() {}, moveTo(x, y) { drawn.push(y); },
        lineTo(x, y) { drawn.push(y); }};
      const count = m.strokeRows(context, lane, xs, ys, 0, xs.length, true);
      return [count, Math.min(...drawn)];
    })()"""
    count, highest = value(page, "plot.js", thinned)
    assert count <= 4 * 201
    assert highest == 0


def test_age_counts_from_the_servers_clock(page: Viewer) -> None:
    ages = """(() => {
      let now = 100;
      const f = new m.Freshness(() => now);
      const ages = [f.age() === Infinity];
      f.arrived(7); ages.push(f.age());
      now = 101; f.arrived(8); ages.push(f.age());
      now = 105; ages.push(f.age());
      f.arrived(9); ages.push(f.age());     // made three seconds ago, held up on the way
      f.renew(); f.arrived(9.1); ages.push(f.age());
      return ages;
    })()"""
    first, *rest = value(page, "feed.js", ages)
    assert first
    assert rest == pytest.approx([0, 0, 4, 3, 0], abs=0.002)


def test_line_is_broken_where_the_screw_was_turned_back(page: Viewer) -> None:
    rows = """(() => {
      const c = new m.Curve();
      for (const [f, b] of [[0, "zero"], [20, "loading"], [40, "loading"], [0, "zero"]]) {
        c.add(f, f / 100, b);
      }
      return [c.samples, Array.from(c.force_N.subarray(0, c.length), String)];
    })()"""
    assert value(page, "store.js", rows) == [4, ["0", "20", "40", "NaN", "0"]]


def test_numbers_for_people(page: Viewer) -> None:
    def text(expression: str) -> Any:
        return value(page, "format.js", f"m.{expression}")

    assert text("number(-0.04, 1)") == "0.0"
    assert text("number(-12.34, 1)") == "−12.3"
    assert text("number(null, 1)") == "–"
    assert text("short(240)") == "240"
    assert text("short(7.783)") == "7.78"
    assert text("short(0.0512)") == "0.051"
    assert text("age(3.24)") == "3.2 s"
    assert text("age(600)") == "10 min"
    assert text("vector([0, -1, 0])") == "−y"
    assert text("vector([0.6, 0.8, 0])") == "(0.60, 0.80, 0.00)"
    assert value(page, "cue.js", "m.turns(0.25)") == "about 90°"
    assert value(page, "cue.js", "m.turns(1.26)") == "about 1.3 turns"
