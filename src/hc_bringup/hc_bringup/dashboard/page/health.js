/* Rates, losses, latency, processor use; and the sentence on top that says what is felt. */
"use strict";

HC.HealthPanel = class {
  constructor(host, edges) {
    this.host = host;
    this.edges = edges;
    this.counts = edges.map(() => 0);
    this.figures = host.querySelector(".figures");
    this.nodes = host.querySelector("tbody");
    const milli = edges.map((edge) => 1000 * edge);
    this.chart = HC.chart(host.querySelector(".latency"), {
      height: 120,
      padding: [6, 18, 0, 18],
      x: {
        label: "latency of the estimates in the last 10 s [ms]",
        range: () => [0.01, 1000],
        scale: { distr: 3 },
        axis: { space: 40, values: (_u, splits) => splits.map((v) => (v === null ? "" : String(v))) },
      },
      y: { range: (_u, _low, high) => [0, Math.max(1, high || 1)], axis: { show: false } },
      series: [{ stroke: () => HC.palette.estimate, fill: HC.bandFill("estimate", 0.5), width: 1,
        points: { show: false }, paths: uPlot.paths.bars({ size: [0.9, 60], align: -1 }) }],
      tip: (plot, i) => (i === null || i === undefined || !plot.data[1][i] ? null
        : [`up to ${plot.data[0][i].toPrecision(2)} ms: ${plot.data[1][i]}`]),
    }, [milli, milli.map(() => 0)]);
  }

  quantile(counts, share) {
    const total = counts.reduce((a, b) => a + b, 0);
    if (!total) return NaN;
    let seen = 0;
    for (let i = 0; i < counts.length; i++) {
      seen += counts[i];
      if (seen >= share * total) return i < this.edges.length ? this.edges[i] : Infinity;
    }
    return Infinity;
  }

  show(status) {
    const upTo = (share) => {
      const value = this.quantile(status.latency, share);
      if (value === Infinity) return "> 1 s";
      return isFinite(value) ? "≤ " + HC.engineering(value, "s", 2) : "–";
    };
    const figures = [
      ["rate", status.rate_hz.toFixed(0) + " Hz"],
      ["lost", String(status.lost)],
      ["refused", String(status.rejected)],
      ["latency 50 %", upTo(0.5)],
      ["99 %", upTo(0.99)],
      ["pages open", String(status.viewers)],
    ];
    this.figures.replaceChildren(...figures.map(([name, value]) => HC.element("div", {},
      HC.element("dt", { text: name }), HC.element("dd", { text: value }))));
    const levels = ["ok", "warning", "error", "stale"];
    this.nodes.replaceChildren(...Object.entries(status.nodes).sort().map(([name, node]) => {
      const gone = node.age_s > 2.5;
      const level = gone ? "stale" : levels[node.level] || "ok";
      const cpu = node.values.cpu_percent;
      return HC.element("tr", { class: `is-${level}` },
        HC.element("td", { text: name }),
        HC.element("td", { class: "number",
          text: gone || cpu === undefined ? "–" : Number(cpu).toFixed(0) + " %" }),
        HC.element("td", { text: gone ? `silent for ${node.age_s.toFixed(0)} s` : node.message }));
    }));
    this.chart.plot.setData([this.edges.map((e) => 1000 * e), status.latency.slice(0, -1)], true);
  }
};

HC.WARNING = 1; // levels of diagnostic_msgs/DiagnosticStatus
HC.ERROR = 2;

/* What the estimator says is wrong, at such a level or above; nothing where it is gone. */
HC.reasonOf = function (nodes, least = HC.WARNING) {
  const estimator = (nodes || {}).estimator;
  if (!estimator || estimator.age_s > 2.5 || !(estimator.level >= least)) return "";
  return `The estimator says: ${estimator.message}.`;
};

/* What any node calls an error, the estimator first: a recorder that cannot write says it nowhere else. */
HC.errorsOf = function (nodes) {
  const others = Object.entries(nodes || {}).sort().filter(([name, node]) =>
    name !== "estimator" && node.level === HC.ERROR && node.age_s <= 2.5);
  return [HC.reasonOf(nodes, HC.ERROR),
    ...others.map(([name, node]) => `The ${name} says: ${node.message}.`)].filter(Boolean).join(" ");
};

/* That the estimator says nothing at all, where it once did. */
HC.silenceOf = function (nodes) {
  const estimator = (nodes || {}).estimator;
  if (!estimator || estimator.age_s <= 2.5) return "";
  return `The estimator has said nothing for ${estimator.age_s.toFixed(0)} s: it was stopped, or has ended.`;
};

/* A tool is never so deep in soft tissue: the contact position was never set. */
HC.BEYOND_REASON_MM = 50;

/* Words for what is felt: one or two sentences that need no knowledge of filters. */
HC.sentences = function (store, map, status) {
  if (store.empty) {
    return [HC.reasonOf(status && status.nodes) ? "Waiting for samples." : "Waiting for the first samples."];
  }
  if (!isFinite(store.last("K"))) {
    return ["Samples come, but nobody estimates: start the estimator node."];
  }
  const out = [];
  if (map && map.lump && map.kind !== "contacts") {
    out.push(map.lump.passed
      ? `A hard spot at ${HC.lumpPlace(map)}: ${HC.lumpFactor(map.lump)} as around it.`
      : `Harder up to ${HC.lumpPlace(map)}, where the map ends: ${HC.lumpFactor(map.lump)} so far.`);
  }
  const K = store.last("K");
  const n = store.last("n");
  const known = store.last("K_known");
  const reading = store.last("displacement");
  if (Math.abs(reading) > HC.BEYOND_REASON_MM) {
    out.push(`The depth reads ${reading.toFixed(0)} mm, beyond reason: was nothing tared? ` +
      "Rest the tool just off the surface and tare.");
  } else if (!store.last("contact")) {
    out.push("The tool is in the air.");
  }
  if (!(known > 0.5)) {
    const reason = HC.reasonOf(status && status.nodes);
    out.push(reason ? `Nothing is known of the tissue. ${reason}`
      : "Nothing is known of the tissue yet: press and move.");
    return out;
  }
  if (store.last("contact")) {
    const depth = Math.max(0, store.last("displacement"));
    const [value, deviation] = HC.stiffnessOf(store, Math.max(depth, 0.05));
    out.push(`In contact, ${depth.toFixed(1)} mm deep: here the tissue resists with ` +
      `${HC.withDeviation(value, 2 * deviation, 1)} N/mm.`);
  } else {
    out.push(`The tissue last felt takes ${HC.engineering(K * 2 ** n, "N", 3)} for 2 mm.`);
  }
  if (store.last("mismatch")) {
    out.push(status && status.explanation ? `The contact law does not fit: ${status.explanation}.`
      : "The contact law does not fit what the sensors say.");
  }
  return out;
};

HC.stiffnessOf = function (store, depth) {
  const K = store.last("K");
  const [value, relative] = HC.stiffnessAt({
    ln_K: Math.log(K), n: store.last("n"), var_ln_K: (store.last("K_std") / K) ** 2,
    var_n: store.last("n_std") ** 2, cov: store.last("K_n_covariance") / K,
  }, depth);
  return [value, value * relative];
};
