"use strict";
// Numbers of the linked views: columns of motions at an instant, and lines for the map.
const vnavData = (() => {
  const block = document.getElementById("explore-data");
  if (!block) return null;
  const data = JSON.parse(block.textContent);
  const motions = new Map();

  function bytes(text) {
    const raw = atob(text), found = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) found[i] = raw.charCodeAt(i);
    return found.buffer;
  }

  // The columns of a motion by name, as Float32Array.
  function motion(key) {
    if (!motions.has(key)) {
      const columns = {};
      for (const [name, text] of Object.entries(data.motions[key])) columns[name] = new Float32Array(bytes(text));
      motions.set(key, columns);
    }
    return motions.get(key);
  }

  // The last row at or before t; the row before the last at the end, so that there is always a next one.
  function row(t, times) {
    let low = 0, high = times.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    return low;
  }

  // All columns of a motion at time t, linear between rows; before it begins and after it ends those of its ends.
  function at(key, t) {
    const columns = motion(key), times = columns.t, i = row(t, times);
    const part = Math.min(Math.max((t - times[i]) / Math.max(times[i + 1] - times[i], 1e-9), 0), 1);
    const found = {};
    for (const [name, values] of Object.entries(columns)) found[name] = values[i] + part * (values[i + 1] - values[i]);
    return found;
  }

  // --- what the cursor reads off the motion followed

  const curves = {};  // rows and curves by name, unpacked once
  function curve(name) {
    if (!data.cursor[name]) return null;
    if (!curves[name]) curves[name] = Object.fromEntries(Object.entries(data.cursor[name]).map(([column, text]) => [column, new Float32Array(bytes(text))]));
    return curves[name];
  }

  // A broken line at x; no number where there is none.
  function line(name, x, of = "t") {
    const columns = curve(name);
    if (!columns) return Number.NaN;
    const xs = columns[of], values = columns.value, i = row(x, xs);
    const part = Math.min(Math.max((x - xs[i]) / Math.max(xs[i + 1] - xs[i], 1e-9), 0), 1);
    return values[i] + part * (values[i + 1] - values[i]);
  }

  function lengths() {  // [m], covered where each row begins: trapezoids are exact as the acceleration is constant
    const { t, v } = curve("rows"), found = new Float64Array(t.length);
    for (let i = 1; i < t.length; i++) found[i] = found[i - 1] + 0.5 * (v[i] + v[i - 1]) * (t[i] - t[i - 1]);
    return found;
  }

  // What is nearest: it goes along a wall as the robot does, and jumps from one to another.
  function nearestTo({ x, y }, t) {
    const { t: times, x: xs, y: ys, nearest_x: nx, nearest_y: ny } = motion(data.executed), i = row(t, times), j = i + 1;
    const part = Math.min(Math.max((t - times[i]) / Math.max(times[j] - times[i], 1e-9), 0), 1);
    if (Math.hypot(nx[j] - nx[i], ny[j] - ny[i]) <= 2 * Math.hypot(xs[j] - xs[i], ys[j] - ys[i]) + 1e-6) return [nx[i] + part * (nx[j] - nx[i]), ny[i] + part * (ny[j] - ny[i])];
    const k = Math.hypot(nx[i] - x, ny[i] - y) <= Math.hypot(nx[j] - x, ny[j] - y) ? i : j;
    return [nx[k], ny[k]];
  }

  // Of each limit [its unit] and, as share.KEY, of the whole of it: what is left at an instant.
  function left(here, room) {
    const { a, v, turn, curvature, clearance, braking } = here, side = Math.abs(turn), found = {};
    const used = { friction: Math.hypot(a, turn), tip: side, reserve: side, steering: Math.abs(curvature), drive: a, brakes: -a, speed: v };
    for (const { key, scale } of data.margins) {
      if (!(key in used)) continue;
      found[`margin.${key}`] = scale - used[key];
      if (scale > 0) found[`share.${key}`] = 1 - used[key] / scale;
    }
    found["margin.clearance"] = clearance;
    found["margin.braking"] = data.zone ? line("gap", here.t) : clearance - braking;
    found["share.braking"] = room > 0 ? Math.max(1 - braking / room, -1) : -1;
    return found;
  }

  const distance = (v) => data.braking.reduceRight((sum, factor) => sum * v + factor, 0);  // [m], to stop

  // The motion followed at time t: an arc of constant curvature with constant acceleration along it.
  function here(t) {
    const rows = curve("rows"), i = Math.min(row(t, rows.t), rows.t.length - 2), dt = Math.min(Math.max(t, rows.t[0]), rows.t.at(-1)) - rows.t[i];
    const a = rows.a[i], curvature = rows.curvature[i], v = rows.v[i] + a * dt, along = 0.5 * (rows.v[i] + v) * dt;
    const half = 0.5 * curvature * along, chord = Math.abs(half) < 1e-6 ? along : (along * Math.sin(half)) / half;
    curves.s ??= lengths();
    const found = { t, s: curves.s[i] + along, x: rows.x[i] + chord * Math.cos(rows.heading[i] + half), y: rows.y[i] + chord * Math.sin(rows.heading[i] + half),
      heading: rows.heading[i] + 2 * half, v, a, curvature, turn: v * v * curvature, clearance: line("clearance", t), braking: distance(v) };
    [found.nearest_x, found.nearest_y] = nearestTo(found, t);
    const room = data.zone ? distance(line("safe", found.s, "s")) : found.clearance;
    return { ...found, ...left(found, room) };
  }

  // What is left of a limit, as a share of it: (n,) of a motion, null where there is no such share.
  function share(key, margin) {
    const columns = motion(key);
    if (margin.key === "braking") return columns["share.braking"] ?? null;
    const values = columns[`margin.${margin.key}`];
    return margin.scale > 0 && values ? values.map((value) => value / margin.scale) : null;
  }

  // Polylines as lists of coordinates, and where each begins.
  function lines({ at: low, step, first: begin, xy }) {
    const first = new Uint32Array(bytes(begin)), whole = new Uint16Array(bytes(xy)), xs = [], ys = [];
    for (let k = 0; k + 1 < first.length; k++) {
      const x = [], y = [];
      for (let i = first[k]; i < first[k + 1]; i++) {
        x.push(low[0] + step[0] * whole[2 * i]);
        y.push(low[1] + step[1] * whole[2 * i + 1]);
      }
      xs.push(x);
      ys.push(y);
    }
    return { xs, ys };
  }

  return { ...data, motion, at, here, row, share, lines };
})();
