// The chart of the page of trends: names beside the curves, markers, quality, alarms, notes, rulers, and another period under this one.
import { Chart, DASHES, unpacked } from "./chart.js";
import * as format from "./format.js";
import * as time from "./time_axis.js";

const MARKER_EVERY = 170;
const SYMBOLS = {
  1: (c, x, y, r) => c.rect(x - r, y - r, 2 * r, 2 * r),
  2: (c, x, y, r) => { c.moveTo(x, y - r); c.lineTo(x + r, y + r); c.lineTo(x - r, y + r); c.closePath(); },
  3: (c, x, y, r) => { c.moveTo(x, y + r); c.lineTo(x + r, y - r); c.lineTo(x - r, y - r); c.closePath(); },
  4: (c, x, y, r) => c.arc(x, y, r, 0, 7),
};
const NARROW = 560;
const measuring = document.createElement("canvas").getContext("2d");

export class TrendChart extends Chart {
  constructor(element, pens, options) {
    super(element, pens, options);
    Object.assign(this, { rulers: {}, marks: [], notes: [], shift: 0 });
  }

  // ---- another period ---------------------------------------------------------------------------------------------

  /** Draw the answer of /history/series for a range `shift` µs earlier under this one; none: nothing more. */
  under(answer, shift) {
    this.shift = answer ? shift : 0;
    for (const pen of this.pens) {
      const series = answer && unpacked(answer.series.find((one) => one.tag === pen.tag) ?? {});
      pen.ghost = series?.first ? this.woven(series).map((item) => ({ ...item, at: item.at + shift })) : null;
    }
  }

  ground(plot) {
    super.ground(plot);
    const { ctx, bbox } = plot;
    if (!this.shift) return;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.globalAlpha = 0.6;
    ctx.lineWidth = uPlot.pxRatio;
    for (const pen of this.shown()) {
      if (!pen.ghost) continue;
      ctx.strokeStyle = this.ink(pen);
      ctx.setLineDash([5, 2].map((one) => one * uPlot.pxRatio));
      ctx.stroke(this.paths(plot, pen, pen.ghost, ctx.Path ?? Path2D).stroke);
    }
    ctx.restore();
  }

  /** The axis of time of the other period below that of this one, and which period it is over the plot. */
  other(plot) {
    if (!this.shift) return;
    const { bbox } = plot, ratio = uPlot.pxRatio, y = bbox.top + bbox.height + 25 * ratio;
    const ats = plot.axes[0]._splits.map((at) => at * 1e6);
    const words = time.labels(ats.map((at) => at - this.shift), this.zone, this.lang);
    ats.forEach((at, i) => { this.text(plot, words[i], plot.valToPos(at / 1e6, "x", true), y, { align: "center" }); });
    const { ctx } = plot, end = bbox.left - 6 * ratio;
    ctx.strokeStyle = this.colour("--text-2");
    ctx.lineWidth = ratio;
    ctx.setLineDash([5, 2].map((one) => one * ratio));
    ctx.beginPath();
    ctx.moveTo(end - 26 * ratio, y);
    ctx.lineTo(end, y);
    ctx.stroke();
    ctx.setLineDash([]);
    this.text(plot, this.options.texts.other.replace("{period}", this.otherPeriod()), bbox.left + bbox.width, bbox.top - 12 * ratio, { align: "right" });
  }

  otherPeriod() {
    const [from, to] = [this.from - this.shift, this.to - this.shift];
    return `${format.date(from, this.zone, this.lang)} ${time.period(from, to, this.zone, this.lang)}`;
  }

  // ---- room ---------------------------------------------------------------------------------------------------------

  ink(pen) { return this.colour(`--pen-${((pen.number - 1) % 6) + 1}`); }
  dash(pen) { return DASHES[pen.number - 1].map((one) => one * uPlot.pxRatio); }
  get below() { return this.shift ? 18 : 0; }
  get least() { return Math.max(40, 14 + this.measured(this.options.texts.quality, 12)); }

