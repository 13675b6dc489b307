/** Bands across the page: emulated run, failed devices, old values, messages. */

import { byId, make, onChange, setHidden, setText } from "./dom.js";
import { age, clock } from "./format.js";

const SAID_S = 12;

const draw = onChange((list) => {
  byId("alarms").replaceChildren(...list.map(({ kind, text, remedy }) => {
    const band = make("p", `band ${kind}`, text);
    if (remedy) band.append(make("span", "remedy", remedy));
    return band;
  }));
});

export class Bands {
  constructor() {
    this.said = "";
    this.saidUntil = 0;
  }

  /** A line for the operator that goes away by itself. */
  say(text) {
    this.said = text;
    this.saidUntil = performance.now() + 1000 * SAID_S;
  }

  draw(state, connection) {
    const emulated = state?.emulated ? state.banner || "EMULATED: no real arm, no real measurement" : "";
    setHidden(byId("emulated"), !emulated);
    setText(byId("emulated"), emulated);
    const list = [...connectionBand(connection, state), ...deviceBands(state)];
    if (state?.message && !connection.end) list.push({ kind: "warn", text: state.message });
    if (this.said && performance.now() < this.saidUntil) list.push({ kind: "warn", text: this.said });
    draw(list);
  }
}

function deviceBands(state) {
  return (state?.devices ?? [])
    .filter((device) => device.state === "fault")
    .map(({ name, reason, remedy }) => ({ kind: "fault", text: `✖ ${name}: ${reason}`, remedy }));
}

/** `connection`: {connected, away, old, last (Date or null), end ({text} or null)}. */
function connectionBand({ connected, away, old, last, age_s, end }, state) {
  if (end) return [{ kind: "warn", text: `■ ${endWords(end, state)}. The values are from ${at(last)}.` }];
  if (!old) return [];
  if (last === null) return [{ kind: "warn", text: connected ? "Waiting for the first values." : "No connection to the measurement yet; trying again." }];
  if (away) return [{ kind: "warn", text: `Catching up: the values are from ${at(last)}.` }];
  const what = connected ? "No values arrive" : "Connection lost";
  const seconds = age(Math.floor(age_s) || 0).replace(".0", "");
  return [{ kind: "fault", text: `⚠ ${what}: the values are from ${at(last)}, ${seconds} ago`, remedy: "Stop turning. The page goes on by itself when values arrive; the terminal shows the same." }];
}

// A failed device has a band of its own that says why.
function endWords(end, state) {
  const told = deviceBands(state).length > 0;
  return told ? "The measurement has ended" : end.text.replace(/\.$/, "");
}

const at = (date) => (date ? clock(date) : "earlier");
