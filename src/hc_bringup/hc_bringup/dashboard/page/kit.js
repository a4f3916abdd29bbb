/* What the live page and the reports share: numbers as text, colours, charts on uPlot.
   Plain script: everything hangs on the one global HC. */
"use strict";
var HC = {};

HC.element = function (name, attributes, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(attributes || {})) {
    if (key === "class") node.className = value;
    else if (key === "text") node.textContent = value;
    else if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value === true) node.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
};

HC.setText = function (node, text) {
  if (node.textContent !== text) node.textContent = text;
};

HC.colour = function (name) {
  return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
};

/* Colours are asked for at every drawing; the style is read once after each change of theme. */
HC.palette = {};
HC.readPalette = function () {
  for (const name of [
    "ink", "soft", "grid", "measured", "estimate", "truth", "alarm", "warn", "good", "accent",
    "band", "panel",
  ]) HC.palette[name] = HC.colour(name);
};

HC.PARAMETERS = ["K", "B", "n", "p"];
HC.UNITS = { K: "N/mmⁿ", B: "N(s/mm)ᵖ/mmⁿ", n: "", p: "" };
HC.MEANING = {
  K: "stiffness: elastic force at 1 mm",
  B: "damping: its force at 1 mm and 1 mm/s",
  n: "exponent of the depth",
  p: "exponent of the speed",
};

/* As many decimals as the deviation can be told by: two digits of it, or as many as asked for. */
HC.decimals = function (value, deviation, digits) {
  const size = deviation > 0 && isFinite(deviation) ? deviation : Math.abs(value) / 1000;
  if (!(size > 0)) return 3;
  return Math.max(0, Math.min(7, (digits || 2) - 1 - Math.floor(Math.log10(size))));
};

HC.withDeviation = function (value, deviation, digits) {
  if (!isFinite(value) || value === null) return "–";
  const places = HC.decimals(value, deviation, digits);
  const text = value.toFixed(places);
  return deviation > 0 && isFinite(deviation) ? text + " ± " + deviation.toFixed(places) : text;
};

/* Engineering notation: 0.0121 N is 12.1 mN. */
HC.engineering = function (value, unit, digits) {
  if (value === null || !isFinite(value)) return "–";
  if (value === 0) return "0 " + unit;
  const prefixes = { "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M" };
  let power = 3 * Math.floor(Math.log10(Math.abs(value)) / 3);
  power = Math.max(-9, Math.min(6, power));
  const scaled = value / 10 ** power;
  const places = Math.max(0, (digits || 3) - 1 - Math.floor(Math.log10(Math.abs(scaled))));
  return scaled.toFixed(places) + " " + prefixes[power] + unit;
};

HC.VIRIDIS = [
  [68, 1, 84], [72, 24, 106], [71, 45, 123], [66, 64, 134], [59, 82, 139], [51, 99, 141],
  [44, 114, 142], [38, 130, 142], [33, 145, 140], [31, 160, 136], [40, 174, 128], [63, 188, 115],
  [94, 201, 98], [132, 212, 75], [173, 220, 48], [216, 226, 25], [253, 231, 37],
];
HC.viridis = function (share, alpha) {
  const place = Math.max(0, Math.min(1, share)) * (HC.VIRIDIS.length - 1);
  const low = Math.min(HC.VIRIDIS.length - 2, Math.floor(place));
  const mixed = HC.VIRIDIS[low].map((c, i) =>
    Math.round(c + (place - low) * (HC.VIRIDIS[low + 1][i] - c)));
  return `rgba(${mixed.join(",")},${alpha === undefined ? 1 : alpha})`;
};

HC.withAlpha = function (colour, alpha) {
  const match = /^#(..)(..)(..)$/.exec(colour);
  if (!match) return colour;
  return `rgba(${match.slice(1).map((h) => parseInt(h, 16)).join(",")},${alpha})`;
};

