// Draws rigid bodies in 3D without perspective: triangles and spheres painted from far to near, planes, terrain, chains of forces.

const DARKEST = 0.55; // brightness of a face that no light falls on

class BodyPainter {
  constructor(player) {
    this.player = player;
    this.data = player.data;
    this.facts = player.facts;
    this.scale = this.data.whole("scale");
    this.shape = this.data.whole("shape");
    this.angles = this.facts.view.map((v) => (v * Math.PI) / 180); // azimuth and elevation of the viewer
    this.view = null; // {x, y: centre on the screen [m], scale: pixels a metre}
    this.own = false;
    this.fits = new Map();
    this.starts = startsOf(this.data.whole("contacts"));
    this.reach = Array.from({ length: this.facts.shapes }, (_, k) => this.reachOf(k));
    this.sprites = new Map();
    this.mayDrag = "turns the scene (dragging with shift moves it)";
    this.turn();
  }

  reachOf(k) {
    let reach = 0;
    if (this.data.has(`spheres${k}`)) {
      const s = this.data.whole(`spheres${k}`);
      for (let m = 0; m < s.length; m += 4) reach = Math.max(reach, Math.hypot(s[m], s[m + 1], s[m + 2]) + s[m + 3]);
    } else {
      const t = this.data.whole(`triangles${k}`);
      for (let m = 0; m < t.length; m += 3) reach = Math.max(reach, Math.hypot(t[m], t[m + 1], t[m + 2]));
    }
    return reach;
  }

  // Unit vectors to the right, up, towards the viewer, and to the light.
  turn() {
    const [a, e] = this.angles;
    this.right = [-Math.sin(a), Math.cos(a), 0];
    this.toward = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
    this.up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
    const light = [0, 1, 2].map((k) => 0.55 * this.toward[k] + 0.65 * this.up[k] - 0.45 * this.right[k]);
    const length = Math.hypot(...light);
    this.light = light.map((v) => v / length);
  }

  flat(x, y, z) {
    const { right, up } = this;
    return [right[0] * x + right[1] * y, up[0] * x + up[1] * y + up[2] * z];
  }

  depth(x, y, z) {
    return this.toward[0] * x + this.toward[1] * y + this.toward[2] * z;
  }

  screen(x, y, z) {
    const [u, v] = this.flat(x, y, z);
    const { width, height } = this.player;
    return [width / 2 + (u - this.view.x) * this.view.scale, height / 2 - (v - this.view.y) * this.view.scale];
  }

  // On the screen [m], of all frames that share a scale with this one.
  bounds(frame) {
    const key = `${this.player.scaleKey(frame)} ${this.angles}`;
    if (!this.fits.has(key)) {
      if (this.fits.size > 50) this.fits.clear(); // there is one for each way that the scene was turned
      const box = [Infinity, -Infinity, Infinity, -Infinity];
      const hold = (x, y, z, r) => {
        const [u, v] = this.flat(x, y, z);
        box[0] = Math.min(box[0], u - r);
        box[1] = Math.max(box[1], u + r);
        box[2] = Math.min(box[2], v - r);
        box[3] = Math.max(box[3], v + r);
      };
      let top = -Infinity;
      for (const f of this.player.scaleFrames(frame, 24)) {
        const [x, y, z, shown] = ["x", "y", "z", "shown"].map((name) => this.data.row(name, f));
        for (let k = 0; k < x.length; k++) {
          if (!shown[k]) continue;
          const reach = this.reach[this.shape[k]] * this.scale[k];
          hold(x[k], y[k], z[k], reach);
          top = Math.max(top, z[k] + reach);
        }
      }
      const normals = this.data.whole("planeNormals");
      for (let w = 0; w < this.facts.planes; w++) {
        const p = this.data.whole(`plane${w}`);
        // Of upright walls only what is beside the bodies, and a little more.
        const low = p.reduce((least, v, m) => (m % 3 === 2 ? Math.min(least, v) : least), Infinity);
        const upright = Math.abs(normals[3 * w + 2]) < 0.1 && top > low;
        const ceiling = upright ? top + 0.15 * (top - low) : Infinity;
        for (let m = 0; m < p.length; m += 3) hold(p[m], p[m + 1], Math.min(p[m + 2], ceiling), 0);
      }
      if (this.data.has("terrain")) {
        const t = this.data.whole("terrain");
        for (let m = 0; m < t.length; m += 3) hold(t[m], t[m + 1], t[m + 2], 0);
      }
      this.fits.set(key, Number.isFinite(box[0]) ? box : [-1, 1, -1, 1]);
    }
    return this.fits.get(key);
  }

