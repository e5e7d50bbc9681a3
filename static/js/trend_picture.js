// What the page of trends shows as a picture to take along: chart, period and numbers, as PNG or as SVG.
import * as format from "./format.js";

const HEAD = 56, ROW = 24, SIDE = 16;
const escaped = (text) => String(text).replace(/[&<>"]/g, (one) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[one]);
const round = (value) => Math.round(value * 100) / 100;

/** A path that remembers how it was drawn. */
class SvgPath {
  d = "";
  moveTo(x, y) { this.d += `M${round(x)} ${round(y)}`; }
  lineTo(x, y) { this.d += `L${round(x)} ${round(y)}`; }
  closePath() { this.d += "Z"; }
  rect(x, y, w, h) { this.d += `M${round(x)} ${round(y)}h${round(w)}v${round(h)}h${round(-w)}Z`; }
  roundRect(x, y, w, h) { this.rect(x, y, w, h); }
  arc(x, y, r) { this.d += `M${round(x - r)} ${round(y)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`; }
}

/** As much of the context of a canvas as the chart uses, written down as SVG. */
class SvgContext {
  Path = SvgPath;
  parts = [];
  fillStyle = "#000"; strokeStyle = "#000"; lineWidth = 1; globalAlpha = 1; font = "12px sans-serif"; textAlign = "left"; textBaseline = "alphabetic";
  #dash = []; #path = new SvgPath(); #saved = []; #open = 0; #clips = 0;
  #measuring = document.createElement("canvas").getContext("2d");

  save() {
    const { fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, textBaseline } = this;
    this.#saved.push([{ fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, textBaseline }, this.#dash, this.#open]);
    this.#open = 0;
  }
  restore() {
    this.parts.push("</g>".repeat(this.#open));
    const [state, dash, open] = this.#saved.pop();
    Object.assign(this, state);
    this.#dash = dash;
    this.#open = open;
  }
  clip() {
    const id = `c${++this.#clips}`;
    this.parts.push(`<clipPath id="${id}"><path d="${this.#path.d}"/></clipPath><g clip-path="url(#${id})">`);
    this.#open++;
  }
  beginPath() { this.#path = new SvgPath(); }
  moveTo(...at) { this.#path.moveTo(...at); }
  lineTo(...at) { this.#path.lineTo(...at); }
  closePath() { this.#path.closePath(); }
  rect(...at) { this.#path.rect(...at); }
  roundRect(...at) { this.#path.rect(...at); }
  arc(...at) { this.#path.arc(...at); }
  setLineDash(dash) { this.#dash = dash; }
  /** A colour #rrggbbaa as colour and opacity: not every program reads it as one. */
  #ink(name, colour) {
    const [, plain, alpha] = /^(#[0-9a-f]{6})([0-9a-f]{2})?$/i.exec(colour) ?? [null, colour];
    const opacity = round((alpha ? parseInt(alpha, 16) / 255 : 1) * this.globalAlpha);
    return `${name}="${escaped(plain)}"${opacity < 1 ? ` ${name}-opacity="${opacity}"` : ""}`;
  }
  #line() { return `${this.#ink("stroke", this.strokeStyle)} stroke-width="${round(this.lineWidth)}" stroke-linejoin="round"${this.#dash.length ? ` stroke-dasharray="${this.#dash.join(" ")}"` : ""}`; }
  fill(path = this.#path) { if (path.d) this.parts.push(`<path d="${path.d}" ${this.#ink("fill", this.fillStyle)}/>`); }
  stroke(path = this.#path) { if (path.d) this.parts.push(`<path d="${path.d}" fill="none" ${this.#line()}/>`); }
  fillRect(x, y, w, h) { this.parts.push(`<rect x="${round(x)}" y="${round(y)}" width="${round(Math.max(0, w))}" height="${round(Math.max(0, h))}" ${this.#ink("fill", this.fillStyle)}/>`); }
  measureText(text) {
    this.#measuring.font = this.font;
    return this.#measuring.measureText(text);
  }
  #text(text, x, y, how) {
    const anchor = { left: "start", center: "middle", right: "end" }[this.textAlign], base = this.textBaseline === "middle" ? ' dominant-baseline="central"' : "";
    const [, weight, size, family] = /^(?:(\d+) )?([\d.]+)px (.*)$/.exec(this.font) ?? [null, 400, 12, "sans-serif"];
    this.parts.push(`<text x="${round(x)}" y="${round(y)}" text-anchor="${anchor}"${base} font-family="${escaped(family)}" font-size="${size}" font-weight="${weight ?? 400}" ${how}>${escaped(text)}</text>`);
  }
  fillText(text, x, y) { this.#text(text, x, y, this.#ink("fill", this.fillStyle)); }
  strokeText(text, x, y) { this.#text(text, x, y, `fill="none" ${this.#line()}`); }
}

/** The chart once more, on another context: axes, curves and all that lies on and under them. */
function drawChart(chart, ctx) {
  const ratio = uPlot.pxRatio, { bbox } = chart.plot, axes = chart.plot.axes;
  const plot = Object.create(chart.plot, { ctx: { value: ctx } });
  chart.ground(plot);
  ctx.lineWidth = ratio;
  ctx.setLineDash([]);
  const rule = (x, y, x2, y2) => {
    ctx.strokeStyle = chart.colour("--grid") + "47";
    ctx.beginPath();
    ctx.moveTo(x, y);
    ctx.lineTo(x2, y2);
    ctx.stroke();
  };
  axes[0]._splits.forEach((at, i) => {
    const x = plot.valToPos(at, "x", true);
    rule(x, bbox.top, x, bbox.top + bbox.height);
    chart.text(plot, axes[0]._values[i], x, bbox.top + bbox.height + 10 * ratio, { align: "center" });
  });
  axes.slice(1).forEach((axis, index) => axis._splits?.forEach((value, i) => {
    const y = plot.valToPos(value, axis.scale, true);
    if (index === 0) rule(bbox.left, y, bbox.left + bbox.width, y);
    chart.text(plot, axis._values[i], (axis._pos - 6) * ratio, y, { align: "right" });
  }));
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  for (const pen of chart.shown()) {
    const { stroke, fill } = chart.paths(plot, pen, undefined, ctx.Path ?? Path2D);
    ctx.fillStyle = chart.ink(pen) + "38";
    ctx.fill(fill);
    ctx.strokeStyle = chart.ink(pen);
    ctx.lineWidth = 2 * ratio;
    ctx.setLineDash(chart.dash(pen));
    ctx.stroke(stroke);
  }
  ctx.restore();
  chart.above(plot);
}

/** The whole sheet: title and period, the chart, the numbers as they stand on the page. `about` = {title, period, made}. */
function drawSheet(chart, ctx, about, table, size) {
  const ratio = uPlot.pxRatio, plot = { ctx };
  const put = (text, x, y, how) => chart.text(plot, text, x * ratio, y * ratio, how);
  ctx.fillStyle = chart.colour("--panel");
  ctx.fillRect(0, 0, size.width * ratio, size.height * ratio);
  put(about.title, SIDE, 20, { colour: "--text", strong: true });
  put(about.period, SIDE, 40);
  put(about.made, size.width - SIDE, 40, { align: "right" });
  if (about.simulated) put(about.simulated, size.width - SIDE, 20, { align: "right", colour: "--text", strong: true });
  const places = table[0].map((_, i) => (i < 2 ? 0 : size.width - SIDE - (table[0].length - 1 - i) * Math.min(120, (size.width * 0.62) / (table[0].length - 2))));
  places[1] = Math.max(SIDE + 150, (places[2] ?? 0) - 160);
  table.forEach((row, line) => {
    const y = HEAD + size.chart + 8 + (line + 0.5) * ROW;
    row.forEach((text, i) => put(i ? text : chart.fitted(text, places[1] - SIDE - 12, line ? 13 : 12, line ? 600 : 400), i ? places[i] : SIDE, y, i > 1 ? { align: "right", colour: "--text" } : { colour: "--text", strong: !i && line > 0 }));
  });
}

function sheetOf(chart, table) {
  const { plot } = chart;
  return { width: plot.width, chart: plot.height, height: HEAD + plot.height + 16 + table.length * ROW };
}

/** The sheet as a text of SVG. */
export function svg(chart, about, table) {
  const size = sheetOf(chart, table), ratio = uPlot.pxRatio, ctx = new SvgContext();
  drawSheet(chart, ctx, about, table, size);
  ctx.parts.push(`<g transform="translate(0 ${HEAD * ratio})">`);
  drawChart(chart, ctx);
  ctx.parts.push("</g>");
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${size.width}" height="${size.height}" viewBox="0 0 ${size.width * ratio} ${size.height * ratio}"><title>${escaped(about.title)}</title>${ctx.parts.join("")}</svg>`;
}

/** The sheet as a PNG. */
export function png(chart, about, table) {
  const size = sheetOf(chart, table), ratio = uPlot.pxRatio;
  const canvas = Object.assign(document.createElement("canvas"), { width: size.width * ratio, height: size.height * ratio }), ctx = canvas.getContext("2d");
  drawSheet(chart, ctx, about, table, size);
  ctx.drawImage(chart.plot.ctx.canvas, 0, HEAD * ratio);
  return new Promise((done) => { canvas.toBlob(done, "image/png"); });
}

/** Give `blob` to the person as a file. */
export function save(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/** A name for a file of this period: pogon-trends-20261123-081500. */
export function named(chart, zone) {
  const stamp = new Date(chart.from / 1000 + format.offset(chart.from, zone) * 60000).toISOString().slice(0, 19);
  return `pogon-trends-${stamp.replace(/[-:]/g, "").replace("T", "-")}`;
}
