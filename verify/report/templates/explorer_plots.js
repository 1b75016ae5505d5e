"use strict";
// Bokeh's side of the linked views: models by name, colours of the page, equal scales, zoom.
const vnavPlots = (data) => {
  const models = JSON.parse(document.getElementById("explore-models").textContent);
  const names = ["map", "speed", "margins", "friction"];
  const places = Object.fromEntries(names.map((name) => [name, document.getElementById(`explore-${name}`)]));
  const homes = {};  // equal scales: the box that shows all
  const asked = {};  // equal scales: the view last set, to tell when it is not the whole any more
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  let wholeMap = null, least = null;
  let doc = null, plots = null, longest = data.end, tinted = [];

  const named = (name) => doc.get_model_by_name(name);
  const put = (name, columns) => { named(`${name}-columns`).data = columns; };

  async function build() {
    const roots = models.roots.map((root) => root.id);
    const shown = Object.fromEntries(roots.map((id, k) => [id, `explore-${names[k]}`]));
    Bokeh.logger.set_level("warn");
    await Bokeh.embed.embed_items({ views: models }, [{ docid: "views", roots: shown, root_ids: roots }]);
    doc = Bokeh.documents[Bokeh.documents.length - 1];
    plots = Object.fromEntries(names.map((name) => [name, named(name)]));
    const [x0, y0, x1, y1] = data.box, pad = 0.03 * Math.max(x1 - x0, y1 - y0);
    wholeMap = [x0 - pad, y0 - pad, x1 + pad, y1 + 2 * pad];  // above: the scale bar
    homes.map = data.near ?? wholeMap;
    homes.friction = [-data.reach, -data.reach, data.reach, data.reach];
    for (const name of Object.keys(homes)) {
      const { inner_width: width, inner_height: height } = plots[name].properties;
      for (const size of [width, height]) size.change.connect(() => resized(name));
      show(name, homes[name]);
    }
    gather();
    if (dark.matches) tint();
    if (navigator.maxTouchPoints > 0) document.getElementById("explore").classList.add("touched");
    dark.addEventListener("change", tint);
    for (const name of names) steer(name);
  }

  // Every colour of a model that is one of the palette's, and the variable that it stands for.
  function gather() {
    const variables = data.variables;
    for (const model of doc._all_models.values()) {
      for (const property of model) {
        if (property.is_unset || !property.attr.includes("color")) continue;
        const value = property.get_value();
        const colour = typeof value === "string" ? value : value?.value;
        if (typeof colour === "string" && variables[colour]) tinted.push([property, typeof value !== "string", variables[colour]]);
      }
    }
  }

  const colour = (variable) => getComputedStyle(document.documentElement).getPropertyValue(variable).trim();

  function tint() {
    for (const [property, spec, variable] of tinted) {
      const found = colour(variable);
      property.obj.setv({ [property.attr]: spec ? { value: found } : found });
    }
    document.dispatchEvent(new CustomEvent("vnav:tint"));
  }

  // Equal scales: as much as shows the box, more where the plot is wider or higher than that.
  function show(name, [x0, y0, x1, y1]) {
    const { inner_width: width, inner_height: height, x_range: x, y_range: y } = plots[name];
    if (!(width > 0 && height > 0)) return;
    const scale = Math.max((x1 - x0) / width, (y1 - y0) / height) / 2, [cx, cy] = [(x0 + x1) / 2, (y0 + y1) / 2];
    x.setv({ start: cx - scale * width, end: cx + scale * width });
    y.setv({ start: cy - scale * height, end: cy + scale * height });
    asked[name] = [x.start, x.end, y.start, y.end];
  }

  function whole(name) {  // of a map that begins at the motions: all of it, then the motions again
    if (name === "map" && data.near) homes.map = homes.map === wholeMap && untouched("map") ? data.near : wholeMap;
    if (homes[name]) return show(name, homes[name]);
    plots[name].x_range.setv({ start: 0, end: longest });
  }

  // Speeds up to `top` are shown: the axis is never lower than it was made.
  function reaching(top) {
    const range = plots.speed.y_range;
    least ??= range.end;
    range.end = Math.max(least, 1.08 * top);
    const limit = named("speed-limit");
    if (limit) limit.visible = limit.y < range.end;
  }

  // Times up to `end` are all that there is to show.
  function lasting(end) {
    longest = end;
    whole("speed");
  }

  function untouched(name) {
    const { x_range: x, y_range: y } = plots[name], last = asked[name];
    return !last || [x.start, x.end, y.start, y.end].every((value, k) => value === last[k]);
  }

  function resized(name) {
    if (name === "map") named("names")?.setv({ visible: plots.map.inner_width > 420 });
    const { x_range: x, y_range: y } = plots[name];
    show(name, untouched(name) ? homes[name] : [x.start, y.start, x.end, y.end]);
  }

  // factor < 1: closer. Times stay within what there is; about the point (x, y) where that is given.
  function zoom(name, factor, about) {
    const { x_range: x, y_range: y } = plots[name];
    const around = ({ start, end }, at) => [at + factor * (start - at), at + factor * (end - at)];
    if (homes[name]) {
      const [cx, cy] = about ?? [(x.start + x.end) / 2, (y.start + y.end) / 2];
      const [x0, x1] = around(x, cx), [y0, y1] = around(y, cy);
      x.setv({ start: x0, end: x1 });
      y.setv({ start: y0, end: y1 });
    } else {
      const [low, high] = x.bounds, [x0, x1] = around(x, about?.[0] ?? (x.start + x.end) / 2);
      x.setv({ start: Math.max(x0, low), end: Math.min(x1, high) });
    }
  }

  function move(name, right, up) {
    const { x_range: x, y_range: y } = plots[name], dx = right * (x.end - x.start), dy = up * (y.end - y.start);
    x.setv({ start: x.start + dx, end: x.end + dx });
    y.setv({ start: y.start + dy, end: y.end + dy });
  }

  // A mouse drags the picture; a finger the page, until "Move" is pressed. The wheel zooms after a click only.
  function steer(name) {
    Bokeh.index[plots[name].id].canvas_view.events_el.tabIndex = -1;  // the place around it is what Tab reaches
    const place = places[name], tools = plots[name].toolbar.tools;
    const pan = tools.find((tool) => tool.type === "PanTool"), wheel = tools.find((tool) => tool.type === "WheelZoomTool");
    const button = document.querySelector(`[data-plot="${name}"][data-zoom="move"]`);
    const moving = () => button.getAttribute("aria-pressed") === "true";
    const still = () => { wheel.active = moving(); place.classList.remove("live"); };
    place.addEventListener("pointerenter", (event) => { pan.active = event.pointerType === "mouse" || moving(); });
    place.addEventListener("pointerleave", () => { pan.active = moving(); still(); });
    place.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "mouse") return;
      wheel.active = true;
      place.classList.add("live");
    });
    place.addEventListener("keydown", (event) => { if (event.key === "Escape") still(); });
    button.addEventListener("click", () => {
      const on = !moving();
      button.setAttribute("aria-pressed", String(on));
      pan.active = wheel.active = on;
      place.style.touchAction = on ? "none" : "";
    });
    for (const [key, act] of [["in", () => zoom(name, 1 / 1.5)], ["out", () => zoom(name, 1.5)], ["all", () => whole(name)]]) {
      document.querySelector(`[data-plot="${name}"][data-zoom="${key}"]`).addEventListener("click", act);
    }
  }

  // Where a pointer is, in the units of a plot, and what a pixel is there; null outside its frame.
  function under(name, event) {
    const view = Bokeh.index[plots[name].id], box = view.canvas_view.el.getBoundingClientRect();
    const sx = event.clientX - box.left, sy = event.clientY - box.top, { frame } = view;
    const { left, right, top, bottom } = frame.bbox;
    if (sx < left || sx > right || sy < top || sy > bottom) return null;
    const { x_range: range } = plots[name];
    return { x: frame.x_scale.invert(sx), y: frame.y_scale.invert(sy), pixel: (range.end - range.start) / (right - left) };
  }

  return { build, named, put, places, plots: () => plots, colour, zoom, move, whole, lasting, reaching, under };
};
