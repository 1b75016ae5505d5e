"use strict";
// What is left of each limit: all as shares of it, or one in its unit; of the motion followed and the chosen class.
const vnavMargins = (data, plots, state) => {
  const { named, put } = plots, followed = data.executed;
  const minus = (text) => text.replace(/-(?=\d)/g, "\u2212");
  const TIE = 0.05;  // [%]: of limits that are reached alike the first one is told
  const shares = data.margins.map((margin) => data.share(followed, margin));
  const percent = (values) => values.map((value) => 100 * Math.min(value, 1));

  function show() {
    const one = data.margins.find((margin) => margin.key === state.margin), own = data.motion(followed);
    const columns = { t: own.t };
    let range = [-6, 106], worst = null;
    data.margins.forEach((margin, k) => {
      const values = one ? own[`margin.${margin.key}`] : shares[k] && percent(shares[k]);
      const shown = values && (!one || one === margin);
      columns[margin.key] = shown ? values : own.t.map(() => Number.NaN);
      named(`margin-${margin.key}`).visible = Boolean(shown);
      if (!shown) return;
      const i = values.reduce((best, value, j) => (value < values[best] ? j : best), 0);
      if (worst === null || values[i] < worst.value - TIE) worst = { value: values[i], t: own.t[i], margin };
      const high = one ? values.reduce((a, b) => Math.max(a, b), 0) : 100, low = Math.min(values[i], 0);
      range = [Math.min(range[0], low - 0.08 * (high - low)), one ? high + 0.1 * (high - low) : 106];
      if (one) range[0] = low - 0.08 * (high - low || 1);
    });
    put("margin-lines", columns);
    plots.plots().margins.y_range.setv({ start: range[0], end: range[1] });
    plots.plots().margins.left[0].axis_label = one ? `${one.name.toLowerCase()} [${one.unit}]` : "left of each limit [%]";
    const words = worst && `least: ${worst.margin.name.toLowerCase()} ${amount(worst.value, one ? one.unit : "%")}`;
    put("least", worst ? { x: [worst.t], y: [worst.value] } : { x: [], y: [] });
    put("least-words", worst ? { x: [worst.t], y: [worst.value], text: [words], align: [worst.t < 0.3 * data.end ? "left" : worst.t > 0.7 * data.end ? "right" : "center"] } : { x: [], y: [], text: [], align: [] });
    showClassMargin(one);
    for (const button of document.querySelectorAll("[data-margin]")) button.setAttribute("aria-pressed", String(button.dataset.margin === state.margin));
  }

  // Of the chosen class: the same margin, or its tightest share.
  function showClassMargin(one) {
    const line = named("margin-class"), key = `class-${state.rank}`;
    line.visible = state.rank !== null && "t" in data.motion(key);
    if (!line.visible) return;
    const { t, ...columns } = data.motion(key);
    const lines = one ? [columns[`margin.${one.key}`]] : data.margins.map((margin) => data.share(key, margin)).map((values) => values && percent(values));
    const known = lines.filter(Boolean);
    put("margin-class", { t, value: t.map((_, i) => known.reduce((least, values) => Math.min(least, values[i]), known.length ? Infinity : Number.NaN)) });
    line.glyph.line_color = { value: plots.colour(data.tones[key]) };
  }

  const digits = (value, count) => minus((Math.abs(value) < 0.5 * 10 ** -count ? 0 : value).toFixed(count));
  const amount = (value, unit) => (unit === "%" ? `${digits(value, 1)} %` : `${digits(value, 3)} ${unit}`);

  function tightest(here) {
    let best = null;
    for (const margin of data.margins) {
      const value = here[`share.${margin.key}`] ?? Number.NaN;
      if (best === null ? Number.isFinite(value) : value < best.value - TIE / 100) best = { value, margin };
    }
    return best;
  }

  return { show, tightest, amount, minus };
};
