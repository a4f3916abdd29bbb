/* The palpation map: stiffness at a chosen depth over where the tip was, with its uncertainty.
   Along a line: a coloured strip above a profile with its band. Over a plane: coloured cells.
   Where no position is known, or all of it was at one place: over the contacts. */
"use strict";

HC.STRIP = 0.26; // share of the height

/* Steps between labels: of lengths, and of contacts, of which there are no halves. */
HC.STEPS = [-2, -1, 0, 1, 2, 3, 4].flatMap((power) => [1, 2, 2.5, 5].map((s) => s * 10 ** power));
HC.COUNTS = HC.STEPS.filter((step) => Number.isInteger(step));

HC.MapPanel = class {
  constructor(host, columns) {
    this.host = host;
    this.columns = columns;
    this.cells = [];
    this.contacts = [];
    this.depth = 2;
    this.told = null; // {depth, lump}: the hard spot that the words beside name, for that depth
    this.tip = [NaN, NaN];
    this.x = new HC.CalmRange(0.01);
    this.y = new HC.CalmRange(0.05, 0);
    this.kind = "empty";
    this.note = host.querySelector(".note");
    this.keys = host.querySelector(".keys");
    this.chart = HC.chart(host, {
      mode: 2,
      x: { label: "sideways [mm]", range: () => this.x.now || [0, 1],
        axis: { incrs: () => (this.kind === "contacts" ? HC.COUNTS : HC.STEPS) } },
      y: { label: "stiffness [N/mm]", range: () => this.y.now || [0, 1] },
      series: [{ stroke: () => HC.palette.ink, paths: (plot) => this.draw(plot) }],
      tip: (plot, _i, left, top) =>
        this.describe(plot.posToVal(left, "x"), plot.posToVal(top, "y")),
    }, [null, [[0, 1], [0, 1]]]);
    host.querySelector("input[type=range]").addEventListener("input", (event) => {
      this.depth = Number(event.target.value);
      this.refresh();
    });
  }

  setCells(cellMm, rows, width, values) {
    this.cellMm = cellMm;
    this.cells = [];
    for (let row = 0; row < rows; row++) {
      const cell = {};
      this.columns.forEach((name, i) => (cell[name] = values[row * width + i]));
      this.cells.push(cell);
    }
    this.refresh();
  }

  setContacts(contacts) {
    this.contacts = contacts;
    if (!this.cells.length || this.atOnePlace()) this.refresh();
  }

  /* True if the cells are neighbours at most: that is no map yet. */
  atOnePlace() {
    return ["x", "y"].every((axis) => {
      const [from, to] = HC.extent(this.cells.map((cell) => cell[axis]));
      return to - from < 1.5 * this.cellMm;
    });
  }

  /* What is shown, from cells or contacts: [{x, y, value, deviation}] sorted along x. */
  refresh() {
    let spots = this.cells;
    this.kind = "plane";
    if (!spots.length || (this.contacts.length && this.atOnePlace())) {
      this.kind = "contacts";
      spots = this.contacts.map((contact) => ({
        x: contact.number, y: 0, ln_K: Math.log(contact.parameters[0]), n: contact.parameters[2],
        var_ln_K: (contact.std[0] / contact.parameters[0]) ** 2, var_n: contact.std[2] ** 2,
        cov: contact.stiffness_exponent_covariance / contact.parameters[0],
        deepest: contact.peak_depth, count: 1,
      }));
    } else {
      const across = HC.extent(spots.map((s) => s.y));
      if (across[1] - across[0] < 2 * this.cellMm) this.kind = "line";
    }
    this.spots = spots.map((spot) => {
      const [value, relative] = HC.stiffnessAt(spot, this.depth);
      return { ...spot, value, deviation: value * relative };
    }).filter((spot) => isFinite(spot.value)).sort((a, b) => a.x - b.x);
    if (!this.spots.length) this.kind = "empty";
    this.setRanges();
    this.chart.plot.axes[0].label = this.kind === "contacts" ? "contact" : "sideways [mm]";
    this.chart.plot.axes[1].label =
      this.kind === "plane" ? "across [mm]" : `stiffness at ${this.depth.toFixed(1)} mm [N/mm]`;
    const noMap = this.kind === "empty" || (this.kind === "contacts" && this.cells.length);
    this.lump = noMap ? null : this.findLump();
    this.describeAll();
    this.chart.plot.setData([null, [[0, 1], [0, 1]]], true);
  }

  /* The hard spot at the depth that is shown, or null. */
  findLump() {
    if (this.told && this.told.depth === this.depth) {
      const { lump } = this.told;
      return lump && { ...lump, value: this.nearest(lump.x, lump.y).value };
    }
    const lump = HC.findLump(this.spots);
    // Where the way ends at its stiffest, the lump has not been passed: it may lie further on.
    if (lump && this.kind === "line") {
      const [from, to] = HC.extent(this.spots.map((s) => s.x));
      lump.passed = lump.x - from > 1.1 * this.cellMm && to - lump.x > 1.1 * this.cellMm;
    }
    return lump;
  }

  setRanges() {
    const half = this.kind === "contacts" ? 0.5 : this.cellMm / 2 || 0.5;
    const xs = HC.extent(this.spots.map((s) => s.x));
    const trusted = this.spots.filter((s) => s.deviation < 0.5 * s.value);
    this.colours = HC.colourRange(trusted.length ? trusted : this.spots);
    this.x = new HC.CalmRange(0.001);
    this.x.update(xs[0] - half, xs[1] + half);
    if (this.kind === "plane") {
      const ys = HC.extent(this.spots.map((s) => s.y));
      this.y.now = [ys[0] - half, ys[1] + half];
    } else {
      const high = HC.extent(trusted.map((s) => s.value + 2 * s.deviation));
      const highest = Math.max(this.colours[1], Math.min(high[1], 1.5 * this.colours[1])) || 1;
      this.y.now = [0, (1.06 * highest) / (1 - HC.STRIP)]; // the strip stands above the profile
    }
  }

  setTip(x, y) {
    if (x === this.tip[0] && y === this.tip[1]) return;
    const first = !isFinite(this.tip[0]);
    this.tip = [x, y];
    if (first) this.describeAll();
    this.chart.plot.redraw(false, false);
  }

  shade(spot) {
    const [low, high] = this.colours;
    const share = high > low ? (spot.value - low) / (high - low) : 0.5;
    // What is hardly known is pale: two deviations as large as the value are invisible.
    return HC.viridis(share, Math.max(0.08, 1 - 2 * spot.deviation / spot.value));
  }

  draw(plot) {
    const { ctx } = plot;
    const { left, top, width, height } = plot.bbox;
    const px = (v) => plot.valToPos(v, "x", true);
    const py = (v) => plot.valToPos(v, "y", true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    if (this.kind === "plane") this.drawPlane(ctx, px, py);
    else if (this.kind !== "empty") this.drawLine(ctx, px, py, top, height);
    this.drawTip(ctx, px, py, top, height);
    if (this.lump) this.drawLump(ctx, px, py, plot.bbox);
    ctx.restore();
    return null;
  }

  /* Where it is and what it is, beside it: who looks at the map need not read the headline. */
  drawLump(ctx, px, py, box) {
    const { x, y, value } = this.lump;
    const ratio = devicePixelRatio;
    let text = (this.lump.passed ? "hard spot: " : "harder to here: ") + HC.lumpFactor(this.lump);
    // Without a position it may as well be the tissue that changed with the time.
    if (this.kind === "contacts") text = `contact ${x}: ${HC.lumpFactor(this.lump)}`;
    const plane = this.kind === "plane";
    const [atX, atY] = [px(x), py(plane ? y : value)];
    ctx.strokeStyle = HC.palette.ink;
    ctx.lineWidth = 2 * ratio;
    ctx.beginPath();
    if (plane) ctx.arc(atX, atY, 10 * ratio, 0, 7);
    else ctx.arc(atX, atY, 5 * ratio, 0, 7);
    ctx.stroke();
    ctx.font = `600 ${12 * ratio}px system-ui, sans-serif`;
    let wide = ctx.measureText(text).width;
    if (wide + 12 * ratio > box.width) { // a narrow window: how much harder is what counts
      text = HC.lumpFactor(this.lump);
      wide = ctx.measureText(text).width;
    }
    // Along a line it stands at the foot, where nothing is drawn; over a plane beside the spot.
    const inside = (from) => Math.max(box.left + 6 * ratio,
      Math.min(box.left + box.width - wide - 6 * ratio, from));
    const left = plane && atX + 16 * ratio + wide > box.left + box.width
      ? inside(atX - wide - 16 * ratio) : inside(plane ? atX + 16 * ratio : atX - wide / 2);
    const line = plane ? atY + 4 * ratio : box.top + box.height - 12 * ratio;
    if (!plane) {
      ctx.lineWidth = ratio;
      ctx.setLineDash([3 * ratio, 3 * ratio]);
      ctx.beginPath();
      ctx.moveTo(atX, atY + 6 * ratio);
      ctx.lineTo(atX, line - 14 * ratio);
      ctx.stroke();
      ctx.setLineDash([]);
    }
    ctx.fillStyle = HC.withAlpha(HC.palette.panel, 0.85);
    ctx.fillRect(left - 4 * ratio, line - 12 * ratio, wide + 8 * ratio, 17 * ratio);
    ctx.fillStyle = HC.palette.ink;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.fillText(text, left, line);
  }

  drawPlane(ctx, px, py) {
    const half = this.cellMm / 2;
    for (const spot of this.spots) {
      const x = px(spot.x - half);
      const y = py(spot.y + half);
      ctx.fillStyle = this.shade(spot);
      ctx.fillRect(x, y, Math.ceil(px(spot.x + half) - x) + 1, Math.ceil(py(spot.y - half) - y) + 1);
    }
  }

  drawLine(ctx, px, py, top, height) {
    const half = this.kind === "contacts" ? 0.5 : this.cellMm / 2;
    const strip = (HC.STRIP - 0.04) * height;
    for (const spot of this.spots) {
      const x = px(spot.x - half);
      const wide = Math.ceil(px(spot.x + half) - x) + 1;
      ctx.fillStyle = this.shade(spot);
      ctx.fillRect(x, top, wide, strip);
      const low = py(Math.max(0, spot.value - 2 * spot.deviation));
      const high = Math.max(top + strip, py(spot.value + 2 * spot.deviation));
      ctx.fillStyle = HC.withAlpha(HC.palette.estimate, 0.25);
      if (low > high) ctx.fillRect(x, high, wide, low - high);
    }
    ctx.strokeStyle = HC.palette.estimate;
    ctx.lineWidth = 2 * devicePixelRatio;
    ctx.beginPath();
    const apart = (i) => !(Math.abs(this.spots[i].x - this.spots[i - 1]?.x) <= 2.5 * 2 * half);
    this.spots.forEach((spot, i) => {
      const at = [px(spot.x), py(spot.value)];
      if (apart(i)) ctx.moveTo(...at);
      else ctx.lineTo(...at);
    });
    ctx.stroke();
    // A place without neighbours has no line: its value would not be seen.
    const alone = (i) => apart(i) && (i + 1 === this.spots.length || apart(i + 1));
    ctx.fillStyle = HC.palette.estimate;
    this.spots.forEach((spot, i) => {
      if (this.kind !== "contacts" && !alone(i)) return;
      ctx.beginPath();
      ctx.arc(px(spot.x), py(spot.value), 3.5 * devicePixelRatio, 0, 7);
      ctx.fill();
    });
  }

  drawTip(ctx, px, py, top, height) {
    const [x, y] = this.tip;
    if (!isFinite(x) || this.kind === "contacts") return;
    ctx.beginPath();
    if (this.kind === "plane") {
      ctx.arc(px(x), py(y), 6 * devicePixelRatio, 0, 7);
    } else {
      ctx.moveTo(px(x), top);
      ctx.lineTo(px(x), top + height);
    }
    // With a rim in the colour of the panel it is seen on every colour of the map.
    for (const [colour, width] of [[HC.palette.panel, 5], [HC.palette.accent, 2]]) {
      ctx.strokeStyle = colour;
      ctx.lineWidth = width * devicePixelRatio;
      ctx.stroke();
    }
  }

  nearest(x, y) {
    let best = null;
    let least = Infinity;
    for (const spot of this.spots || []) {
      const far = Math.abs(spot.x - x) + (this.kind === "plane" ? Math.abs(spot.y - y) : 0);
      if (far < least) [best, least] = [spot, far];
    }
    return best;
  }

  describe(x, y) {
    const spot = this.nearest(x, y);
    if (!spot) return null;
    const where = this.kind === "contacts" ? `contact ${spot.x}` :
      this.kind === "plane" ? `${spot.x.toFixed(1)}, ${spot.y.toFixed(1)} mm` :
        `${spot.x.toFixed(1)} mm`;
    const lines = [where, `${HC.withDeviation(spot.value, 2 * spot.deviation)} N/mm`];
    if (this.depth > 1.05 * spot.deepest) {
      lines.push(`extrapolated: pressed ${spot.deepest.toFixed(1)} mm deep here`);
    }
    return lines;
  }

  describeAll() {
    let text = "";
    if (this.kind === "empty") {
      text = "Nothing felt yet.";
    } else {
      const deepest = HC.extent(this.spots.map((s) => s.deepest))[1];
      if (this.kind === "contacts") {
        text = this.cells.length ? "Pressed at one place: over the contacts."
          : "No position is known: over the contacts.";
      }
      if (this.kind === "plane") text = "The paler a cell, the less is known of it.";
      if (this.depth > 1.05 * deepest) {
        text += ` Extrapolated: nowhere was it pressed deeper than ${deepest.toFixed(1)} mm.`;
      }
    }
    HC.setText(this.note, text.trim());
    if (this.keys) {
      this.keys.hidden = this.kind === "empty";
      this.keys.querySelector(".estimate").hidden = this.kind === "plane";
      this.keys.querySelector(".tool").hidden = this.kind === "contacts" || !isFinite(this.tip[0]);
    }
    const [low, high] = this.colours || [NaN, NaN];
    const scale = this.host.querySelector(".scale");
    scale.hidden = !isFinite(low);
    if (!scale.hidden) {
      HC.setText(scale.querySelector(".low"), low.toFixed(HC.decimals(low, high / 50, 1)));
      HC.setText(scale.querySelector(".high"),
        high.toFixed(HC.decimals(high, high / 50, 1)) + " N/mm");
    }
  }
};

HC.distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);

