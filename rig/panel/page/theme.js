/** Light or dark: as the system has it until the button says otherwise. */

import { byId, setText } from "./dom.js";

const KEPT = "panel-theme";

export class Theme {
  constructor(onSwitch) {
    this.onSwitch = onSwitch;
    const system = matchMedia("(prefers-color-scheme: dark)");
    const wanted = () => localStorage.getItem(KEPT) ?? (system.matches ? "dark" : "light");
    system.addEventListener("change", () => this.#show(wanted()));
    byId("theme").addEventListener("click", () => this.toggle());
    this.#show(wanted());
  }

  toggle() {
    const other = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    localStorage.setItem(KEPT, other);
    this.#show(other);
  }

  #show(name) {
    document.documentElement.dataset.theme = name;
    setText(byId("theme"), name === "dark" ? "Light" : "Dark");
    this.onSwitch();
  }
}

/** To the full screen and back; browsers that refuse it (phones) stay as they are. */
export function toggleFullScreen() {
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen?.().catch(() => {});
}
