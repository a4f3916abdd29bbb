/* What happened: lanes of contact, fit and hypothesis over time, events as marks and as a list. */
"use strict";

HC.EVENTS = {
  1: ["tissue changed", "alarm"], 2: ["contact", "good"], 3: ["contact lost", "measured"],
  4: ["samples refused", "warn"], 5: ["reset", "accent"], 6: ["reconfigured", "accent"],
  7: ["time jumped", "warn"], 8: ["input silent", "alarm"], 9: ["input is back", "good"],
  10: ["input frozen", "alarm"], 11: ["input saturated", "alarm"], 12: ["source restarted", "warn"],
  13: ["two sources", "alarm"], 14: ["samples skipped", "warn"], 15: ["tared", "accent"],
  16: ["state loaded", "accent"], 17: ["law does not fit", "alarm"],
  18: ["not tared", "warn"], 19: ["readings cannot be right", "alarm"], 64: ["mark", "estimate"],
};
HC.eventName = (kind) => (HC.EVENTS[kind] || [`event ${kind}`, "measured"])[0];
HC.eventColour = (kind) => HC.palette[(HC.EVENTS[kind] || ["", "measured"])[1]];

/* Hypotheses: colours that are told apart by every eye, and a pattern of brightness. */
HC.HYPOTHESIS_COLOURS = ["#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00", "#cc79a7"];

HC.TimelinePanel = class {
  constructor(host, hypotheses) {
    this.host = host;
    this.list = host.querySelector("ol");
    this.hypotheses = hypotheses;
    this.events = [];
    this.view = { start: 0, end: 1 };
    this.chart = HC.chart(host.querySelector(".lanes"), {
      height: 104,
      x: { range: () => [this.view.start, this.view.end] },
      y: {
        range: () => [0, 4],
        axis: {
          splits: () => [0.5, 1.5, 2.5, 3.5],
          values: () => ["events", "leads", "law", "contact"],
          grid: { show: false }, ticks: { show: false }, size: 50,
        },
      },
      sync: "time",
      series: [{ stroke: "transparent", points: { show: false } }],
      hooks: { draw: [(plot) => this.draw(plot)] },
      tip: (plot, _i, left) => this.describe(plot.posToVal(left, "x"), plot),
    }, [[], []]);
  }

  setEvents(items) {
    this.events = items;
    this.fillList();
  }

  setOrigin(origin) {
    if (origin === this.origin) return;
    this.origin = origin;
    this.fillList();
  }

  fillList() {
    const items = this.events.slice(-40).reverse().map((event) => {
      const [name, colour] = HC.EVENTS[event.kind] || [`event ${event.kind}`, "measured"];
      const at = this.origin === null || this.origin === undefined ? NaN : event.time - this.origin;
      const reason = event.reason && event.reason !== name ? event.reason : "";
      const said = reason.includes(name) ? reason : reason ? `${name}: ${reason}` : name;
      return HC.element("li", {},
        HC.element("span", { class: "when", text: !isFinite(at) ? "" : at < 0 ? "before" : at.toFixed(1) + " s" }),
        HC.element("span", { class: `dot of-${colour}`, "aria-hidden": "true" }),
        HC.element("span", { text: said }));
    });
    this.list.replaceChildren(...items);
  }

  update(view) {
    this.view = view;
    const [time] = HC.take(view, [["time", "last"]]);
    this.lanes = HC.take(view, [["contact", "max"], ["mismatch", "max"], ["hypothesis", "last"]]);
    this.chart.plot.setData([time, time.map(() => null)], true);
  }

  draw(plot) {
    const { ctx } = plot;
    const { left, top, width, height } = plot.bbox;
    const px = (v) => plot.valToPos(v, "x", true);
    const lane = height / 4;
    const [time] = plot.data;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    const fill = (number, colourOf) => {
      for (let i = 0; i < time.length; i++) {
        const colour = colourOf(i);
        if (!colour) continue;
        const from = i ? px(time[i - 1]) : px(time[i]) - 2;
        ctx.fillStyle = colour;
        ctx.fillRect(from, top + number * lane + 0.18 * lane,
          Math.min(px(time[i]) - from, width / 8) + 1, 0.64 * lane);
      }
    };
    const [contact, mismatch, hypothesis] = this.lanes || [[], [], []];
    fill(0, (i) => (contact[i] ? HC.palette.good : null));
    fill(1, (i) => (contact[i] === null ? null : mismatch[i] ? HC.palette.alarm
      : contact[i] ? HC.onPanel(HC.palette.good, 0.35) : null));
    fill(2, (i) => (hypothesis[i] === null ? null : HC.HYPOTHESIS_COLOURS[hypothesis[i]]));
    for (const event of this.events) {
      const at = event.time - this.origin;
      if (!(at >= this.view.start && at <= this.view.end)) continue;
      ctx.fillStyle = HC.eventColour(event.kind);
      ctx.fillRect(px(at) - devicePixelRatio, top + 3.1 * lane, 2 * devicePixelRatio, 0.8 * lane);
    }
    ctx.restore();
  }

  describe(at, plot) {
    const near = 6 * (plot.scales.x.max - plot.scales.x.min) / Math.max(1, plot.over.clientWidth);
    const lines = this.events
      .filter((e) => Math.abs(e.time - this.origin - at) < near)
      .slice(-5)
      .map((e) => `${(e.time - this.origin).toFixed(2)} s  ${HC.eventName(e.kind)}  ${e.reason}`);
    const row = plot.valToIdx(at);
    const number = this.lanes && this.lanes[2] ? this.lanes[2][row] : null;
    if (number !== null && number !== undefined) lines.push(`leads: ${this.hypotheses[number]}`);
    return [`${at.toFixed(2)} s`, ...lines];
  }
};

