/* The connection to the dashboard: token to cookie, socket, frames, coming back. */
"use strict";

HC.Connection = class {
  /* handlers: hello, rows(first, count, values, epoch, answer), map(cellMm, table), taxels(cellMm, table), text(message),
     state(word, detail). */
  constructor(handlers) {
    this.handlers = handlers;
    this.waiting = new Map();
    this.nextId = 1;
    this.delay = 250;
    this.heard = 0;
  }

  async start() {
    await this.openSession();
    this.connect();
    setInterval(() => this.watch(), 500);
  }

  /* The token stands behind # in the address: handed over once, then taken out of sight. */
  async openSession() {
    const match = /[#&]token=([^&]+)/.exec(location.hash);
    if (!match) return;
    history.replaceState(null, "", location.pathname);
    const response = await fetch("/session", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ token: decodeURIComponent(match[1]) }),
    });
    if (!response.ok) this.refused = (await response.text()).trim();
  }

  connect() {
    this.handlers.state("connecting");
    this.opened = this.stalled = false;
    const socket = new WebSocket(`ws://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.opened = true;
      this.refused = "";
      this.delay = 250;
      this.heard = performance.now();
    };
    socket.onmessage = (event) => {
      this.heard = performance.now();
      if (this.stalled) this.handlers.state("connected"); // it goes on as if nothing had been
      this.stalled = false;
      if (typeof event.data === "string") this.onText(JSON.parse(event.data));
      else this.onFrame(event.data);
    };
    socket.onclose = (event) => {
      if (this.socket !== socket) return;
      for (const finish of this.waiting.values()) finish({ ok: false, message: "disconnected" });
      this.waiting.clear();
      const why = this.refused || event.reason ||
        (this.opened ? "" : "If this does not pass, open the page by the address that was printed");
      this.handlers.state("disconnected", why);
      setTimeout(() => this.connect(), this.delay);
      this.delay = Math.min(4000, 2 * this.delay);
    };
    this.socket = socket;
  }

  /* A status comes four times a second: without any the connection is dead, whatever it says. */
  watch() {
    if (this.opened && performance.now() - this.heard > 1500) {
      this.stalled = true;
      this.handlers.state("disconnected", "the dashboard does not answer");
      if (performance.now() - this.heard > 6000) this.socket.close();
    }
  }

  onText(message) {
    if (message.op === "answer") {
      const finish = this.waiting.get(message.id);
      this.waiting.delete(message.id);
      if (finish) finish(message);
      return;
    }
    if (message.op === "hello") {
      this.handlers.state("connected");
      this.handlers.hello(message);
    } else {
      this.handlers.text(message);
    }
  }

  onFrame(buffer) {
    const [kind, epoch, first, rows, columns, answer] = new Uint32Array(buffer, 0, 6);
    const values = new Float64Array(buffer, 24, rows * columns);
    if (kind === 1) this.handlers.rows(first, rows, values, epoch, answer === 1);
    else if (kind === 2) this.handlers.map(first / 1000, rows, columns, values);
    else if (kind === 3) this.handlers.taxels(first / 1000, rows, columns, values);
  }

  send(message) {
    if (this.socket && this.socket.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(message));
      return true;
    }
    return false;
  }

  /* Asks and resolves with the answer {ok, message, ...}; never rejects. */
  ask(message) {
    const id = this.nextId++;
    return new Promise((resolve) => {
      this.waiting.set(id, resolve);
      if (!this.send({ ...message, id })) {
        this.waiting.delete(id);
        resolve({ ok: false, message: "not connected" });
      }
    });
  }
};