  measured(text, size, weight = 400) {
    measuring.font = `${weight} ${size}px ${getComputedStyle(this.element).fontFamily}`;
    return measuring.measureText(text).width;
  }

  /** Names stand at the right of the plot, none on a curve; on a narrow screen only their markers do. */
  margins(width, scales) {
    const widths = this.shown().map((pen) => Math.max(this.measured(pen.label, 13, 600), this.measured(pen.machine, 12)));
    const names = width < NARROW ? 24 : Math.min(Math.ceil(Math.max(40, ...widths)) + 52, Math.floor(width * 0.24));
    return [scales.length > 1 ? 40 : 26, names];
  }

  fitted(text, most, size, weight) {
    let out = text;
    while (out.length > 3 && this.measured(out, size, weight) > most) out = out.slice(0, -2).trimEnd() + "…";
    return out;
  }

  inscribe(plot) {
    this.gapLabels(plot);
    this.markers(plot);
    this.flags(plot);
    this.names(plot);
    this.other(plot);
    this.strip(plot);
    this.alarms(plot);
    this.units(plot);
    this.dots(plot);
  }

  gapLabels(plot) {
    const pen = this.pen(this.selected), { ctx, bbox } = plot, ratio = uPlot.pxRatio;
    for (const [a, b] of pen?.on ? this.gaps(pen) : []) {
      const x = plot.valToPos(a / 1e6, "x", true), end = plot.valToPos(b / 1e6, "x", true);
      if (end - x < 14 * ratio) continue;
      const text = `${this.options.texts.no_data} ${format.duration((b - a) / 1e6, this.lang)}`;
      ctx.font = `${12 * ratio}px ${getComputedStyle(this.element).fontFamily}`;
      const width = ctx.measureText(text).width + 14 * ratio, y = bbox.top + bbox.height - 26 * ratio;
      const middle = Math.min(Math.max((x + end) / 2, bbox.left + width / 2), bbox.left + bbox.width - width / 2);
      ctx.fillStyle = this.colour("--inset");
      ctx.strokeStyle = this.colour("--line");
      ctx.lineWidth = ratio;
      ctx.setLineDash([]);
      ctx.beginPath();
      ctx.roundRect(middle - width / 2, y - 10 * ratio, width, 20 * ratio, 3 * ratio);
      ctx.fill();
      ctx.stroke();
      this.text(plot, text, middle, y, { align: "center" });
    }
  }

  marker(plot, number, x, y, size = 4) {
    const { ctx } = plot, r = size * uPlot.pxRatio, line = [5, 6].includes(number);
    ctx.beginPath();
    if (number === 1 || number === 8) ctx.arc(x, y, number === 8 ? r / 2 : r, 0, 7);
    else if (number === 2) SYMBOLS[1](ctx, x, y, r * 0.9);
    else if (number === 3) SYMBOLS[2](ctx, x, y, r);
    else if (number === 7) SYMBOLS[3](ctx, x, y, r);
    else if (number === 4) { ctx.moveTo(x, y - r * 1.2); ctx.lineTo(x + r * 1.2, y); ctx.lineTo(x, y + r * 1.2); ctx.lineTo(x - r * 1.2, y); ctx.closePath(); }
    else if (number === 5) { ctx.moveTo(x - r, y - r); ctx.lineTo(x + r, y + r); ctx.moveTo(x + r, y - r); ctx.lineTo(x - r, y + r); }
    else { ctx.moveTo(x - r, y); ctx.lineTo(x + r, y); ctx.moveTo(x, y - r); ctx.lineTo(x, y + r); }
    ctx.setLineDash([]);
    ctx.lineWidth = 1.75 * uPlot.pxRatio;
    ctx.strokeStyle = this.colour(`--pen-${((number - 1) % 6) + 1}`);
    ctx.fillStyle = this.colour("--inset");
    if (!line) ctx.fill();
    ctx.stroke();
  }

