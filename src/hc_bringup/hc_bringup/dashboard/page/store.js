/* The rows of the last minutes in one block of memory, and what the charts take from it. */
"use strict";

HC.Store = class {
  constructor(columns, capacity) {
    this.columns = columns;
    this.width = columns.length;
    this.capacity = capacity;
    this.data = new Float64Array(capacity * this.width);
    this.place = Object.fromEntries(columns.map((name, index) => [name, index]));
    this.clear(0, 0);
  }

  clear(epoch, number) {
    this.epoch = epoch;
    this.first = number; // number of the oldest row kept
    this.count = number; // number of the next row
  }

  /* Adds rows that begin with row number `first`; returns false if rows before are missing. */
  add(first, rows, values) {
    if (first > this.count) return false;
    for (let row = this.count - first; row < rows; row++) {
      const from = row * this.width;
      this.data.set(values.subarray(from, from + this.width),
        (this.count % this.capacity) * this.width);
      this.count++;
    }
    this.first = Math.max(this.first, this.count - this.capacity);
    return true;
  }

  get empty() {
    return this.count === this.first;
  }

  at(row, name) {
    return this.data[(row % this.capacity) * this.width + this.place[name]];
  }

  last(name) {
    return this.empty ? NaN : this.at(this.count - 1, name);
  }

  /* Number of the first row that is not before a time. */
  find(time) {
    let low = this.first;
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.at(middle, "time") < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /* Rows of a window, in groups so that a chart has no more points than it has pixels. The groups
     are counted from row 0, so that a curve does not flicker while it moves. */
  view(seconds, end, points) {
    const from = Math.max(this.first, this.find(end - seconds) - 1);
    const to = this.find(end + 1e-9);
    const group = Math.max(1, Math.ceil((to - from) / points));
    // A run that has only begun fills the width all the same.
    const begin = this.empty ? 0 : this.at(this.first, "time");
    const start = Math.min(Math.max(end - seconds, begin), end - Math.min(2, seconds));
    return { from: from - (from % group), to, group, start, end, store: this };
  }
};

/* A store filled at once, for a page at rest. `blocks` gives numbers by column. */
HC.fullStore = function (columns, rows, blocks) {
  const store = new HC.Store(columns, Math.max(1, rows));
  store.data.fill(NaN);
  for (const [name, values] of Object.entries(blocks)) {
    const place = store.place[name];
    for (let row = 0; row < rows; row++) store.data[row * store.width + place] = values[row];
  }
  store.count = rows;
  return store;
};

/* Numbers of a page: base64 of float32 or float64. */
HC.numbers = function (packed) {
  const bytes = Uint8Array.from(atob(packed.base64), (c) => c.charCodeAt(0));
  return packed.type === "f8" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
};

/* Columns of a view as arrays for uPlot: null where there is nothing. `specs` lists
   [name, kind]: last (that is there), min, max, sum or any of a group. */
HC.take = function (view, specs) {
  const { store, group } = view;
  const out = specs.map(() => []);
  for (let start = view.from; start < view.to; start += group) {
    const begin = Math.max(start, store.first);
    const end = Math.min(start + group, view.to);
    if (begin >= end) continue;
    specs.forEach(([name, kind], index) => {
      const place = store.place[name];
      let value = NaN;
      if (kind === "last") {
        for (let row = end - 1; row >= begin && value !== value; row--) {
          value = store.data[(row % store.capacity) * store.width + place];
        }
      } else {
        for (let row = begin; row < end; row++) {
          const one = store.data[(row % store.capacity) * store.width + place];
          if (one !== one) continue;
          if (value !== value) value = one;
          else if (kind === "min") value = Math.min(value, one);
          else if (kind === "max") value = Math.max(value, one);
          else value += one;
        }
      }
      out[index].push(value === value ? value : null);
    });
  }
  return out;
};

/* Least and greatest of an array, nulls left out. */
HC.extent = function (values, extent) {
  const result = extent || [Infinity, -Infinity];
  for (const value of values) {
    if (value === null) continue;
    if (value < result[0]) result[0] = value;
    if (value > result[1]) result[1] = value;
  }
  return result;
};

HC.median = function (values) {
  const sorted = values.filter((v) => v !== null && isFinite(v)).sort((a, b) => a - b);
  return sorted.length ? sorted[sorted.length >> 1] : NaN;
};
