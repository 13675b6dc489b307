/** What the page keeps: every recorded sample, and the last minutes of live values. */

const LIVE_S = 180;

/** Columns of numbers that grow in place: a run has tens of thousands of rows. */
export class Columns {
  constructor(names) {
    this.length = 0;
    this.names = names;
    for (const name of names) this[name] = new Float64Array(1024);
  }

  push(...values) {
    if (this.length === this[this.names[0]].length) this.#grow();
    this.names.forEach((name, i) => { this[name][this.length] = values[i]; });
    this.length += 1;
  }

  /** Forgets the first `count` rows. */
  drop(count) {
    for (const name of this.names) this[name].copyWithin(0, count, this.length);
    this.length -= count;
  }

  #grow() {
    for (const name of this.names) {
      const wider = new Float64Array(2 * this.length);
      wider.set(this[name]);
      this[name] = wider;
    }
  }
}

const COLUMNS = ["force_N", "displacement_mm"];
const number = (value) => (typeof value === "number" ? value : NaN);

/** One repetition. `samples` counts those that are to be used; rows also hold gaps. */
export class Curve extends Columns {
  constructor() {
    super(COLUMNS);
    this.samples = 0;
    this.branch = "";
  }

  /** Adds a sample and returns its row. */
  add(force_N, displacement_mm, branch) {
    // Back at zero load the screw has been turned back: no line leads there from the last step.
    if (branch === "zero" && !["", "zero"].includes(this.branch)) this.push(NaN, NaN);
    this.branch = branch;
    this.push(force_N, displacement_mm);
    this.samples += 1;
    return this.length - 1;
  }

  /** The sample in this row is not to be used. */
  discard(row) {
    for (const name of COLUMNS) this[name][row] = NaN;
    this.samples -= 1;
  }
}

/**
 * `curves`: Map "pose|direction" -> Map repetition -> Curve.
 * `run`: all samples on the session's clock; `live`: states on the server's clock.
 * `version` changes whenever earlier points are no longer valid and all must be drawn again.
 */
export class Store {
  constructor() {
    this.version = 0;
    this.clear();
  }

  clear() {
    this.version += 1;
    this.curves = new Map();
    this.run = new Columns(["t_s", ...COLUMNS]);
    this.live = new Columns(["t_s", ...COLUMNS]);
    this.predictions = new Map();
    this.plan = null;
    this.rows = []; // by row number: where its values lie; null once discarded
  }

  /** One item of the stream. */
  add(item) {
    if (item.sample) this.#sample(item.sample);
    else if (item.discard) this.#discard(item.discard);
    else if (item.plan) this.plan = item.plan;
    else if (item.prediction) this.#prediction(item.prediction);
  }

  /** The values of a state; a stale one leaves a gap. */
  addLive(state) {
    const live = this.live;
    if (live.length && !(state.t_s > live.t_s[live.length - 1])) return;
    const force = state.force.stale ? NaN : number(state.force.N);
    const displacement = state.displacement.stale ? NaN : number(state.displacement.mm);
    live.push(state.t_s, force, displacement);
    if (live.t_s[live.length - 1] - live.t_s[0] > 1.5 * LIVE_S) {
      live.drop(live.t_s.findIndex((t) => t > state.t_s - LIVE_S));
    }
  }

  /** The last minutes as the server has them: all of them, also those in which nobody listened. */
  recall(rows) {
    this.live = new Columns(["t_s", ...COLUMNS]);
    for (const row of rows) this.live.push(...row.map(number));
  }

  repetitions(pose, direction) {
    return this.curves.get(`${pose}|${direction}`) ?? new Map();
  }

  #sample(sample) {
    if (this.rows[sample.row] !== undefined) return; // told twice: after a reconnection
    const curve = this.#curve(`${sample.pose}|${sample.direction}`, sample.repetition);
    const values = [number(sample.force_N), number(sample.displacement_mm)];
    this.rows[sample.row] = { curve, at: curve.add(...values, sample.branch) };
    this.run.push(number(sample.session_s), ...values);
  }

  #curve(where, repetition) {
    if (!this.curves.has(where)) this.curves.set(where, new Map());
    const repetitions = this.curves.get(where);
    if (!repetitions.has(repetition)) repetitions.set(repetition, new Curve());
    return repetitions.get(repetition);
  }

  // What is measured again leaves the curve, and stays in the time plot: it did happen.
  #discard({ first, last }) {
    for (let row = first; row <= last; row += 1) {
      const place = this.rows[row];
      if (place) place.curve.discard(place.at);
      this.rows[row] = null;
    }
    this.version += 1;
  }

  #prediction(prediction) {
    for (const [where, points] of Object.entries(prediction)) this.predictions.set(where, points);
    this.version += 1;
  }
}
