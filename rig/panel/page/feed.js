/** The stream of states, and how old they are. Nothing that arrives late may look live. */

export const STALE_S = 1.0;
const RECONNECT_S = 4.0;
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
 * Connects to `url` and reconnects by itself. `handlers`: reset(), message(object).
 * The browser resumes a broken stream with Last-Event-ID; a stream that is open and silent, or
 * that the server refused, is replaced by a new one, which tells the whole run again.
 */
export class Feed {
  constructor(url, handlers) {
    this.url = url;
    this.handlers = handlers;
    this.freshness = new Freshness();
    this.connected = false;
    this.ended = false;
    this.connect();
  }

  connect() {
    this.source?.close();
    this.since_s = nowS();
    this.first = true;
    this.source = new EventSource(this.url);
    this.source.onopen = () => {
      this.connected = true;
      this.since_s = nowS();
      this.freshness.renew();
    };
    this.source.onerror = () => { this.connected = false; };
    this.source.onmessage = (event) => this.#receive(JSON.parse(event.data));
  }

  /** To be called a few times a second: replaces a connection that brings nothing. */
  check() {
    if (this.ended) return;
    const silent_s = nowS() - Math.max(this.since_s, this.freshness.lastArrival_s ?? 0);
    if (silent_s > RECONNECT_S) this.connect();
  }

  #receive(message) {
    if (this.first) {
      this.first = false;
      this.handlers.reset();
    }
    if (typeof message.t_s === "number") this.freshness.arrived(message.t_s);
    if (message.end) {
      this.ended = true;
      this.source.close();
    }
    this.handlers.message(message);
  }
}
