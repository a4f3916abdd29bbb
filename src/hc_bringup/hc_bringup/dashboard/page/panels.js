/* Charts over time: the four parameters, force, its error, NIS. Each is made once and then given
   a view of the store. */
"use strict";

HC.timeAxis = (view) => ({ range: () => [view.start, view.end] });

/* One parameter: value, band of two deviations, truth. */
HC.ParameterPanel = class {
  constructor(host, name) {
    this.name = name;
    this.host = host;
    this.range = new HC.CalmRange(0.002, 0);
    this.view = { start: 0, end: 1 };
    this.value = host.querySelector(".value");
    this.known = host.querySelector(".known");
    this.chart = HC.chart(host, {
      x: { range: () => [this.view.start, this.view.end] },
      y: { range: () => this.range.now || [0, 1], axis: { size: HC.labelRoom(50) } },
      sync: "time",
      series: [HC.hidden(), HC.hidden(), HC.line("estimate"),
        HC.line("truth", { dash: [6, 4], width: 1.5 })],
      bands: [{ series: [1, 2], fill: HC.bandFill("estimate", 0.25) }],
      tip: (plot, index) => this.describe(plot, index),
    }, [[], [], [], [], []]);
  }

  update(view) {
    this.view = view;
    const name = this.name;
    const [time, value, deviation, truth] = HC.take(view, [
      ["time", "last"], [name, "last"], [name + "_std", "last"], [name + "_true", "last"]]);
    const high = value.map((v, i) => (v === null ? null : v + 2 * deviation[i]));
    const low = value.map((v, i) => (v === null ? null : Math.max(0, v - 2 * deviation[i])));
    const usual = HC.median(deviation);
    // What was not known yet must not squeeze what is known now into a line.
    const trusted = value.filter((v, i) => v !== null && deviation[i] <= 8 * usual);
    const around = HC.extent(trusted);
    HC.extent(truth, around);
    this.range.update(around[0] - 2.5 * usual, around[1] + 2.5 * usual);
    this.chart.plot.setData([time, high, low, value, truth], true);
  }

  show(store, row) {
    const at = (name) => (row === undefined ? store.last(name) : store.at(row, name));
    const value = at(this.name);
    const deviation = at(this.name + "_std");
    const known = at(this.name + "_known");
    HC.setText(this.value, HC.withDeviation(value, 2 * deviation));
    this.known.value = isFinite(known) ? known : 0;
    const share = isFinite(known) ? Math.round(100 * known) + " % known from the data" : "not known";
    this.known.title = share;
    HC.setText(this.host.querySelector(".share"), share);
    const truth = at(this.name + "_true");
    const shown = this.host.querySelector(".true");
    shown.hidden = !isFinite(truth);
    HC.setText(shown,
      isFinite(truth) ? "true " + truth.toFixed(HC.decimals(truth, 2 * deviation)) : "");
  }

  describe(plot, index) {
    if (index === null || index === undefined) return null;
    const [time, high, , value, truth] = plot.data.map((column) => column[index]);
    if (value === null || value === undefined) return null;
    const lines = [`${time.toFixed(2)} s`, `${this.name} = ${HC.withDeviation(value, high - value)}`];
    if (truth !== null) lines.push(`true ${truth.toFixed(HC.decimals(truth, high - value))}`);
    return lines;
  }
};

/* Force measured and one step ahead. */
HC.ForcePanel = class {
  constructor(host) {
    this.range = new HC.CalmRange(0.01);
    this.view = { start: 0, end: 1 };
    this.chart = HC.chart(host, {
      x: { range: () => [this.view.start, this.view.end] },
      y: { range: () => this.range.now || [0, 1] },
      sync: "time",
      series: [HC.hidden(), HC.hidden(), HC.line("measured", { width: 2.5 }),
        HC.line("estimate", { width: 1.2 })],
      bands: [{ series: [1, 2], fill: HC.bandFill("measured", 0.45) }],
      tip: (plot, i) => {
        const [time, , , force, predicted] = plot.data.map((c) => c[i]);
        if (force === null || force === undefined) return null;
        return [`${time.toFixed(2)} s`, `measured ${force.toFixed(3)} N`,
          `one step ahead ${predicted === null ? "–" : predicted.toFixed(3) + " N"}`];
      },
    }, [[], [], [], [], []]);
  }

  update(view) {
    this.view = view;
    const [time, low, high, force, predicted] = HC.take(view, [["time", "last"],
      ["force_min", "min"], ["force_max", "max"], ["force", "last"], ["predicted", "last"]]);
    this.range.update(...HC.extent(high, HC.extent(low)));
    this.chart.plot.setData([time, high, low, force, predicted], true);
  }
};