/* A colour that lets so much of what is behind it through, opaque: pieces drawn side by side overlap. */
HC.onPanel = function (colour, share) {
  const parts = (hex) => hex.slice(1).match(/../g).map((h) => parseInt(h, 16));
  const behind = parts(HC.palette.panel);
  return `rgb(${parts(colour).map((c, i) => Math.round(behind[i] + share * (c - behind[i]))).join(",")})`;
};

HC.FACETS = [{ scale: "x", auto: true }, { scale: "y", auto: true }];

/* Every chart of the page, so that sizes and themes reach them all. */
HC.charts = new Set();

HC.ink = () => HC.palette.ink;
HC.axis = function (more) {
  return {
    stroke: HC.ink,
    grid: { stroke: () => HC.palette.grid, width: 1 },
    ticks: { stroke: () => HC.palette.grid, width: 1, size: 4 },
    font: "11px system-ui, sans-serif",
    labelFont: "11px system-ui, sans-serif",
    labelSize: 16,
    size: 44,
    gap: 3,
    ...more,
  };
};

/* Room for the longest label of an axis, as many pixels at least. */
HC.labelRoom = (least) => (_plot, labels) =>
  Math.max(least, ...(labels || []).map((label) => 12 + 6.6 * String(label ?? "").length));

/* Tick labels that fit the axis: no more digits than the steps need. */
HC.tickLabels = function (_plot, splits, _axis, _space, step) {
  const largest = Math.max(...splits.map(Math.abs));
  let places = 0;
  const rest = (v) => Math.abs(v - Math.round(v)) > 1e-6 * Math.max(1, Math.abs(v));
  while (places < 7 && rest(step * 10 ** places)) places++;
  if (largest >= 1e6) return splits.map((v) => v.toExponential(1));
  return splits.map((v) => v.toFixed(places));
};

/* An axis in decades, with a line at each; uPlot leaves out the labels that have no room. */
HC.wholeDecades = (_plot, splits) =>
  splits.map((v) => (v > 0 && Math.abs(Math.log10(v) % 1) < 1e-9 ? v : null));
HC.DECADES_AXIS = {
  grid: { stroke: () => HC.palette.grid, width: 1, filter: HC.wholeDecades },
  ticks: { stroke: () => HC.palette.grid, width: 1, size: 4, filter: HC.wholeDecades },
  space: 30, values: (_plot, splits) => splits.map((v) => (v === null ? "" : String(Number(v.toPrecision(6))))),
};

/* The same for a time axis, whose unit stands at the last label. */
HC.timeLabels = function (plot, splits, axis, space, step) {
  const labels = HC.tickLabels(plot, splits, axis, space, step);
  if (labels.length) labels[labels.length - 1] += " s";
  return labels;
};

/* What stands above a chart, where its panel has no name of its own. */
HC.titleOf = function (host) {
  const title = (host.closest("section") || host).querySelector("h2, h3");
  return title ? title.textContent : host.dataset.curve || "values over time";
};

/* A chart in a host element, as wide as it; returns {plot, setData, note}.
   options: series (uPlot's), bands, x and y: {label, range, ...axis}, hooks, cursor, tip. */
