/** Buttons and questions: what the operator can say, and who is the operator. */

import { byId, make, onChange, setHidden, setText } from "./dom.js";

const CONFIRM_S = 15; // an unanswered "abort?" must not wait for a stray key
const LONG = 150; // characters; longer questions are set smaller
const OVER = ["done", "aborted", "fault"];

/** A word for this page that outlives a reload, so that the server knows who comes back. */
function clientWord() {
  const kept = sessionStorage.getItem("panel-client");
  if (kept) return kept;
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  const word = Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");
  sessionStorage.setItem("panel-client", word);
  return word;
}

export class Link {
  constructor(address = new URL(location.href)) {
    this.token = address.searchParams.get("token") ?? "";
    this.client = clientWord();
  }

  /** Address of the stream that goes on after the id `last`; from the start if that is "". */
  events(last) {
    return `events?${new URLSearchParams({ token: this.token, client: this.client, last })}`;
  }

  /** Sends a command; returns "" or why it was refused, in words. */
  async send(command, extra = {}) {
    const headers = {
      "Content-Type": "application/json",
      "X-Panel-Token": this.token,
      "X-Panel-Client": this.client,
    };
    try {
      const body = JSON.stringify({ command, ...extra });
      const signal = AbortSignal.timeout(5000);
      const reply = await fetch("command", { method: "POST", headers, body, signal });
      const said = await reply.json();
      return said.ok ? "" : said.error || `refused (${reply.status})`;
    } catch {
      return `"${command}" did not reach the measurement: no connection. Ctrl-C in the terminal interrupts it.`;
    }
  }
}

export class Controls {
  constructor(send, say) {
    this.send = send;
    this.say = say;
    this.state = null;
    this.answered = null;
    this.showPrompt = onChange((prompt) => this.#prompt(prompt));
    byId("pause").addEventListener("click", () => this.pause());
    byId("redo").addEventListener("click", () => this.command("redo"));
    byId("abort").addEventListener("click", () => this.askAbort());
    byId("confirm-yes").addEventListener("click", () => { this.endAbort(); this.command("abort"); });
    byId("confirm-no").addEventListener("click", () => this.endAbort());
    byId("take").addEventListener("click", () => this.command("take_over"));
    byId("prompt").addEventListener("submit", (event) => {
      event.preventDefault();
      const field = byId("prompt-choices").querySelector("input");
      if (field) this.answer(field.value.trim());
    });
  }

  get mine() {
    return Boolean(this.state?.operator?.you);
  }

  /** `live`: whether the measurement still goes on and is heard. */
  draw(state, live) {
    this.state = state;
    const over = OVER.includes(state.phase);
    const watching = !this.mine;
    document.body.classList.toggle("asking", Boolean(state.prompt) && !over);
    this.showPrompt(over ? null : { prompt: state.prompt, mine: this.mine });
    setHidden(byId("viewer"), !watching || over);
    if (watching) this.#viewer(state.operator);
    if (watching || over) this.endAbort();
    setHidden(byId("controls"), watching || over || !byId("confirm").hidden);
    const paused = state.prompt?.kind === "paused";
    setText(byId("pause-word"), paused ? "Go on" : "Pause");
    setText(byId("pause-sign"), paused ? "▶" : "❚❚");
    const allowed = { pause: paused || !state.prompt, redo: this.#can("redo_step"), abort: true };
    for (const [id, yes] of Object.entries(allowed)) byId(id).disabled = !(live && yes);
    byId("confirm-yes").disabled = !live;
  }

  pause() {
    this.command(this.state?.prompt?.kind === "paused" ? "resume" : "pause");
  }

  command(name) {
    return this.#send(name);
  }

  /** Once per question, unless it is refused: a double click is no second answer. */
  async answer(key) {
    const prompt = this.state?.prompt;
    if (!prompt || !key || this.answered === prompt.id) return;
    this.answered = prompt.id;
    if (!(await this.#send("answer", { prompt_id: prompt.id, key }))) this.answered = null;
  }

  /** The n-th answer of the question, counted from 1, as on the buttons. */
  choose(n) {
    const choice = this.state?.prompt?.choices[n - 1];
    if (choice && this.mine) this.answer(choice.key);
  }

  askAbort() {
    if (byId("abort").disabled || byId("controls").hidden) return;
    setHidden(byId("controls"), true);
    setHidden(byId("confirm"), false);
    byId("confirm-yes").focus();
    this.timer = setTimeout(() => this.endAbort(), 1000 * CONFIRM_S);
  }

  endAbort() {
    clearTimeout(this.timer);
    if (byId("confirm").hidden) return;
    setHidden(byId("confirm"), true);
    setHidden(byId("controls"), false);
    byId("abort").focus();
  }

  // Redoing in a question is one of its answers; without one the runner hears the command.
  #can(key) {
    const prompt = this.state.prompt;
    return !prompt ? this.state.run.step > 0 : prompt.choices.some((choice) => choice.key === key);
  }

  async #send(command, extra = {}) {
    const refused = await this.send(command, extra);
    if (refused) this.say(refused);
    return !refused;
  }

  #viewer(operator) {
    const words = operator?.taken ? "You are watching; somebody else is the operator." : "You are watching; nobody is the operator.";
    setText(byId("viewer-text"), words);
    setHidden(byId("take"), !operator?.may_take);
  }

  #prompt(shown) {
    const prompt = shown?.prompt;
    const form = byId("prompt");
    const hadFocus = form.contains(document.activeElement);
    setHidden(form, !prompt);
    if (!prompt) {
      byId("prompt-choices").replaceChildren();
      return;
    }
    setText(byId("prompt-text"), prompt.text);
    byId("prompt-text").classList.toggle("long", prompt.text.length > LONG);
    const parts = prompt.choices.length ? prompt.choices.map((c, i) => this.#choice(c, i)) : this.#field();
    byId("prompt-choices").replaceChildren(...(shown.mine ? parts : []));
    // A question goes to who is not just doing something else on the page.
    if (hadFocus || document.activeElement === document.body) byId("prompt-text").focus();
  }

  #choice(choice, index) {
    const button = make("button", index === 0 ? "choice first" : "choice");
    button.type = "button";
    button.append(make("span", "", choice.label), make("kbd", "", String(index + 1)));
    button.addEventListener("click", () => this.answer(choice.key));
    return button;
  }

  #field() {
    const field = make("input");
    field.setAttribute("aria-labelledby", "prompt-text");
    field.maxLength = 500;
    const button = make("button", "choice first", "Send");
    button.type = "submit";
    return [field, button];
  }
}