/* Error of the force one step ahead. */
HC.ErrorPanel = class {
  constructor(host) {
    this.host = host;
    this.range = new HC.CalmRange(0.01);
    this.view = { start: 0, end: 1 };
    this.chart = HC.chart(host, {
      x: { range: () => [this.view.start, this.view.end] },
      y: { range: () => this.range.now || [-1, 1] },
      sync: "time",
      series: [HC.line("estimate", { width: 0.8 }), HC.line("estimate", { width: 0.8 })],
      bands: [{ series: [1, 2], fill: HC.bandFill("estimate", 0.35) }],
      tip: (plot, i) => {
        const [time, high, low] = plot.data.map((c) => c[i]);
        if (high === null || high === undefined) return null;
        return [`${time.toFixed(2)} s`, `${low.toFixed(1)} to ${high.toFixed(1)} mN`];
      },
    }, [[], [], []]);
  }

  update(view) {
    this.view = view;
    const [time, low, high] = HC.take(view,
      [["time", "last"], ["error_min", "min"], ["error_max", "max"]]);
    const milli = (column) => column.map((v) => (v === null ? null : 1000 * v));
    const sizes = [...low, ...high].filter((v) => v !== null).map(Math.abs).sort((a, b) => a - b);
    // A first guess that is far off must not hide what follows.
    const usual = sizes.length ? sizes[Math.floor(0.98 * (sizes.length - 1))] : NaN;
    this.range.update(-1500 * usual, 1500 * usual);
    this.chart.plot.setData([time, milli(high), milli(low)], true);
  }
};

/* Mean NIS of each group against the band that chi-square gives for so many of them. */
HC.NisPanel = class {
  constructor(host, table) {
    this.table = table;
    this.view = { start: 0, end: 1 };
    this.top = 5;
    this.chart = HC.chart(host, {
      x: { range: () => [this.view.start, this.view.end] },
      y: { range: () => [0, this.top] },
      sync: "time",
      series: [HC.hidden(), HC.hidden(), HC.line("estimate", { width: 1.2 })],
      bands: [{ series: [1, 2], fill: HC.bandFill("good", 0.22) }],
      tip: (plot, i) => {
        const [time, high, low, mean] = plot.data.map((c) => c[i]);
        if (mean === null || mean === undefined) return null;
        return [`${time.toFixed(2)} s`, `mean NIS ${mean.toFixed(2)}`,
          `95 % of a consistent filter: ${low.toFixed(2)} to ${high.toFixed(2)}`];
      },
    }, [[], [], [], []]);
  }

  update(view) {
    this.view = view;
    // At least a quarter of a second in each mean: single ones say little.
    const group = Math.max(view.group, 12);
    const coarse = { ...view, group, from: view.from - (view.from % group) };
    const [time, sums, counts] = HC.take(coarse,
      [["time", "last"], ["nis_sum", "sum"], ["nis_count", "sum"]]);
    const mean = sums.map((sum, i) => (counts[i] ? sum / counts[i] : null));
    const bands = counts.map((count) => HC.nisBand(this.table, count));
    const sorted = mean.filter((v) => v !== null).sort((a, b) => a - b);
    const usual = sorted.length ? sorted[Math.floor(0.9 * (sorted.length - 1))] : 2;
    const wanted = Math.max(5, Math.min(60, 1.6 * usual));
    if (wanted > this.top || wanted < 0.5 * this.top) this.top = wanted;
    this.chart.plot.setData([time, bands.map((b) => b[1]), bands.map((b) => b[0]), mean], true);
  }
};
