/** Force and displacement against time: the last two minutes live, or the whole run as recorded. */

import { byId } from "./dom.js";
import { Lane, Surface, extent, roundRange, strokeRows } from "./plot.js";

const WINDOW_S = 120;
const LANES = [
  { column: "force_N", name: "Force in N", least: 1 },
  { column: "displacement_mm", name: "Displacement in mm", least: 0.01 },
];

export class TimePlot {
  constructor(onSwitch) {
    this.surface = new Surface(byId("time"));
    this.wholeRun = false;
    byId("span-live").addEventListener("click", () => { this.#show(false); onSwitch(); });
    byId("span-run").addEventListener("click", () => { this.#show(true); onSwitch(); });
  }

  #show(wholeRun) {
    this.wholeRun = wholeRun;
    byId("span-live").setAttribute("aria-pressed", String(!wholeRun));
    byId("span-run").setAttribute("aria-pressed", String(wholeRun));
  }

  draw(store, old) {
    if (this.wholeRun) this.#drawRun(store, old);
    else this.#drawLive(store.live, old);
  }

  // The window moves with every state, so all of it is drawn anew; it holds 1200 rows at most.
  #drawLive(live, old) {
    const end = live.length ? live.t_s[live.length - 1] : 0;
    let first = live.length;
    while (first > 0 && live.t_s[first - 1] >= end - WINDOW_S) first -= 1;
    const shifted = { ...pick(live), t_s: live.t_s.subarray(0, live.length).map((t) => t - end) };
    this.key = null;
    const lanes = this.#axes(shifted, first, live.length, [-WINDOW_S, 0], "Time in s, now at the right");
    this.#lines(lanes, shifted, first, live.length, old);
    this.#describe(`the last two minutes, ${live.length - first} values`);
  }

  #drawRun(store, old) {
    const run = store.run;
    const times = run.length ? [run.t_s[0], run.t_s[run.length - 1]] : [0, 0];
    const range = roundRange(...times, 60);
    const spans = LANES.map(({ column, least }) => roundRange(...extent(run[column], 0, run.length), least));
    const key = [this.surface.stamp, store.version, ...range, ...spans.flat()].join();
    if (key !== this.key) {
      this.lanes = this.#axes(pick(run), 0, run.length, range, "Time of the session in s");
      this.key = key;
      this.drawn = 0;
    }
    this.#lines(this.lanes, pick(run), this.drawn, run.length, old);
    this.drawn = run.length;
    this.#describe(`the whole run, ${run.length} samples`);
  }

  #axes(rows, from, to, xRange, xName) {
    const { surface } = this;
    surface.clear(surface.base);
    const boxes = surface.boxes(LANES.length);
    return LANES.map(({ column, name, least }, i) => {
      const lane = new Lane(boxes[i], xRange, roundRange(...extent(rows[column], from, to), least));
      surface.axes(lane, i === LANES.length - 1 ? xName : "", name);
      return lane;
    });
  }

  #lines(lanes, rows, from, to, old) {
    const { surface } = this;
    surface.clear(surface.top);
    lanes.forEach((lane, i) => {
      const ys = rows[LANES[i].column];
      surface.base.strokeStyle = surface.colours.now;
      surface.base.lineWidth = 2.5;
      surface.base.lineJoin = "round";
      strokeRows(surface.base, lane, rows.t_s, ys, from, to, true);
      if (to > 0) surface.dot(lane, rows.t_s[to - 1], ys[to - 1], old);
    });
  }

  #describe(what) {
    const text = `Force and displacement against time: ${what}`;
    if (this.label !== text) byId("time").setAttribute("aria-label", text);
    this.label = text;
  }
}

function pick({ t_s, force_N, displacement_mm }) {
  return { t_s, force_N, displacement_mm };
}
