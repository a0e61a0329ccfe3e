"use strict";
// The page without scripts is complete; this adds the choice of theme, folding, and the charts.
(() => {
  const root = document.documentElement;
  const found = document.getElementById("chart-data");
  const data = found ? JSON.parse(found.textContent) : {};
  const drawn = []; // figures with their charts

  const probe = document.body.appendChild(document.createElement("span"));
  const colour = (role) => {
    probe.style.color = `var(--${role})`;
    return getComputedStyle(probe).color;
  };
  const pale = (role) => colour(role).replace(/^rgb\((.*)\)$/, "rgba($1, 0.45)");
  const element = (parent, kind, words = "", given = {}) => {
    const made = Object.assign(document.createElement(kind), given);
    made.textContent = words;
    return parent.appendChild(made);
  };
  const raised = (power) => [...String(power)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c])).join("");
  const power = (value) => value.toExponential().replace(/e\+(\d+)$/, (_, p) => `·10${raised(p)}`).replace(/^1·/, "");
  const number = (value) => {
    if (value == null) return "–";
    const shown = Number(value.toPrecision(4)), large = Math.abs(shown) >= 1e6;
    return (large ? shown.toExponential().replace(/e\+(\d+)$/, (_, p) => ` × 10${raised(p)}`) : String(shown)).replace("-", "−");
  };

  const shown = (value) => (value == null ? "" : number(value)); // no value where no pointer is

  const axis = (given, extra = {}) => ({
    label: given.label, labelSize: 18, font: "11px system-ui", labelFont: "12px system-ui",
    stroke: colour("ink"), grid: { stroke: colour("line"), width: 1, ...(given.log && { filter: decades }) },
    ticks: { stroke: colour("line"), size: 5 },
    ...(given.log && { values: (_, splits) => splits.map((v) => (v == null ? null : v >= 1e4 ? power(v) : String(v))) }), ...extra,
  });
  // A logarithmic axis ends where its data end, not at a decade, and has grid lines at decades only.
  const scale = (given) => (given.log
    ? { time: false, distr: 3, range: (_, low, high) => [0.9 * low, 1.1 * high] }
    : { time: false });
  const decades = (_, splits) => splits.map((v) => (v > 0 && Math.abs(Math.log10(v) % 1) < 1e-9 ? v : null));

  function lines(spec, width, group) {
    return {
      width, height: Math.max(0.6 * (spec.height || 260), Math.min(spec.height || 260, (spec.height || 260) * width / 600)),
      scales: { x: scale(spec.x), y: scale(spec.y) },
      axes: [axis(spec.x, { size: 34 }), axis(spec.y, { size: 54 })],
      series: [
        { label: spec.x.label, value: (_, v) => shown(v) },
        ...spec.series.map((one) => ({
          label: one.label, stroke: one.width ? pale(one.role) : colour(one.role), width: one.width || 1.3,
          spanGaps: false, points: { show: false }, value: (_, v) => shown(v),
        })),
      ],
      bands: spec.band ? [{ series: spec.band, fill: colour("noise") }] : [],
      cursor: { sync: { key: group, scales: ["x", null] } },
      hooks: { setCursor: [(chart) => chart.root.classList.toggle("pointed", chart.cursor.idx != null)] },
    };
  }

  // ---- maps of cells
  const share = (spec, value) => {
    const [low, high] = spec.range;
    const part = spec.log ? Math.log(value / low) / Math.log(high / low) : Math.abs(value) / high;
    return 0.12 + 0.88 * Math.min(Math.max(part, 0), 1);
  };
  function paint(chart, spec) {
    const pen = chart.ctx, [before, after] = [colour("before"), colour("after")];
    const at = (edges, axisName) => edges.map((edge) => Math.round(chart.valToPos(edge, axisName, true)));
    const [xs, ys] = [at(spec.x.edges, "x"), at(spec.y.edges, "y")];
    const { left, top, width, height } = chart.bbox;
    pen.save();
    pen.beginPath();
    pen.rect(left, top, width, height);
    pen.clip();
    spec.values.forEach((row, i) => row.forEach((value, j) => {
      if (value == null) return;
      pen.globalAlpha = share(spec, value);
      pen.fillStyle = value < 0 ? after : before;
      pen.fillRect(xs[j], Math.min(ys[i], ys[i + 1]), xs[j + 1] - xs[j], Math.abs(ys[i + 1] - ys[i]));
    }));
    pen.restore();
  }
  const place = (edges, value) => edges.findIndex((edge, i) => i + 1 < edges.length && value >= edge && value < edges[i + 1]);
  function cellAt(chart, spec) {
    const { left, top } = chart.cursor;
    if (!(left >= 0)) return null;
    const j = place(spec.x.edges, chart.posToVal(left, "x")), i = place(spec.y.edges, chart.posToVal(top, "y"));
    return i < 0 || j < 0 ? null : [i, j];
  }
  function cells(spec, width, group, say) {
    const names = spec.y.names;
    const span = (edges, i) => `${number(edges[i])} to ${number(edges[i + 1])}`;
    const words = ([i, j]) => {
      const row = spec.labels ? spec.labels[i] : `${spec.y.label} ${span(spec.y.edges, i)}`;
      const value = spec.values[i][j];
      return `${row}, ${spec.x.label} ${span(spec.x.edges, j)}: ${value == null ? "within the noise" : `${number(value)} ${spec.unit}`}`;
    };
    const rows = names ? {
      splits: () => names.map((_, i) => i + 0.5), size: 90, label: null,
      values: () => names.map((name) => (name.length > 12 ? `${name.slice(0, 11)}…` : name)),
    } : { size: 54 };
    return {
      width: names ? width : Math.min(width, 480), height: names ? Math.max(180, 70 + 20 * names.length) : Math.min(width, 480),
      legend: { show: false },
      scales: {
        x: { time: false, range: (_, low, high) => [low, high] },
        y: { range: (_, low, high) => [low, high], dir: names ? -1 : 1 },
      },
      axes: [axis(spec.x, { size: 34, grid: { show: false } }), axis(spec.y, { grid: { show: false }, ...rows })],
      series: [{}, { paths: () => null, points: { show: false } }],
      cursor: { drag: { x: true, y: true, uni: 20 }, points: { show: false } },
      hooks: {
        draw: [(chart) => paint(chart, spec)],
        setCursor: [(chart) => { const cell = cellAt(chart, spec); say(cell ? words(cell) : ""); }],
      },
    };
  }
  const ends = (edges) => [edges[0], edges[edges.length - 1]];
  const cellData = (spec) => [ends(spec.x.edges), ends(spec.y.edges)];

  // ---- zoom by button: also for a keyboard and a touch screen
  function zoom(chart, spec, factor, shift) {
    const names = spec.kind === "cells" && !spec.y.names ? ["x", "y"] : ["x"];
    for (const name of names) {
      const { min, max, distr } = chart.scales[name];
      const [there, back] = distr === 3 ? [Math.log, Math.exp] : [(v) => v, (v) => v];
      const [low, high] = [there(min), there(max)];
      const middle = 0.5 * (low + high) + (name === "x" ? shift * (high - low) : 0);
      chart.setScale(name, { min: back(middle - 0.5 * factor * (high - low)), max: back(middle + 0.5 * factor * (high - low)) });
    }
  }
  const whole = (chart) => chart.setData(chart.data, true);
  const nearest = (chart, one, spec) => {
    const range = spec.views && spec.views[one.view].range;
    if (range) chart.setScale("x", { min: range[0], max: range[1] });
  };

  function choose(name, run) {
    for (const one of drawn.filter((other) => other.select && other.name !== name)) {
      const at = one.specs[0].views.findIndex((view) => view.run === run);
      if (at >= 0) { one.select.value = at; one.select.dispatchEvent(new Event("change")); }
    }
  }

  function build(one) {
    one.charts.forEach((chart) => chart.destroy());
    one.charts = one.specs.map((spec, i) => {
      const width = one.box.clientWidth;
      const say = (words) => { one.hint.textContent = words || one.help; };
      const options = spec.kind === "cells" ? cells(spec, width, one.name, say) : lines(spec, width, one.name);
      const chart = new uPlot(options, spec.kind === "cells" ? cellData(spec) : spec.views[one.view].data, one.places[i]);
      nearest(chart, one, spec);
      const wrap = chart.root.querySelector(".u-wrap");
      wrap.setAttribute("role", "img");
      wrap.setAttribute("aria-label", `${spec.title}. ${one.text}`);
      if (spec.y.names) chart.over.addEventListener("click", () => {
        const cell = cellAt(chart, spec);
        if (cell) choose(one.name, spec.y.names[cell[0]]);
      });
      return chart;
    });
    one.keys.forEach(({ bar, spec }) => {
      const [high, low] = [colour("before"), spec.range[0] < 0 ? colour("after") : "transparent"];
      bar.style.background = `linear-gradient(to right, ${low}, transparent ${spec.range[0] < 0 ? "50%" : "0"}, ${high})`;
    });
  }

  function tools(one) {
    const bar = element(one.box, "div", "", { className: "tools" });
    bar.setAttribute("role", "group");
    bar.setAttribute("aria-label", "Chart controls");
    const views = one.specs[0].views || [];
    if (views.length > 1) {
      one.select = element(bar, "select");
      one.select.setAttribute("aria-label", "Run");
      views.forEach((view, i) => element(one.select, "option", view.label, { value: i }));
      one.select.addEventListener("change", () => {
        one.view = Number(one.select.value);
        one.charts.forEach((chart, i) => {
          chart.setData(one.specs[i].views[one.view].data);
          nearest(chart, one, one.specs[i]);
        });
      });
    }
    const each = (act) => () => one.charts.forEach((chart, i) => act(chart, one.specs[i]));
    for (const [words, label, act] of [
      ["+", "Zoom in", (chart, spec) => zoom(chart, spec, 0.5, 0)],
      ["−", "Zoom out", (chart, spec) => zoom(chart, spec, 2, 0)],
      ["◀", "Move left", (chart, spec) => zoom(chart, spec, 1, -0.25)],
      ["▶", "Move right", (chart, spec) => zoom(chart, spec, 1, 0.25)],
      ["Whole", "Show the whole chart", whole],
      ...(views.some((view) => view.range)
        ? [["Largest difference", "Show the cycles where the models differ most", (chart, spec) => nearest(chart, one, spec)]] : []),
    ]) element(bar, "button", words, { type: "button", title: label, ariaLabel: label }).addEventListener("click", each(act));
  }

  function start(figure, specs) {
    const box = figure.querySelector(".charts");
    const rows = specs.some((spec) => spec.y.names);
    const one = {
      name: figure.dataset.figure, box, specs, charts: [], view: 0, keys: [],
      text: figure.querySelector("svg").getAttribute("aria-label"),
      help: "Drag to zoom, double-click for the whole chart." + (rows ? " Click a run to show its spectrum and its fit." : ""),
    };
    figure.classList.add("live");
    one.places = specs.map((spec) => {
      const part = element(box, "div", "", { className: "chart" });
      if (spec.kind === "cells" || !spec.y.label) element(part, "h4", spec.title);
      if (spec.kind === "cells") {
        const key = element(part, "div", "", { className: "key" });
        element(key, "span", number(spec.range[0]));
        one.keys.push({ bar: element(key, "i"), spec });
        element(key, "span", `${number(spec.range[1])} ${spec.unit}${spec.log ? ", logarithmic" : ""}`);
      }
      return part;
    });
    tools(one);
    one.hint = element(box, "p", one.help, { className: "small" });
    drawn.push(one);
    let width = 0; // a chart in a closed part has none, and is drawn when the part is opened
    new ResizeObserver(() => {
      if (box.clientWidth && box.clientWidth !== width) { width = box.clientWidth; build(one); }
    }).observe(box);
  }

  for (const [name, specs] of Object.entries(data)) {
    const figure = document.querySelector(`[data-figure="${name}"]`);
    if (figure) start(figure, specs);
  }

  const redraw = () => drawn.filter((one) => one.charts.length).forEach(build);
  const theme = document.getElementById("theme"), themes = ["automatic", "light", "dark"];
  if (theme) {
    theme.hidden = false;
    theme.addEventListener("click", () => {
      const next = themes[(themes.indexOf(root.dataset.theme || "automatic") + 1) % themes.length];
      root.dataset.theme = next;
      theme.textContent = `Theme: ${next}`;
      redraw();
    });
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

  // Printed, each sheet is one page: it shrinks until it fits the narrower A4 and the lower Letter, without margins.
  const paper = document.getElementById("paper"), sheets = [...document.querySelectorAll(".sheet")];
  const [width, height] = [186, 253].map((mm) => (mm / 25.4) * 96);
  const opened = () => document.querySelector("section:not(.printed) > details[open]");
  const fit = (sheet) => {
    for (let scale = 0.98; scale > 0.4 && sheet.getBoundingClientRect().height > height; scale -= 0.02) sheet.style.zoom = scale;
  };
  if (paper) addEventListener("beforeprint", () => {
    paper.media = "all";
    document.body.style.width = `${width}px`;
    sheets.forEach((sheet, i) => { sheet.style.zoom = ""; if (!i || !opened()) fit(sheet); });
    document.body.style.width = "";
    paper.media = "print";
  });
  addEventListener("afterprint", () => sheets.forEach((sheet) => { sheet.style.zoom = ""; }));

  const fold = document.getElementById("fold"), parts = [...document.querySelectorAll("details")];
  if (fold) {
    fold.hidden = false;
    fold.addEventListener("click", () => {
      const open = parts.some((part) => !part.open);
      parts.forEach((part) => { part.open = open; });
      fold.textContent = open ? "Close all" : "Open all";
    });
  }
})();