/* What the ends of the colours mean. Not less than a tenth of the value, or two deviations to both
   sides: tissue that is the same everywhere has one colour, and not all from the softest on. */
HC.colourRange = function (spots) {
  const [low, high] = HC.extent(spots.map((s) => s.value));
  const sorted = spots.map((s) => s.deviation).filter(isFinite).sort((a, b) => a - b);
  const usual = sorted.length ? sorted[sorted.length >> 1] : 0;
  const middle = (low + high) / 2;
  const half = Math.max((high - low) / 2, 0.05 * middle, Math.min(2 * usual, middle));
  return [middle - half, middle + half];
};

/* The stiffest place, if it stands out of the rest by more than the uncertainty allows. */
HC.findLump = function (spots) {
  if (spots.length < 6) return null;
  // The lower quartile is what is around: a lump that takes up half of the way is not in it.
  const around = [...spots].sort((a, b) => a.value - b.value)[Math.floor(spots.length / 4)];
  const usual = around.value;
  const known = spots.filter((s) => s.deviation < 0.2 * s.value);
  if (!known.length) return null;
  const peak = known.reduce((a, b) => (b.value > a.value ? b : a));
  if (peak.value < 1.3 * usual || peak.value - usual < 4 * peak.deviation) return null;
  // One estimate that went astray is no lump: a neighbour must feel it too.
  const gap = Math.min(...known.filter((s) => s !== peak).map((s) => HC.distance(s, peak)));
  const neighbours = known.filter((s) => s !== peak && HC.distance(s, peak) < 2.1 * gap);
  if (!neighbours.some((s) => s.value > 1.15 * usual)) return null;
  const factor = peak.value / usual;
  const deviation = factor * Math.hypot(peak.deviation / peak.value, around.deviation / usual);
  return { x: peak.x, y: peak.y, value: peak.value, factor, deviation, passed: true };
};

/* How much harder, with two deviations; what is known better than to a tenth is not shown. */
HC.lumpFactor = function (lump) {
  const spread = Math.max(0.1, 2 * lump.deviation);
  return `${lump.factor.toFixed(1)} ± ${spread.toFixed(1)} times as stiff`;
};

HC.lumpPlace = function (map) {
  const { x, y } = map.lump;
  return map.kind === "plane" ? `(${x.toFixed(1)}, ${y.toFixed(1)}) mm` : `${x.toFixed(1)} mm`;
};