  markers(plot) {
    const { bbox } = plot, every = MARKER_EVERY * uPlot.pxRatio;
    for (const pen of this.shown()) {
      let next = bbox.left + every * (0.25 + pen.number / 10);
      for (const [x, y] of pen.places ?? []) {
        if (x < next || x > bbox.left + bbox.width) continue;
        this.marker(plot, pen.number, x, y, 3.5);
        while (next <= x) next += every;
      }
    }
  }

  /** Each curve's name beside its right end, none on top of another. */
  names(plot) {
    const { ctx, bbox } = plot, ratio = uPlot.pxRatio, edge = bbox.left + bbox.width, bottom = bbox.top + bbox.height, labels = [];
    const room = (plot.width - 8) * ratio - edge, narrow = room < 40 * ratio;
    const double = !narrow && this.shown().length * 33 * ratio < bbox.height;
    for (const pen of this.shown()) {
      const place = (pen.places ?? []).findLast(([x]) => x <= edge + 1 && x >= bbox.left);
      if (!place) continue;
      const end = Math.min(Math.max(place[1], bbox.top), bottom);
      labels.push({ pen, x: place[0], end, y: end, half: (double && pen.machine ? 16 : narrow ? 7 : 9) * ratio });
    }
    labels.sort((a, b) => a.y - b.y);
    labels.forEach((one, i) => { one.y = Math.max(one.y, i ? labels[i - 1].y + labels[i - 1].half + one.half : bbox.top + one.half); });
    for (let i = labels.length - 1, last = bottom; i >= 0; i--) {
      labels[i].y = Math.min(labels[i].y, last - labels[i].half);
      last = labels[i].y - labels[i].half;
    }
    for (const { pen, x, end, y } of labels) {
      const from = edge + 2 * ratio, to = from + (narrow ? 6 : 10) * ratio, most = room / ratio - 40;
      ctx.strokeStyle = this.ink(pen);
      ctx.lineWidth = ratio;
      ctx.setLineDash([]);
      ctx.beginPath();
      ctx.moveTo(Math.min(x, edge), end);
      if (x < edge - 3 * ratio) ctx.moveTo(from, end);
      ctx.lineTo(from, end);
      ctx.lineTo(to, y);
      ctx.stroke();
      if (narrow) { this.marker(plot, pen.number, to + 5 * ratio, y, 3.5); continue; }
      ctx.lineWidth = 2 * ratio;
      ctx.setLineDash(this.dash(pen));
      ctx.beginPath();
      ctx.moveTo(to, y);
      ctx.lineTo(to + 20 * ratio, y);
      ctx.stroke();
      ctx.setLineDash([]);
      this.marker(plot, pen.number, to + 10 * ratio, y, 3.5);
      const left = to + 25 * ratio;
      if (double && pen.machine) {
        this.text(plot, this.fitted(pen.machine, most, 12, 400), left, y - 8 * ratio);
        this.text(plot, this.fitted(pen.label, most, 13, 600), left, y + 7 * ratio, { colour: "--text", strong: true });
      } else this.text(plot, this.fitted(pen.machine ? `${pen.machine} · ${pen.label}` : pen.label, most, 13, 600), left, y, { colour: "--text", strong: true });
    }
  }

  /** Quality of the selected pen below the axis: full = good, hatched = uncertain, nothing = bad or not recorded. */
  strip(plot) {
    const pen = this.pen(this.selected), { ctx, bbox } = plot, ratio = uPlot.pxRatio;
    const y = bbox.top + bbox.height + (27 + this.below) * ratio;
    this.text(plot, this.options.texts.quality, bbox.left - 6 * ratio, y + 2.5 * ratio, { align: "right" });
    if (!pen?.on) return;
    const X = (at) => Math.min(Math.max(plot.valToPos(at / 1e6, "x", true), bbox.left), bbox.left + bbox.width);
    const items = this.drawn(pen);
    items.forEach((item, i) => {
      if (item.last === null && item.low === null) return;
      const a = X(item.at), b = items[i + 1] ? X(items[i + 1].at) : a;
      const level = item.level === 2 && item.last !== null ? items[i + 1]?.level ?? 0 : item.level;
      if (item.last === null || b <= a) return;
      ctx.fillStyle = this.colour("--line");
      if (level === 1) for (let x = a; x < b; x += 4 * ratio) ctx.fillRect(x, y, Math.min(2 * ratio, b - x), 5 * ratio);
      else ctx.fillRect(a, y, b - a + 0.5, 5 * ratio);
    });
  }

