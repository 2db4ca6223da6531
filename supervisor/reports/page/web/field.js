// Guidance field: direction at any point, streamlines, colours, and the path of a robot along it.

const STEPS = 254;
const NONE = 255;

export class Field {
  /// `unpacked` has the blob and its cells: all directions, then all depths.
  constructor({ blob, cells }) {
    this.blob = blob;
    this.cells = cells;
    this.n = blob.cells;
  }

  index(x, y) {
    const col = Math.floor((x - this.blob.left) / this.blob.side);
    const row = Math.floor((y - this.blob.bottom) / this.blob.side);
    return col >= 0 && row >= 0 && col < this.n && row < this.n ? row * this.n + col : -1;
  }

  /// Returns the angle at a point, radians, or null without one.
  angle(x, y) {
    const at = this.index(x, y);
    if (at < 0 || this.cells[at] === NONE) return null;
    return (this.cells[at] / STEPS) * 2 * Math.PI;
  }

  /// Returns points along the field until `stop` returns true for one.
  trace(x, y, sense, most, stop = () => false) {
    const points = [[x, y]];
    const step = this.blob.side * 0.6;
    const [tx, ty] = this.blob.target;
    for (let count = 0; count < most; count++) {
      const angle = this.angle(x, y);
      if (angle === null) break;
      x += sense * step * Math.cos(angle);
      y += sense * step * Math.sin(angle);
      if (stop(x, y)) break;
      points.push([x, y]);
      if (sense > 0 && Math.hypot(tx - x, ty - y) < step * 1.5) {
        points.push([tx, ty]);
        break;
      }
    }
    return points;
  }

  /// Returns the path of a robot along the field, and whether it ends at the target.
  way(x, y) {
    const points = this.trace(x, y, 1, 4000);
    const [lx, ly] = points[points.length - 1];
    const [tx, ty] = this.blob.target;
    return { points, arrives: Math.hypot(tx - lx, ty - ly) < this.blob.side * 2 };
  }

  /// Returns streamlines about `apart` metres from each other.
  lines(apart) {
    const side = Math.max(1, Math.round(apart / this.blob.side));
    const coarse = Math.ceil(this.n / side);
    const taken = new Uint8Array(coarse * coarse);
    const place = (x, y) => {
      const col = Math.floor((x - this.blob.left) / this.blob.side / side);
      const row = Math.floor((y - this.blob.bottom) / this.blob.side / side);
      return col >= 0 && row >= 0 && col < coarse && row < coarse ? row * coarse + col : -1;
    };
    const found = [];
    for (let row = 0; row < coarse; row++) {
      for (let col = 0; col < coarse; col++) {
        if (taken[row * coarse + col]) continue;
        const x = this.blob.left + (col + 0.5) * side * this.blob.side;
        const y = this.blob.bottom + (row + 0.5) * side * this.blob.side;
        if (this.angle(x, y) === null) continue;
        const own = new Set([row * coarse + col]);
        const isTaken = (px, py) => {
          const at = place(px, py);
          if (at < 0 || (taken[at] && !own.has(at))) return true;
          own.add(at);
          return false;
        };
        const back = this.trace(x, y, -1, 200, isTaken).reverse();
        const line = back.concat(this.trace(x, y, 1, 200, isTaken).slice(1));
        for (const at of own) taken[at] = 1;
        if (line.length > 6) found.push(line);
      }
    }
    return found;
  }

  /// Returns an image of the cells' depths: light near the target, dark far from it.
  image(isDark) {
    const image = new ImageData(this.n, this.n);
    const area = this.n * this.n;
    for (let row = 0; row < this.n; row++) {
      for (let col = 0; col < this.n; col++) {
        const depth = this.cells[area + row * this.n + col];
        const to = 4 * ((this.n - 1 - row) * this.n + col);
        if (depth === NONE) continue;
        // Bands of eight halvings appear as lines of equal depth.
        const share = Math.min(1, Math.log2(1 + depth / 4) / 6);
        const band = (depth >> 4) % 2 ? 8 : 0;
        const [from, towards] = isDark ? [[56, 120, 150], [22, 30, 48]] : [[255, 246, 205], [92, 140, 200]];
        for (let part = 0; part < 3; part++) {
          image.data[to + part] = from[part] + (towards[part] - from[part]) * share - band;
        }
        image.data[to + 3] = 235;
      }
    }
    return image;
  }
}
