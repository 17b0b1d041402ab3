// What the reader does: buttons, choices, keys and pointer of a player.

const RATES = [1, 2, 5, 10, 20, 40]; // frames a second

function fillControls(player) {
  const { facts } = player;
  const option = (select, value, text) => select.add(new Option(text, value));
  const gaps = facts.places.slice(1).map((place, k) => place - facts.places[k]);
  const gap = percentile(gaps.filter((v) => v > 0).sort((a, b) => a - b), 0.5);
  for (const rate of RATES) {
    const real = facts.axis === "time" && gap > 0 ? `, ${formatNumber(rate * gap, 2)} x real time` : "";
    option(player.part("speed"), rate, `${rate} frame${rate > 1 ? "s" : ""}/s${real}`);
  }
  player.part("speed").value = "10";
  for (const quantity of facts.quantities) option(player.part("color"), quantity.name, quantity.label);
  player.part("color").value = facts.color;
  player.part("scrub").max = String(player.count - 1);
  player.part("chains").checked = true;
  const bodies = facts.kind === "bodies";
  if (bodies) player.part("chains").checked = false;
  player.root.querySelector('[data-only="grains"]').hidden = bodies;
  player.root.querySelector('[data-only="bonds"]').hidden = !facts.several;
  player.noun = bodies ? "body" : facts.several ? "disc" : "grain";
  player.part("noun").textContent = player.noun[0].toUpperCase() + player.noun.slice(1);
  player.part("dragging").textContent = player.painter.mayDrag;
  player.part("grain").max = String(player.ids.reduce((most, id) => Math.max(most, id), 0));
}

function listen(player) {
  const on = (name, type, act) => player.part(name).addEventListener(type, act);
  on("play", "click", () => player.toggle());
  on("first", "click", () => player.show(0));
  on("last", "click", () => player.show(player.count - 1));
  on("back", "click", () => player.step(-1));
  on("next", "click", () => player.step(1));
  on("scrub", "input", (event) => player.show(Number(event.target.value)));
  for (const name of ["color", "chains", "marks", "bonds"]) on(name, "change", () => player.redraw());
  on("scale", "change", () => {
    player.painter.own = false;
    player.redraw();
  });
  on("grain", "input", (event) => {
    player.selected = event.target.value === "" ? -1 : player.ids.indexOf(Number(event.target.value));
    player.redraw();
  });
  const middle = () => [player.width / 2, player.height / 2];
  on("in", "click", () => player.zoom(1.4, ...middle()));
  on("out", "click", () => player.zoom(1 / 1.4, ...middle()));
  on("fit", "click", () => player.fit());
  player.canvas.addEventListener("keydown", (event) => actOnKey(player, event));
}

function listenToPointer(player) {
  const { canvas } = player;
  let held = null;
  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("pointerdown", (event) => {
    held = { x: event.clientX, y: event.clientY, moved: false };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (held) {
      const [dx, dy] = [event.clientX - held.x, event.clientY - held.y];
      if (!held.moved && Math.hypot(dx, dy) < 4) return;
      held = { x: event.clientX, y: event.clientY, moved: true };
      player.painter.drag(dx, dy, event.shiftKey);
    } else {
      player.hovered = player.painter.pick(...at(event), player.frame);
    }
    player.redraw();
  });
  canvas.addEventListener("pointerup", (event) => {
    if (held && !held.moved) player.select(player.painter.pick(...at(event), player.frame));
    held = null;
  });
  canvas.addEventListener("pointercancel", () => (held = null));
  canvas.addEventListener("pointerleave", () => {
    player.hovered = -1;
    player.redraw();
  });
  // Only where the reader has chosen the picture: the wheel belongs to the page else.
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      player.zoom(Math.exp(-Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 100) * 0.002), ...at(event));
    },
    { passive: false },
  );
}

function actOnKey(player, event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const middle = [player.width / 2, player.height / 2];
  const acts = {
    " ": () => player.toggle(),
    ArrowLeft: () => player.step(-1),
    ArrowRight: () => player.step(1),
    Home: () => player.show(0),
    End: () => player.show(player.count - 1),
    "+": () => player.zoom(1.4, ...middle),
    "=": () => player.zoom(1.4, ...middle),
    "-": () => player.zoom(1 / 1.4, ...middle),
    0: () => player.fit(),
    n: () => player.select((player.selected + 1) % player.ids.length),
    p: () => player.select((Math.max(player.selected, 0) - 1 + player.ids.length) % player.ids.length),
    Escape: () => player.select(-1),
  };
  const moves = { ArrowLeft: [-40, 0], ArrowRight: [40, 0], ArrowUp: [0, -40], ArrowDown: [0, 40] };
  const move = event.shiftKey && moves[event.key];
  if (!move && !(event.key in acts)) return;
  event.preventDefault();
  if (!move) acts[event.key]();
  else {
    player.painter.drag(...move, false);
    player.redraw();
  }
}
