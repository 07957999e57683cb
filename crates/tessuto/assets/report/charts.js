"use strict";
/** Line charts; those over the frames carry a mark at the frame that is shown, and a click on them goes to a frame. */
tessuto.Charts = class {
  /** `places`: where the charts over frames and over steps go. */
  constructor(places, player) {
    Object.assign(this, { places, player, charts: [], plots: [] });
    tessuto.darkness.addEventListener("change", () => this.set(this.charts));
    new ResizeObserver(() => this.resize()).observe(places.main);
  }

  /** Replaces all charts, see `Chart` in chart.rs. */
  set(charts) {
    this.charts = charts;
    for (const plot of this.plots) plot.destroy();
    for (const place of [this.places.frames, this.places.steps]) place.replaceChildren();
    this.plots = charts.map(chart => this.plot(chart));
    this.places.framesSection.hidden = !charts.some(c => c.by_frame);
    this.places.stepsSection.hidden = charts.every(c => c.by_frame);
    this.resize();
    this.mark();
  }

  plot(chart) {
    const place = chart.by_frame ? this.places.frames : this.places.steps;
    const holder = document.createElement("figure");
    place.append(holder);
    const ink = tessuto.style("--soft"), rule = tessuto.style("--rule");
    const colours = tessuto.lineColours(tessuto.darkness.matches);
    const font = "12px system-ui, sans-serif";
    const axis = { stroke: ink, font, labelFont: font, grid: { stroke: rule, width: 1 }, ticks: { stroke: rule, width: 1, size: 5 } };
    const label = chart.unit ? `[${chart.unit}]` : "";
    const value = (_, v) => (v === null ? "–" : tessuto.readable(v));
    const series = chart.series.map((s, k) => ({
      label: s.name, stroke: colours[k % colours.length], width: 1.75, points: { show: s.values.length < 3 }, value, spanGaps: false,
    }));
    const positive = v => (v !== null && v > 0 ? v : null);
    const data = [chart.x, ...chart.series.map(s => (chart.log ? s.values.map(positive) : s.values))];
    const powers = (_, splits) => splits.map(v => (Number.isInteger(Math.round(Math.log10(v) * 1e6) / 1e6) ? v.toExponential(0) : null));
    const options = {
      title: chart.title,
      width: 400,
      height: 250,
      scales: { x: { time: false }, y: { distr: chart.log ? 3 : 1 } },
      axes: [
        { ...axis, label: chart.x_label, labelSize: 18, size: 34 },
        { ...axis, label: chart.log ? `${label} log` : label, labelSize: 18, size: 52, ...(chart.log ? { values: powers } : {}) },
      ],
      series: [{ label: chart.x_label, value }, ...series],
      cursor: { points: { size: 6 }, ...(chart.by_frame ? { sync: { key: "frames" } } : {}) },
      legend: { live: true },
      hooks: { draw: [plot => this.drawMark(plot)], ready: [plot => this.tell(plot)] },
    };
    const plot = new uPlot(options, data, holder);
    plot.chart = chart;
    if (chart.by_frame) {
      plot.over.style.cursor = "pointer";
      plot.over.addEventListener("click", event => {
        this.player.toggle(false);
        this.player.seek(plot.posToVal(event.offsetX, "x") - this.player.first);
      });
    }
    plot.over.addEventListener("pointerleave", () => setTimeout(() => this.mark(), 0));
    return plot;
  }

  /** Moves the mark to the frame that is shown. */
  mark() {
    for (const plot of this.plots) {
      if (plot.chart.by_frame) plot.redraw(false, false);
      this.tell(plot);
    }
  }

  /** Where no pointer is: the values of the frame that is shown, or of the last step. */
  tell(plot) {
    const { chart, cursor } = plot;
    if (!chart || cursor.left >= 0) return;
    plot.setLegend({ idx: chart.by_frame ? chart.x.indexOf(this.number()) : chart.x.length - 1 });
  }

  number() {
    return this.player.first + this.player.frame;
  }

  drawMark(plot) {
    if (!plot.chart?.by_frame) return;
    const x = plot.valToPos(this.number(), "x", true), { left, width, top, height } = plot.bbox;
    if (!(x >= left && x <= left + width)) return;
    const pen = plot.ctx;
    pen.save();
    pen.strokeStyle = tessuto.style("--accent");
    pen.lineWidth = 1.5 * devicePixelRatio;
    pen.beginPath();
    pen.moveTo(x, top);
    pen.lineTo(x, top + height);
    pen.stroke();
    pen.restore();
  }

  resize() {
    for (const plot of this.plots) {
      const width = plot.root.parentElement.clientWidth;
      if (width > 0 && width !== plot.width) plot.setSize({ width, height: 250 });
    }
  }
};
