/** What to do now: one word, one sign, how far, and how long. */

import { byId, setHidden, setText } from "./dom.js";
import { isNumber, number } from "./format.js";

// An arc with an arrow head: which way the screw's head turns, seen by who turns it.
const CLOCKWISE = "M-36.4 -21A42 42 0 1 1 -7.3 41.4L-9 51.2 -27.2 21.2 -3 16.7 -4.7 26.6A27 27 0 1 0 -23.4 -13.5z";
const SIGNS = {
  in: CLOCKWISE,
  out: CLOCKWISE,
  hold: "M-38 2l12-12 16 16 32-32 12 12-44 44z",
  done: "M-38 2l12-12 16 16 32-32 12 12-44 44z",
  hands: "M-32-32h24v64h-24zM8-32h24v64h-24z",
  stop: "M-16-38h32l22 22v32l-22 22h-32l-22-22v-32z",
  ask: "M-6 18h12v12h-12zM-6 10V-2Q-6-8 2-12 10-17 8-22 5-28-2-28-10-27-12-16L-24-18Q-20-38 0-39 20-38 21-22 20-9 8-3 6-1 6 10z",
};

const WAITING = {
  starting: ["hands", "Wait", "devices are being opened"],
  settling: ["hands", "Hands off", "the arm settles"],
  sampling: ["hands", "Hands off", "sampling"],
  zero: ["hands", "Hands off", "force and laser are zeroed"],
  rest: ["hands", "Rest", "the next repetition follows"],
  paused: ["hands", "Paused", "the arm may be under load"],
  done: ["done", "Done", "all runs are measured"],
  aborted: ["stop", "Stopped", "turn the screw back until it no longer touches the arm"],
  fault: ["stop", "Stop", "a device has failed; turn the screw back"],
};

/** [sign, word, how far] for a state; `old`: its values can't be trusted any more. */
export function cueOf(state, old) {
  if (["done", "aborted", "fault"].includes(state.phase)) return WAITING[state.phase];
  if (old) return ["stop", "Stop turning", "the values are old"];
  const failed = state.devices.find((device) => device.state === "fault");
  if (failed) return ["stop", "Stop turning", `${failed.name} has failed`];
  // A way to turn stands beside a question only where there is a force to watch.
  if (state.prompt && !(state.turn && isNumber(state.force.N))) return ["ask", "Answer", "the question below"];
  if (["prompt", "turning"].includes(state.phase)) {
    if (!isNumber(state.force.N)) return ["hands", "Wait", "no force yet"];
    return state.force.stale || !state.turn ? ["stop", "Stop turning", "the force is old"] : turnCue(state);
  }
  const [sign, word, far] = WAITING[state.phase] ?? ["hands", "Wait", ""];
  const { taken, wanted } = state.samples;
  const counted = ["sampling", "zero"].includes(state.phase) && wanted > 0;
  return [sign, word, counted ? `${far}, ${taken} of ${wanted}` : far];
}

function turnCue({ turn, prompt }) {
  if (turn.sense === "hold") return ["hold", "Hold", "in the band"];
  const word = turn.sense === "in" ? "Tighten" : "Loosen";
  if (prompt?.kind === "unload") return [turn.sense, word, "until the force no longer answers"];
  return [turn.sense, word, howFar(turn)];
}

function howFar(turn) {
  const parts = [];
  if (isNumber(turn.turns)) parts.push(turns(Math.abs(turn.turns)));
  if (isNumber(turn.remaining_N)) parts.push(`${number(Math.abs(turn.remaining_N), 1)} N to go`);
  return parts.join("\n");
}

/** Turns of a hand are judged by eye: degrees below half a turn. */
export function turns(count) {
  if (count < 0.5) return `about ${Math.max(1, Math.round(count * 360))}°`;
  return `about ${number(count, 1)} turns`;
}

export function drawCue(state, old) {
  const [sign, word, far] = cueOf(state, old);
  const cue = byId("cue");
  if (cue.dataset.cue !== sign) {
    cue.dataset.cue = sign;
    byId("cue-path").setAttribute("d", SIGNS[sign]);
    byId("cue-path").setAttribute("transform", sign === "out" ? "scale(-1 1)" : "");
  }
  // A question speaks for itself, below; only a way to turn stands beside it.
  setHidden(cue, sign === "ask");
  setText(byId("cue-word"), word);
  setText(byId("cue-far"), far);
  drawCountdown(state, old);
}

function drawCountdown(state, old) {
  const settle = state.settle;
  const left = settle ? settle.left_s : state.countdown_s;
  const shown = isNumber(left) && !old;
  setHidden(byId("countdown"), !shown);
  if (!shown) return;
  const whole = settle && settle.of_s > 0 ? settle.of_s : null;
  setHidden(byId("countdown-bar"), whole === null);
  if (whole) byId("countdown-fill").style.transform = `scaleX(${1 - Math.min(1, Math.max(0, left / whole))})`;
  const reason = settle?.reason ? `: ${settle.reason}` : "";
  const text = left > 0 || !settle ? `${number(Math.max(0, left), 0)} s left${reason}` : `not at rest yet${reason}`;
  setText(byId("countdown-text"), text);
}
