// One player: its frames, scales, colours and tables. What a frame looks like is the painter's, what the reader does the controls'.

const MOST_VALUES = 200000; // of a quantity that its limits are taken from

class Player {
  constructor(root) {
    this.root = root;
    this.facts = JSON.parse(root.querySelector(".facts-of-player").textContent);
    this.part = (name) => root.querySelector(`[data-part="${name}"]`);
    this.canvas = root.querySelector("canvas");
    this.ctx = this.canvas.getContext("2d");
    this.frame = 0;
    this.playing = false;
    this.hovered = -1;
    this.selected = -1;
    this.waiting = false;
    this.limits = new Map();
    this.widths = new Map();
  }

  async start() {
    try {
      const holder = this.root.querySelector(".data-of-player");
      this.data = new Data(await inflate(holder.textContent), this.facts.sections);
      holder.remove();
    } catch (error) {
      this.part("status").textContent = `The frames cannot be unpacked in this browser (${error.message}).`;
      return;
    }
    this.maps = Object.fromEntries(Object.entries(this.facts.maps).map(([name, hex]) => [name, parseMap(hex)]));
    this.ids = Array.from(this.data.whole("id"));
    this.painter = this.facts.kind === "bodies" ? new BodyPainter(this) : new GrainPainter(this);
    this.count = this.facts.places.length;
    fillControls(this);
    const [x0, x1, y0, y1] = this.painter.bounds(this.count - 1);
    this.aspect = Math.min(Math.max((y1 - y0) / (x1 - x0), 0.3), 0.8);
    listen(this);
    listenToPointer(this);
    this.part("status").hidden = true;
    this.root.dataset.ready = "yes";
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
    this.resize();
    // Where grains are too small to be told from the lines through them, the reader may still ask for the lines.
    this.painter.fit(this.count - 1);
    if (this.facts.kind === "grains" && this.painter.mean * this.painter.view.scale < 2.5) this.part("chains").checked = false;
    this.show(this.count - 1);
  }

  select(k) {
    this.selected = k;
    this.part("grain").value = k < 0 ? "" : String(this.ids[k]);
    this.redraw();
  }

  chosen() {
    return this.hovered >= 0 ? this.hovered : this.selected;
  }

  zoom(factor, px, py) {
    this.painter.zoom(factor, px, py);
    this.redraw();
  }

  fit() {
    this.painter.own = false;
    this.redraw();
  }

  // ---------------------------------------------------------------- time

  show(frame) {
    this.frame = Math.min(Math.max(frame, 0), this.count - 1);
    this.part("scrub").value = String(this.frame);
    const text = `${this.placeText()}, frame ${this.frame + 1} of ${this.count}`;
    this.part("scrub").setAttribute("aria-valuetext", text);
    this.part("place").textContent = text;
    this.redraw();
  }

  placeText() {
    const place = this.facts.places[this.frame];
    return this.facts.axis === "time" ? `t = ${formatNumber(place, 5)} s` : `increment ${place}`;
  }

