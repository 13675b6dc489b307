/** The stream of states, and how old they are. Nothing that arrives late may look live. */

export const STALE_S = 1.0;
const RECONNECT_S = 4.0;
const YIELD_MS = 500; // what has not got through by then lacks a connection
const CONNECTIONS = 6;
const HEARD_S = 5; // a window that was not heard of for so long is gone
const TURN_S = 2; // a crowded window holds its stream for so long,
const PAUSE_MS = 300; // and leaves its connection to others for so long: less than turns a value old
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
 *
 * Where as many windows are in sight as there are connections, one more could not even load. So
 * those that only look on then take turns: each pauses now and then, too shortly to be seen.
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
    this.operates = false;
    this.pausing = 0; // the timer of a turn left to others
    this.tabs = new BroadcastChannel("panel-stream");
    this.name = Math.random();
    this.heard_s = new Map(); // when each other tab was heard last
    this.tabs.onmessage = ({ data }) => {
      this.company = true;
      this.heard_s.set(data, nowS());
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
    this.tabs.postMessage(this.name);
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
    if (this.source === null && !this.pausing) return;
    clearTimeout(this.pausing);
    this.pausing = 0;
    this.source?.close();
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
    if (this.#crowded() && this.source.readyState === EventSource.OPEN && nowS() - this.since_s > TURN_S) {
      this.#pause();
      return;
    }
    const silent_s = nowS() - Math.max(this.since_s, this.freshness.lastArrival_s ?? 0);
    if (silent_s > RECONNECT_S) this.connect();
  }

  /** Whether windows in sight take all connections, and this one only looks on. */
  #crowded() {
    if (nowS() - (this.told_s ?? 0) > 1) {
      this.told_s = nowS();
      this.tabs.postMessage(this.name);
    }
    const others = [...this.heard_s.values()].filter((at_s) => nowS() - at_s < HEARD_S);
    return !this.operates && others.length >= CONNECTIONS - 1;
  }

  /** Lets go for a moment. What waited for a connection comes first, then this stream again. */
  #pause() {
    this.source.close();
    this.source = null;
    this.pausing = setTimeout(() => { this.pausing = 0; this.resume(); }, PAUSE_MS);
  }

  #receive(message) {
    if (message.operator) this.operates = message.operator.you;
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