HC.chart = function (host, options, data) {
  // To a screen reader a chart is a picture with the name of its panel; the panels say in words
  // and tables what matters.
  const panel = host.closest("[aria-labelledby], [aria-label]");
  const title = panel && (panel.getAttribute("aria-label") ||
    document.getElementById(panel.getAttribute("aria-labelledby")).textContent);
  const box = HC.element("div", { class: "chart", role: "img",
    "aria-label": `chart: ${title || HC.titleOf(host)}` });
  host.append(box);
  const tip = HC.element("div", { class: "tip", hidden: true });
  const make = () => ({
    width: Math.max(120, box.clientWidth),
    height: Math.max(80, options.height || box.clientHeight || 160),
    pxAlign: 1,
    padding: options.padding || [6, 16, 0, 0],
    legend: { show: false },
    cursor: {
      points: { show: false },
      drag: { x: !!HC.onZoom && options.sync === "time", y: false, setScale: false },
      y: false,
      ...(options.sync ? { sync: { key: options.sync, scales: ["x", null] } } : {}),
      ...options.cursor,
    },
    scales: {
      x: { time: false, ...(options.x.range ? { range: options.x.range } : {}), ...options.x.scale },
      y: { ...(options.y.range ? { range: options.y.range } : {}), ...options.y.scale },
    },
    axes: [
      HC.axis({ size: options.x.label ? 30 : 22, labelSize: 14, space: 55, ...options.x.axis,
        values: (options.x.axis || {}).values ||
          (options.sync === "time" ? HC.timeLabels : HC.tickLabels),
        label: options.x.label }),
      HC.axis({ space: 20, size: HC.labelRoom(44), values: HC.tickLabels, ...options.y.axis,
        label: options.y.label }),
    ],
    series: [options.mode === 2 ? null : {}, ...options.series.map((one) => ({
      ...(options.mode === 2 ? { facets: HC.FACETS } : {}), ...one }))],
    bands: options.bands || [],
    hooks: {
      ...options.hooks,
      setCursor: [(plot) => HC.showTip(plot, tip, options.tip)],
      setSelect: [(plot) => HC.zoomTo(plot)],
    },
    ...(options.mode ? { mode: options.mode } : {}),
  });
  const plot = new uPlot(make(), data, box);
  plot.over.append(tip);
  if (HC.onZoom && options.sync === "time") {
    plot.over.addEventListener("dblclick", () => HC.onZoom(null, null));
  }
  const chart = { plot, box, visible: true };
  chart.fit = function () {
    const width = Math.max(120, box.clientWidth);
    const height = Math.max(80, options.height || box.clientHeight || 160);
    if (width !== plot.width || height !== plot.height) plot.setSize({ width, height });
  };
  HC.charts.add(chart);
  HC.watchSize(chart);
  return chart;
};

/* A live page sets HC.onSight(): it is told when a chart comes into sight. */
HC.onSight = null;

HC.watchSize = function (chart) {
  chart.box.hcChart = chart;
  if (!HC.sizes) {
    HC.sizes = new ResizeObserver((entries) => {
      for (const entry of entries) entry.target.hcChart.fit();
    });
    HC.sight = new IntersectionObserver((entries) => {
      for (const entry of entries) entry.target.hcChart.visible = entry.isIntersecting;
      // What came while a chart was out of sight is not in it yet.
      if (HC.onSight && entries.some((entry) => entry.isIntersecting)) HC.onSight();
    });
  }
  HC.sizes.observe(chart.box);
  HC.sight.observe(chart.box);
};

/* A page at rest sets HC.onZoom(from, to): it is told what was chosen with the pointer, and null
   for the whole. */
