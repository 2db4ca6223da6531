// The charts, all on one axis of time, drawn by uPlot.

/* global uPlot */

const HEIGHT = 120;

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/// What the charts show: a title, a unit, and series with a name and their values in the store.
function charts(store) {
  const column = (name, text) => ({ text, of: () => store.columns[name] });
  const sensors = (cone) => store.about.sensors.map((sensor, at) => ({ sensor, text: sensor.name, of: () => store.ranges[at] })).filter(({ sensor }) => sensor.cone === cone);
  return [
    { title: "Speed", unit: "m/s", series: [column("v", "driven"), column("v_told", "told"), column("limit", "limit")] },
    { title: "Turn rate", unit: "rad/s", series: [column("omega", "turned"), column("omega_told", "told")] },
    { title: "Sonar", unit: "m", series: sensors(true) },
    { title: "Infrared", unit: "m", series: sensors(false) },
    { title: "Battery", unit: "V", series: [column("board_v", "boards"), column("motor_v", "motors")] },
    { title: "Tick latency", unit: "ms", series: [column("latency_ms", "link")] },
  ].filter(({ series }) => series.length);
}

export class Charts {
  /// `onTime` is told the mission time that is clicked.
  constructor(parent, store, onTime) {
    this.parent = parent;
    this.store = store;
    this.onTime = onTime;
    this.plots = [];
    this.t = 0;
    this.shown = -1;
    new ResizeObserver(() => this.resize()).observe(parent);
  }

  /// Make the charts of the store's run, in the colours of now.
  make() {
    for (const { plot } of this.plots) plot.destroy();
    this.parent.replaceChildren();
    this.shown = -1;
    if (!this.store.about) {
      this.plots = [];
      return;
    }
    const sync = uPlot.sync("time");
    const all = charts(this.store);
    this.plots = all.map((chart, row) => {
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      caption.textContent = `${chart.title}, ${chart.unit}`;
      figure.append(caption);
      this.parent.append(figure);
      const isLast = row === all.length - 1;
      const axis = { stroke: colour("soft"), grid: { stroke: colour("line"), width: 0.5 }, ticks: { stroke: colour("line"), width: 0.5 }, font: "11px system-ui" };
      const plot = new uPlot({
        width: this.width(),
        height: isLast ? HEIGHT + 30 : HEIGHT,
        cursor: { sync: { key: sync.key }, drag: { x: false, y: false } },
        scales: { x: { time: false } },
        axes: [{ ...axis, size: isLast ? 42 : 24, label: isLast ? "mission time, s" : undefined, labelSize: 18, labelFont: "11px system-ui" }, { ...axis, size: 44 }],
        series: [{ label: "s", value: (_, t) => (t === null ? "–" : t.toFixed(2)) }, ...chart.series.map(({ text }, at) => ({
          label: text,
          stroke: colour(`c${at % 7}`),
          width: 1.4,
          points: { show: false },
          value: (_, value) => (value === null || value === undefined ? "–" : value.toFixed(2)),
        }))],
        hooks: { draw: [(it) => this.mark(it)] },
      }, this.data(chart), figure);
      plot.over.addEventListener("click", () => {
        if (plot.cursor.left >= 0) this.onTime(plot.posToVal(plot.cursor.left, "x"));
      });
      return { chart, plot };
    });
  }

  data(chart) {
    return [this.store.times, ...chart.series.map(({ of }) => of())];
  }

  width() {
    return Math.max(this.parent.clientWidth, 200);
  }

  resize() {
    for (const { plot } of this.plots) {
      if (plot.width !== this.width()) plot.setSize({ width: this.width(), height: plot.height });
    }
  }

  /// A line at the time that is shown.
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
      // Without a pointer the legend has the values at the time that is shown.
      if (!(plot.cursor.left >= 0)) plot.setLegend({ idx: Math.max(this.store.rowAt(t), 0) });
    }
    this.shown = end;
  }
}
