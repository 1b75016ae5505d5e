"use strict";
// Draws the braking zone at one instant on the map and marks that instant in the curves: by pointing, by slider, and
// where the linked views are.
(() => {
  const box = document.getElementById("zone-viewer");
  if (!box) return;
  const data = JSON.parse(document.getElementById("zone-data").textContent);
  const slider = box.querySelector("input"), told = box.querySelector("output");
  const picture = (key) => document.getElementById(`${key}-title`).closest("svg");
  const make = (svg, name, attributes) => {
    const shape = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries({ ...attributes, "pointer-events": "none" })) shape.setAttribute(key, value);
    return svg.appendChild(shape);
  };
  const maps = Object.entries(data.maps).map(([key, frame]) => {
    const svg = picture(key);
    const zone = make(svg, "polygon", { "fill-opacity": 0.35, "stroke-width": 2.2 });
    const dot = make(svg, "circle", { r: 4, fill: "var(--paper)", stroke: "var(--ink)", "stroke-width": 1.6 });
    return { svg, frame, zone, dot };
  });
  const curves = Object.entries(data.curves).map(([key, frame]) => {
    const svg = picture(key), [top, foot] = frame.top;
    return { svg, frame, line: make(svg, "line", { y1: top, y2: foot, stroke: "var(--ink)", "stroke-width": 1.2 }) };
  });

  function show(i) {
    const colour = data.colours[data.held[i]];
    for (const { frame, zone, dot } of maps) {
      const across = (x) => frame.x[0] + frame.x[1] * x, down = (y) => frame.y[0] + frame.y[1] * y;
      const points = [], outline = data.outlines[i];
      for (let k = 0; k < outline.length; k += 2) points.push(`${across(outline[k]).toFixed(2)},${down(outline[k + 1]).toFixed(2)}`);
      zone.setAttribute("points", points.join(" "));
      zone.setAttribute("fill", colour);
      zone.setAttribute("stroke", colour);
      dot.setAttribute("cx", across(data.x[i]));
      dot.setAttribute("cy", down(data.y[i]));
    }
    for (const { frame, line } of curves) {
      const x = frame.x[0] + frame.x[1] * data.s[i];
      line.setAttribute("x1", x);
      line.setAttribute("x2", x);
    }
    slider.value = i;
    const gap = data.gap[i] === null ? "" : `, nearest obstacle ${data.gap[i].toFixed(3)} m from the zone`;
    told.textContent = `${data.t[i].toFixed(2)} s, ${data.s[i].toFixed(2)} m, ${data.v[i].toFixed(2)} m/s: ${data.words[data.held[i]]}${gap}`.replace(/-(?=\d)/g, "−");
  }

  // What a hand does here, the linked views follow.
  function lead(i) {
    show(i);
    document.dispatchEvent(new CustomEvent("vnav:time", { detail: { t: data.t[i], source: "zone" } }));
  }

  function place(svg, event) {
    const matrix = svg.getScreenCTM();
    return matrix ? new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse()) : null;
  }

  function least(cost) {
    let best = 0;
    for (let i = 1; i < data.s.length; i++) if (cost(i) < cost(best)) best = i;
    return best;
  }

  for (const { svg, frame } of maps) {
    svg.addEventListener("pointermove", (event) => {
      const at = place(svg, event);
      if (!at) return;
      const x = (at.x - frame.x[0]) / frame.x[1], y = (at.y - frame.y[0]) / frame.y[1];
      lead(least((i) => (data.x[i] - x) ** 2 + (data.y[i] - y) ** 2));
    });
  }
  for (const { svg, frame } of curves) {
    svg.addEventListener("pointermove", (event) => {
      const at = place(svg, event);
      if (!at || at.x < frame.side[0] || at.x > frame.side[1]) return;
      const s = (at.x - frame.x[0]) / frame.x[1];
      lead(least((i) => Math.abs(data.s[i] - s)));
    });
  }
  slider.max = data.s.length - 1;
  slider.addEventListener("input", () => lead(Number(slider.value)));
  document.addEventListener("vnav:time", ({ detail }) => {
    if (detail.source !== "zone") show(least((i) => Math.abs(data.t[i] - detail.t)));
  });
  box.hidden = false;
  show(Math.floor(data.s.length / 3));
})();
