/* A tactile array: the palpation map of all taxels at once. Taxels that never touched are missing. */
"use strict";

HC.TaxelPanel = class extends HC.MapPanel {
  constructor(host, columns) {
    super(host, columns);
    this.depth = 1;
  }

  /* One row or one taxel is a plane too. */
  refresh() {
    super.refresh();
    HC.setText(this.note, this.kind === "empty" ? "No taxel has touched yet."
      : "The paler a taxel, the less is known of it.");
  }

  setRanges() {
    if (this.kind !== "empty") this.kind = "plane";
    super.setRanges();
  }

  /* Size and load of the array, from the status; null where there is none. */
  show(taxels) {
    this.host.hidden = !taxels;
    if (!taxels) return;
    const { rows, columns, touched, touching, force, every } = taxels;
    let text = `${rows} × ${columns} taxels: ${touching} touch, ${touched} have touched; ` +
      `${HC.engineering(force, "N")} in all.`;
    if (every > 1) text += ` Of ${every} rows and columns one is shown.`;
    HC.setText(this.host.querySelector(".figures"), text);
  }

  describe(x, y) {
    const spot = this.nearest(x, y);
    if (!spot) return null;
    return [`${spot.x.toFixed(1)}, ${spot.y.toFixed(1)} mm from the middle`,
      `${HC.withDeviation(spot.value, 2 * spot.deviation)} N/mm`];
  }
};
