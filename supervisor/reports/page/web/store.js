// Data of the page: chart rows, states, events, maps and fields, each with its mission time.

// Ten minutes of a live run at 10 Hz. Older rows are dropped, and a recording is kept whole.
const MOST_ROWS = 6000;
const MOST_STATES = 3000;
const MOST_EVENTS = 1000;
const MOST_BLOBS = 1200;

/// Returns the last index of `list` whose `time` is at most `t`, or -1.
export function lastBefore(list, t, time = (item) => item) {
  let low = 0;
  let high = list.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time(list[middle]) <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export class Store {
  constructor(isBounded) {
    this.isBounded = isBounded;
    this.clear(null);
  }

  clear(about) {
    this.about = about;
    this.columns = {};
    this.sensors = [];
    this.states = [];
    this.events = [];
    this.results = [];
    this.maps = [];
    this.fields = [];
    this.preview = null;
    this.ranges = [];
    this.movers = [];
    this.running = false;
    this.problem = "";
    this.heard = null;
    if (!about) return;
    for (const name of about.columns) this.columns[name] = [];
    this.ranges = about.sensors.map(() => []);
  }

  get times() {
    return this.columns.t ?? [];
  }

  /// Newest mission time.
  get end() {
    const states = this.states;
    return this.times[this.times.length - 1] ?? (states.length ? states[states.length - 1].t : 0);
  }

  get start() {
    return this.times[0] ?? 0;
  }

  /// Takes a message of the server, or of a recording.
  take(message) {
    if ("about" in message) this.clear(message.about);
    if ("running" in message) this.running = message.running;
    if ("problem" in message) this.problem = message.problem;
    for (const row of message.rows ?? []) this.row(row);
    for (const event of message.events ?? []) this.events.push(event);
    for (const result of message.results ?? []) this.results.push(result);
    if (message.metrics) this.summary = message;
    if (message.state) this.states.push(message.state);
    if (message.state || message.rows) this.heard = performance.now();
    if (!this.isBounded) return;
    for (const list of [this.events, this.results]) {
      if (list.length > MOST_EVENTS) list.splice(0, list.length - MOST_EVENTS);
    }
    if (this.states.length > MOST_STATES) this.states.splice(0, MOST_STATES / 10);
  }

  row(row) {
    const names = this.about.columns;
    names.forEach((name, at) => this.columns[name].push(row[at]));
    this.ranges.forEach((range, at) => range.push(row[names.length + at] ?? null));
    this.movers.push(row[names.length + this.ranges.length] ?? []);
    if (this.isBounded && this.times.length > MOST_ROWS * 1.1) {
      const surplus = this.times.length - MOST_ROWS;
      for (const list of [...Object.values(this.columns), ...this.ranges, this.movers]) list.splice(0, surplus);
    }
  }

  /// Takes a packed map or field.
  takeBlob(buffer) {
    const view = new DataView(buffer);
    const blob = {
      kind: view.getUint8(0),
      cells: view.getUint16(2, true),
      side: view.getFloat32(4, true),
      left: view.getFloat32(8, true),
      bottom: view.getFloat32(12, true),
      t: view.getFloat64(16, true),
      target: [view.getFloat32(24, true), view.getFloat32(28, true)],
      packed: new Uint8Array(buffer, 32),
    };
    if (blob.kind === 3) {
      this.preview = blob;
      return blob;
    }
    const list = blob.kind === 1 ? this.maps : this.fields;
    list.push(blob);
    if (this.isBounded && list.length > MOST_BLOBS) list.splice(0, MOST_BLOBS / 10);
    return blob;
  }

  /// Returns the index of the row at `t`.
  rowAt(t) {
    return lastBefore(this.times, t);
  }

  /// Age of the newest row or state, seconds.
  get age() {
    return this.heard === null ? 0 : (performance.now() - this.heard) / 1000;
  }

  value(name, at) {
    return at < 0 ? null : (this.columns[name]?.[at] ?? null);
  }

  stateAt(t) {
    const at = lastBefore(this.states, t, (state) => state.t);
    return this.states[Math.max(at, 0)] ?? null;
  }

  mapAt(t) {
    return this.maps[Math.max(lastBefore(this.maps, t, (map) => map.t), 0)] ?? null;
  }

  fieldAt(t) {
    return this.fields[Math.max(lastBefore(this.fields, t, (field) => field.t), 0)] ?? null;
  }
}

/// Unpacks the newest requested blob, one at a time.
export class Unpacker {
  constructor(changed) {
    this.changed = changed;
    this.done = null;
    this.wanted = null;
    this.busy = false;
  }

  /// Returns the cells of `blob` if unpacked. Otherwise returns the previous ones, and calls
  /// `changed` later.
  of(blob) {
    if (blob && this.done?.blob !== blob) {
      this.wanted = blob;
      if (!this.busy) this.unpack();
    }
    return blob ? this.done : null;
  }

  async unpack() {
    this.busy = true;
    while (this.wanted) {
      const blob = this.wanted;
      this.wanted = null;
      try {
        this.done = { blob, cells: await inflate(blob.packed) };
      } catch {
        this.done = null;
      }
      this.changed();
    }
    this.busy = false;
  }
}
