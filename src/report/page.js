"use strict";
// Draws the figures of a page with uPlot, each from the JSON beside it (src/report/figure.rs says what that holds).
// uPlot does axes, zoom and cursor; series have abscissae of their own (its mode 2), so their paths are made here.
(() => {
const FONT = '12px system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
const LEFT = 58, RIGHT = 22, TOP = 8, BOTTOM = 26, LABEL = 22;
const SHADES = [1, 0.65, 0.4];
const NEAR = 45; // Distance from the pointer in which a point is told [px].
const plots = window.figures = [];
let chosen = ""; // The run that is shown; all where it is empty.

const css = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const element = (tag, parent, properties = {}) =>
  parent.appendChild(Object.assign(document.createElement(tag), properties));
const minus = text => text.replace(/-/g, "\u2212");

// A number to so many significant digits.
function number(value, digits = 4) {
  const size = Math.abs(value);
  const plain = value === 0 || (size >= 1e-4 && size < 1e6);
  return minus(plain ? String(+value.toPrecision(digits)) : value.toExponential(Math.max(0, digits - 2)));
}

// `position 5.31 m` of the label `position [m]`.
function quantity(label, value) {
  const [, name, unit] = label.match(/^(.*?)(?: \[(.*)\])?$/);
  return `${name} ${number(value)} ${unit && unit !== "1" ? unit : ""}`.trim();
}

// ---- Scales and axes

// Least and greatest value of those series.
function ends(all, along, isLog) {
  let [low, high] = [Infinity, -Infinity];
  for (const series of all) {
    for (const value of series[along])
      if (value !== null && (value > 0 || !isLog)) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    if (series.look === "stems" && along === "y") [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  }
  return [low, high];
}

// Least and greatest value along an axis of what is shown. Bands and ellipses reach beyond lines and points by half of
// their range at most: what is not known at all must not hide what is.
function extent(u, panel, along) {
  const { log, names } = panel[along];
  const shown = panel.series.filter((series, i) => u.series[i + 1].show);
  let [low, high] = ends(shown.filter(series => series.look !== "area"), along, log);
  const [least, most] = ends(shown.filter(series => series.look === "area"), along, log);
  const beyond = low < high ? 0.5 * (high - low) : Infinity;
  if (!log) [low, high] = [Math.min(low, Math.max(least, low - beyond)), Math.max(high, Math.min(most, high + beyond))];
  if (low > high) return [0.1, 1];
  const rim = along === "y" ? (high / low) ** 0.04 : 1;
  if (log) return low < high ? [low / rim, high * rim] : [low / 2, high * 2];
  if (names.length) return [-0.5, names.length - 0.5];
  const hasMarks = shown.some(series => ["dots", "rings", "crosses"].includes(series.look));
  const part = along === "y" || panel.equal ? 0.05 : hasMarks ? 0.02 : 0;
  const same = high - low <= 1e-9 * Math.max(Math.abs(low), Math.abs(high), 1e-9);
  const margin = same ? Math.max(0.5 * Math.abs(low), 1e-3) : part * (high - low);
  const room = Math.max(margin, 0.5 * (panel[along].least - (high - low)));
  return [low - room, high + room];
}

// The same; where both axes have one scale, the one that has room reaches further.
function range(u, panel, along) {
  const own = extent(u, panel, along);
  if (!panel.equal) return own;
  const other = extent(u, panel, along === "x" ? "y" : "x");
  const inner = [u.width - LEFT - RIGHT, u.height - TOP - BOTTOM - LABEL];
  const [length, beside] = along === "x" ? inner : [inner[1], inner[0]];
  const reach = 0.5 * length * Math.max((own[1] - own[0]) / length, (other[1] - other[0]) / beside);
  const middle = 0.5 * (own[0] + own[1]);
  return [middle - reach, middle + reach];
}

// Round numbers in decades: all 1, 2, 5 where there are few.
function decades(low, high) {
  const all = [], count = Math.log10(high / low), parts = count < 3 ? [1, 2, 5] : [1];
  const step = Math.ceil(count / 7);
  for (let power = Math.floor(Math.log10(low) / step) * step; power <= Math.log10(high); power += step)
    for (const part of parts) all.push(+`${part}e${power}`);
  return all.filter(value => value >= low * 0.999999 && value <= high * 1.000001);
}

function ticks(step, values) {
  let digits = 0;
  while (digits < 9 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6 * step * 10 ** digits) digits++;
  const far = Math.max(...values.map(Math.abs)) >= 1e6 || step < 1e-5;
  return values.map(value => minus(far ? value.toExponential(1) : (value || 0).toFixed(digits)));
}

function axis(panel, along, isLast) {
  const { label, log, names } = panel[along];
  const across = along === "x";
  const own = {
    scale: along, font: FONT, labelFont: FONT, space: across ? 55 : 30, gap: 4, ticks: { show: false },
    stroke: () => css("quiet"), size: across ? BOTTOM : LEFT,
    grid: { stroke: () => css("faint"), width: 1, show: !names.length },
    values: (u, all, index, space, step) => ticks(step, all),
  };
  if (across && isLast) Object.assign(own, { label, labelSize: LABEL, labelGap: 0 });
  if (log) {
    own.splits = (u, index, low, high) => decades(low, high);
    own.values = (u, all) => all.map(value => number(value, 1));
    own.filter = (u, all) => all;
  }
  if (names.length) {
    const short = names.map(name => name.length > 26 ? "\u2026" + name.slice(-25) : name);
    const longest = 7 * Math.max(...short.map(name => name.length));
    const every = u => Math.max(1, Math.ceil(names.length * 16 / (across ? u.bbox.width : u.bbox.height) * devicePixelRatio));
    own.splits = u => names.map((_, k) => k).filter(k => k % every(u) === 0);
    own.values = (u, all) => all.map(k => short[k]);
    own.size = Math.max(longest + 14, BOTTOM);
    if (across && longest > 50) own.rotate = -90;
  }
  return own;
}

// ---- Series

function cells(u, series) {
  const size = along => Math.abs(u.valToPos(1, along, true) - u.valToPos(0, along, true));
  const [width, height] = [size("x"), size("y")];
  const { ctx } = u;
  ctx.save();
  ctx.font = FONT.replace("12", Math.round(12 * devicePixelRatio));
  Object.assign(ctx, { textAlign: "center", textBaseline: "middle" });
  series.values.forEach((value, k) => {
    const [x, y] = [u.valToPos(series.x[k], "x", true), u.valToPos(series.y[k], "y", true)];
    ctx.fillStyle = css(value === null ? "faint" : value < 0 ? "line-2" : "line-1");
    ctx.globalAlpha = value === null ? 1 : Math.min(1, Math.abs(value));
    ctx.fillRect(x - width / 2, y - height / 2, width - 1, height - 1);
    ctx.globalAlpha = 1;
    ctx.fillStyle = Math.abs(value) > 0.6 ? css("page") : css("ink");
    if (value !== null && width > 36 * devicePixelRatio) ctx.fillText(minus(value.toFixed(2)), x, y);
  });
  ctx.restore();
  return null;
}

// What uPlot strokes and fills of a series.
function path(u, series) {
  if (series.look === "cells") return cells(u, series);
  const whole = new Path2D(), r = 4 * devicePixelRatio;
  const zero = u.valToPos(u.scales.y.distr === 3 ? u.scales.y.min : 0, "y", true);
  let isDown = false;
  series.x.forEach((value, k) => {
    const isThere = value !== null && series.y[k] !== null;
    const [x, y] = isThere ? [u.valToPos(value, "x", true), u.valToPos(series.y[k], "y", true)] : [];
    switch (isThere ? series.look : "") {
      case "": break;
      case "dots": case "rings":
        whole.moveTo(x + r, y);
        whole.arc(x, y, r, 0, 7);
        break;
      case "crosses":
        for (const turn of [1, -1]) {
          whole.moveTo(x - r, y - turn * r);
          whole.lineTo(x + r, y + turn * r);
        }
        break;
      case "stems":
        whole.moveTo(x, zero);
        whole.lineTo(x, y);
        break;
      default: whole[isDown ? "lineTo" : "moveTo"](x, y);
    }
    isDown = isThere;
  });
  return { stroke: whole, fill: ["area", "dots"].includes(series.look) ? whole : null, clip: null, flags: 0 };
}

function drawn(series, shade) {
  const isArea = series.look === "area";
  return {
    label: series.label, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }],
    stroke: () => css(series.colour), fill: () => css(series.colour) + (isArea ? "30" : ""),
    width: { area: 0.5, data: 1.2 }[isArea ? "area" : series.colour] ?? 1.8, alpha: isArea ? 1 : shade,
    dash: series.look === "dashed" ? [6, 5] : undefined, points: { show: false }, paths: (u, i) => path(u, series),
  };
}

// The lines of zero, stronger than the grid; those between stable and unstable are among them.
function zero(u, panel) {
  const { ctx, bbox: { left, top, width, height } } = u;
  const has = along => !panel[along].log && !panel[along].names.length && u.scales[along].min < 0 && u.scales[along].max > 0;
  ctx.save();
  Object.assign(ctx, { strokeStyle: css("rule"), lineWidth: 1.5 * devicePixelRatio });
  ctx.beginPath();
  if (has("x")) ctx.rect(u.valToPos(0, "x", true), top, 0, height);
  if (has("y")) ctx.rect(left, u.valToPos(0, "y", true), width, 0);
  ctx.stroke();
  ctx.restore();
}

// Words beside points that leave room for them.
function words(u, panel) {
  const told = [], { ctx } = u;
  ctx.save();
  ctx.font = FONT.replace("12", Math.round(12 * devicePixelRatio));
  ctx.fillStyle = css("ink");
  panel.series.forEach((series, i) => u.series[i + 1].show && (series.words || []).forEach((text, k) => {
    const [x, y] = [u.valToPos(series.x[k], "x", true), u.valToPos(series.y[k], "y", true)];
    const isFree = told.every(([a, b]) => Math.abs(a - x) > 90 * devicePixelRatio || Math.abs(b - y) > 16 * devicePixelRatio);
    const { left, top, width, height } = u.bbox;
    if (!isFree || x < left || x > left + width || y < top || y > top + height) return;
    told.push([x, y]);
    const isRight = x < left + 0.7 * width;
    ctx.textAlign = isRight ? "left" : "right";
    ctx.fillText(text, x + (isRight ? 9 : -9) * devicePixelRatio, Math.max(y - 6 * devicePixelRatio, top + 12 * devicePixelRatio));
  }));
  ctx.restore();
}

// ---- What the pointer tells

function nearest(u, panel) {
  let best = null, least = NEAR * NEAR;
  panel.series.forEach((series, i) => {
    if (!u.series[i + 1].show || series.look === "area") return;
    series.x.forEach((value, k) => {
      if (value === null || series.y[k] === null) return;
      const [dx, dy] = [u.valToPos(value, "x") - u.cursor.left, u.valToPos(series.y[k], "y") - u.cursor.top];
      const distance = dx * dx + dy * dy;
      if (distance < least) [best, least] = [{ series, k }, distance];
    });
  });
  return best;
}

function tell(u, panel, tip, spot) {
  const found = u.cursor.left < 0 ? null : nearest(u, panel);
  tip.hidden = spot.hidden = !found;
  if (!found) return;
  const { series, k } = found;
  const name = along => panel[along].names[series[along][k]] ?? quantity(panel[along].label, series[along][k]);
  const lines = [[series.run, series.label].filter(Boolean).join(", "), name("x"), name("y")];
  if (series.values.length) lines.push(number(series.values[k]));
  tip.textContent = lines.filter(Boolean).join("\n");
  const [x, y] = [u.valToPos(series.x[k], "x"), u.valToPos(series.y[k], "y")];
  spot.style.transform = `translate(${x - 5}px, ${y - 5}px)`;
  spot.style.borderColor = css(series.colour);
  const isLeft = x + tip.offsetWidth + 16 < u.over.clientWidth;
  const left = isLeft ? x + 12 : Math.max(0, x - tip.offsetWidth - 12);
  tip.style.transform = `translate(${left}px, ${Math.max(0, Math.min(y + 10, u.over.clientHeight - tip.offsetHeight))}px)`;
}

// ---- Figures

function height(panel, width) {
  return Math.round(Math.max(Math.min(panel.height, 0.85 * width), Math.min(220, panel.height)));
}

function draw(figure, panel, box, isLast) {
  if (panel.y.label) element("div", box, { className: "ordinate", textContent: panel.y.label });
  const place = element("div", box, { className: "panel" });
  const counts = {};
  const series = panel.series.map(own => {
    const before = counts[own.colour + own.look] = (counts[own.colour + own.look] ?? -1) + 1;
    return drawn(own, SHADES[before % SHADES.length]);
  });
  const scale = along => ({ time: false, distr: panel[along].log ? 3 : 1, range: u => range(u, panel, along) });
  const [tip, spot] = ["tip", "spot"].map(className => Object.assign(document.createElement("div"), { className, hidden: true }));
  const u = new uPlot({
    mode: 2, width: place.clientWidth, height: height(panel, place.clientWidth), padding: [TOP, RIGHT, 0, 0],
    scales: { x: scale("x"), y: scale("y") }, axes: [axis(panel, "x", isLast), axis(panel, "y", isLast)],
    series: [{}, ...series], legend: { show: false },
    cursor: { points: { show: false }, drag: { x: true, y: true, uni: 30 }, dataIdx: () => null },
    hooks: {
      init: [u => u.over.append(spot, tip)],
      drawAxes: [u => zero(u, panel)],
      draw: [u => words(u, panel)],
      setCursor: [u => tell(u, panel, tip, spot)],
      setScale: [(u, key) => key === "x" && together(u)],
      setSelect: [u => { if (u.select.width || u.select.height) u.reset.hidden = false; }],
    },
  }, [null, ...panel.series.map(own => [own.x, own.y])], place);
  u.panel = panel;
  u.root.setAttribute("role", "img");
  u.root.setAttribute("aria-label", `${figure.title}: ${panel.y.label}`);
  new ResizeObserver(() => {
    const width = place.clientWidth;
    if (width && width !== u.width) u.setSize({ width, height: height(panel, width) });
  }).observe(place);
  return u;
}

// Panels with the same abscissa show the same part of it.
function together(u) {
  if (!u.beside || together.isBusy) return;
  together.isBusy = true;
  const { min, max } = u.scales.x;
  u.beside.filter(other => other !== u && other.panel.x.label === u.panel.x.label).forEach(other => other.setScale("x", { min, max }));
  together.isBusy = false;
}

function show(u) {
  u.batch(() => u.panel.series.forEach((series, i) => {
    const isShown = !u.hidden.has(series.label) && (!chosen || !series.run || series.run === chosen);
    if (u.series[i + 1].show !== isShown) u.setSeries(i + 1, { show: isShown });
  }));
}

function legend(figure, box, beside, hidden) {
  const all = figure.panels.flatMap(panel => panel.series).filter(series => series.label);
  const labels = new Map(all.reverse().map(series => [series.label, series]));
  for (const [label, series] of [...labels].reverse()) {
    const button = element("button", box, { type: "button", title: "hide or show" });
    const key = element("span", button, { className: `key ${series.look}` });
    key.style.setProperty("--colour", `var(--${series.colour})`);
    button.append(label);
    button.setAttribute("aria-pressed", "true");
    button.onclick = () => {
      const isOff = !hidden.delete(label) && hidden.add(label);
      button.setAttribute("aria-pressed", String(!isOff));
      beside.forEach(show);
    };
  }
}

function whole(figure, box) {
  const bar = element("div", box, { className: "legend" });
  const beside = figure.panels.map((panel, k) => draw(figure, panel, box, figure.panels[k + 1]?.x.label !== panel.x.label));
  const hidden = new Set();
  legend(figure, bar, beside, hidden);
  const reset = element("button", bar, { type: "button", className: "reset", textContent: "show all", hidden: true });
  reset.onclick = () => {
    reset.hidden = true;
    beside.forEach(u => u.setData(u.data));
  };
  beside.forEach(u => Object.assign(u, { beside, hidden, reset }));
  plots.push(...beside);
}

function choice(runs) {
  const bar = document.querySelector("#choice");
  if (!bar || runs.length < 2) return;
  const select = element("select", element("label", bar, { textContent: "run " }));
  for (const run of ["", ...runs]) element("option", select, { value: run, textContent: run || `all ${runs.length}` });
  select.onchange = () => {
    chosen = select.value;
    plots.forEach(show);
  };
  bar.hidden = false;
}

const redraw = () => plots.forEach(u => u.redraw(false, true));
const runs = new Set();
for (const source of document.querySelectorAll("figure > script")) {
  const figure = JSON.parse(source.textContent);
  figure.panels.forEach(panel => panel.series.forEach(series => series.run && runs.add(series.run)));
  whole(figure, source.parentElement);
}
choice([...runs]);
for (const media of ["print", "(prefers-color-scheme: dark)"]) matchMedia(media).addEventListener("change", redraw);
})();
