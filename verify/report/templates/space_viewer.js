"use strict";
// Turns the picture of position-velocity space: faces are painted from the back to the front, as on paper.
(() => {
  const box = document.getElementById("vc-space-viewer");
  const data = JSON.parse(document.getElementById("vc-space-data").textContent);
  const canvas = box.querySelector("canvas"), pen = canvas.getContext("2d");
  if (!pen) return;
  const layers = [...box.querySelectorAll("input")];
  const still = { azimuth: data.azimuth, elevation: data.elevation };
  let view = { ...still }, waiting = false;

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const shown = (name) => layers.some((layer) => layer.checked && layer.value === name);
  // Numbers of a shape follow each other: x, y, v, x, y, v, ... in shares of the world and of the top speed.
  const centre = [data.size[0] / 2, data.size[1] / 2];

  function projector(ratio) {
    const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
    const reach = Math.hypot(...data.size) / 2;
    const wide = canvas.width, high = canvas.height;
    const scale = Math.min((wide - 90 * ratio) / (2 * reach), high / (2.02 * reach * se + 1.1 * data.rise * data.unit * ce));
    const middle = high / 2 + (data.rise * data.unit * ce * scale) / 2;
    return (points) => {
      const flat = new Float64Array((points.length / 3) * 2);
      let depth = 0;
      for (let i = 0, k = 0; i < points.length; i += 3) {
        const x = points[i] - centre[0], y = points[i + 1] - centre[1], up = points[i + 2] * data.rise;
        const out = ca * x + sa * y;
        flat[k++] = wide / 2 + (ca * y - sa * x) * scale;
        flat[k++] = middle - (ce * up - se * out) * scale;
        depth += ce * out + se * up;
      }
      return { flat, depth: (3 * depth) / points.length };
    };
  }

  function trace(flat, close) {
    pen.beginPath();
    for (let i = 0; i < flat.length; i += 2) i ? pen.lineTo(flat[i], flat[i + 1]) : pen.moveTo(flat[0], flat[1]);
    if (close) pen.closePath();
  }

  function faces(project) {
    const wanted = data.faces.filter((face) => shown(face.layer));
    const parts = wanted.flatMap((face) => face.shapes.map((points) => ({ ...project(points), face })));
    const onFloor = (part) => part.face.layer === "plan";
    const above = parts.filter((part) => !onFloor(part)).sort((a, b) => a.depth - b.depth);
    for (const part of [...parts.filter(onFloor), ...above]) {
      pen.fillStyle = part.face.colour.startsWith("--") ? colours[part.face.colour] : part.face.colour;
      pen.globalAlpha = part.face.alpha;
      trace(part.flat, true);
      pen.fill();
    }
    pen.globalAlpha = 1;
  }

  function lines(project, ratio) {
    for (const group of data.lines) {
      if (!shown(group.layer)) continue;
      pen.strokeStyle = colours[group.colour];
      pen.lineWidth = group.width * ratio;
      pen.setLineDash(group.dash.map((step) => step * ratio));
      for (const points of group.shapes) {
        trace(project(points).flat, false);
        pen.stroke();
      }
    }
    pen.setLineDash([]);
  }

  function marks(project, ratio) {
    for (const group of data.points) {
      if (!shown(group.layer)) continue;
      const { flat } = project(group.points), r = group.size * ratio;
      pen.fillStyle = colours[group.fill];
      pen.strokeStyle = colours["--ink"];
      pen.lineWidth = ratio;
      for (let i = 0; i < flat.length; i += 2) {
        const [x, y] = [flat[i], flat[i + 1]];
        pen.beginPath();
        if (group.mark === "triangle") {
          pen.moveTo(x, y - 1.2 * r); pen.lineTo(x + r, y + 0.7 * r); pen.lineTo(x - r, y + 0.7 * r); pen.closePath();
        } else if (group.mark === "cross") {
          for (const turn of [0, 1, 2, 3]) {
            const [c, s] = [[0, -1], [1, 0], [0, 1], [-1, 0]][turn];
            pen.lineTo(x + 0.35 * r * c, y + 0.35 * r * s);
            pen.lineTo(x + r * (c - s) * 0.8, y + r * (s + c) * 0.8);
          }
          pen.closePath();
        } else pen.arc(x, y, r, 0, 2 * Math.PI);
        pen.fill();
        if (group.mark !== "dot") pen.stroke();
      }
    }
  }

  function words(project, ratio) {
    pen.font = `600 ${13 * ratio}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    pen.lineWidth = 3 * ratio;
    pen.strokeStyle = colours["--paper"];
    pen.fillStyle = colours["--ink"];
    for (const label of data.labels) {
      const { flat } = project(label.at);
      const [x, y] = [flat[0] + label.across * ratio, flat[1] + label.down * ratio];
      pen.textAlign = label.across < 0 ? "right" : "center";
      pen.strokeText(label.text, x, y);
      pen.fillText(label.text, x, y);
    }
  }

  let colours = {};
  function readColours() {
    const used = ["--ink", "--paper", ...data.faces.map((f) => f.colour), ...data.lines.map((l) => l.colour), ...data.points.map((p) => p.fill)];
    colours = Object.fromEntries(used.filter((name) => name.startsWith("--")).map((name) => [name, colour(name)]));
  }

  function draw() {
    waiting = false;
    const ratio = window.devicePixelRatio || 1, wide = canvas.clientWidth;
    if (!wide) return;
    const high = Math.round(Math.min(0.72 * wide, 0.8 * window.innerHeight));
    canvas.style.height = `${high}px`;
    canvas.width = Math.round(wide * ratio);
    canvas.height = Math.round(high * ratio);
    const project = projector(ratio), fine = ratio * Math.min(1, 0.45 + wide / 1600);
    faces(project);
    lines(project, fine);
    marks(project, fine);
    words(project, ratio);
  }

  function later() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }

  function turn(azimuth, elevation) {
    view.azimuth += azimuth;
    view.elevation = Math.min(Math.max(view.elevation + elevation, 0.12), Math.PI / 2);
    later();
  }

  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    held = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    turn((held[0] - event.clientX) * 0.008, (event.clientY - held[1]) * 0.008);
    held = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { held = null; });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (!step) return;
    event.preventDefault();
    turn(...step);
  });
  const buttons = { still: () => { view = { ...still }; }, above: () => { view = { azimuth: -Math.PI / 2, elevation: Math.PI / 2 }; } };
  for (const button of box.querySelectorAll("button")) {
    button.addEventListener("click", () => { buttons[button.value](); later(); });
  }
  for (const layer of layers) layer.addEventListener("change", later);
  window.addEventListener("resize", later);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); later(); });
  readColours();
  box.hidden = false;
  box.closest("figure").classList.add("live");
  draw();
})();
