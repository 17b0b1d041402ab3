// Draws grains in 2D: discs and ellipses to scale, grains of several elements with one outline, force chains, bonds, walls.

const FAR = 1e4; // pixels beyond the picture at which endless walls end
const MOST_EDGES = 5000;

class GrainPainter {
  constructor(player) {
    this.player = player;
    this.data = player.data;
    this.facts = player.facts;
    this.radius = this.data.whole("radius");
    this.a = this.data.whole("a");
    this.b = this.data.whole("b");
    this.body = this.data.whole("body");
    this.mean = this.radius.reduce((sum, r) => sum + r, 0) / Math.max(this.radius.length, 1);
    this.bonds = this.data.whole("bonds");
    this.view = null; // {x, y: centre [m], scale: pixels a metre}
    this.own = false; // whether the user has moved the view
    this.fits = new Map();
    this.starts = startsOf(this.data.whole("contacts"));
    this.mayDrag = "moves the view";
  }

  // x0, x1, y0, y1 of what is to be seen in some frames: grains, and walls with ends.
  box(frames) {
    const box = [Infinity, -Infinity, Infinity, -Infinity];
    for (const frame of frames) {
      const x = this.data.row("x", frame);
      const y = this.data.row("y", frame);
      const shown = this.data.row("shown", frame);
      for (let k = 0; k < x.length; k++) {
        if (!shown[k]) continue;
        const r = this.a[k];
        if (x[k] - r < box[0]) box[0] = x[k] - r;
        if (x[k] + r > box[1]) box[1] = x[k] + r;
        if (y[k] - r < box[2]) box[2] = y[k] - r;
        if (y[k] + r > box[3]) box[3] = y[k] + r;
      }
      const walls = this.walls(frame);
      for (let w = 0; w < walls.length; w++) {
        const side = w % 2 ? 2 : 0;
        const low = w % 2 ? box[2] : box[0];
        const reach = 3 * Math.max(box[1] - box[0], box[3] - box[2]);
        if (!Number.isFinite(walls[w]) || Math.abs(walls[w] - low) > reach) continue;
        box[side] = Math.min(box[side], walls[w]);
        if (this.facts.axis === "increment" || side === 0) box[side + 1] = Math.max(box[side + 1], walls[w]);
      }
    }
    return Number.isFinite(box[0]) ? box : [0, 1, 0, 1];
  }

  walls(frame) {
    const width = this.data.sections.walls.row;
    const all = this.data.whole("walls");
    const from = all.length > width ? frame * width : 0;
    return all.subarray(from, from + width);
  }

  // Of all frames that share a scale with this one.
  bounds(frame) {
    const key = this.player.scaleKey(frame);
    if (!this.fits.has(key)) this.fits.set(key, this.box(this.player.scaleFrames(frame, 24)));
    return this.fits.get(key);
  }

  fit(frame) {
    const [x0, x1, y0, y1] = this.bounds(frame);
    const { width, height } = this.player;
    this.view = { x: (x0 + x1) / 2, y: (y0 + y1) / 2, scale: 0.94 * Math.min(width / (x1 - x0), height / (y1 - y0)) };
  }

  screen(x, y) {
    const { width, height } = this.player;
    return [width / 2 + (x - this.view.x) * this.view.scale, height / 2 - (y - this.view.y) * this.view.scale];
  }

  zoom(factor, px, py) {
    const { width, height } = this.player;
    const x = this.view.x + (px - width / 2) / this.view.scale;
    const y = this.view.y - (py - height / 2) / this.view.scale;
    this.view.scale *= factor;
    this.view.x = x - (px - width / 2) / this.view.scale;
    this.view.y = y + (py - height / 2) / this.view.scale;
    this.own = true;
  }

  drag(dx, dy) {
    this.view.x -= dx / this.view.scale;
    this.view.y += dy / this.view.scale;
    this.own = true;
  }

  outline(ctx, k, px, py, angle) {
    const s = this.view.scale;
    if (this.a[k] === this.b[k]) {
      ctx.moveTo(px + this.a[k] * s, py);
      ctx.arc(px, py, this.a[k] * s, 0, 2 * Math.PI);
    } else {
      const c = Math.cos(angle);
      const t = Math.sin(angle);
      ctx.moveTo(px + this.a[k] * s * c, py - this.a[k] * s * t);
      ctx.ellipse(px, py, this.a[k] * s, this.b[k] * s, -angle, 0, 2 * Math.PI);
    }
  }