  step(by) {
    this.pause();
    this.show(this.frame + by);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  pause() {
    this.playing = false;
    this.part("play").textContent = "Play";
  }

  play() {
    if (this.count < 2) return;
    if (this.frame >= this.count - 1) this.show(0);
    this.playing = true;
    this.part("play").textContent = "Pause";
    let from = null;
    const tick = (now) => {
      if (!this.playing) return;
      const rate = Number(this.part("speed").value);
      if (from === null) from = now;
      const steps = Math.floor(((now - from) / 1000) * rate);
      if (steps > 0) {
        from += (steps * 1000) / rate;
        this.show(this.frame + steps);
        if (this.frame >= this.count - 1) return this.pause();
      }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  // ---------------------------------------------------------------- what view, colours and widths are scaled by

  scaleKey(frame) {
    const by = this.part("scale").value;
    return by === "run" ? "run" : by === "frame" ? `frame ${frame}` : `stage ${this.facts.stage[frame]}`;
  }

  // Frames that share a scale with this one, at most `most` of them, evenly spread.
  scaleFrames(frame, most) {
    const key = this.scaleKey(frame);
    const all = this.facts.places.map((_, k) => k).filter((k) => this.scaleKey(k) === key);
    if (all.length <= most) return all;
    return Array.from({ length: most }, (_, k) => all[Math.round((k * (all.length - 1)) / (most - 1))]);
  }

  widest(frame) {
    const key = this.scaleKey(frame);
    if (!this.widths.has(key)) {
      const forces = [];
      for (const k of this.scaleFrames(frame, 24)) {
        for (const force of contactsOf(this.data, this.painter.starts, k, this.facts.count).force) forces.push(force);
      }
      this.widths.set(key, percentile(Float64Array.from(forces).sort(), 0.995));
    }
    return this.widths.get(key);
  }

  // ---------------------------------------------------------------- quantities

  quantity(name) {
    return this.facts.quantities.find((quantity) => quantity.name === name);
  }

  // Values (SI) of a quantity in a frame, one a grain.
  values(name, frame) {
    const { data } = this;
    const quantity = this.quantity(name);
    if (quantity && quantity.of) {
      const [how, ...names] = quantity.of;
      const [a, b, c] = names.map((one) => data.row(one, frame));
      if (how === "hypot") return Float64Array.from(a, (v, k) => Math.hypot(v, b[k]));
      if (how === "mean") return Float64Array.from(a, (v, k) => (v + b[k]) / 2);
      return Float64Array.from(a, (v, k) => Math.hypot((v - b[k]) / 2, c[k]));
    }
    if (name === "kind") return data.whole("group");
    if (name === "height") return data.row("z", frame);
    return data.sections[name].rows ? data.row(name, frame) : data.whole(name);
  }

  limitsOf(quantity, frame) {
    const key = `${quantity.name} ${this.scaleKey(frame)}`;
    if (!this.limits.has(key)) {
      const grains = this.facts.count - (this.facts.boundary || 0);
      const most = Math.max(1, Math.floor(MOST_VALUES / Math.max(grains, 1)));
      const found = [];
      for (const k of this.scaleFrames(frame, Math.min(most, 60))) {
        const values = this.values(quantity.name, k);
        const shown = this.data.row("shown", k);
        for (let m = 0; m < grains; m++) if (shown[m]) found.push(values[m]);
      }
      this.limits.set(key, colorLimits(quantity.kind, found));
    }
    return this.limits.get(key);
  }

  // A colour for each grain, and the limits they stand for.
  colors(quantity, frame, look) {
    const values = this.values(quantity.name, frame);
    const inner = this.facts.count - (this.facts.boundary || 0);
    const outer = (k, color) => (k < inner ? color : this.facts.boundaryColor);
    if (quantity.kind === "label") {
      const { palette } = this.facts;
      return [Array.from(values, (v, k) => outer(k, palette[v % palette.length])), null];
    }
    const limits = this.limitsOf(quantity, frame);
    const [low, high] = limits;
    const map = this.mapOf(quantity);
    const color = (v) =>
      Number.isFinite(v) ? map[Math.min(255, Math.max(0, Math.floor((256 * (v - low)) / (high - low))))] : look.none;
    return [Array.from(values, (v, k) => outer(k, color(v))), limits];
  }

  mapOf(quantity) {
    return this.maps[quantity.kind] || this.maps.range;
  }

  // ---------------------------------------------------------------- drawing

  resize() {
    const width = Math.max(this.canvas.parentElement.clientWidth, 50);
    const height = Math.min(Math.max(this.aspect * width, 220), Math.max(0.72 * window.innerHeight, 220));
    if (width === this.width && height === this.height) return;
    [this.width, this.height] = [width, height];
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.canvas.style.height = `${height}px`;
    this.ratio = ratio;
    this.redraw();
  }

  redraw() {
    if (this.waiting || !this.painter || !this.width) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  look() {
    const style = getComputedStyle(this.root);
    const color = (name) => style.getPropertyValue(`--${name}`).trim();
    const checked = (name) => this.part(name).checked;
    return {
      ...Object.fromEntries(["paper", "ink", "edge", "stroke", "pale", "chain", "halo", "ring", "none"].map((name) => [name, color(name)])),
      chains: checked("chains"),
      marks: checked("marks"),
      bonds: this.facts.several && checked("bonds"),
    };
  }

  draw() {
    const { ctx, frame } = this;
    const look = this.look();
    const quantity = this.quantity(this.part("color").value);
    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.clearRect(0, 0, this.width, this.height);
    ctx.fillStyle = look.paper;
    ctx.fillRect(0, 0, this.width, this.height);
    const [colors, limits] = this.colors(quantity, frame, look);
    const caption = this.painter.draw(ctx, frame, colors, look);
    const shaken = this.facts.readouts.some((one) => one.label.includes("of the container"));
    const axes = shaken ? "Drawn in the container's own axes, which move with it." : "";
    this.part("caption").textContent = [caption, axes].filter(Boolean).join(" ");
    this.drawBar(quantity, limits);
    this.fillFrame();
    this.fillGrain();
    this.root.dataset.drawn = String(frame);
  }

  drawBar(quantity, limits) {
    const key = JSON.stringify([quantity.name, limits]);
    if (key === this.barKey) return;
    this.barKey = key;
    const strip = this.part("strip");
    const ticks = this.part("ticks");
    strip.hidden = ticks.hidden = !limits;
    if (!limits) {
      const names = quantity.name === "kind" ? `: ${this.facts.groups.join(", ")}` : ": colours only tell them apart";
      this.part("bar-label").textContent = quantity.label + names;
      return;
    }
    const [low, high, below, above] = limits;
    const [factor, unit] = displayUnit(this.facts.units, quantity.unit, Math.max(Math.abs(low), Math.abs(high)));
    const notes = [below && "values below", above && "values above"].filter(Boolean);
    const beyond = notes.length ? ` (${notes.join(" and ")} have the colour of the end)` : "";
    this.part("bar-label").textContent = `${quantity.label}${unit ? ` [${unit}]` : ""}${beyond}`;
    const map = this.mapOf(quantity);
    strip.style.background = `linear-gradient(to right, ${map.filter((_, k) => k % 8 === 0 || k === 255).join(", ")})`;
    const at = quantity.kind === "cyclic" ? [-90, -45, 0, 45, 90] : niceTicks(low / factor, high / factor, 6, quantity.kind === "count");
    ticks.replaceChildren(
      ...at.map((value) => {
        const tick = document.createElement("span");
        tick.textContent = formatNumber(value, 6);
        tick.style.left = `${(100 * (value * factor - low)) / (high - low)}%`;
        return tick;
      }),
    );
  }

  fillFrame() {
    const { facts, frame } = this;
    const axis = facts.axis === "time" ? ["time", withUnit({}, facts.places[frame], "s", 5)] : ["increment", String(facts.places[frame])];
    const rows = [axis, ["stage", facts.stages[facts.stage[frame]] || "-"]];
    for (const one of facts.readouts) {
      const value = one.values[frame];
      const largest = Math.max(...one.values.map((v) => Math.abs(v ?? 0)));
      const [factor, unit] = displayUnit(facts.units, one.unit, largest);
      const text = value === null ? "-" : formatNumber(value / factor);
      rows.push([one.label, unit && value !== null ? `${text} ${unit}` : text]);
    }
    if (facts.numbers[frame] !== frame || facts.total !== this.count) {
      rows.push(["frame of the file", `${facts.numbers[frame]} of ${facts.total}`]);
    }
    fillRows(this.part("frame"), rows);
  }

  fillGrain() {
    const k = this.chosen();
    const known = k >= 0 && this.data.row("shown", this.frame)[k];
    const title = this.part("grain-title");
    const name = this.noun[0].toUpperCase() + this.noun.slice(1);
    if (k < 0) title.textContent = `No ${this.noun} chosen: point at one`;
    else title.textContent = known ? `${name} ${this.ids[k]}` : `${name} ${this.ids[k]} has escaped`;
    // The same rows without numbers where there is none, so that the page keeps its height.
    const rows = this.painter.rows(known ? k : 0, this.frame);
    fillRows(this.part("facts"), known ? rows : rows.map(([label]) => [label, "-"]));
  }
}

function fillRows(body, rows) {
  while (body.rows.length > rows.length) body.deleteRow(-1);
  rows.forEach(([label, text], k) => {
    const row = body.rows[k] || body.insertRow();
    if (!row.cells.length) {
      row.append(Object.assign(document.createElement("th"), { scope: "row" }), document.createElement("td"));
    }
    if (row.cells[0].textContent !== label) row.cells[0].textContent = label;
    if (row.cells[1].textContent !== text) row.cells[1].textContent = text;
  });
}