  fit(frame) {
    const [x0, x1, y0, y1] = this.bounds(frame);
    const { width, height } = this.player;
    this.view = { x: (x0 + x1) / 2, y: (y0 + y1) / 2, scale: 0.94 * Math.min(width / (x1 - x0), height / (y1 - y0)) };
  }

  zoom(factor, px, py) {
    const { width, height } = this.player;
    this.view.x += ((px - width / 2) / this.view.scale) * (1 - 1 / factor);
    this.view.y -= ((py - height / 2) / this.view.scale) * (1 - 1 / factor);
    this.view.scale *= factor;
    this.own = true;
  }

  drag(dx, dy, shift) {
    if (shift) {
      this.view.x -= dx / this.view.scale;
      this.view.y += dy / this.view.scale;
      this.own = true;
      return;
    }
    this.angles[0] -= dx * 0.008;
    this.angles[1] = Math.min(Math.max(this.angles[1] + dy * 0.008, -Math.PI / 2), Math.PI / 2);
    this.turn();
  }

  matrix(k, q) {
    const [w, x, y, z] = [q[0][k], q[1][k], q[2][k], q[3][k]];
    const n = 1 / (w * w + x * x + y * y + z * z || 1);
    return [
      1 - 2 * n * (y * y + z * z), 2 * n * (x * y - w * z), 2 * n * (x * z + w * y),
      2 * n * (x * y + w * z), 1 - 2 * n * (x * x + z * z), 2 * n * (y * z - w * x),
      2 * n * (x * z - w * y), 2 * n * (y * z + w * x), 1 - 2 * n * (x * x + y * y),
    ];
  }

  draw(ctx, frame, colors, look) {
    if (!this.own || !this.view) this.fit(frame);
    this.drawPlanes(ctx, true, look);
    const items = []; // [depth, corners of a triangle or an edge, or null; colour; sphere, or null; whether it is terrain]
    this.ink = look.stroke;
    this.addTerrain(items);
    const [x, y, z, shown] = ["x", "y", "z", "shown"].map((name) => this.data.row(name, frame));
    const q = [0, 1, 2, 3].map((axis) => this.data.row(`q${axis}`, frame));
    for (let k = 0; k < x.length; k++) {
      if (shown[k]) this.addBody(items, k, [x[k], y[k], z[k]], this.matrix(k, q), colors[k]);
    }
    items.sort((one, other) => one[0] - other[0]);
    ctx.lineJoin = "round";
    ctx.lineWidth = 0.7;
    ctx.globalAlpha = 1;
    for (const item of items) {
      if (!item[4] && look.chains) ctx.globalAlpha = 0.35;
      if (item[1]) this.paintPolygon(ctx, item[1], item[2]);
      else this.paintSphere(ctx, item[3], item[2]);
      ctx.globalAlpha = 1;
    }
    this.drawPlanes(ctx, false, look);
    const caption = look.chains ? this.drawChains(ctx, frame, x, y, z, look) : "";
    const chosen = this.player.chosen();
    if (chosen >= 0 && shown[chosen]) {
      const [px, py] = this.screen(x[chosen], y[chosen], z[chosen]);
      ctx.beginPath();
      ctx.arc(px, py, this.reach[this.shape[chosen]] * this.scale[chosen] * this.view.scale + 2, 0, 2 * Math.PI);
      ctx.lineWidth = 3;
      ctx.strokeStyle = look.ring;
      ctx.stroke();
    }
    return caption;
  }

