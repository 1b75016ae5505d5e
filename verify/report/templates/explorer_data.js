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

  return { ...data, motion, at, row, share, lines };
})();
