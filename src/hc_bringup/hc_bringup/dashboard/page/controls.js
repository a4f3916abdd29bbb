/* Controls: estimator, parameters with their ranges, services, recording, marks, rig. */
"use strict";

HC.Controls = class {
  constructor(host, connection, announce) {
    this.host = host;
    this.connection = connection;
    this.announce = announce;
    this.settings = { estimator: [], indenter: [] };
    this.changes = new Map();
    host.querySelectorAll("button[data-service]").forEach((button) => {
      button.addEventListener("click", () =>
        this.ask({ op: "call", node: "estimator", service: button.dataset.service }));
    });
    this.record = host.querySelector("#record");
    this.record.addEventListener("click", () => this.toggleRecording());
    host.querySelector("#mark-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.mark();
    });
    host.querySelector("#clear-map").addEventListener("click", () => this.ask({ op: "clear_map" }));
    for (const kind of ["filter", "state_space", "contact_model"]) {
      host.querySelector("#" + kind).addEventListener("change", (event) =>
        this.ask({ op: "set", node: "estimator", parameters: { [kind]: event.target.value } })
          .then(() => this.refresh()));
    }
    host.querySelector("#parameter-name").addEventListener("input", () => this.showParameter());
    host.querySelector("#parameter-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.stage();
    });
    host.querySelector("#apply").addEventListener("click", () => this.apply());
    host.querySelector("#discard").addEventListener("click", () => this.discard());
    host.querySelector("#rig-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.applyRig();
    });
  }

  allow(allowed) {
    this.allowed = allowed;
    this.host.querySelector(".read-only").hidden = allowed;
    this.host.querySelectorAll("fieldset").forEach((set) => (set.disabled = !allowed));
  }

  async ask(message) {
    const answer = await this.connection.ask(message);
    this.announce(answer.message || (answer.ok ? "done" : "failed"), !answer.ok);
    return answer;
  }

  mark() {
    const input = this.host.querySelector("#mark-text");
    this.ask({ op: "mark", text: input.value });
    input.value = "";
  }

  toggleRecording() {
    this.ask({ op: "record", on: !this.recording });
  }

  showRecording(status) {
    const own = status.recording || { on: false };
    this.recording = own.on;
    HC.setText(this.record, own.on ? "Stop recording" : "Start recording");
    this.record.setAttribute("aria-pressed", String(own.on));
    const lines = [];
    for (const [name, node] of Object.entries(status.nodes)) {
      const values = node.values;
      if (!values.bag || node.age_s > 2.5) continue;
      const size = Number(values.file_bytes || values.bytes || 0) / 1e6;
      lines.push(`${name}: ${values.bag.split("/").pop()}, ${size.toFixed(1)} MB, ` +
        `${values.dropped || 0} dropped`);
    }
    if (own.failure) lines.push(own.failure);
    if (!own.on && own.bag && !own.failure) lines.push(`recorded: ${own.bag.split("/").pop()}`);
    HC.setText(this.host.querySelector("#recordings"), lines.join("\n"));
    return own.on || lines.length > 0;
  }

  /* Reads all settings of both nodes again. */
  async refresh() {
    for (const node of ["estimator", "indenter"]) {
      const answer = await this.connection.ask({ op: "settings", node });
      this.settings[node] = answer.ok ? answer.parameters : [];
    }
    this.fill();
  }

  setting(node, name) {
    return this.settings[node].find((entry) => entry.name === name);
  }

  fill() {
    for (const kind of ["filter", "state_space", "contact_model"]) {
      const select = this.host.querySelector("#" + kind);
      const entry = this.setting("estimator", kind);
      const choices = (entry && entry.choices) || [];
      select.replaceChildren(...choices.map((choice) =>
        HC.element("option", { value: choice, text: choice, selected: choice === entry.value })));
      select.disabled = !choices.length;
    }
    const names = this.settings.estimator.filter((entry) => !entry.read_only);
    this.host.querySelector("#parameter-names").replaceChildren(
      ...names.map((entry) => HC.element("option", { value: entry.name })));
    this.showParameter();
    this.fillRig();
  }

  limits(entry) {
    if (entry.choices) return "one of " + entry.choices.join(", ");
    if (entry.suggestions) return "a name from the list, or a file of your own";
    if (entry.type === "bool") return "true or false";
    if (entry.from === undefined) return entry.type === "text" ? "a text" : "any " + entry.type;
    const text = (v) => (Math.abs(v) >= 1e15 || !isFinite(v) ? (v < 0 ? "-∞" : "∞") : String(v));
    return `${entry.type === "integer" ? "whole numbers " : ""}${text(entry.from)} to ` +
      text(entry.to);
  }

  showParameter() {
    const name = this.host.querySelector("#parameter-name").value;
    const entry = this.setting("estimator", name);
    const input = this.host.querySelector("#parameter-value");
    const about = this.host.querySelector("#parameter-about");
    input.disabled = !entry || entry.read_only;
    if (!entry) {
      HC.setText(about, name ? "No parameter of that name." : "");
      return;
    }
    if (this.shown !== name) input.value = this.asText(entry.value);
    this.shown = name;
    HC.setText(about, `${entry.about} Now ${this.asText(entry.value)}; ${this.limits(entry)}.`);
  }

  asText(value) {
    return Array.isArray(value) ? value.join(", ") : String(value);
  }

  /* Reads what was typed in the type that the parameter has; throws what is wrong with it. */
  parse(entry, text) {
    const trimmed = text.trim();
    if (entry.type === "bool") {
      if (!["true", "false"].includes(trimmed)) throw new Error("true or false");
      return trimmed === "true";
    }
    if (entry.type === "integer" || entry.type === "number") {
      const value = Number(trimmed);
      if (trimmed === "" || Number.isNaN(value)) throw new Error("a number");
      if (entry.from !== undefined && !(value >= entry.from && value <= entry.to)) {
        throw new Error(this.limits(entry));
      }
      return value;
    }
    if (entry.type === "numbers") return trimmed.split(/[ ,]+/).map(Number);
    if (entry.type === "texts") return trimmed.split(/ *, */);
    if (entry.choices && !entry.choices.includes(trimmed)) throw new Error(this.limits(entry));
    return trimmed;
  }

  stage() {
    const name = this.host.querySelector("#parameter-name").value;
    const entry = this.setting("estimator", name);
    if (!entry) return;
    try {
      this.changes.set(name, this.parse(entry, this.host.querySelector("#parameter-value").value));
    } catch (error) {
      this.announce(`${name} must be ${error.message}`, true);
      return;
    }
    this.showChanges();
  }

  showChanges() {
    const items = [...this.changes].map(([name, value]) => HC.element("li", {},
      HC.element("span", { text: `${name} = ${this.asText(value)}` }),
      HC.element("button", { type: "button", class: "plain", text: "×",
        "aria-label": `leave out ${name}`,
        onclick: () => {
          this.changes.delete(name);
          this.showChanges();
        } })));
    this.host.querySelector("#changes").replaceChildren(...items);
    const apply = this.host.querySelector("#apply");
    apply.disabled = this.host.querySelector("#discard").disabled = !this.changes.size;
    HC.setText(apply, this.changes.size > 1 ? `Apply all ${this.changes.size}` : "Apply");
  }

  async apply() {
    const answer = await this.ask(
      { op: "set", node: "estimator", parameters: Object.fromEntries(this.changes) });
    if (answer.ok) this.changes.clear();
    this.showChanges();
    this.shown = null;
    await this.refresh();
  }

  discard() {
    this.changes.clear();
    this.showChanges();
  }

  fillRig() {
    const box = this.host.querySelector("#rig");
    const entries = this.settings.indenter.filter((entry) => !entry.read_only &&
      (entry.type !== "integer" || !entry.name.startsWith("expected_")));
    box.hidden = !entries.length;
    const scenario = this.setting("indenter", "scenario");
    HC.setText(this.host.querySelector("#scenario-name"), scenario ? `${scenario.value}` : "");
    const focused = document.activeElement && document.activeElement.name;
    if (focused && entries.some((entry) => entry.name === focused)) return; // being typed into
    const lists = [];
    const fields = entries.map((entry) => {
      const common = { name: entry.name, id: "rig-" + entry.name, "data-type": entry.type };
      let field;
      if (entry.type === "bool") {
        field = HC.element("input", { ...common, type: "checkbox", checked: entry.value });
      } else if (entry.choices) {
        field = HC.element("select", common, ...entry.choices.map((choice) =>
          HC.element("option", { value: choice, text: choice, selected: choice === entry.value })));
      } else {
        const list = entry.suggestions ? `rig-${entry.name}-names` : null;
        field = HC.element("input", { ...common, type: "text", list,
          inputmode: entry.type === "text" ? null : "decimal",
          value: this.asText(entry.value), autocomplete: "off" });
        if (list) {
          lists.push(HC.element("datalist", { id: list },
            ...entry.suggestions.map((name) => HC.element("option", { value: name }))));
        }
      }
      return HC.element("label", { for: "rig-" + entry.name },
        HC.element("span", { text: entry.name.replaceAll("_", " ") }), field,
        HC.element("small", { text: `${entry.about}; ${this.limits(entry)}` }));
    });
    this.host.querySelector("#rig-fields").replaceChildren(...fields, ...lists);
  }

  async applyRig() {
    const changes = {};
    for (const entry of this.settings.indenter) {
      const field = this.host.querySelector(`[name="${CSS.escape(entry.name)}"]`);
      if (!field) continue;
      let value;
      try {
        value = field.type === "checkbox" ? field.checked : this.parse(entry, field.value);
      } catch (error) {
        this.announce(`${entry.name} must be ${error.message}`, true);
        field.focus();
        return;
      }
      if (this.asText(value) !== this.asText(entry.value)) changes[entry.name] = value;
    }
    if (!Object.keys(changes).length) {
      this.announce("nothing was changed", false);
      return;
    }
    document.activeElement.blur();
    await this.ask({ op: "set", node: "indenter", parameters: changes });
    await this.refresh();
  }
};