  addBody(items, k, at, m, color) {
    const shape = this.shape[k];
    const s = this.scale[k];
    const place = (p, o) => [
      at[0] + s * (m[0] * p[o] + m[1] * p[o + 1] + m[2] * p[o + 2]),
      at[1] + s * (m[3] * p[o] + m[4] * p[o + 1] + m[5] * p[o + 2]),
      at[2] + s * (m[6] * p[o] + m[7] * p[o + 1] + m[8] * p[o + 2]),
    ];
    if (this.data.has(`spheres${shape}`)) {
      const spheres = this.data.whole(`spheres${shape}`);
      for (let o = 0; o < spheres.length; o += 4) {
        const c = place(spheres, o);
        items.push([this.depth(...c), null, color, [...this.screen(...c), spheres[o + 3] * s * this.view.scale], false]);
      }
      return;
    }
    const triangles = this.data.whole(`triangles${shape}`);
    const normals = this.data.whole(`normals${shape}`);
    const { toward: t, light: l } = this;
    for (let o = 0, n = 0; o < triangles.length; o += 9, n += 3) {
      const nx = m[0] * normals[n] + m[1] * normals[n + 1] + m[2] * normals[n + 2];
      const ny = m[3] * normals[n] + m[4] * normals[n + 1] + m[5] * normals[n + 2];
      const nz = m[6] * normals[n] + m[7] * normals[n + 1] + m[8] * normals[n + 2];
      if (nx * t[0] + ny * t[1] + nz * t[2] <= 1e-9) continue;
      const bright = DARKEST + (1 - DARKEST) * Math.max(0, nx * l[0] + ny * l[1] + nz * l[2]);
      const corners = [place(triangles, o), place(triangles, o + 3), place(triangles, o + 6)];
      const depth = corners.reduce((sum, c) => sum + this.depth(...c), 0) / 3;
      items.push([depth, corners.flatMap((c) => this.screen(...c)), shaded(color, bright), null, false]);
    }
    if (this.data.has(`edges${shape}`)) this.addEdges(items, shape, m, place, 0.25 * s * this.reach[shape]);
  }

  // Edges beside which a face is seen, brought before the faces that meet in them.
  addEdges(items, shape, m, place, forward) {
    const edges = this.data.whole(`edges${shape}`);
    const beside = this.data.whole(`beside${shape}`);
    const { toward: t } = this;
    const facing = (o) =>
      [0, 1, 2].reduce((sum, k) => sum + t[k] * (m[3 * k] * beside[o] + m[3 * k + 1] * beside[o + 1] + m[3 * k + 2] * beside[o + 2]), 0);
    for (let o = 0; o < edges.length; o += 6) {
      if (facing(o) <= 1e-9 && facing(o + 3) <= 1e-9) continue;
      const [a, b] = [place(edges, o), place(edges, o + 3)];
      const depth = (this.depth(...a) + this.depth(...b)) / 2 + forward;
      items.push([depth, [...this.screen(...a), ...this.screen(...b)], this.ink, null, false]);
    }
  }

  addTerrain(items) {
    if (!this.data.has("terrain")) return;
    const corners = this.data.whole("terrain");
    for (let o = 0; o < corners.length; o += 9) {
      const [a, b, c] = [0, 3, 6].map((k) => [corners[o + k], corners[o + k + 1], corners[o + k + 2]]);
      const u = b.map((v, k) => v - a[k]);
      const w = c.map((v, k) => v - a[k]);
      const normal = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
      const length = Math.hypot(...normal) || 1;
      const facing = this.depth(...normal) >= 0 ? 1 : -1;
      const bright = normal.reduce((sum, v, k) => sum + (facing * v * this.light[k]) / length, 0);
      const color = shaded(facing > 0 ? "#ccc4b5" : "#8a8478", DARKEST + (1 - DARKEST) * Math.max(0, bright));
      // Pushed back by its size, so that what lies on it is before it.
      const reach = Math.max(Math.hypot(...u), Math.hypot(...w));
      const depth = (this.depth(...a) + this.depth(...b) + this.depth(...c)) / 3 - reach;
      items.push([depth, [a, b, c].flatMap((p) => this.screen(...p)), color, null, true]);
    }
  }

  paintPolygon(ctx, p, color) {
    ctx.beginPath();
    ctx.moveTo(p[0], p[1]);
    ctx.lineTo(p[2], p[3]);
    ctx.strokeStyle = color;
    if (p.length > 4) {
      ctx.lineTo(p[4], p[5]);
      ctx.closePath();
      ctx.fillStyle = color;
      ctx.fill();
    }
    ctx.stroke(); // of a triangle it closes the hairline to its neighbours
  }

  // A shaded ball of each colour is painted once and then copied.
  paintSphere(ctx, [px, py, r], color) {
    let ball = this.sprites.get(color);
    if (!ball) {
      ball = document.createElement("canvas");
      ball.width = ball.height = 96;
      const c = ball.getContext("2d");
      const shade = c.createRadialGradient(36, 30, 4, 48, 48, 47);
      shade.addColorStop(0, shaded(color, 1.12));
      shade.addColorStop(0.55, shaded(color, 0.9));
      shade.addColorStop(1, shaded(color, 0.5));
      c.fillStyle = shade;
      c.beginPath();
      c.arc(48, 48, 47, 0, 2 * Math.PI);
      c.fill();
      this.sprites.set(color, ball);
    }
    ctx.drawImage(ball, px - r, py - r, 2 * r, 2 * r);
  }

