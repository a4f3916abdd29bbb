/* The page: connection to panels, twenty drawings a second at most, keys. */
"use strict";

HC.FRAME_MS = 45;
HC.STATUS_LATE_S = 1; // a status comes four times a second: later ones are held up on the way
HC.PAUSE_S = 0.5; // a silence that a status told of goes on, for all that is known

HC.App = class {
  constructor() {
    this.seconds = 30;
    this.frozen = false;
    this.panels = [];
    this.lastDrawn = 0;
    this.asked = false;
    this.status = null;
    this.connection = new HC.Connection({
      hello: (message) => this.hello(message),
      rows: (...frame) => this.rows(...frame),
      map: (cell, rows, columns, values) => this.map && this.map.setCells(cell, rows, columns, values),
      taxels: (pitch, rows, columns, values) =>
        this.taxels && this.taxels.setCells(pitch, rows, columns, values),
      text: (message) => this.text(message),
      state: (word, detail) => this.connectionState(word, detail),
    });
    this.controls = new HC.Controls(document.getElementById("controls"), this.connection,
      (text, bad) => this.announce(text, bad));
  }

  start() {
    HC.startTheme();
    HC.onSight = () => (this.changed = true);
    this.listen();
    this.connection.start();
    requestAnimationFrame((now) => this.draw(now));
    setInterval(() => this.judge(), 250);
  }

  /* The server says what the columns are; from then on there is something to draw. */
  hello(message) {
    if (!this.store) this.build(message);
    this.controls.allow(message.control);
    if (message.space) { // of several pages each says whose it is
      document.title = `hc ${message.space}: soft tissue, live`;
      HC.setText(document.querySelector("h1"), `hc ${message.space}`);
    }
    this.refreshControls();
    const kept = this.life === message.life && this.store.epoch === message.epoch &&
      message.rows >= this.store.count;
    this.life = message.life;
    const oldest = Math.max(0, message.rows - this.store.capacity);
    if (!kept || this.store.count < oldest) this.store.clear(message.epoch, oldest);
    this.askRows();
  }

  build(message) {
    this.store = new HC.Store(message.columns, 30000);
    const host = document.getElementById("parameters");
    for (const name of HC.PARAMETERS) {
      const card = HC.element("section", { class: "panel card", id: "parameter-" + name,
        "aria-label": `${name}, ${HC.MEANING[name]}` },
      HC.element("h2", {}, HC.element("b", { text: name }),
        HC.element("small", { text: HC.MEANING[name] })),
      HC.element("p", { class: "big" }, HC.element("span", { class: "value", text: "–" })),
      HC.element("p", { class: "under" },
        HC.element("span", { class: "unit", text: HC.UNITS[name] }),
        HC.element("span", { class: "true key truth", hidden: true })),
      HC.element("p", { class: "under" },
        HC.element("meter", { class: "known", min: 0, max: 1, low: 0.5, high: 0.8, optimum: 1,
          value: 0, "aria-label": `${name} known from the data` }),
        HC.element("span", { class: "share" })));
      host.append(card);
    }
    host.append(HC.element("p", { class: "under zeros", hidden: true }));
    const find = (id) => document.getElementById(id);
    this.parameters = HC.PARAMETERS.map((name) =>
      new HC.ParameterPanel(find("parameter-" + name), name));
    this.map = new HC.MapPanel(find("map"), message.map_columns);
    this.timeline = new HC.TimelinePanel(find("timeline"), message.hypotheses);
    this.hypotheses = new HC.HypothesisPanel(find("hypotheses"), message.hypotheses);
    this.health = new HC.HealthPanel(find("health"), message.latency_edges);
    this.panels = [...this.parameters, new HC.DepthPanel(find("depth")),
      new HC.ForcePanel(find("force")), new HC.ErrorPanel(find("error")),
      new HC.NisPanel(find("nis"), message.nis_band), this.timeline];
    this.taxels = new HC.TaxelPanel(find("taxels"), message.map_columns);
    for (const name of ["map", "taxels"]) {
      const output = find(name).querySelector("output");
      find(name).querySelector("input").addEventListener("input", (event) =>
        HC.setText(output, Number(event.target.value).toFixed(1) + " mm"));
    }
  }

  /* Rows are numbered. Where some are missing (a page that slept) they are asked for; what is not
     kept any more is a gap. */
  rows(first, count, values, epoch, answer) {
    if (!this.store) return;
    if (epoch !== this.store.epoch) {
      if (answer) return;
      this.store.clear(epoch, 0);
      this.asked = false;
    }
    if (answer) {
      this.asked = false;
      if (first > this.store.count) this.store.clear(epoch, first);
    }
    if (this.store.add(first, count, values)) this.changed = true;
    else if (!this.asked) this.askRows();
  }

  askRows() {
    this.asked = this.connection.send(
      { op: "rows", epoch: this.store.epoch, from: this.store.count });
  }

  text(message) {
    if (!this.store) return;
    if (message.op === "status") {
      this.status = message;
      this.statusAt = performance.now();
      this.health.show(message);
      this.taxels.show(message.taxels);
      this.showZeros(message.zero_effect);
      this.showMap();
      this.timeline.setOrigin(message.origin);
      document.getElementById("record").classList.toggle("on",
        !!(message.recording && message.recording.on));
      this.controls.showRecording(message);
      const revision = message.configuration.revision;
      if (revision !== this.revision) this.refreshControls();
      this.revision = revision;
    } else if (message.op === "events") {
      this.timeline.setEvents(message.items);
      this.changed = true;
    } else if (message.op === "contacts") {
      this.map.setContacts(message.items);
      this.showMap();
    }
  }

  /* How much of K hangs on zeros that nobody has called unsure. */
  showZeros(sentence) {
    const note = document.querySelector("#parameters .zeros");
    HC.setText(note, sentence);
    note.hidden = !sentence;
  }

  /* Where no position is known and no contact has ended there is no map: its room is the law's. */
  showMap() {
    const nothing = this.map.kind === "empty" && !(this.status && this.status.tip);
    document.getElementById("map").hidden = nothing;
    document.getElementById("depth").classList.toggle("full", nothing);
  }

  /* Settings are read only for who looks at them. */
  refreshControls() {
    if (!document.getElementById("controls").hidden) this.controls.refresh();
  }

  draw(now) {
    requestAnimationFrame((later) => this.draw(later));
    if (!this.store || this.store.empty || now - this.lastDrawn < HC.FRAME_MS) return;
    if (this.frozen || (!this.changed && this.drawnSeconds === this.seconds)) return;
    this.changed = false;
    this.drawnSeconds = this.seconds;
    this.lastDrawn = now;
    const end = this.store.last("time");
    const view = this.store.view(this.seconds, end, 700);
    for (const panel of this.panels) if (panel.chart.visible) panel.update(view);
    this.map.setTip(this.store.last("tip_x"), this.store.last("tip_y"));
  }

  /* Words and figures four times a second: faster nobody reads. */
  judge() {
    const word = this.word();
    const state = document.getElementById("state");
    HC.setText(state, word[0]);
    state.dataset.level = word[1];
    const banner = document.getElementById("banner");
    HC.setText(banner, word[2] || "");
    banner.dataset.level = word[3] || word[1];
    banner.hidden = !word[2];
    if (!this.store || this.frozen) return;
    if (!this.store.empty) {
      for (const panel of this.parameters) panel.show(this.store);
      this.hypotheses.show(this.store);
    }
    const sentences = HC.sentences(this.store, this.map, this.status);
    if (word[1] === "bad") sentences.unshift("Last heard:");
    HC.setText(document.getElementById("headline"), sentences.join(" "));
  }

  /* State in a word, its level, a line for the banner where something is wrong, and its level. */
  word() {
    if (this.state !== "connected") {
      return [this.state || "connecting", "bad",
        this.state === "disconnected"
          ? `Not connected: what you see is old. ${this.why || "Trying again."}` : ""];
    }
    const status = this.status;
    if (!status) return ["waiting", "idle", ""];
    if (status.silent_s === null) { // of a stream that has stopped before somebody looked, too
      const reason = HC.reasonOf(status.nodes);
      if (reason) return ["no samples", "warn", `No samples since this page was opened. ${reason}`, "bad"];
      return ["no samples yet", "idle", "No samples yet: is a rig or a robot running?"];
    }
    const late = (performance.now() - this.statusAt) / 1000;
    if (late > HC.STATUS_LATE_S && status.silent_s <= HC.PAUSE_S) {
      return ["slow connection", "bad",
        `The connection is slow: what you see is old, by ${late.toFixed(0)} s at least.`];
    }
    const silent = status.silent_s + late;
    if (status.silent_s > HC.PAUSE_S && silent > 1) {
      const what = status.estimating ? "estimates" : "samples";
      const why = HC.reasonOf(status.nodes) || HC.silenceOf(status.nodes);
      return ["stopped", "bad",
        `Stopped: no ${what} for ${silent.toFixed(0)} s. ${why}`.trim()];
    }
    const wrong = HC.errorsOf(status.nodes);
    if (this.frozen) return ["frozen", "idle", wrong, "bad"];
    if (!this.store || this.store.empty) return ["waiting", "idle", wrong, "bad"];
    if (this.store.last("mismatch")) return ["law does not fit", "warn", wrong, "bad"];
    const touches = this.store.last("contact");
    return touches ? ["in contact", "good", wrong, "bad"] : ["in the air", "idle", wrong, "bad"];
  }

  connectionState(word, why) {
    if (word === "connecting" && this.state === "disconnected") return;
    this.state = word;
    this.why = why;
    this.judge();
  }

  announce(text, bad) {
    const message = document.getElementById("message");
    HC.setText(message, text);
    message.dataset.level = bad ? "bad" : "good";
    message.hidden = false;
    clearTimeout(this.silence);
    this.silence = setTimeout(() => (message.hidden = true), bad ? 8000 : 4000);
  }

  freeze(on) {
    this.frozen = on;
    this.changed = true;
    const button = document.getElementById("freeze");
    button.setAttribute("aria-pressed", String(on));
    HC.setText(button, on ? "Go on" : "Freeze");
    this.judge();
  }

  showControls(open) {
    document.getElementById("controls").hidden = !open;
    document.body.classList.toggle("with-controls", open);
    document.getElementById("open-controls").setAttribute("aria-expanded", String(open));
    if (open) this.controls.refresh();
    if (open) this.before = document.activeElement; // the page itself, where a key opened them
    const back = this.before === document.body ? null : document.getElementById("open-controls");
    if (open) document.getElementById("close-controls").focus();
    else if (back) back.focus();
    else document.activeElement.blur(); // so that space freezes again, and presses no button
  }

  setWindow(index) {
    const select = document.getElementById("window");
    if (index >= select.options.length) return;
    select.selectedIndex = index;
    this.seconds = Number(select.value);
    this.changed = true;
  }

  listen() {
    const find = (id) => document.getElementById(id);
    const controls = find("controls");
    const actions = {
      " ": () => this.freeze(!this.frozen),
      c: () => this.showControls(controls.hidden),
      m: () => this.controls.mark(),
      r: () => this.controls.toggleRecording(),
      t: () => HC.toggleTheme(),
      "?": () => find("keys").showModal(),
    };
    find("window").addEventListener("change", (e) => this.setWindow(e.target.selectedIndex));
    find("freeze").addEventListener("click", actions[" "]);
    find("open-controls").addEventListener("click", actions.c);
    find("close-controls").addEventListener("click", actions.c);
    find("theme").addEventListener("click", actions.t);
    find("help").addEventListener("click", actions["?"]);
    document.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "Escape" && !controls.hidden) this.showControls(false);
      const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName);
      const pressing = event.key === " " && /^(BUTTON|SUMMARY|A)$/.test(event.target.tagName);
      if (typing || pressing || find("keys").open) return;
      if (/^[1-9]$/.test(event.key)) this.setWindow(Number(event.key) - 1);
      else if (actions[event.key]) actions[event.key]();
      else return;
      event.preventDefault();
    });
  }
};

HC.app = new HC.App();
HC.app.start();
