// What the page of trends shows as a picture to take along: chart, period and numbers, as PNG or as SVG.
import * as format from "./format.js";

const HEAD = 56, ROW = 24, SIDE = 16; // [px]
const escaped = (text) => String(text).replace(/[&<>"]/g, (one) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[one]);
const round = (value) => Math.round(value * 100) / 100;

/** A path that remembers how it was drawn. */
class Written extends Path2D {
  constructor(d = "") { super(); this.d = d; }
  moveTo(x, y) { this.d += `M${round(x)} ${round(y)}`; }
  lineTo(x, y) { this.d += `${this.d ? "L" : "M"}${round(x)} ${round(y)}`; } // on a canvas the first line begins where it ends
  closePath() { this.d += "Z"; }
  rect(x, y, w, h) { this.d += `M${round(x)} ${round(y)}h${round(w)}v${round(h)}h${round(-w)}Z`; }
}

/** A colour and its opacity: not every program reads them as one. */
function ink(name, colour, alpha) {
  const [, plain, own] = /^rgba\((.*), ([\d.]+)\)$/.exec(colour) ?? [], opacity = round((own ?? 1) * alpha);
  return `${name}="${plain ? `rgb(${plain})` : colour}"${opacity < 1 ? ` ${name}-opacity="${opacity}"` : ""}`;
}

/** What is drawn on `ctx` while `work` runs, written down as SVG instead. */
function written(ctx, work) {
  const parts = [], saved = [], real = Object.getPrototypeOf(ctx), Path = window.Path2D;
  let path = new Written(), open = 0, clips = 0;
  const placed = () => { const { a, b, c, d, e, f } = ctx.getTransform(); return a === 1 && !e && !f ? "" : ` transform="matrix(${[a, b, c, d, e, f].map(round).join(" ")})"`; };
  const fill = () => ink("fill", ctx.fillStyle, ctx.globalAlpha);
  const line = () => `${ink("stroke", ctx.strokeStyle, ctx.globalAlpha)} stroke-width="${round(ctx.lineWidth)}" stroke-linejoin="round"${ctx.getLineDash().length ? ` stroke-dasharray="${ctx.getLineDash().join(" ")}"` : ""}`;
  const put = (d, how) => { if (d) parts.push(`<path d="${d}" ${how}${placed()}/>`); };
  const words = (text, x, y, how) => {
    const anchor = { center: "middle", right: "end", end: "end" }[ctx.textAlign] ?? "start", base = { middle: "central", top: "text-before-edge", bottom: "text-after-edge" }[ctx.textBaseline] ?? "auto";
    const [, weight, size, family] = /^(?:(\w+) )?([\d.]+)px (.*)$/.exec(ctx.font) ?? [null, 400, 12, "sans-serif"];
    parts.push(`<text x="${round(x)}" y="${round(y)}" text-anchor="${anchor}" dominant-baseline="${base}" font-family="${escaped(family)}" font-size="${size}" font-weight="${weight ?? 400}" ${how}${placed()}>${escaped(text)}</text>`);
  };
  Object.assign(ctx, {
    save() { real.save.call(ctx); saved.push(open); open = 0; },
    restore() { real.restore.call(ctx); parts.push("</g>".repeat(open)); open = saved.pop(); },
    clip({ d } = path) { open++; parts.push(`<clipPath id="c${++clips}"><path d="${d}"/></clipPath><g clip-path="url(#c${clips})">`); },
    beginPath() { path = new Written(); },
    moveTo(...at) { path.moveTo(...at); },
    lineTo(...at) { path.lineTo(...at); },
    rect(...at) { path.rect(...at); },
    fill({ d } = path) { put(d, fill()); },
    stroke({ d } = path) { put(d, `fill="none" ${line()}`); },
    fillRect(x, y, w, h) { const box = new Written(); box.rect(x, y, Math.max(0, w), Math.max(0, h)); put(box.d, fill()); },
    fillText(text, x, y) { words(text, x, y, fill()); },
    strokeText(text, x, y) { words(text, x, y, `fill="none" ${line()}`); },
    clearRect() {},
  });
  window.Path2D = Written;
  try {
    work(parts);
  } finally {
    window.Path2D = Path;
    for (const name of Object.keys(ctx)) delete ctx[name];
  }
  return parts.join("");
}

/** Draw the chart once more, its curves too. */
function again(chart) {
  for (const series of chart.plot.series) series._paths = null;
  chart.draw();
}

/** The sheet around the chart: title and period, the numbers as they stand on the page. `about` = {title, period, made, simulated}. */
function drawSheet(chart, ctx, about, table, size) {
  const ratio = uPlot.pxRatio, columns = table[0].length, put = (text, x, y, how) => chart.text({ ctx }, text, x * ratio, y * ratio, how);
  ctx.fillStyle = chart.colour("--panel");
  ctx.fillRect(0, 0, size.width * ratio, size.height * ratio);
  put(about.title, SIDE, 20, { colour: "--text", strong: true });
  put(about.period, SIDE, 40);
  put(about.made, size.width - SIDE, 40, { align: "right" });
  if (about.simulated) put(about.simulated, size.width - SIDE, 20, { align: "right", colour: "--text", strong: true });
  const places = table[0].map((_, i) => size.width - SIDE - (columns - 1 - i) * Math.min(120, (size.width * 0.62) / (columns - 2)));
  places[1] = Math.max(SIDE + 150, places[2] - 160);
  table.forEach((row, line) => row.forEach((text, i) => {
    const y = HEAD + size.chart + 8 + (line + 0.5) * ROW;
    if (i) put(text, places[i], y, { align: i > 1 ? "right" : "left", colour: "--text" });
    else put(chart.fitted(text, places[1] - SIDE - 12, line ? 13 : 12, line > 0), SIDE, y, { colour: "--text", strong: line > 0 });
  }));
}

function sheetOf({ plot: { width, height } }, table) { return { width, chart: height, height: HEAD + height + 16 + table.length * ROW }; }

/** The sheet as a text of SVG. */
export function svg(chart, about, table) {
  const size = sheetOf(chart, table), ratio = uPlot.pxRatio, { ctx } = chart.plot;
  const content = written(ctx, (parts) => {
    ctx.save();
    drawSheet(chart, ctx, about, table, size);
    ctx.restore();
    parts.push(`<g transform="translate(0 ${HEAD * ratio})">`);
    again(chart);
    parts.push("</g>");
  });
  again(chart);
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${size.width}" height="${size.height}" viewBox="0 0 ${size.width * ratio} ${size.height * ratio}"><title>${escaped(about.title)}</title>${content}</svg>`;
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
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/** A name for a file of this period: pogon-trends-20261123-081500. */
export function named(chart, zone) {
  const stamp = new Date(chart.from / 1000 + format.offset(chart.from, zone) * 60000).toISOString().slice(0, 19);
  return `pogon-trends-${stamp.replace(/[-:]/g, "").replace("T", "-")}`;
}