HC.onZoom = null;
HC.zoomTo = function (plot) {
  const { left, width } = plot.select;
  if (!HC.onZoom || width < 3) return;
  HC.onZoom(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
  plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
};

HC.showTip = function (plot, tip, describe) {
  const { left, top, idx } = plot.cursor;
  const lines = describe && left >= 0 ? describe(plot, idx, left, top) : null;
  tip.hidden = !lines;
  if (!lines) return;
  HC.setText(tip, lines.join("\n"));
  const right = left > plot.over.clientWidth / 2;
  tip.style.left = right ? "auto" : left + 12 + "px";
  tip.style.right = right ? plot.over.clientWidth - left + 12 + "px" : "auto";
};

HC.redrawAll = function () {
  HC.readPalette();
  for (const chart of HC.charts) chart.plot.redraw(false, true);
};

/* Theme: as the system says, or as chosen; remembered where the browser allows it. */
HC.setTheme = function (name) {
  if (name) document.documentElement.dataset.theme = name;
  else delete document.documentElement.dataset.theme;
  try {
    if (name) localStorage.setItem("hc-theme", name);
    else localStorage.removeItem("hc-theme");
  } catch (_error) {
    return HC.redrawAll(); // storage is switched off: the choice lasts as long as the page
  }
  HC.redrawAll();
};
HC.startTheme = function () {
  let chosen = null;
  try {
    chosen = localStorage.getItem("hc-theme");
  } catch (_error) {
    chosen = null;
  }
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
  HC.readPalette();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", HC.redrawAll);
};
HC.isDark = function () {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
};
HC.toggleTheme = () => HC.setTheme(HC.isDark() ? "light" : "dark");

/* Where a curve is broken, in pixels: between two points further apart than five usual steps of
   them. A point that is missing among its neighbours breaks nothing: the sensor may be slow. */
HC.GAP_STEPS = 5;
HC.timeGaps = function (plot, series, from, to) {
  const [times, values] = [plot.data[0], plot.data[series]];
  const known = [];
  for (let i = from; i <= to; i++) if (values[i] != null) known.push(times[i]);
  if (known.length < 3) return [];
  const steps = Float64Array.from({ length: known.length - 1 }, (_, i) => known[i + 1] - known[i]);
  const longest = HC.GAP_STEPS * steps.slice().sort()[steps.length >> 1];
  const place = (time) => plot.valToPos(time, "x", true);
  const gaps = [];
  steps.forEach((step, i) => {
    if (step > longest) gaps.push([place(known[i]), place(known[i + 1])]);
  });
  return gaps;
};

/* Series in the house's style. */
HC.line = (colour, more) => ({
  stroke: () => HC.palette[colour], width: 1.5, points: { show: false }, gaps: HC.timeGaps, ...more,
});
HC.hidden = () => ({
  stroke: "transparent", width: 0, points: { show: false }, gaps: HC.timeGaps,
});
HC.bandFill = (colour, alpha) => () => HC.withAlpha(HC.palette[colour], alpha);

/* A range around what is drawn, that grows at once and shrinks slowly, so that axes keep still. */
HC.CalmRange = class {
  constructor(least, floor) {
    this.least = least;
    this.floor = floor;
    this.now = null;
  }

  update(low, high) {
    if (!(isFinite(low) && isFinite(high))) return this.now || [0, 1];
    const middle = 0.5 * (low + high);
    const half = Math.max(0.5 * (high - low) * 1.12, this.least * Math.max(Math.abs(middle), 1e-6));
    let [from, to] = [middle - half, middle + half];
    if (this.now) {
      const [a, b] = this.now;
      const slow = 0.05;
      if (from > a) from = from - a > 0.15 * (b - a) ? a + slow * (from - a) : a;
      if (to < b) to = b - to > 0.15 * (b - a) ? b - slow * (b - to) : b;
    }
    if (this.floor !== undefined) from = Math.max(this.floor, from);
    this.now = [from, to];
    return this.now;
  }
};

/* Chi-square band of the mean of `count` NIS of two degrees; exact from the table, beyond it by
   Wilson and Hilferty. */
HC.nisBand = function (table, count) {
  if (!count) return [null, null];
  if (count <= table.length) return table[Math.max(1, Math.round(count)) - 1];
  const degrees = 2 * count;
  const spread = Math.sqrt(2 / (9 * degrees));
  return [-1.959964, 1.959964].map((z) => 2 * (1 - 2 / (9 * degrees) + z * spread) ** 3);
};

/* Stiffness dF/dd of the elastic part at a depth, and its relative deviation, from
   ln K, n and their covariance; where that is NaN the deviation is the largest there can be. */
HC.stiffnessAt = function (cell, depth) {
  const n = cell.n;
  if (!(n > 0)) return [null, null];
  const lnDepth = Math.log(depth);
  const value = Math.exp(cell.ln_K + Math.log(n) + (n - 1) * lnDepth);
  const slope = 1 / n + lnDepth;
  if (isNaN(cell.cov)) { // not told: as if the two went astray together
    return [value, Math.sqrt(cell.var_ln_K) + Math.abs(slope) * Math.sqrt(cell.var_n)];
  }
  const variance = cell.var_ln_K + slope * slope * cell.var_n + 2 * slope * cell.cov;
  return [value, Math.sqrt(Math.max(0, variance))];
};
