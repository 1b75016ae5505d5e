"use strict";
// Linked views: one instant and one homotopy class on map, speed, margins and friction circle.
(() => {
  const data = vnavData;
  if (!data) return;
  const byId = (key) => document.getElementById(`explore-${key}`);
  const slider = byId("time"), play = byId("play"), rate = byId("rate"), now = byId("now"), replay = byId("replay"), chosen = byId("class");
  const boxes = [...document.querySelectorAll("#explore-layers input")];
  const plots = vnavPlots(data), { named, put } = plots;
  const followed = data.executed, ways = Object.keys(data.motions).filter((key) => key.startsWith("plan-") && key !== followed);
  const zoned = data.zone ? document.getElementById("zone-data") : null, zone = zoned ? JSON.parse(zoned.textContent) : null;
  const state = { t: 0, rank: null, layers: {}, margin: "", playing: 0 };
  const margins = vnavMargins(data, plots, state), { amount, minus, tightest } = margins;
  const filled = new Set();
  const tint = {};  // colours of dots by key

  // --- what is drawn once, and on demand

  function fill(key) {  // the columns of a motion, when it is first shown
    if (filled.has(key)) return;
    filled.add(key);
    const source = named(`motion-${key}-columns`), columns = data.motion(key);
    source.data = Object.fromEntries(Object.keys(source.data).map((name) => [name, columns[name]]));
  }

  function fillLines(key) {  // a layer of lines
    if (filled.has(key)) return;
    filled.add(key);
    const lines = data.lines(data.layers[key]);
    if (key !== "stops") return put(`lines-${key}`, lines);
    const { straightened, bad } = data.layers.stops, straight = new Set(straightened), failed = new Set(bad);
    const pick = (keep) => ({ xs: lines.xs.filter((_, k) => keep(k)), ys: lines.ys.filter((_, k) => keep(k)) });
    put("lines-stops-held", pick((k) => !straight.has(k)));
    put("lines-stops-straightened", pick((k) => straight.has(k)));
    put("lines-stops-bad", pick((k) => failed.has(k)));
    put("bad-places", { x: bad.map((k) => lines.xs[k].at(-1)), y: bad.map((k) => lines.ys[k].at(-1)) });
  }

  function drawPath() {
    const { x, y, v } = data.motion(followed), n = x.length - 1;
    fill(followed);
    put("pieces", { x0: x.subarray(0, n), y0: y.subarray(0, n), x1: x.subarray(1), y1: y.subarray(1),
      v: v.subarray(0, n).map((speed, k) => 0.5 * (speed + v[k + 1])) });
  }

  // --- layers and classes

  const on = (key) => state.layers[key] === true;
  const look = (name, visible, alpha = 1) => {
    const renderer = named(name);
    if (visible && renderer.glyph.line_alpha.value !== alpha) renderer.glyph.line_alpha = { value: alpha };
    renderer.visible = visible;
  };

  function showLayers() {
    const aside = state.rank === null ? 1 : 0.25;
    for (const key of ways) {
      if (on(key)) fill(key);
      look(key, on(key), aside);
      look(`speed-${key}`, on(key), aside);
    }
    for (const name of [followed, "pieces"]) named(name).visible = state.layers[followed] !== false;
    for (const rank of data.ranks) {
      const key = `class-${rank}`, own = rank === state.rank, shown = own || on("classes");
      if (shown) fill(key);
      look(key, shown, own ? 1 : aside);
      const moving = own && "t" in data.motion(key);
      look(`speed-${key}`, moving);
      look(`friction-${key}`, moving);
    }
    const seen = [...ways.filter(on), ...(state.rank === null ? [] : [`class-${state.rank}`])];
    plots.reaching(seen.reduce((top, key) => (data.motion(key).v ?? []).reduce((a, b) => Math.max(a, b), top), 0));
    for (const key of ["arcs", "graph", "mesh"]) {
      if (on(key)) fillLines(key);
      named(key).visible = on(key);
    }
    if (on("stops")) fillLines("stops");
    for (const name of ["stops-held", "stops-straightened", "stops-bad", "stops-bad-places"]) named(name).visible = on("stops");
    named("disc").visible = named("nearest").visible = on("disc");
    cursor();
  }

  function choose(rank) {
    state.rank = data.ranks.includes(rank) ? rank : null;
    chosen.hidden = rank === null;
    if (rank !== null) {
      const known = state.rank !== null && "t" in data.motion(`class-${rank}`);
      const words = known ? `its optimum takes ${data.motion(`class-${rank}`).t.at(-1).toFixed(3)} s` : state.rank === null ? "its path is not drawn here" : "without a motion: its path comes too close";
      chosen.textContent = `Class ${rank} beside the motion: ${words}. Esc takes it back.`;
    }
    const end = state.rank === null ? 0 : data.motion(`class-${rank}`).t?.at(-1) ?? 0;
    plots.lasting(Math.max(data.end, end));
    margins.show();
    showLayers();
  }

  // --- the cursor

  function ring(x, y, radius) {
    const xs = [], ys = [];
    for (let k = 0; k < 72; k++) {
      xs.push(x + radius * Math.cos((k * Math.PI) / 36));
      ys.push(y + radius * Math.sin((k * Math.PI) / 36));
    }
    return { x: xs, y: ys };
  }

  function outline({ x, y, braking }) {
    if (!data.zone) return ring(x, y, data.radius + braking);
    if (!zone) return { x: [], y: [] };
    const i = data.row(state.t, zone.t), next = Math.min(i + 1, zone.t.length - 1);
    const points = zone.outlines[state.t - zone.t[i] < zone.t[next] - state.t ? i : next];
    return { x: points.filter((_, k) => k % 2 === 0), y: points.filter((_, k) => k % 2 === 1) };
  }

  const tone = (key) => (tint[key] ??= plots.colour(data.tones[key] ?? key));

  function cursor() {
    const { t } = state, here = data.here(t), tight = tightest(here);
    const shown = [...ways.filter(on), ...(state.rank === null ? [] : [`class-${state.rank}`])].filter((key) => "t" in data.motion(key));
    const others = shown.map((key) => ({ ...data.at(key, t), colour: tone(key) }));
    put("robot", { x: [here.x], y: [here.y], x1: [here.x + data.heading * Math.cos(here.heading)], y1: [here.y + data.heading * Math.sin(here.heading)] });
    if (on("disc")) {
      put("disc", outline(here));
      put("nearest", { x0: [here.x], y0: [here.y], x1: [here.nearest_x], y1: [here.nearest_y] });
    }
    put("beside", { x: others.map((o) => o.x), y: others.map((o) => o.y), colour: others.map((o) => o.colour) });
    const all = [...others, { ...here, colour: tone(followed) }];
    named("speed-line").location = named("margins-line").location = t;
    put("speed-dots", { x: all.map(() => t), y: all.map((o) => o.v), colour: all.map((o) => o.colour) });
    const value = state.margin ? here[`margin.${state.margin}`] : 100 * Math.min(tight.value, 1);
    put("margins-dots", { x: [t], y: [value], colour: [tone("--ink")] });
    put("friction-cursor", { x: [here.turn], y: [here.a], x0: [0], y0: [0] });
    tell(here, tight);
    slider.value = t;
    slider.setAttribute("aria-valuetext", `${t.toFixed(2)} s`);
    if (replay) replay.href = `${replay.getAttribute("href").split("#")[0]}#t=${t.toFixed(2)}`;
  }

  function tell(here, tight) {
    const rows = [["", `${state.t.toFixed(2)} s`], ["way", `${here.s.toFixed(2)} m`], ["speed", `${here.v.toFixed(2)} m/s`],
      ["clearance", `${here.clearance.toFixed(2)} m`], ["stops within", `${here.braking.toFixed(2)} m`],
      ["tightest", `${tight.margin.name.toLowerCase()}, ${amount(100 * tight.value, "%")} left`]];
    now.replaceChildren(...rows.map(([name, value]) => {
      const part = document.createElement("span"), strong = document.createElement("b");
      strong.textContent = minus(value);
      part.append(name ? `${name} ` : "", strong);
      return part;
    }));
  }

  function seek(t, source = "explorer") {
    state.t = Math.min(Math.max(t, 0), data.end);
    cursor();
    if (source === "explorer") document.dispatchEvent(new CustomEvent("vnav:time", { detail: { t: state.t, source } }));
  }

  // --- play

  function stop() {
    cancelAnimationFrame(state.playing);
    state.playing = 0;
    play.firstElementChild.textContent = "\u25b6";
    play.setAttribute("aria-label", "Play");
  }

  function start() {
    let last = performance.now();
    if (state.t >= data.end) seek(0);
    const step = (time) => {
      seek(state.t + ((time - last) / 1000) * Number(rate.value));
      last = time;
      if (state.t >= data.end) stop(); else state.playing = requestAnimationFrame(step);
    };
    play.firstElementChild.textContent = "\u275a\u275a";
    play.setAttribute("aria-label", "Pause");
    state.playing = requestAnimationFrame(step);
  }

  const toggle = () => (state.playing ? stop() : start());

  // --- hands

  function nearest(name, spot) {
    const own = data.motion(followed), [xs, ys] = name === "map" ? [own.x, own.y] : [own.turn, own.a];
    const away = (i) => Math.hypot(xs[i] - spot.x, ys[i] - spot.y) / spot.pixel;
    let best = 0, cost = Infinity;
    for (let i = 0; i < xs.length; i++) {  // where a path crosses itself, the branch that the cursor is on
      const own_cost = away(i) + (4 * Math.abs(own.t[i] - state.t)) / data.end;
      if (own_cost < cost) [best, cost] = [i, own_cost];
    }
    return away(best) < 40 ? own.t[best] : null;
  }

  function point(name, event) {
    const spot = plots.under(name, event);
    if (!spot) return;
    const t = name === "map" || name === "friction" ? nearest(name, spot) : spot.x;
    if (t !== null) seek(t);
  }

  function key(event, name) {
    const step = event.shiftKey ? 1 : 0.1, moves = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, 0.15], ArrowDown: [0, -0.15] };
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key === " ") toggle();
    else if (name && "+=".includes(event.key)) plots.zoom(name, 1 / 1.5);
    else if (name && event.key === "-") plots.zoom(name, 1.5);
    else if (name && event.key === "0") plots.whole(name);
    else if (name === "map" && moves[event.key]) plots.move(name, ...moves[event.key]);
    else if (event.key === "ArrowRight" || event.key === "ArrowUp") seek(state.t + step);
    else if (event.key === "ArrowLeft" || event.key === "ArrowDown") seek(state.t - step);
    else if (event.key === "PageUp") seek(state.t + 1);
    else if (event.key === "PageDown") seek(state.t - 1);
    else if (event.key === "Home") seek(0);
    else if (event.key === "End") seek(data.end);
    else return;
    event.preventDefault();
  }

  function listen() {
    play.addEventListener("click", toggle);
    slider.addEventListener("input", () => seek(Number(slider.value)));
    slider.addEventListener("keydown", (event) => key(event, null));
    for (const [name, place] of Object.entries(plots.places)) {
      place.addEventListener("pointermove", (event) => {
        if (event.pointerType === "mouse" ? event.buttons === 0 && !state.playing : place.classList.contains("scrub")) point(name, event);
      });
      place.addEventListener("pointerdown", (event) => point(name, event));
      place.addEventListener("keydown", (event) => key(event, name));
    }
    for (const box of boxes) {
      box.addEventListener("change", () => { state.layers[box.dataset.layer] = box.checked; showLayers(); });
    }
    for (const button of document.querySelectorAll("[data-margin]")) {
      button.addEventListener("click", () => { state.margin = button.dataset.margin; margins.show(); cursor(); });
    }
    document.addEventListener("vnav:time", ({ detail }) => { if (detail.source !== "explorer") { stop(); seek(detail.t, detail.source); } });
    document.addEventListener("vnav:class", ({ detail }) => { if (detail.source !== "explorer") choose(detail.rank); });
    document.addEventListener("vnav:tint", () => { for (const name of Object.keys(tint)) delete tint[name]; margins.show(); cursor(); });
    window.addEventListener("hashchange", address);
  }

  // The report's address with #t=5.6 begins at that instant.
  function address() {
    const t = Number.parseFloat(new URLSearchParams(window.location.hash.slice(1)).get("t"));
    if (Number.isFinite(t)) { stop(); seek(t); }
    return Number.isFinite(t);
  }

  async function build() {
    byId("views").hidden = false;
    const map = byId("map");
    map.style.setProperty("--shape", map.dataset.shape);
    for (const box of boxes) state.layers[box.dataset.layer] = box.checked && !box.disabled;
    await plots.build();
    drawPath();
    margins.show();
    showLayers();
    listen();
    if (!address()) seek(data.end / 3);
  }

  window.vnavReport = { ready: build(), state: () => ({ t: state.t, rank: state.rank, layers: { ...state.layers } }) };
})();
