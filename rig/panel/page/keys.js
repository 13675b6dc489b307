/** Single keys; they can be switched off, and never act while text is being typed. */

import { byId, make } from "./dom.js";

const LIST = [
  ["P", "pause, go on"],
  ["R", "redo the step"],
  ["A", "abort; asks once more: Enter aborts, Esc goes on"],
  ["1 … 9", "answer a question"],
  ["T", "light or dark"],
  ["F", "full screen"],
  ["W", "two minutes or the whole run"],
  ["?", "this list"],
  ["Tab, Enter", "reach and press every button"],
];

export class Keys {
  constructor(controls, display) {
    this.actions = {
      p: () => byId("pause").click(),
      r: () => byId("redo").click(),
      a: () => controls.askAbort(),
      t: display.theme,
      f: display.full,
      w: () => byId(byId("span-run").getAttribute("aria-pressed") === "true" ? "span-live" : "span-run").click(),
      "?": () => this.help(),
    };
    this.controls = controls;
    byId("help-keys").append(...LIST.flatMap(([key, what]) => {
      const term = make("dt");
      term.append(make("kbd", "", key));
      return [term, make("dd", "", what)];
    }));
    byId("keys").addEventListener("click", () => this.help());
    byId("help-close").addEventListener("click", () => byId("help").close());
    document.addEventListener("keydown", (event) => this.#press(event));
  }

  help() {
    if (!byId("help").open) byId("help").showModal();
  }

  #press(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    if (event.key === "Escape") this.controls.endAbort();
    if (event.target instanceof HTMLInputElement || byId("help").open) return;
    if (!byId("single-keys").checked || !byId("confirm").hidden) return;
    const action = this.actions[event.key.toLowerCase()];
    if (action) {
      event.preventDefault();
      action();
    } else if (/^[1-9]$/.test(event.key)) {
      this.controls.choose(Number(event.key));
    }
  }
}
