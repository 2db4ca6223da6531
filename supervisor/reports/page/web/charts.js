// Charts, drawn by uPlot on one time axis, except for the histogram.

import { colour } from "./map.js";

/* global uPlot */

const HEIGHT = 120;

// Histogram buckets per octave, from a microsecond.
const PER_OCTAVE = 8;

/// Counts `values`, ms, per bucket. Returns the lower ends of the buckets, and the counts.
function histogram(values) {
  const counts = [];
  for (const value of values) {
    if (!value) continue;
    const bucket = Math.max(0, Math.floor(Math.log2(value * 1000) * PER_OCTAVE));
    counts[bucket] = (counts[bucket] ?? 0) + 1;
  }
  const [ends, heights] = [[], []];
  for (let bucket = counts.findIndex(Boolean); bucket >= 0 && bucket <= counts.length; bucket++) {
    ends.push(2 ** (bucket / PER_OCTAVE) / 1000);
    heights.push(counts[bucket] ?? 0);
  }
  return [ends, heights];
}

/// Lists the charts: a title, a unit, and series with names and their values in the store.
function charts(store) {
  const column = (name, text) => ({ text, of: () => store.columns[name] });
  const sensors = (cone) => store.about.sensors.map((sensor, at) => ({ sensor, text: sensor.name, of: () => store.ranges[at] })).filter(({ sensor }) => sensor.cone === cone && !sensor.scan);
  const { steers } = store.about;
  return [
    { title: "Speed", unit: "m/s", series: [column("v", "driven"), column("v_sent", "sent"), column("limit", "limit")] },
    { title: "Turn rate", unit: "rad/s", series: [column("omega", "turned"), column("omega_sent", "sent")] },
    { title: steers ? "Driven wheel" : "Left wheel", unit: "rad/s", series: [column("left", "measured"), column("left_sent", "sent")] },
    steers
      ? { title: "Steering", unit: "rad", series: [column("right_sent", "sent")] }
      : { title: "Right wheel", unit: "rad/s", series: [column("right", "measured"), column("right_sent", "sent")] },
    { title: "Sonar", unit: "m", series: sensors(true) },
    { title: "Infrared", unit: "m", series: sensors(false) },
    { title: "Battery", unit: "V", series: [column("board_v", "boards"), column("motor_v", "motors")] },
    { title: "Tick latency", unit: "ms", series: [column("latency_ms", "link")] },
    { title: "Ticks by latency", unit: "count", isHistogram: true, series: [column("latency_ms", "ticks")] },
  ].filter(({ series }) => series.length);
}

export class Charts {
  /// `onTime` receives a clicked mission time.
  constructor(parent, store, onTime) {
    this.parent = parent;
    this.store = store;
    this.onTime = onTime;
    this.plots = [];
    this.t = 0;
    this.shown = -1;
    new ResizeObserver(() => this.resize()).observe(parent);
  }

  /// Makes the charts of the store's run, in the current colours.
  make() {
    for (const { plot } of this.plots) plot.destroy();
    this.parent.replaceChildren();
    this.shown = -1;
    if (!this.store.about) {
      this.plots = [];
      return;
    }
    const width = this.width();
    const font = "11px system-ui";
    const all = charts(this.store);
    this.plots = all.map((chart, row) => {
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      caption.textContent = `${chart.title}, ${chart.unit}`;
      figure.append(caption);
      this.parent.append(figure);
      const { isHistogram } = chart;
      const label = isHistogram ? "tick latency, ms" : all[row + 1]?.isHistogram ? "mission time, s" : undefined;
      const axis = { stroke: colour("soft"), grid: { stroke: colour("line"), width: 0.5 }, ticks: { stroke: colour("line"), width: 0.5 }, font, labelFont: font, labelSize: 18 };
      const plot = new uPlot({
        width,
        height: label ? HEIGHT + 30 : HEIGHT,
        cursor: { sync: isHistogram ? {} : { key: "time" }, drag: { x: false, y: false } },
        scales: { x: { time: false, ...(isHistogram && { distr: 3, range: (_, from, to) => [from, to] }) } },
        axes: [{ ...axis, size: label ? 42 : 24, label }, { ...axis, size: 44 }],
        series: [{ label: isHistogram ? "ms" : "s", value: (_, t) => (t === null ? "–" : t.toFixed(2)) }, ...chart.series.map(({ text }, at) => ({
          label: text,
          stroke: colour(`c${at % 7}`),
          width: 1.4,
          points: { show: false },
          ...(isHistogram && { fill: colour("c0"), paths: uPlot.paths.stepped({ align: 1 }) }),
          value: (_, value) => (value === null || value === undefined ? "–" : value.toFixed(2)),
        }))],
        hooks: { draw: isHistogram ? [] : [(it) => this.mark(it)] },
      }, this.data(chart), figure);
      plot.over.addEventListener("click", () => {
        if (!isHistogram && plot.cursor.left >= 0) this.onTime(plot.posToVal(plot.cursor.left, "x"));
      });
      return { chart, plot };
    });
    this.shown = this.store.end;
    this.t = NaN;
  }

  data(chart) {
    if (chart.isHistogram) return histogram(this.store.columns.latency_ms);
    return [this.store.times, ...chart.series.map(({ of }) => of())];
  }

  width() {
    return Math.max(this.parent.clientWidth, 200);
  }

  resize() {
    const width = this.width();
    for (const { plot } of this.plots) {
      if (plot.width !== width) plot.setSize({ width, height: plot.height });
    }
  }

  /// Draws a line at the shown time.
  mark(plot) {
    const at = Math.round(plot.valToPos(this.t, "x", true));
    const { left, top, width, height } = plot.bbox;
    if (at < left || at > left + width) return;
    plot.ctx.save();
    plot.ctx.strokeStyle = colour("accent");
    plot.ctx.lineWidth = 2;
    plot.ctx.beginPath();
    plot.ctx.moveTo(at, top);
    plot.ctx.lineTo(at, top + height);
    plot.ctx.stroke();
    plot.ctx.restore();
  }

  draw(t) {
    const end = this.store.end;
    if (t === this.t && end === this.shown) return;
    this.t = t;
    for (const { chart, plot } of this.plots) {
      if (end !== this.shown) plot.setData(this.data(chart));
      else plot.redraw(false, false);
      if (chart.isHistogram) continue;
      // Without a pointer the legend has the values at the shown time.
      if (!(plot.cursor.left >= 0)) plot.setLegend({ idx: Math.max(this.store.rowAt(t), 0) });
    }
    this.shown = end;
  }
}
