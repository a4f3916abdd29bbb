/* Force over depth: what was measured lately, and the law that was fitted, with its band. */
"use strict";

HC.DepthPanel = class {
  constructor(host) {
    this.x = new HC.CalmRange(0.02);
    this.y = new HC.CalmRange(0.02);
    this.seconds = 4;
    this.chart = HC.chart(host, {
      mode: 2,
      x: { label: "depth [mm]", range: () => this.x.now || [0, 1] },
      y: { label: "force [N]", range: () => this.y.now || [0, 1] },
      series: [
        { stroke: () => HC.palette.measured, paths: (u, s) => this.points(u, s) },
        { stroke: () => HC.palette.estimate, paths: (u, s) => this.band(u, s) },
        { stroke: () => HC.palette.estimate, paths: (u, s) => this.law(u, s) },
      ],
      tip: (plot, _i, left, top) => [
        `${plot.posToVal(left, "x").toFixed(2)} mm`, `${plot.posToVal(top, "y").toFixed(3)} N`,
        ...this.atDepth(plot.posToVal(left, "x")),
      ],
    }, [null, [[0], [0]], [[0], [0]], [[0], [0]]]);
  }

  /* The law's elastic force at a depth and its deviation. */
  elastic(depth) {
    const { K, n, K_std: sK, n_std: sn, K_n_covariance: both } = this.now;
    if (!(depth > 0)) return [0, 0];
    const force = K * depth ** n;
    const log = Math.log(depth);
    const variance = (sK / K) ** 2 + 2 * log * both / K + (log * sn) ** 2;
    return [force, force * Math.sqrt(Math.max(0, variance))];
  }

  atDepth(depth) {
    if (!this.now || !(this.now.K > 0) || !(depth > 0)) return [];
    const [force, deviation] = this.elastic(depth);
    return [`law at rest ${HC.withDeviation(force, 2 * deviation)} N`];
  }

  update(view) {
    const { store } = view;
    const last = Math.max(store.first, view.to - 1);
    this.now = Object.fromEntries(["K", "n", "B", "p", "K_std", "n_std", "K_n_covariance"]
      .map((name) => [name, store.at(last, name)]));
    const begin = this.seconds ? view.end - this.seconds : view.start;
    const from = Math.max(store.first, store.find(begin));
    const depth = [];
    const force = [];
    for (let row = from; row < view.to; row++) {
      const felt = store.at(row, "force");
      if (felt !== felt) continue; // the sensor is slower than the rows
      depth.push(store.at(row, "displacement"));
      force.push(felt);
    }
    const xs = HC.extent(depth);
    const ys = HC.extent(force);
    this.x.update(Math.min(0, xs[0]), Math.max(xs[1], 0.05));
    this.y.update(Math.min(0, ys[0]), Math.max(ys[1], 0.05));
    const law = [[], []];
    const edge = [[], []];
    if (this.now.K > 0 && xs[1] > 0) {
      const deepest = Math.min(this.x.now[1], 1.25 * xs[1]);
      const back = [];
      for (let step = 0; step <= 80; step++) {
        const at = (deepest * step) / 80;
        const [value, deviation] = this.elastic(at);
        law[0].push(at);
        law[1].push(value);
        edge[0].push(at);
        edge[1].push(value + 2 * deviation);
        back.push([at, Math.max(0, value - 2 * deviation)]);
      }
      for (const [at, value] of back.reverse()) {
        edge[0].push(at);
        edge[1].push(value);
      }
    }
    const none = (xy) => (xy[0].length ? xy : [[0], [0]]);
    this.chart.plot.setData([null, none([depth, force]), none(edge), none(law)], true);
  }

  inside(plot, draw) {
    const { ctx } = plot;
    const { left, top, width, height } = plot.bbox;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    draw(ctx, (v) => plot.valToPos(v, "x", true), (v) => plot.valToPos(v, "y", true));
    ctx.restore();
    return null;
  }

  points(plot, series) {
    return this.inside(plot, (ctx, px, py) => {
      const [xs, ys] = plot.data[series];
      const size = 2.2 * devicePixelRatio;
      for (let i = 0; i < xs.length && xs.length > 1; i++) {
        const fresh = i / xs.length;
        // Live, the law is that of the present: what was felt elsewhere fades.
        const alpha = this.seconds ? 0.06 + 0.94 * fresh ** 3 : 0.15 + 0.75 * fresh;
        ctx.fillStyle = HC.withAlpha(HC.palette.measured, alpha);
        ctx.fillRect(px(xs[i]) - size / 2, py(ys[i]) - size / 2, size, size);
      }
      if (this.seconds && xs.length > 1) { // one point stands for none
        ctx.fillStyle = HC.palette.accent;
        ctx.beginPath();
        ctx.arc(px(xs.at(-1)), py(ys.at(-1)), 4.5 * devicePixelRatio, 0, 7);
        ctx.fill();
      }
    });
  }

  band(plot, series) {
    return this.inside(plot, (ctx, px, py) => {
      const [xs, ys] = plot.data[series];
      ctx.fillStyle = HC.withAlpha(HC.palette.estimate, 0.25);
      ctx.beginPath();
      xs.forEach((x, i) => ctx.lineTo(px(x), py(ys[i])));
      ctx.fill();
    });
  }

  law(plot, series) {
    return this.inside(plot, (ctx, px, py) => {
      const [xs, ys] = plot.data[series];
      ctx.strokeStyle = HC.palette.estimate;
      ctx.lineWidth = 2 * devicePixelRatio;
      ctx.beginPath();
      xs.forEach((x, i) => ctx.lineTo(px(x), py(ys[i])));
      ctx.stroke();
    });
  }
};
