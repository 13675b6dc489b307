/** The operator's page: puts the parts together and draws at the screen's pace. */

import { drawArm } from "./arm.js";
import { Bands } from "./bands.js";
import { Controls, Link } from "./controls.js";
import { drawCue } from "./cue.js";
import { CurvePlot } from "./curve.js";
import { byId, setText } from "./dom.js";
import { Feed, STALE_S } from "./feed.js";
import { Keys } from "./keys.js";
import { Readout } from "./readout.js";
import { drawSide } from "./side.js";
import { Store } from "./store.js";
import { Theme, toggleFullScreen } from "./theme.js";
import { TimePlot } from "./timeline.js";

const CHECK_MS = 200; // ages grow also when nothing arrives

class Page {
  constructor() {
    this.store = new Store();
    this.state = null;
    this.last = null; // Date of the newest state
    this.end = null;
    this.wanted = false;
    this.bands = new Bands();
    this.readout = new Readout();
    this.curve = new CurvePlot();
    this.time = new TimePlot(() => this.want());
    const theme = new Theme(() => this.restyle());
    const link = new Link();
    const send = (...words) => this.feed.giveWayTo(link.send(...words));
    this.controls = new Controls(send, (text) => { this.bands.say(text); this.want(); });
    new Keys(this.controls, { theme: () => theme.toggle(), full: toggleFullScreen });
    byId("full").addEventListener("click", toggleFullScreen);
    new ResizeObserver(() => this.want()).observe(document.body);
    // Drawn at once when the stream is let go: a hidden tab is given no frame to draw in.
    this.feed = new Feed((last) => link.events(last), { message: (m) => this.receive(m), released: () => this.draw() });
    setInterval(() => { this.feed.check(); this.want(); }, CHECK_MS);
  }

  receive(message) {
    if (message.batch) message.batch.forEach((item) => this.item(item));
    else if (message.reset !== undefined) this.store.clear();
    else if (message.recent) this.store.recall(message.recent);
    else if (message.end) this.end = message.end;
    else if (message.seq !== undefined) this.newest(message);
    this.want();
  }

  newest(state) {
    this.state = state;
    this.last = new Date();
    this.store.addLive(state);
  }

  item(item) {
    this.store.add(item);
    if (item.log) setText(byId("log"), item.log.text);
  }

  restyle() {
    this.curve?.surface.restyle();
    this.time?.surface.restyle();
    this.want();
  }

  want() {
    if (this.wanted) return;
    this.wanted = true;
    requestAnimationFrame(() => { this.wanted = false; this.draw(); });
  }

  draw() {
    const { connected, ended, away } = this.feed;
    const age_s = this.feed.freshness.age();
    const old = ended || !connected || age_s > STALE_S;
    this.bands.draw(this.state, { connected, away, old, last: this.last, age_s, end: this.end });
    if (this.state === null) return;
    this.readout.draw(this.state, old, old ? Math.max(0, age_s) : 0);
    drawCue(this.state, old);
    drawSide(this.state);
    drawArm(this.state, this.store.plan);
    this.curve.draw(this.store, this.state, old);
    this.time.draw(this.store, old);
    this.controls.draw(this.state, !old);
  }
}

new Page();
