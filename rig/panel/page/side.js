/** Where the run stands, how the devices are, and how much is left until a limit. */

import { byId, make, makeSvg, onChange, setText } from "./dom.js";
import { isNumber, number, short, vector } from "./format.js";

const NEAR = 0.2; // of the limit left: shown as near
const LATE_MS = 100;
const UNITS = { "deg C": "°C", deg: "°" };
// Shape says what colour says.
const LAMPS = {
  ok: ["ready", "M1 8a7 7 0 1 0 14 0a7 7 0 1 0-14 0zm2.7 .4l1.5-1.5 2.2 2.2 4-4.4 1.5 1.4-5.5 6z"],
  warn: ["attention", "M8 1l7 13H1z"],
  fault: ["FAULT", "M1 3l2-2 5 5 5-5 2 2-5 5 5 5-2 2-5-5-5 5-2-2 5-5z"],
  off: ["off", "M3 8a5 5 0 1 0 10 0a5 5 0 1 0-10 0zm2 0a3 3 0 1 1 6 0a3 3 0 1 1-6 0z"],
};

const devices = onChange((list) => {
  byId("devices").replaceChildren(...list.map(device));
});

function device({ name, state, reason, remedy }) {
  const [word, path] = LAMPS[state] ?? LAMPS.off;
  const item = make("li");
  const lamp = makeSvg("svg", { viewBox: "0 0 16 16", class: state, "aria-hidden": "true" });
  lamp.append(makeSvg("path", { d: path, fill: "currentColor", "fill-rule": "evenodd" }));
  item.append(lamp, make("span", "name", name), make("span", state === "ok" ? "spoken" : `state ${state}`, word));
  const why = [reason, remedy && `→ ${remedy}`].filter(Boolean);
  if (why.length) item.className = "said";
  item.append(...why.map((words) => make("span", "why", words)));
  return item;
}

const limits = onChange((list) => {
  byId("limits").replaceChildren(...list.map(limit));
});

function limit({ name, amount, fraction, action }) {
  const near = fraction !== null && fraction < NEAR;
  const item = make("li", near ? "near" : "");
  const [sign, then] = near ? ["▲ ", ` → ${action}`] : ["", ""];
  const track = make("div", "track");
  const left = make("div", "left");
  left.style.transform = `scaleX(${fraction ?? 0})`;
  track.append(left);
  item.append(make("span", "name", `${sign}${name}`), make("span", "amount", amount + then), track);
  return item;
}

/** The limits as they are shown, the nearest first; values are rounded so that noise is no news. */
export function shownLimits(list) {
  return list
    .map(({ name, value, limit: max, unit, left_fraction, action }) => ({
      name, action,
      amount: `${isNumber(value) ? short(max - value) : "–"} of ${short(max)} ${UNITS[unit] ?? unit}`,
      fraction: isNumber(left_fraction) ? Math.round(100 * Math.min(1, Math.max(0, left_fraction))) / 100 : null,
    }))
    .sort((a, b) => (a.fraction ?? 2) - (b.fraction ?? 2));
}

function slots({ missed, late_ms }) {
  const element = byId("slots");
  element.classList.toggle("late", missed > 0 || late_ms > LATE_MS);
  const words = missed > 0 ? `▲ ${missed} missed` : "none missed";
  // Before the first sample there is nothing to say.
  setText(element, isNumber(late_ms) ? `Samples: ${words}, ${number(late_ms, 0)} ms late` : "");
}

export function drawSide(state) {
  const run = state.run;
  setText(byId("title"), state.protocol || "Stiffness measurement");
  const place = [state.robot, run.pose && `pose ${run.pose}`, run.branch].filter(Boolean);
  setText(byId("place"), place.join(" · "));
  setText(byId("step"), run.step > 0 ? `${run.step} of ${run.steps}` : "–");
  setText(byId("repetition"), run.repetition > 0 ? `${run.repetition} of ${run.repetitions}` : "–");
  const along = vector(run.unit_vector);
  const named = run.direction && run.direction !== along.slice(1);
  setText(byId("direction"), named ? `${run.direction} ${along}` : along);
  devices(state.devices);
  limits(shownLimits(state.limits));
  slots(state.slots);
}
