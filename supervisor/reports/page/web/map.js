// Map: the robot's belief, the field, its path, its beams, targets, and the truth in simulation.

import { Field } from "./field.js";
import { Unpacker } from "./store.js";

const TAU = 2 * Math.PI;
// Distance within which a finger grabs a target, CSS pixels.
const GRAB = 26;
// Height of the actions over the lowest part of the map.
const ACTIONS = 70;
// Colour names of cell states.
const CELLS = [null, "sensed", "known", "rim", "scanned", "margin"];
const LEGEND = [["sensed", "believed hazard"], ["margin", "its margin"], ["known", "known hazard"], ["scanned", "scanned"], ["way", "path"], ["beam", "beams"], ["target", "target"], ["mover", "moving: arrow to its place in 1 s, uncertainty ring"]];

const colours = new Map();

/// Returns a colour of the style sheet by name.
export function colour(name) {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
}

function rgb(name) {
  const hex = colour(name).slice(1);
  const full = hex.length === 3 ? [...hex].map((digit) => digit + digit).join("") : hex;
  return [0, 2, 4].map((at) => parseInt(full.slice(at, at + 2), 16));
}

export class MapView {
  /// `changed` requests a redraw. `onChoose` receives the places that an operator with permission
  /// chooses.
  constructor(canvas, store, changed, onChoose) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.store = store;
    this.changed = changed;
    this.onChoose = onChoose;
    this.maps = new Unpacker(changed);
    this.fields = new Unpacker(changed);
    this.previews = new Unpacker(changed);
    this.images = {};
    this.fieldMode = "lines";
    this.showsTruth = true;
    this.chosen = [];
    this.mayChoose = false;
    this.view = null;
    this.watchPointers();
    new ResizeObserver(changed).observe(canvas);
  }

  fit() {
    this.view = null;
    this.changed();
  }

  /// Redraws after a change of colours.
  repaint() {
    colours.clear();
    this.images = {};
    this.changed();
  }

  // --- places ---

  home() {
    const about = this.store.about;
    const { width_m: width, centre } = about?.perimeter ?? { width_m: 12, centre: [0, 0] };
    return { x: centre[0], y: centre[1], span: width * 1.04 };
  }

  pixels(x, y) {
    const { view, scale } = this;
    return [this.width / 2 + (x - view.x) * scale, this.middle - (y - view.y) * scale];
  }

  metres(px, py) {
    const { view, scale } = this;
    return [view.x + (px - this.width / 2) / scale, view.y - (py - this.middle) / scale];
  }

  zoom(factor, px, py) {
    const [x, y] = this.metres(px, py);
    const span = Math.min(Math.max(this.view.span / factor, 0.5), this.home().span * 2);
    const share = span / this.view.span;
    this.view = { x: x + (this.view.x - x) * share, y: y + (this.view.y - y) * share, span };
    this.changed();
  }

  // --- pointers and keys ---

  watchPointers() {
    const pointers = new Map();
    let moved = false;
    let grabbed = -1;
    const place = (event) => [event.offsetX, event.offsetY];
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, place(event));
      moved = pointers.size > 1;
      grabbed = -1;
      if (this.mayChoose && pointers.size === 1) {
        const [px, py] = place(event);
        grabbed = this.chosen.findIndex(([x, y]) => {
          const [cx, cy] = this.pixels(x, y);
          return Math.hypot(cx - px, cy - py) < GRAB;
        });
      }
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before || !this.view) return;
      const now = place(event);
      const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      if (Math.hypot(now[0] - before[0], now[1] - before[1]) < 4 && !moved) return;
      moved = true;
      pointers.set(event.pointerId, now);
      if (grabbed >= 0 && others.length === 0) {
        this.chosen[grabbed] = this.metres(...now);
        this.onChoose(this.chosen, grabbed, false);
      } else if (others.length === 1) {
        const [other] = others;
        const was = Math.hypot(before[0] - other[0], before[1] - other[1]);
        const is = Math.hypot(now[0] - other[0], now[1] - other[1]);
        this.zoom(is / Math.max(was, 1), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      } else {
        this.view = { ...this.view, x: this.view.x - (now[0] - before[0]) / this.scale, y: this.view.y + (now[1] - before[1]) / this.scale };
      }
      this.changed();
    });
    const up = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      if (event.type === "pointercancel" || pointers.size > 0) return;
      if (grabbed >= 0 && moved) this.onChoose(this.chosen, grabbed, true);
      else if (!moved && this.mayChoose && this.view) {
        const at = Math.max(this.chosen.length - 1, 0);
        this.chosen[at] = this.metres(...place(event));
        this.onChoose(this.chosen, at, true);
      }
      this.changed();
    };
    this.canvas.addEventListener("pointerup", up);
    this.canvas.addEventListener("pointercancel", up);
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.view) this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      const step = steps[event.key];
      const last = this.chosen.length - 1;
      if (step && this.mayChoose) {
        event.preventDefault();
        const from = this.chosen[last] ?? this.robot?.slice(0, 2) ?? [0, 0];
        this.chosen[Math.max(last, 0)] = [from[0] + 0.1 * step[0], from[1] + 0.1 * step[1]];
        this.onChoose(this.chosen, Math.max(last, 0), true);
      } else if (event.key === "+" || event.key === "-") {
        this.zoom(event.key === "+" ? 1.25 : 0.8, this.width / 2, this.middle);
      }
    });
  }

  // --- drawing ---

  draw(t) {
    const { canvas, context, store } = this;
    const ratio = window.devicePixelRatio || 1;
    this.width = canvas.clientWidth;
    this.height = canvas.clientHeight;
    const size = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    this.view ??= store.about ? this.home() : null;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = colour("map");
    context.fillRect(0, 0, this.width, this.height);
    if (!this.view) return;
    const free = this.height - (this.mayChoose ? ACTIONS : 0);
    this.middle = free / 2;
    this.scale = Math.min(this.width, free) / this.view.span;
    const at = store.rowAt(t);
    const field = this.fields.of(this.fieldMode === "none" ? null : store.fieldAt(t));
    if (field && this.fieldMode === "colours") this.drawImage("field", field, (it) => new Field(it).image(matchMedia("(prefers-color-scheme: dark)").matches));
    const map = this.maps.of(store.mapAt(t));
    if (map) this.drawImage("map", map, (it) => this.mapImage(it));
    if (field && this.fieldMode === "lines") this.drawLines(field);
    this.drawPerimeter();
    this.drawShapes(store.about.known, "known", [4, 3]);
    if (this.showsTruth && store.about.world) {
      this.drawShapes(store.about.world, "shape", []);
      this.drawThings(t);
    }
    this.drawWays(at);
    this.drawBeams(at);
    this.drawTargets(t);
    this.drawMovers(at);
    this.drawRobot(at);
    this.drawScale();
  }

  drawImage(name, unpacked, make) {
    const key = `${name}${this.fieldMode}`;
    let cached = this.images[key];
    if (cached?.of !== unpacked) {
      const image = make(unpacked);
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [image.width, image.height];
      canvas.getContext("2d").putImageData(image, 0, 0);
      cached = this.images[key] = { of: unpacked, canvas };
    }
    const { left, bottom, side, cells } = unpacked.blob;
    const [px, py] = this.pixels(left, bottom + side * cells);
    const extent = side * cells * this.scale;
    this.context.imageSmoothingEnabled = name === "field";
    this.context.drawImage(cached.canvas, px, py, extent, extent);
  }

  mapImage({ blob, cells }) {
    const n = blob.cells;
    const image = new ImageData(n, n);
    const colours = CELLS.map((name) => name && rgb(name));
    for (let row = 0; row < n; row++) {
      for (let col = 0; col < n; col++) {
        const state = cells[row * n + col];
        const seen = colours[state] ?? (state > 5 ? colours[3] : null);
        if (!seen || (state === 4 && this.fieldMode === "colours")) continue;
        const to = 4 * ((n - 1 - row) * n + col);
        image.data.set([...seen, state === 5 ? 190 : 255], to);
      }
    }
    return image;
  }

  path(points) {
    this.context.beginPath();
    points.forEach(([x, y], at) => {
      const [px, py] = this.pixels(x, y);
      if (at) this.context.lineTo(px, py);
      else this.context.moveTo(px, py);
    });
  }

  stroke(name, width, dash = []) {
    this.context.strokeStyle = colour(name);
    this.context.lineWidth = width;
    this.context.setLineDash(dash);
    this.context.stroke();
    this.context.setLineDash([]);
  }

  drawLines(unpacked) {
    if (this.lines?.of !== unpacked) {
      const path = new Path2D();
      for (const line of new Field(unpacked).lines(0.3)) line.forEach(([x, y], at) => (at ? path.lineTo(x, y) : path.moveTo(x, y)));
      this.lines = { of: unpacked, path };
    }
    const { context, scale } = this;
    const [px, py] = this.pixels(0, 0);
    context.save();
    context.transform(scale, 0, 0, -scale, px, py);
    context.globalAlpha = 0.7;
    context.strokeStyle = colour("stream");
    context.lineWidth = 0.8 / scale;
    context.stroke(this.lines.path);
    context.restore();
  }

  drawPerimeter() {
    const { width_m: width, centre: [x, y] } = this.store.about.perimeter;
    const half = width / 2;
    this.path([[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half], [x - half, y - half]]);
    this.stroke("rim", 1.5);
  }

  drawShapes(shapes, name, dash) {
    for (const drum of shapes?.drum ?? []) {
      const [px, py] = this.pixels(...drum.at);
      this.context.beginPath();
      this.context.arc(px, py, drum.radius_m * this.scale, 0, TAU);
      this.solid(name, dash);
    }
    for (const box of shapes?.box ?? []) {
      const angle = ((box.angle_deg ?? 0) * Math.PI) / 180;
      const [w, h] = box.size_m.map((size) => size / 2);
      const corners = [[-w, -h], [w, -h], [w, h], [-w, h], [-w, -h]];
      this.path(corners.map(([x, y]) => [box.at[0] + x * Math.cos(angle) - y * Math.sin(angle), box.at[1] + x * Math.sin(angle) + y * Math.cos(angle)]));
      this.solid(name, dash);
    }
    for (const wall of shapes?.wall ?? []) {
      this.path(wall.points);
      this.stroke(name, 2.5, dash);
    }
  }

  /// Draws the simulated things that appear, vanish and move, at their true places.
  drawThings(t) {
    for (const { shape, from_s: from, until_s: until, moves = [] } of this.store.about.things ?? []) {
      if (t < from || t >= (until ?? Infinity)) continue;
      const next = moves.findIndex((station) => station.at_s > t);
      // It rests before the first station and after the last, whose index is then -1.
      const after = moves.at(next);
      const before = moves[next - 1] ?? after;
      const share = before === after ? 0 : (t - before.at_s) / (after.at_s - before.at_s);
      const [x, y] = after ? [0, 1].map((axis) => before.by[axis] + share * (after.by[axis] - before.by[axis])) : [0, 0];
      this.context.save();
      this.context.translate(x * this.scale, -y * this.scale);
      this.drawShapes(shape, "shape", []);
      this.context.restore();
    }
  }

  /// Draws the laser's moving objects: a disc, a ring for the uncertainty, an arrow to the place in
  /// 1 s, and the speed.
  drawMovers(at) {
    const { context } = this;
    const texts = [];
    for (const [x, y, vx, vy, radius, reach] of this.store.movers[at] ?? []) {
      const [px, py] = this.pixels(x, y);
      const [qx, qy] = this.pixels(x + vx, y + vy);
      const ring = (metres) => {
        context.beginPath();
        context.arc(px, py, metres * this.scale, 0, TAU);
      };
      ring(reach);
      context.globalAlpha = 0.45;
      this.stroke("mover", 1.2);
      context.globalAlpha = 1;
      ring(radius);
      this.solid("mover", []);
      const heading = Math.atan2(qy - py, qx - px);
      context.beginPath();
      context.moveTo(px, py);
      context.lineTo(qx, qy);
      for (const side of [-2.6, 2.6]) {
        context.moveTo(qx, qy);
        context.lineTo(qx + 8 * Math.cos(heading + side), qy + 8 * Math.sin(heading + side));
      }
      this.stroke("mover", 2);
      texts.push([`${this.width < 500 ? "" : "moving, "}${Math.hypot(vx, vy).toFixed(1)} m/s`, px + reach * this.scale + 4, py + 4]);
    }
    // An overlapping text moves down.
    texts.forEach(([text, left, bottom], nth) => {
      const wide = 7 * text.length;
      const lies = ([, x, y]) => Math.abs(x - left) < wide && Math.abs(y - bottom) < 14;
      while (texts.slice(0, nth).some(lies)) bottom += 7;
      texts[nth][2] = bottom;
      this.label(text, left, bottom);
    });
  }

  /// Draws a text that is legible over any colour.
  label(text, left, bottom) {
    const { context } = this;
    context.font = "12px system-ui, sans-serif";
    context.lineWidth = 3;
    context.strokeStyle = colour("map");
    context.strokeText(text, left, bottom);
    context.fillStyle = colour("ink");
    context.fillText(text, left, bottom);
  }

  solid(name, dash) {
    this.context.globalAlpha = 0.18;
    this.context.fillStyle = colour(name);
    this.context.fill();
    this.context.globalAlpha = 1;
    this.stroke(name, 1.4, dash);
  }

  drawWays(at) {
    const column = (name) => this.store.columns[name] ?? [];
    const way = (xs, ys) => {
      const points = [];
      const every = Math.max(1, Math.floor(at / 3000));
      for (let row = 0; row <= at; row += every) if (xs[row] !== null && ys[row] !== null) points.push([xs[row], ys[row]]);
      return points;
    };
    if (this.showsTruth) {
      this.path(way(column("true_x"), column("true_y")));
      this.stroke("truth", 1.4, [5, 3]);
    }
    this.path(way(column("x"), column("y")));
    this.stroke("way", 2.2);
  }

  drawBeams(at) {
    const robot = this.pose(at, "");
    if (!robot) return;
    const [x, y, heading] = robot;
    this.store.about.sensors.forEach((sensor, row) => {
      const range = this.store.ranges[row]?.[at];
      // A laser's readings have only the nearest beam.
      if (range === null || range === undefined || sensor.scan) return;
      const bearing = heading + sensor.bearing;
      const from = [x + sensor.forward_m * Math.cos(bearing), y + sensor.forward_m * Math.sin(bearing)];
      const [px, py] = this.pixels(...from);
      const reach = range * this.scale;
      this.context.beginPath();
      this.context.moveTo(px, py);
      if (sensor.cone) this.context.arc(px, py, reach, -bearing - sensor.half, -bearing + sensor.half);
      else this.context.lineTo(px + reach * Math.cos(bearing), py - reach * Math.sin(bearing));
      if (sensor.cone) this.context.closePath();
      this.context.globalAlpha = sensor.used ? 0.16 : 0.06;
      this.context.fillStyle = colour("beam");
      if (sensor.cone) this.context.fill();
      this.context.globalAlpha = sensor.used ? 1 : 0.45;
      this.stroke("beam", 1.1);
      this.context.globalAlpha = 1;
    });
  }

  pose(at, prefix) {
    const of = (name) => this.store.value(prefix + name, at);
    return of("x") === null ? null : [of("x"), of("y"), of("heading")];
  }

  drawTargets(t) {
    const { store } = this;
    const tolerance = store.about.tolerance_m * this.scale;
    const targets = store.stateAt(t)?.targets ?? [store.about.target];
    targets.forEach((place, at) => this.cross(place, "target", tolerance, targets.length > 1 ? `${at + 1}` : ""));
    const preview = this.previews.of(store.preview);
    const robot = this.robot;
    if (this.chosen.length && preview && robot) {
      const { points, arrives } = new Field(preview).way(robot[0], robot[1]);
      this.path(points);
      this.stroke(arrives ? "target" : "sensed", 2, [7, 5]);
    }
    this.chosen.forEach((place, at) => this.cross(place, "robot", GRAB / 2, `${at + 1}`));
  }

  cross([x, y], name, radius, label) {
    const [px, py] = this.pixels(x, y);
    this.context.beginPath();
    this.context.arc(px, py, Math.max(radius, 6), 0, TAU);
    this.context.moveTo(px - 7, py - 7);
    this.context.lineTo(px + 7, py + 7);
    this.context.moveTo(px - 7, py + 7);
    this.context.lineTo(px + 7, py - 7);
    this.stroke(name, 2);
    if (!label) return;
    this.context.font = "600 13px system-ui, sans-serif";
    this.context.fillStyle = colour(name);
    this.context.fillText(label, px + Math.max(radius, 6) + 3, py - 6);
  }

  drawRobot(at) {
    const robot = this.pose(at, "");
    this.robot = robot;
    if (this.showsTruth) {
      const truth = this.pose(at, "true_");
      if (truth) this.body(truth, "truth", [3, 3]);
    }
    if (!robot) return;
    const of = (name) => this.store.value(name, at) ?? 0;
    const [xx, xy, yy] = [of("xx"), of("xy"), of("yy")];
    const mean = (xx + yy) / 2;
    const half = Math.hypot((xx - yy) / 2, xy);
    const axes = [mean + half, Math.max(mean - half, 0)].map((it) => 2 * Math.sqrt(it) * this.scale);
    const [px, py] = this.pixels(robot[0], robot[1]);
    this.context.beginPath();
    this.context.ellipse(px, py, axes[0], axes[1], -Math.atan2(2 * xy, xx - yy) / 2, 0, TAU);
    this.stroke("way", 1.4);
    this.body(robot, "robot", []);
  }

  body([x, y, heading], name, dash) {
    const radius = this.store.about.radius_m * this.scale;
    const [px, py] = this.pixels(x, y);
    this.context.beginPath();
    this.context.arc(px, py, radius, 0, TAU);
    if (!dash.length) {
      this.context.globalAlpha = 0.25;
      this.context.fillStyle = colour(name);
      this.context.fill();
      this.context.globalAlpha = 1;
    }
    this.context.moveTo(px, py);
    this.context.lineTo(px + radius * Math.cos(heading), py - radius * Math.sin(heading));
    this.stroke(name, 2, dash);
  }

  /// Draws a scale bar of a round length.
  drawScale() {
    const metres = [0.1, 0.2, 0.5, 1, 2, 5, 10].findLast((it) => it * this.scale < this.width / 4) ?? 0.1;
    const [left, bottom] = [12, 30];
    this.context.beginPath();
    this.context.moveTo(left, bottom);
    this.context.lineTo(left + metres * this.scale, bottom);
    this.stroke("ink", 2);
    this.label(`${metres} m`, left, bottom - 6);
  }

  /// Lists the colours and their meanings.
  legend(list) {
    const rows = this.store.about?.world ? [...LEGEND, ["truth", "true path"], ["shape", "true obstacle"]] : LEGEND;
    list.replaceChildren(...rows.map(([name, text]) => {
      const item = document.createElement("li");
      const sample = document.createElement("i");
      sample.style.background = `var(--${name})`;
      item.append(sample, text);
      return item;
    }));
  }
}
