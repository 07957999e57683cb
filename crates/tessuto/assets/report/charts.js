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
    this.arrange();
    this.resize();
    this.mark();
  }

  /** Rows of about as many charts, so that none is left with one. */
  arrange() {
    for (const place of [this.places.frames, this.places.steps]) {
      const count = place.childElementCount, most = Math.max(1, Math.floor((this.places.main.clientWidth - 48) / 300));
      const columns = Math.ceil(count / Math.ceil(count / most)) || 1;
      place.style.setProperty("--columns", columns);
    }
  }

  plot(chart) {
    const place = chart.by_frame ? this.places.frames : this.places.steps;
    const holder = document.createElement("figure"), title = document.createElement("figcaption"),
      key = document.createElement("div");
    title.textContent = chart.unit ? `${chart.title} [${chart.unit}]` : chart.title;
    key.className = "key";
    holder.append(title);
    place.append(holder);
    const ink = tessuto.style("--soft"), rule = tessuto.style("--rule");
    const colours = tessuto.lineColours(tessuto.darkness.matches);
    const font = "12px system-ui, sans-serif";
    const axis = { stroke: ink, font, labelFont: font, grid: { stroke: rule, width: 1 },
      ticks: { stroke: rule, width: 1, size: 5 } };
    const series = chart.series.map((s, k) => ({
      label: s.name, stroke: colours[k % colours.length], width: chart.stacked ? 1 : 1.75,
      points: { show: s.values.length < 3 && !chart.stacked }, spanGaps: false,
      ...(chart.stacked ? { fill: colours[k % colours.length] } : {}),
    }));
    const positive = v => (v !== null && v > 0 ? v : null);
    const lines = chart.stacked ? this.stacked(chart)
      : chart.series.map(s => (chart.log ? s.values.map(positive) : s.values));
    const data = [chart.x, ...lines];
    const isPower = v => Number.isInteger(Math.round(Math.log10(v) * 1e6) / 1e6);
    const powers = (_, splits) => splits.map(v => (isPower(v) ? v.toExponential(0) : null));
    const options = {
      width: 400,
      height: tessuto.chartHeight,
      scales: {
        x: { time: false },
        y: { distr: chart.log ? 3 : 1, ...(chart.stacked ? { range: (_, low, high) => [0, high] } : {}) },
      },
      axes: [
        { ...axis, label: chart.x_label, labelSize: 18, size: 34 },
        { ...axis, size: 52, ...(chart.log ? { values: powers } : {}) },
      ],
      series: [{ label: chart.x_label }, ...series],
      cursor: { points: { size: 6 }, ...(chart.by_frame ? { sync: { key: "frames" } } : {}) },
      legend: { show: false },
      hooks: {
        draw: [plot => this.drawMark(plot)], ready: [plot => this.tell(plot)], setCursor: [plot => this.tell(plot)],
      },
    };
    const plot = new uPlot(options, data, holder);
    Object.assign(plot, { chart, key });
    holder.append(key);
    key.append(document.createElement("span"), ...chart.series.map((s, k) => {
      const item = document.createElement("button"), dot = document.createElement("i");
      item.type = "button";
      item.title = chart.stacked ? "" : "show or hide";
      dot.style.background = colours[k % colours.length];
      item.append(dot, `${s.name} `, document.createElement("b"));
      // Parts of a whole stand upon each other.
      if (!chart.stacked) item.addEventListener("click", () => {
        plot.setSeries(k + 1, { show: !plot.series[k + 1].show });
        item.classList.toggle("off", !plot.series[k + 1].show);
      });
      return item;
    }));
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

  /** Each line with all after it below it, so that the first one's area is drawn first and the others over it. */
  stacked(chart) {
    return chart.series.map((_, k) =>
      chart.x.map((_, i) => chart.series.slice(k).reduce((sum, s) => sum + (s.values[i] ?? 0), 0)));
  }

  /** Moves the mark to the frame that is shown. */
  mark() {
    for (const plot of this.plots) {
      if (plot.chart.by_frame) plot.redraw(false, false);
      this.tell(plot);
    }
  }

  /** The values under the pointer; without one, those of the frame that is shown, or of the last step. */
  tell(plot) {
    const { chart, cursor, key } = plot;
    if (!chart) return;
    const pointed = cursor.left >= 0 && cursor.idx !== null && cursor.idx !== undefined;
    const at = pointed ? cursor.idx : chart.by_frame ? chart.x.indexOf(this.number()) : chart.x.length - 1;
    const [place, ...items] = key.children;
    place.textContent = at >= 0 ? `${chart.by_frame ? "frame" : chart.x_label.split(",")[0]} ${chart.x[at]}` : "";
    items.forEach((item, k) => {
      item.querySelector("b").textContent = tessuto.told(chart.series[k].values[at], chart);
    });
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
    this.arrange();
    for (const plot of this.plots) {
      const width = plot.root.parentElement.clientWidth;
      const inside = width - 16;
      if (width > 0 && inside !== plot.width) plot.setSize({ width: inside, height: tessuto.chartHeight });
    }
  }
};
