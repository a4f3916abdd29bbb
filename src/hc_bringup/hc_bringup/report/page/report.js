/* The report of one run: the live page's charts over what was recorded, to look closer at. */
"use strict";

HC.MOST_PIECES = 6;

HC.Report = class {
  constructor(data) {
    this.data = data;
    const blocks = Object.fromEntries(
      Object.entries(data.blocks).map(([name, packed]) => [name, HC.numbers(packed)]));
    this.store = HC.fullStore(data.columns, data.rows, blocks);
    this.first = this.store.at(0, "time");
    this.last = this.store.last("time");
    HC.onZoom = (from, to) => this.show(from, to);
    const find = (id) => document.getElementById(id);
    this.parameters = HC.PARAMETERS.map((name) =>
      new HC.ParameterPanel(find("parameter-" + name), name));
    for (const name of HC.PARAMETERS) {
      HC.setText(find("parameter-" + name).querySelector("h2 small"), HC.MEANING[name]);
    }
    const depth = new HC.DepthPanel(find("depth"));
    depth.seconds = null; // whatever is shown
    this.timeline = new HC.TimelinePanel(find("timeline"), data.hypotheses);
    this.timeline.setOrigin(0);
    this.timeline.setEvents(data.events);
    this.panels = [...this.parameters, depth, new HC.ForcePanel(find("force")),
      new HC.ErrorPanel(find("error")), new HC.NisPanel(find("nis"), data.nis_band), this.timeline];
    this.hypotheses = new HC.HypothesisPanel(find("hypotheses"), data.hypotheses);
    if (find("map")) this.startMap(find("map"));
    find("theme").addEventListener("click", HC.toggleTheme);
    find("whole").addEventListener("click", () => this.show(null, null));
    this.showPieces(data.pieces);
    this.hypotheses.show(this.store);
  }

  /* Opens what lies between long gaps, the longest of it first, with a button for each. */
  showPieces(pieces) {
    this.show(null, null);
    if (!pieces.length) return;
    for (const [from, to] of pieces.slice(0, HC.MOST_PIECES)) {
      const button = document.createElement("button");
      button.type = "button";
      HC.setText(button, `${from.toFixed(0)} to ${to.toFixed(0)} s`);
      button.addEventListener("click", () => this.show(from, to));
      document.getElementById("pieces").append(button);
    }
    const longest = pieces.reduce((a, b) => b[1] - b[0] > a[1] - a[0] ? b : a);
    this.show(...longest);
  }

  startMap(host) {
    const output = host.querySelector("output");
    const slider = host.querySelector("input");
    const map = this.map = new HC.MapPanel(host, this.data.map_columns);
    slider.addEventListener("input", () =>
      HC.setText(output, Number(slider.value).toFixed(1) + " mm"));
    map.depth = Number(slider.value);
    map.told = this.data.map;
    map.setContacts(this.data.contacts);
    if (this.data.cell_count) {
      map.setCells(this.data.cell_mm, this.data.cell_count, this.data.map_columns.length,
        HC.numbers(this.data.cells));
    }
  }

  /* Shows a span of time, or the whole. */
  show(from, to) {
    const whole = from === null || !(to - from > 1e-6);
    const begin = whole ? this.first : Math.max(this.first, from);
    const end = whole ? this.last : Math.min(this.last, to);
    const view = this.store.view(Math.max(end - begin, 1e-6), end, 1200);
    view.start = begin;
    for (const panel of this.panels) {
      for (const range of [panel.range, panel.x, panel.y]) if (range) range.now = null;
      panel.update(view);
    }
    for (const panel of this.parameters) panel.show(this.store, Math.max(view.to - 1, 0));
    document.getElementById("whole").hidden = whole;
    const zoomed = document.getElementById("zoomed");
    zoomed.hidden = whole;
    HC.setText(zoomed, `${begin.toFixed(2)} to ${end.toFixed(2)} s`);
  }
};

HC.startTheme();
HC.report = new HC.Report(JSON.parse(document.getElementById("data").textContent));
