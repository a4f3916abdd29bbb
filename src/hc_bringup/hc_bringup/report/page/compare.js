/* A comparison: the same quantity of several variants in one chart. */
"use strict";

/* Eight colours that every eye tells apart (test_colours.py), and dashes for who sees none. */
HC.VARIANTS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#7828f0", "#a02828"];
HC.DASHES = [[], [8, 3], [2, 3], [10, 3, 2, 3], [], [8, 3], [2, 3], [10, 3, 2, 3]];

/* What differs by decades from filter to filter is drawn so. */
HC.IN_DECADES = ["rms", "nis"];

HC.Comparison = class {
  constructor(data) {
    this.span = [null, null];
    this.charts = [];
    this.labels = [...new Set(data.recordings.flatMap((r) => r.variants.map((v) => v.label)))];
    HC.onZoom = (from, to) => this.zoom(from, to);
    data.recordings.forEach((recording, number) => this.add(recording, number));
    document.querySelectorAll("[data-variant]").forEach((box) =>
      box.addEventListener("change", () =>
        this.setShown(Number(box.dataset.variant), box.checked)));
    document.getElementById("theme").addEventListener("click", HC.toggleTheme);
    document.getElementById("whole").addEventListener("click", () => this.zoom(null, null));
  }

  add(recording, number) {
    const unpack = (curves) => Object.fromEntries(Object.entries(curves)
      .map(([name, packed]) => [name, Array.from(HC.numbers(packed))]));
    const variants = recording.variants.map((v) => ({ label: v.label, ...unpack(v.curves) }));
    const truth = recording.truth ? unpack(recording.truth) : null;
    for (const host of document.querySelectorAll(`[data-recording="${number}"]`)) {
      this.chart(host, host.dataset.curve, variants, truth);
    }
  }

  chart(host, name, variants, truth) {
    // uPlot wants one time axis: all times together, and nothing where a curve has no point.
    const decades = HC.IN_DECADES.includes(name);
    const drawn = (x) => isFinite(x) && (x > 0 || !decades);
    const tables = variants.map((v) => [v.time, v[name].map((x) => (drawn(x) ? x : null))]);
    if (truth && truth[name]) tables.push([truth.time, truth[name]]);
    const data = uPlot.join(tables);
    const end = Math.max(...variants.map((v) => v.time.at(-1)));
    const begin = Math.min(...variants.map((v) => v.time[0]));
    const numbers = variants.map((v) => this.labels.indexOf(v.label));
    const series = numbers.map((n) => ({
      stroke: HC.VARIANTS[n % 8], dash: HC.DASHES[n % 8], width: 1.5, points: { show: false },
      gaps: HC.timeGaps,
    }));
    if (truth && truth[name]) {
      series.push(HC.line("ink", { dash: [6, 4], width: 2 }));
    }
    const chart = HC.chart(host, {
      height: 210,
      sync: "time",
      x: { range: () => [this.span[0] ?? begin, this.span[1] ?? end] },
      y: { range: () => (decades ? this.decades : this.limits).call(this, chart, name, variants, truth),
        axis: { size: HC.labelRoom(54), ...(decades ? HC.DECADES_AXIS : {}) },
        ...(decades ? { scale: { distr: 3 } } : {}) },
      series,
      tip: (plot, i) => this.describe(plot, i, variants, name, truth),
    }, data);
    this.charts.push({ chart, numbers });
    chart.plot.setData(data, true);
  }

  /* A range of what is shown that one bad curve or its first guess does not spoil. */
  limits(chart, name, variants, truth) {
    const values = this.inSight(chart, name, variants);
    if (truth && truth[name]) values.push(...truth[name].filter(isFinite));
    if (!values.length) return [0, 1];
    values.sort((a, b) => a - b);
    const low = values[Math.floor(0.01 * (values.length - 1))];
    const high = values[Math.floor(0.99 * (values.length - 1))];
    const margin = 0.15 * (high - low) || 0.05 * Math.abs(high) || 1;
    return [Math.max(0, low - margin), high + margin];
  }

  /* All that is shown, whole decades of it. */
  decades(chart, name, variants) {
    const values = this.inSight(chart, name, variants).filter((x) => x > 0);
    if (!values.length) return [0.1, 10];
    const whole = (round, x) => 10 ** round(Math.log10(x));
    const low = whole(Math.floor, values.reduce((a, b) => Math.min(a, b)));
    const high = whole(Math.ceil, values.reduce((a, b) => Math.max(a, b)));
    return [low, high > low ? high : 10 * low];
  }

  inSight(chart, name, variants) {
    const [from, to] = this.span;
    const values = [];
    variants.forEach((v, i) => {
      if (chart && !chart.plot.series[i + 1].show) return;
      const first = from ?? v.time[0] + 0.1 * (v.time.at(-1) - v.time[0]);
      v.time.forEach((t, k) => {
        if (t >= first && t <= (to ?? Infinity) && isFinite(v[name][k])) values.push(v[name][k]);
      });
    });
    return values;
  }

  describe(plot, index, variants, name, truth) {
    if (index === null || index === undefined) return null;
    const time = plot.data[0][index];
    const near = (times, values) => {
      let low = 0;
      let high = times.length - 1;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (times[middle] < time) low = middle + 1;
        else high = middle;
      }
      return values[low];
    };
    const lines = [`${time.toFixed(2)} s`];
    variants.forEach((v, i) => {
      if (!plot.series[i + 1].show) return;
      const value = near(v.time, v[name]);
      const deviation = v[name + "_std"] ? near(v.time, v[name + "_std"]) : 0;
      lines.push(`${v.label}  ${HC.withDeviation(value, 2 * deviation)}`);
    });
    if (truth && truth[name]) lines.push(`true  ${near(truth.time, truth[name]).toPrecision(4)}`);
    return lines;
  }

  setShown(number, shown) {
    for (const { chart, numbers } of this.charts) {
      const place = numbers.indexOf(number);
      if (place < 0) continue;
      chart.plot.setSeries(place + 1, { show: shown });
      chart.plot.setData(chart.plot.data, true);
    }
  }

  zoom(from, to) {
    const whole = from === null || !(to - from > 1e-6);
    this.span = whole ? [null, null] : [from, to];
    document.getElementById("whole").hidden = whole;
    for (const { chart } of this.charts) chart.plot.setData(chart.plot.data, true);
  }
};

HC.startTheme();
HC.comparison = new HC.Comparison(JSON.parse(document.getElementById("data").textContent));
