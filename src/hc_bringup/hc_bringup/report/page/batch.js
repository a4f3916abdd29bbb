/* A batch: one point for each recording, a chart for each parameter. */
"use strict";

HC.BATCH_COLOURS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00"];

HC.WHOLE_STEPS = [0, 1, 2, 3, 4, 5].flatMap((power) => [1, 2, 5].map((s) => s * 10 ** power));

HC.batchChart = function (host, name, variants) {
  // Side by side, so that equal ones do not hide one another.
  const aside = (i) => 0.1 * (i - 0.5 * (variants.length - 1));
  const tables = variants.map((v, i) => [
    v.number.map((x) => x + aside(i)), v[name].map((x) => (isFinite(x) ? x : null))]);
  const data = uPlot.join(tables);
  const numbers = data[0];
  const values = variants.flatMap((v) => v[name].filter(isFinite)).sort((a, b) => a - b);
  const low = values[Math.floor(0.01 * (values.length - 1))] ?? 0;
  const high = values[Math.ceil(0.99 * (values.length - 1))] ?? 1;
  const margin = 0.1 * (high - low) || 0.1 * Math.abs(high) || 1;
  HC.chart(host, {
    height: 210,
    x: { label: "recording", range: () => [0, Math.ceil(numbers.at(-1) ?? 0) + 1],
      axis: { incrs: HC.WHOLE_STEPS } },
    y: { range: () => [Math.max(0, low - margin), high + margin], axis: { size: HC.labelRoom(54) } },
    series: variants.map((_, i) => ({
      stroke: HC.BATCH_COLOURS[i], paths: () => null,
      points: { show: true, size: variants[i].number.length > 500 ? 3 : 6,
        fill: HC.BATCH_COLOURS[i] },
    })),
    tip: (plot, i) => {
      if (i === null || i === undefined) return null;
      const number = Math.round(plot.data[0][i]);
      const lines = [`recording ${number}`];
      for (const v of variants) {
        const at = v.number.indexOf(number);
        if (at < 0) continue;
        const deviation = v[name + "_std"] ? v[name + "_std"][at] : 0;
        lines.push(`${v.label} ${HC.withDeviation(v[name][at], 2 * deviation)}`.trim());
      }
      return lines;
    },
  }, data);
};

HC.batchKey = function (host, variants) {
  variants.forEach((v, i) => {
    const mark = HC.element("span", { text: "● " });
    mark.style.color = HC.BATCH_COLOURS[i];
    host.append(HC.element("span", {}, mark, v.label), "    ");
  });
};

HC.startBatch = function (data) {
  const variants = data.variants.map((v) => ({
    label: v.label,
    ...Object.fromEntries(Object.entries(v).filter(([name]) => name !== "label")
      .map(([name, packed]) => [name, Array.from(HC.numbers(packed))])),
  })).filter((v) => v.number.length);
  if (variants.length > 1) HC.batchKey(document.getElementById("key"), variants);
  for (const host of document.querySelectorAll("[data-curve]")) {
    if (variants.length) HC.batchChart(host, host.dataset.curve, variants);
    else host.hidden = true;
  }
  document.getElementById("theme").addEventListener("click", HC.toggleTheme);
};

HC.startTheme();
HC.startBatch(JSON.parse(document.getElementById("data").textContent));
