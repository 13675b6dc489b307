/** Displacement over force in this pose and direction: now, earlier repetitions, simulation. */

import { byId, make, onChange } from "./dom.js";
import { isNumber } from "./format.js";
import { Lane, Surface, extent, roundRange, strokeRows } from "./plot.js";

const LEAST_N = 10, LEAST_MM = 0.05;

const legend = onChange(({ now, earlier, model }) => {
  const items = now ? [make("li", "", `repetition ${now}`)] : [];
  if (earlier) items.push(make("li", "earlier", "earlier"));
  if (model) items.push(make("li", "model", "simulation"));
  byId("curve-legend").replaceChildren(...items);
});

export class CurvePlot {
  constructor() {
    this.surface = new Surface(byId("curve"));
    this.state = null;
    this.old = true;
  }

  /** Everything or only what is new; cheap when nothing is. */
  draw(store, state, old) {
    const { pose, direction, repetition } = state.run;
    const repetitions = store.repetitions(pose, direction);
    const model = store.predictions.get(`${pose}|${direction}`) ?? [];
    const range = this.#range(repetitions, model, state, old);
    const key = [this.surface.stamp, store.version, pose, direction, repetition, ...range.flat()].join();
    if (key !== this.key) this.#restart(key, range, model);
    this.#add(repetitions, repetition);
    this.surface.clear(this.surface.top);
    if (!old && isNumber(state.force.N) && isNumber(state.displacement.mm)) this.surface.dot(this.lane, state.force.N, state.displacement.mm, false);
    const earlier = [...repetitions.keys()].some((r) => r !== repetition);
    legend({ now: repetitions.has(repetition) ? repetition : 0, earlier, model: model.length > 0 });
    this.#describe(repetitions, direction, model);
  }

  #range(repetitions, model, state, old) {
    let [x0, x1, y0, y1] = [0, 0, 0, 0];
    const widen = (x, y) => {
      if (!isNumber(x) || !isNumber(y)) return;
      [x0, x1, y0, y1] = [Math.min(x0, x), Math.max(x1, x), Math.min(y0, y), Math.max(y1, y)];
    };
    for (const rows of repetitions.values()) {
      const [xs, ys] = [extent(rows.force_N, 0, rows.length), extent(rows.displacement_mm, 0, rows.length)];
      widen(xs[0], ys[0]);
      widen(xs[1], ys[1]);
    }
    for (const [force, displacement] of model) widen(force, displacement);
    if (!old) widen(state.force.N, state.displacement.mm);
    if (isNumber(state.force.target_N)) widen(state.force.target_N, 0);
    return [roundRange(x0, x1, LEAST_N), roundRange(y0, y1, LEAST_MM)];
  }

  #restart(key, range, model) {
    const { surface } = this;
    this.key = key;
    this.drawn = new Map();
    this.lane = new Lane(surface.boxes(1)[0], ...range);
    surface.clear(surface.base);
    surface.axes(this.lane, "Force in N", "Displacement in mm");
    const context = surface.base;
    context.strokeStyle = surface.colours.model;
    context.lineWidth = 3;
    context.setLineDash([10, 7]);
    strokeRows(context, this.lane, model.map((p) => p[0]), model.map((p) => p[1]), 0, model.length, false);
    context.setLineDash([]);
  }

  #add(repetitions, current) {
    const { surface, lane, drawn } = this;
    const others = [...repetitions.keys()].filter((r) => r !== current);
    for (const r of [...others, current]) {
      const rows = repetitions.get(r);
      const from = drawn.get(r) ?? 0;
      if (!rows || rows.length === from) continue;
      surface.base.strokeStyle = r === current ? surface.colours.now : surface.colours.earlier;
      surface.base.lineWidth = r === current ? 3.5 : 2;
      surface.base.lineJoin = "round";
      strokeRows(surface.base, lane, rows.force_N, rows.displacement_mm, from, rows.length, false);
      drawn.set(r, rows.length);
    }
  }

  #describe(repetitions, direction, model) {
    const counts = [...repetitions].map(([r, rows]) => `repetition ${r}: ${rows.samples} samples`);
    const simulated = model.length ? "; with the simulation's prediction" : "";
    const text = `Displacement over force along ${direction || "no direction"}: ${counts.join(", ") || "no samples yet"}${simulated}`;
    if (this.label !== text) byId("curve").setAttribute("aria-label", text);
    this.label = text;
  }
}