/* Which hypothesis leads, with the score of each; delay, surface and zero where estimated. */
HC.HypothesisPanel = class {
  constructor(host, hypotheses) {
    this.hypotheses = hypotheses;
    this.note = host.querySelector(".note");
    this.rows = hypotheses.map((name, number) => {
      const bar = HC.element("meter", { min: 0, max: 1, value: 0, "aria-label": name });
      const figure = HC.element("span", { class: "figure", text: "–" });
      const row = HC.element("div", { class: `hypothesis number-${number}` },
        HC.element("span", { class: "name", text: name }), bar, figure);
      host.querySelector(".hypotheses").append(row);
      return { row, bar, figure };
    });
    this.faults = host.querySelector(".faults");
  }

  show(store) {
    const leads = store.last("hypothesis");
    const scores = this.hypotheses.map((_name, i) => store.last(`score_${i}`));
    const known = scores.filter((s) => isFinite(s));
    const best = Math.min(...known);
    this.rows.forEach(({ row, bar, figure }, number) => {
      row.classList.toggle("leads", number === leads);
      const score = scores[number];
      bar.value = isFinite(score) && score > 0 ? best / score : number === leads ? 1 : 0;
      HC.setText(figure, isFinite(score) ? HC.engineering(score, "N", 3)
        : number === leads ? "leads" : "–");
    });
    HC.setText(this.note, known.length
      ? "Error of the force that each foretold 0.05 to 0.4 s before; the longer the bar, the less. " +
        "The calmest one leads that errs no more than it admits."
      : isFinite(leads) ? "This filter follows one hypothesis: it gives no scores." : "");
    const delay = store.last("delay");
    const lines = [
      [!isFinite(store.last("delay_std")) ? "delay of the force" : delay < 0 ? "force ahead of the displacement by" : "force behind the displacement by",
        1000 * Math.abs(delay), 1000 * store.last("delay_std"), "ms"],
      ["surface at", store.last("contact_position"), store.last("contact_position_std"), "mm"],
      ["force zero", 1000 * store.last("force_zero"), 1000 * store.last("force_zero_std"), "mN"],
    ].map(([what, value, deviation, unit]) => isFinite(deviation)
      ? `${what} ${HC.withDeviation(value, 2 * deviation)} ${unit}`
      : `${what}: not estimated by this filter`);
    HC.setText(this.faults, isFinite(leads) ? lines.join("\n") : "");
  }
};
