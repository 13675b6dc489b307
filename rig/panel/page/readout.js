/** The numbers: force with its gauge, and displacement. */

import { byId, setHidden, setText } from "./dom.js";
import { age, isNumber, number, short } from "./format.js";

// Near the target the gauge shows only its surroundings, or the band is a hair's breadth.
const FINE_IN = 6, FINE_OUT = 8;

/** Range of the gauge in N, from left to right; `fine` is what the last call returned. */
export function gaugeRange(force_N, target_N, band_N, wasFine) {
  const target = isNumber(target_N) ? target_N : 0;
  const sense = target < 0 ? -1 : 1;
  const band = isNumber(band_N) && band_N > 0 ? band_N : 0;
  const away = isNumber(force_N) ? Math.abs(force_N - target) : Infinity;
  const fine = target !== 0 && band > 0 && away < (wasFine ? FINE_OUT : FINE_IN) * band;
  if (fine) return { from: target - sense * FINE_OUT * band, to: target + sense * FINE_OUT * band, fine };
  const top = Math.max(1.25 * Math.abs(target), 4 * band, 10);
  return { from: 0, to: sense * top, fine };
}

export class Readout {
  #fine = false;

  /** `old`: the whole picture is no longer live; `old_s`: how long. */
  draw(state, old, old_s) {
    const { force, displacement } = state;
    const forceOld = old || force.stale;
    const text = number(force.N, 1);
    setText(byId("force-number"), text);
    byId("force").classList.toggle("long", text.length > 5);
    byId("force").classList.toggle("old", forceOld);
    this.#age(byId("force-age"), forceOld && isNumber(force.N), force.age_s, old_s);
    setText(byId("target"), this.#target(force));
    setText(byId("displacement-number"), number(displacement.mm, 3));
    const displacementOld = old || displacement.stale;
    byId("displacement").classList.toggle("old", displacementOld);
    this.#age(byId("displacement-age"), displacementOld && isNumber(displacement.mm), displacement.age_s, old_s);
    byId("force-card").classList.toggle("stale", forceOld);
    this.#gauge(force, forceOld);
  }

  #age(element, isOld, age_s, old_s) {
    setHidden(element, !isOld);
    if (isOld) setText(element, `${age((age_s ?? 0) + old_s)} old`);
  }

  #target(force) {
    if (!isNumber(force.target_N)) return "no target";
    const band = isNumber(force.band_N) && force.band_N > 0 ? ` ± ${number(force.band_N, 1)}` : "";
    return `target ${number(force.target_N, 1)}${band} N`;
  }

  #gauge(force, old) {
    const range = gaugeRange(force.N, force.target_N, force.band_N, this.#fine);
    this.#fine = range.fine;
    const at = (value) => Math.min(1, Math.max(0, (value - range.from) / (range.to - range.from)));
    const here = isNumber(force.N) ? at(force.N) : 0;
    byId("gauge-mark").style.transform = `translateX(${100 * here}%)`;
    byId("gauge-fill").style.transform = `scaleX(${here})`;
    this.#band(force, at);
    setText(byId("gauge-low"), `${short(range.from)} N`);
    setText(byId("gauge-high"), `${short(range.to)} N`);
    setText(byId("gauge-word"), this.#word(force, range, old));
    byId("gauge").setAttribute("aria-label", `Force ${number(force.N, 1)} N, ${this.#target(force)}`);
  }

  #band(force, at) {
    const known = isNumber(force.target_N);
    const band = byId("gauge-band");
    setHidden(byId("gauge-target"), !known);
    setHidden(band, !(known && force.band_N > 0));
    if (!known) return;
    byId("gauge-target").style.transform = `translateX(${100 * at(force.target_N)}%)`;
    const edges = [at(force.target_N - force.band_N), at(force.target_N + force.band_N)].sort((a, b) => a - b);
    band.style.left = `${100 * edges[0]}%`;
    band.style.width = `${100 * (edges[1] - edges[0])}%`;
  }

  #word(force, range, old) {
    if (!isNumber(force.N)) return "no force yet";
    if (old) return "the value is old";
    const zoom = range.fine ? "close-up · " : "";
    if (!isNumber(force.target_N) || !(force.band_N > 0)) return "";
    const off = force.N - force.target_N;
    if (Math.abs(off) <= force.band_N) return `${zoom}● in the band`;
    // Below and above are meant along the load: −20 N is above a target of −10 N.
    const above = off * (force.target_N < 0 ? -1 : 1) > 0;
    return `${zoom}${above ? "▲ above" : "▼ below"} the band`;
  }
}