  // Planes seen from their bodies' side as pale pieces below all, the others as outlines over all.
  drawPlanes(ctx, faced, look) {
    const normals = this.data.whole("planeNormals");
    for (let w = 0; w < this.facts.planes; w++) {
      const seen = this.depth(normals[3 * w], normals[3 * w + 1], normals[3 * w + 2]) > 0;
      if (seen !== faced) continue;
      const p = this.data.whole(`plane${w}`);
      ctx.beginPath();
      for (let o = 0; o < p.length; o += 3) ctx.lineTo(...this.screen(p[o], p[o + 1], p[o + 2]));
      ctx.closePath();
      ctx.lineWidth = 1;
      ctx.fillStyle = look.pale;
      ctx.strokeStyle = look.edge;
      if (faced) ctx.fill();
      ctx.stroke();
    }
  }

  drawChains(ctx, frame, x, y, z, look) {
    const contacts = contactsOf(this.data, this.starts, frame, this.facts.count);
    const widest = this.player.widest(frame);
    if (!(widest > 0) || !contacts.count) return "No contacts carry force here.";
    ctx.strokeStyle = look.chain;
    ctx.lineCap = "round";
    for (let c = 0; c < contacts.count; c++) {
      const share = Math.min(contacts.force[c] / widest, 1);
      if (share < 0.02) continue;
      const i = contacts.first[c];
      const j = contacts.second[c];
      const f = 3 * contacts.foot[c];
      const end = j < this.facts.count ? [x[j], y[j], z[j]] : [contacts.feet[f], contacts.feet[f + 1], contacts.feet[f + 2]];
      ctx.lineWidth = 5 * share;
      ctx.beginPath();
      ctx.moveTo(...this.screen(x[i], y[i], z[i]));
      ctx.lineTo(...this.screen(...end));
      ctx.stroke();
    }
    ctx.lineCap = "butt";
    const text = withUnit(this.facts.units, widest, "N", 3);
    return `Red lines are normal forces (mean of the last step), as wide as they are large: the widest ${text} or more.`;
  }

  // The nearest body whose sphere of reach is under the pointer, by how far off its centre the pointer is.
  pick(mx, my, frame) {
    const [x, y, z, shown] = ["x", "y", "z", "shown"].map((name) => this.data.row(name, frame));
    let best = -1;
    let nearest = -Infinity;
    for (let k = 0; k < x.length; k++) {
      if (!shown[k]) continue;
      const [px, py] = this.screen(x[k], y[k], z[k]);
      const reach = 0.8 * this.reach[this.shape[k]] * this.scale[k];
      const off = Math.hypot(mx - px, my - py) / this.view.scale / reach;
      if (off > 1) continue;
      const depth = this.depth(x[k], y[k], z[k]) + reach * Math.sqrt(1 - off * off);
      if (depth > nearest) [best, nearest] = [k, depth];
    }
    return best;
  }

  place(k, frame) {
    return this.screen(...["x", "y", "z"].map((name) => this.data.row(name, frame)[k]));
  }

  rows(k, frame) {
    const { units, groups } = this.facts;
    const value = (name) => this.player.values(name, frame)[k];
    return [
      ["kind", groups[this.data.whole("group")[k]]],
      ["x", withUnit(units, value("x"), "m", 5)],
      ["y", withUnit(units, value("y"), "m", 5)],
      ["z", withUnit(units, value("z"), "m", 5)],
      ["mass", withUnit(units, this.data.whole("mass")[k], "kg")],
      ["speed", withUnit(units, value("speed"), "m/s")],
      ["angular speed", withUnit(units, value("spin"), "rad/s")],
      ["kinetic energy", withUnit(units, value("kinetic"), "J")],
      ["displacement since the stage began", withUnit(units, value("displacement"), "m")],
      ["turned since the stage began", withUnit(units, value("rotation"), "rad")],
      ["bodies, planes and terrain touched", String(value("coordination"))],
    ];
  }
}

// A colour "#rrggbb" or "rgb(...)" times a brightness.
function shaded(color, bright) {
  const rgb = [1, 3, 5].map((k) => Math.min(255, Math.round(parseInt(color.slice(k, k + 2), 16) * bright)));
  return `rgb(${rgb.join(",")})`;
}
