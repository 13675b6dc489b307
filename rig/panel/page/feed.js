/** The stream of states, and how old they are. Nothing that arrives late may look live. */

export const STALE_S = 1.0;
const RECONNECT_S = 4.0;
const YIELD_MS = 500; // what has not got through by then lacks a connection
// Two clocks drift apart by some 100 ppm: the smallest delay seen may rise by twice that.
const CREEP = 2e-4;

const nowS = () => performance.now() / 1000;

/** Age of a state from the server's clock: what has been queued on the way is old on arrival. */
export class Freshness {
  constructor(now = nowS) {
    this.now = now;
    this.offset_s = Infinity;
    this.renewed = false;
    this.lastArrival_s = null;
    this.last_t_s = null;
  }

  /** Another connection, perhaps another server: the delays of the earlier one say nothing. */
  renew() {
    this.renewed = true;
  }

  arrived(t_s) {
    const now = this.now();
    if (this.renewed) this.offset_s = Infinity;
    this.renewed = false;
    if (this.lastArrival_s !== null) this.offset_s += CREEP * (now - this.lastArrival_s);
    this.offset_s = Math.min(this.offset_s, now - t_s);
    this.lastArrival_s = now;
    this.last_t_s = t_s;
  }

  /** Seconds since the newest state was made; Infinity before the first. */
  age() {
    return this.last_t_s === null ? Infinity : this.now() - this.last_t_s - this.offset_s;
  }
}

/**
 * Connects and reconnects by itself. `address(last id)`: of a stream that goes on after this id;
 * `handlers`: message(object), released().
 * The browser resumes a broken stream with Last-Event-ID; a stream that is open and silent, or
 * that the server refused, is replaced by a new one.
 *
 * Browsers allow six connections to a server, all tabs together, and a stream holds one. So a
 * hidden tab lets go of its stream once there are other tabs, and every tab does for a command
 * that finds no connection. `away`: let go on purpose, and nothing has come since.
 */
export class Feed {
  constructor(address, handlers) {
    this.address = address;
    this.handlers = handlers;
    this.freshness = new Freshness();
    this.connected = false;
    this.away = false;
    this.ended = false;
    this.source = null;
    this.last = "";
    this.company = false; // another tab of this browser has been heard of
    this.tabs = new BroadcastChannel("panel-stream");
    this.tabs.onmessage = () => {
      this.company = true;
      if (document.hidden) this.release();
    };
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) this.resume();
      else if (this.company) this.release();
    });
    this.resume();
  }

  connect() {
    this.source?.close();
    this.since_s = nowS();
    this.source = new EventSource(this.address(this.last));
    this.tabs.postMessage("connects");
    this.source.onopen = () => {
      this.connected = true;
      this.since_s = nowS();
      this.freshness.renew();
    };
    this.source.onerror = () => { this.connected = this.away = false; };
    this.source.onmessage = (event) => {
      this.last = event.lastEventId || this.last;
      this.#receive(JSON.parse(event.data));
    };
  }

  /** Lets go of the connection; the values are no longer live. */
  release() {
    if (this.source === null) return;
    this.source.close();
    this.source = null;
    this.connected = false;
    this.away = true;
    this.handlers.released();
  }

  /** Takes the stream up again where it was left, unless nobody sees the page. */
  resume() {
    if (this.source === null && !this.ended && !document.hidden) this.connect();
  }

  /** Waits for the answer to a request; if it takes long, without the stream. */
  async giveWayTo(answer) {
    const timer = setTimeout(() => this.release(), YIELD_MS);
    try {
      return await answer;
    } finally {
      clearTimeout(timer);
      this.resume();
    }
  }

  /** To be called a few times a second: replaces a connection that brings nothing. */
  check() {
    if (this.ended || this.source === null) return;
    const silent_s = nowS() - Math.max(this.since_s, this.freshness.lastArrival_s ?? 0);
    if (silent_s > RECONNECT_S) this.connect();
  }

  #receive(message) {
    if (typeof message.t_s === "number") {
      this.freshness.arrived(message.t_s);
      this.away = false;
    }
    if (message.end) {
      this.ended = true;
      this.source.close();
    }
    this.handlers.message(message);
  }
}