  /** Alarms on the axis of time, in the shape and colour of their priority. */
  alarms(plot) {
    const { ctx, bbox } = plot, ratio = uPlot.pxRatio, y = bbox.top + bbox.height + (48 + this.below) * ratio;
    for (const { time: at, priority } of this.marks) {
      if (at < this.from || at > this.to) continue;
      const x = plot.valToPos(at / 1e6, "x", true);
      ctx.beginPath();
      SYMBOLS[priority](ctx, x, y, 6 * ratio);
      ctx.fillStyle = this.colour(`--alm-${priority}`);
      ctx.fill();
      ctx.strokeStyle = this.colour("--outline");
      ctx.lineWidth = 1.25 * ratio;
      ctx.stroke();
      ctx.font = `600 ${8 * ratio}px ${getComputedStyle(this.element).fontFamily}`;
      ctx.textAlign = "center";
      ctx.textBaseline = "middle";
      ctx.fillStyle = this.colour(`--alm-${priority}-on`);
      ctx.fillText(String(priority), x, y + (priority === 2 ? 1.5 : priority === 3 ? -1 : 0.5) * ratio);
    }
  }

  /** Notes: a rule with a numbered flag at the top, as the list beside numbers them. */
  flags(plot) {
    const { ctx, bbox } = plot, ratio = uPlot.pxRatio;
    for (const { at, number } of this.notes) {
      if (at < this.from || at > this.to) continue;
      const x = plot.valToPos(at / 1e6, "x", true), wide = (10 + 7 * number.length) * ratio, right = x + wide > bbox.left + bbox.width;
      ctx.strokeStyle = ctx.fillStyle = this.colour("--outline");
      ctx.lineWidth = ratio;
      ctx.setLineDash([]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.fillRect(right ? x - wide : x, bbox.top, wide, 18 * ratio);
      this.text(plot, number, x + ((right ? -1 : 1) * wide) / 2, bbox.top + 9.5 * ratio, { align: "center", colour: "--inset", strong: true });
    }
  }

  /** Units over their axes, and over these the markers of the pens that they are of, when there are several. */
  units(plot) {
    const ratio = uPlot.pxRatio, { bbox } = plot, axes = plot.axes.slice(1);
    for (const axis of axes) {
      const pens = this.shown().filter((pen) => this.scaleOf(pen) === axis.scale);
      const text = pens[0]?.unit || (pens.length === 1 ? pens[0].label : ""), right = (axis._pos - 6) * ratio;
      this.text(plot, this.fitted(text, Math.max(34, axis._pos - 8), 12, 400), right, bbox.top - 12 * ratio, { align: "right" });
      if (this.scales().length > 1) pens.slice(0, 3).forEach((pen, i) => { this.marker(plot, pen.number, right - (4 + 12 * i) * ratio, bbox.top - 28 * ratio, 3.5); });
    }
  }

  /** Where the rulers cut the curves. */
  dots(plot) {
    for (const at of Object.values(this.rulers)) {
      if (at === null || at < this.from || at > this.to) continue;
      for (const pen of this.shown()) {
        const value = this.at(pen, at);
        if (value !== null) this.marker(plot, pen.number, plot.valToPos(at / 1e6, "x", true), plot.valToPos(value, this.scaleOf(pen), true), 4.5);
      }
    }
  }
}