  draw(ctx, frame, colors, look) {
    if (!this.own || !this.view) this.fit(frame);
    const x = this.data.row("x", frame);
    const y = this.data.row("y", frame);
    const angle = this.data.row("angle", frame);
    const shown = this.data.row("shown", frame);
    const n = x.length;
    const s = this.view.scale;
    const px = new Float64Array(n);
    const py = new Float64Array(n);
    for (let k = 0; k < n; k++) [px[k], py[k]] = this.screen(x[k], y[k]);
    const edges = n <= MOST_EDGES && this.mean * s > 1.2;
    ctx.lineWidth = edges ? 1 : 0;
    ctx.strokeStyle = look.edge;
    // Members of a grain stand in a row: their outlines first, then their faces, so that only the grain's own outline stays.
    for (let start = 0; start < n; ) {
      let stop = start + 1;
      while (stop < n && this.body[stop] === this.body[start]) stop++;
      if (edges) {
        ctx.beginPath();
        for (let k = start; k < stop; k++) if (shown[k]) this.outline(ctx, k, px[k], py[k], angle[k]);
        ctx.stroke();
      }
      for (let k = start; k < stop; k++) {
        if (!shown[k]) continue;
        ctx.fillStyle = colors[k];
        ctx.beginPath();
        this.outline(ctx, k, px[k], py[k], angle[k]);
        ctx.fill();
      }
      start = stop;
    }
    if (look.bonds) this.drawBonds(ctx, px, py, shown, look);
    const caption = look.chains ? this.drawChains(ctx, frame, px, py, look) : "";
    if (look.marks) this.drawMarks(ctx, px, py, angle, shown, look);
    this.drawWalls(ctx, frame, look);
    const chosen = this.player.chosen();
    if (chosen >= 0 && shown[chosen]) {
      ctx.beginPath();
      this.outline(ctx, chosen, px[chosen], py[chosen], angle[chosen]);
      ctx.lineWidth = 5;
      ctx.strokeStyle = look.ring;
      ctx.stroke();
      ctx.lineWidth = 2;
      ctx.strokeStyle = look.paper;
      ctx.stroke();
    }
    return caption;
  }

  drawBonds(ctx, px, py, shown, look) {
    ctx.strokeStyle = look.ink;
    ctx.lineWidth = Math.min(Math.max(0.25 * this.mean * this.view.scale, 0.5), 4);
    ctx.beginPath();
    const line = (i, j) => {
      if (!shown[i] || !shown[j]) return;
      ctx.moveTo(px[i], py[i]);
      ctx.lineTo(px[j], py[j]);
    };
    if (this.bonds.length) for (let k = 0; k < this.bonds.length; k += 2) line(this.bonds[k], this.bonds[k + 1]);
    else for (let k = 1; k < px.length; k++) if (this.body[k] === this.body[k - 1]) line(k - 1, k);
    ctx.stroke();
  }

  // Lines from centre to centre, or to the contact point on a wall, in 24 widths; the widest is the 99.5th percentile of the scale.
  drawChains(ctx, frame, px, py, look) {
    const contacts = contactsOf(this.data, this.starts, frame, this.facts.count);
    const widest = this.player.widest(frame);
    if (!(widest > 0) || !contacts.count) return "No contacts carry force here.";
    const most = Math.min(Math.max(0.8 * this.mean * this.view.scale, 1.5), 6);
    const bins = Array.from({ length: 24 }, () => []);
    for (let c = 0; c < contacts.count; c++) {
      const share = Math.min(contacts.force[c] / widest, 1);
      if (share >= 0.02) bins[Math.min(23, Math.floor(24 * share))].push(c);
    }
    const path = (bin) => {
      ctx.beginPath();
      for (const c of bin) {
        const i = contacts.first[c];
        const j = contacts.second[c];
        ctx.moveTo(px[i], py[i]);
        if (j < this.facts.count) ctx.lineTo(px[j], py[j]);
        else ctx.lineTo(...this.screen(contacts.feet[2 * contacts.foot[c]], contacts.feet[2 * contacts.foot[c] + 1]));
      }
      ctx.stroke();
    };
    const widths = bins.map((_, k) => (most * (k + 0.5)) / 24);
    ctx.strokeStyle = look.halo; // thin lines need none, and there are many of them
    bins.forEach((bin, k) => {
      ctx.lineWidth = widths[k] + Math.min(widths[k], 1.5);
      ctx.lineCap = "round";
      if (bin.length && widths[k] > 1) path(bin);
    });
    ctx.strokeStyle = look.chain;
    bins.forEach((bin, k) => {
      ctx.lineWidth = widths[k];
      ctx.lineCap = widths[k] > 1 ? "round" : "butt";
      if (bin.length) path(bin);
    });
    ctx.lineCap = "butt";
    return `Red lines are normal forces, as wide as they are large: the widest ${withUnit(this.facts.units, widest, "N", 3)} or more.`;
  }

  drawMarks(ctx, px, py, angle, shown, look) {
    ctx.strokeStyle = look.ink;
    ctx.lineWidth = 1;
    ctx.beginPath();
    for (let k = 0; k < px.length; k++) {
      if (!shown[k]) continue;
      const reach = this.a[k] * this.view.scale;
      ctx.moveTo(px[k], py[k]);
      ctx.lineTo(px[k] + reach * Math.cos(angle[k]), py[k] - reach * Math.sin(angle[k]));
    }
    ctx.stroke();
  }

  drawWalls(ctx, frame, look) {
    const walls = this.walls(frame);
    const near = (v) => Math.min(Math.max(v, -FAR), FAR);
    ctx.strokeStyle = look.ink;
    ctx.lineWidth = 2;
    ctx.beginPath();
    for (let k = 0; k < walls.length; k += 4) {
      const [x0, y0] = this.screen(walls[k], walls[k + 1]);
      const [x1, y1] = this.screen(walls[k + 2], walls[k + 3]);
      ctx.moveTo(near(x0), near(y0));
      ctx.lineTo(near(x1), near(y1));
    }
    ctx.stroke();
  }

  pick(mx, my, frame) {
    const x = this.data.row("x", frame);
    const y = this.data.row("y", frame);
    const angle = this.data.row("angle", frame);
    const shown = this.data.row("shown", frame);
    let best = -1;
    let least = 1;
    for (let k = 0; k < x.length; k++) {
      if (!shown[k]) continue;
      const [px, py] = this.screen(x[k], y[k]);
      const dx = (mx - px) / this.view.scale;
      const dy = (py - my) / this.view.scale;
      const c = Math.cos(angle[k]);
      const s = Math.sin(angle[k]);
      const inside = Math.hypot((c * dx + s * dy) / this.a[k], (c * dy - s * dx) / this.b[k]);
      if (inside <= least) [best, least] = [k, inside];
    }
    return best;
  }

  // Where an element's centre is in the picture, in CSS pixels from its upper left corner.
  place(k, frame) {
    return this.screen(this.data.row("x", frame)[k], this.data.row("y", frame)[k]);
  }

  // Rows of the table of one element.
  rows(k, frame) {
    const { units, axis } = this.facts;
    const value = (name) => this.player.values(name, frame)[k];
    const degrees = (v) => (Number.isFinite(v) ? `${formatNumber((v * 180) / Math.PI)} deg` : "-");
    const turn = ((this.data.row("angle", frame)[k] + Math.PI) % (2 * Math.PI)) - Math.PI;
    const rows = [];
    if (this.facts.several) rows.push(["grain", String(this.body[k])]);
    rows.push(["x", withUnit(units, value("x"), "m", 5)], ["y", withUnit(units, value("y"), "m", 5)]);
    if (this.a[k] === this.b[k]) rows.push(["radius", withUnit(units, this.radius[k], "m")]);
    else rows.push(["semi-axes", `${withUnit(units, this.a[k], "m")}, ${withUnit(units, this.b[k], "m")}`]);
    rows.push(["angle", degrees(turn)]);
    if (axis === "time") {
      rows.push(["speed", withUnit(units, value("speed"), "m/s")]);
      rows.push(["angular velocity", withUnit(units, value("spin"), "rad/s")]);
    }
    rows.push(["displacement since the stage began", withUnit(units, value("displacement"), "m")]);
    rows.push(["rotation since the stage began", degrees(value("rotation"))]);
    rows.push(["contacts", String(value("coordination"))]);
    rows.push(["mean stress", withUnit(units, value("pressure"), "Pa")]);
    rows.push(["largest shear stress", withUnit(units, value("shear_stress"), "Pa")]);
    for (const name of ["stress_xx", "stress_yy", "stress_xy"]) {
      rows.push([name.replace("_", " "), withUnit(units, value(name), "Pa")]);
    }
    return rows;
  }
}
