// Curves over time, drawn by uPlot: each pen as the history gives it (first, low, high, last of every column), then what arrives live.
// A pen is lifted where nothing good is known; nothing is ever drawn across a gap. Times are µs UTC, on the axis of uPlot seconds.
import * as format from "./format.js";
import { unpacked } from "./fetched.js";
import { apart } from "./names.js";
import * as time from "./time_axis.js";

/** Dash of each pen [px]; colours are --pen-1 to --pen-6, 7 and 8 take the first two again with other dashes and markers. */
const DASHES = [[], [8, 4], [2, 3], [8, 3, 2, 3], [12, 4], [4, 2], [14, 3, 2, 3, 2, 3], [3, 7]];
const THIN = [5, 2]; // the other period
/** How far an extreme must stand out of the line to be drawn as line, not only as part of the band: pixels, and usual heights of the band. */
const STANDS_OUT = [6, 2];
const LASTS = 1e6, SCAN = 200e3; // a value unchanged for longer held; how long before its change it is known to have done so [µs]
const KEPT = 630e6; // the recorder stores a value at least so often [µs]
const MARKER_EVERY = 170, NARROW = 560; // [px]
/** Alarms by priority, around their middle; markers of pens are those of the page (templates/macros/trend.html), around 16, 7. */
const ALARMS = { 1: "M-6-6h12v12h-12z", 2: "M0-6L6 6H-6z", 3: "M0 6L6-6H-6z", 4: "M-6 0a6 6 0 1 0 12 0a6 6 0 1 0-12 0z" };
const LEVEL = { good: 0, uncertain: 1, stale: 1, bad: 2, none: 2 };
const linear = uPlot.paths.linear();
const measuring = document.createElement("canvas").getContext("2d");

export class Chart {
  /** Draw `pens` into `element`. options: zone, lang, texts; mini: without names and marks, letters at the right ends. */
  constructor(element, pens, options) {
    Object.assign(this, { element, options, pens, ...options, from: 0, to: 1, now: 0, axis: "auto", selected: pens[0]?.tag, plot: null, shape: "", ranges: {} });
    Object.assign(this, { rulers: {}, marks: [], notes: [], shift: 0 });
    for (const pen of pens) Object.assign(pen, { columns: [], step: 0, fresh: [], items: [], ghost: null });
    element.chart = this;
    new ResizeObserver(() => this.draw()).observe(element);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.rebuild());
  }

  // ---- data ---------------------------------------------------------------------------------------------------

  pen(tag) { return this.pens.find((pen) => pen.tag === tag); }

  /** An answer of /history/series; what arrived live before its end is in it. */
  take(answer) {
    for (const series of answer.series) {
      const pen = this.pen(series.tag);
      if (!pen) continue;
      Object.assign(pen, { columns: unpacked(series), step: series.step ?? 0 });
      const last = pen.columns.at(-1)?.at ?? 0, held = pen.fresh.findLast(({ at }) => at <= last);
      pen.fresh = pen.fresh.filter(({ at }) => at > last);
      if (held && !pen.fresh.length && held.last === null) pen.fresh.push({ ...held, at: last + 1 });
      pen.items = [...pen.columns, ...pen.fresh];
    }
  }

  /** Draw the answer of /history/series for a range `shift` µs earlier under this one; none: nothing more. */
  under(answer, shift) {
    this.shift = answer ? shift : 0;
    for (const pen of this.pens) {
      const series = answer?.series.find((one) => one.tag === pen.tag);
      pen.ghost = series ? unpacked(series).map((item) => ({ ...item, at: item.at + shift })) : null;
    }
  }

  /** A value that has just arrived, null when it is not usable; level 0 good, 1 uncertain, 2 bad. */
  append(tag, at, value, level) {
    const pen = this.pen(tag), held = pen?.items.at(-1);
    if (!pen || (held && (at < held.at || (at === held.at && !pen.fresh.length)))) return;
    const put = (when, y, quality) => pen.fresh.push({ at: when, first: y, low: y, high: y, last: y, level: quality, count: 1 });
    // What did not change was not sent: it held until now, and no line leads from there to here.
    if (!pen.stepped && held && held.last !== null && value !== null && held.last !== value && at - held.at > LASTS) put(at - SCAN, held.last, held.level);
    put(at, value, level);
    pen.items = [...pen.columns, ...pen.fresh];
  }

  /** Take what arrives live; while nothing does, nothing is known. now() is the clock of the server. */
  follow(now) {
    document.addEventListener("pogon:frame", ({ detail }) => {
      for (const { name, value, state } of detail.changed) this.append(name, detail.time, LEVEL[state] < 2 && typeof value === "number" ? value : null, LEVEL[state]);
    });
    document.addEventListener("pogon:live", ({ detail }) => {
      if (detail === "offline") for (const pen of this.pens) this.append(pen.tag, now(), null, 2);
    });
  }

  /** What holds now is drawn up to now, while values arrive. */
  drawn({ items }) {
    const last = items.at(-1);
    if (!this.holds || !last || last.last === null || this.now <= last.at || this.now - last.at > KEPT) return items;
    return [...items, { ...last, at: this.now, first: last.last, low: last.last, high: last.last, count: 0 }];
  }

  /** The points of a pen as uPlot gets them: seconds and values, null where the pen is lifted. */
  points(pen, items = this.drawn(pen)) {
    const xs = [], ys = [], put = (at, y) => { xs.push(at / 1e6); ys.push(y); };
    const out = pen.stepped ? 0 : this.out(pen, items);
    let before = null;
    items.forEach(({ at, first, low, high, last, count }, i) => {
      if (first === null) { put(at, null); before = null; }
      if (low === null) return;
      if (pen.stepped && before !== null && first !== before) put(at, before);
      const ends = [first ?? low, last ?? high];
      // A column of many samples that is no higher than usual is a line through its last value; after a rest, the value before held until then.
      const flat = !pen.stepped && count > 3 && first !== null && last !== null && high - low <= out;
      if (flat && (before === null || at - items[i - 1].at <= 1.5 * pen.step)) put(at, last);
      else {
        put(at, ends[0]);
        if (Math.min(...ends) - low > out) put(at, low);
        if (high - Math.max(...ends) > out) put(at, high);
        if (count > 1) put(at, ends[1]);
      }
      const alone = before === null && (last === null || items[i + 1]?.first === null) ? (this.to - this.from) / 800 : 0; // a sample between two gaps is a dot
      if (alone) put(at + alone, ends[1]);
      if (last === null) put(at + alone, null);
      before = last;
    });
    return [xs, ys];
  }

  out(pen, items) {
    const heights = items.filter(({ at, count, low }) => count > 1 && low !== null && at >= this.from).map(({ low, high }) => high - low).sort((a, b) => a - b);
    const [low, high] = this.ranges[this.scaleOf(pen)] ?? [0, 0];
    return Math.max((STANDS_OUT[0] * (high - low)) / Math.max(60, this.element.clientHeight - 90), STANDS_OUT[1] * (heights[heights.length >> 1] ?? 0));
  }

  /** Where the line of the pen, as it is drawn, is at a time; null in a gap. */
  at(pen, at) {
    const [xs, ys] = pen.line ?? [[], []], when = at / 1e6, i = xs.findLastIndex((x) => x <= when), value = ys[i], after = ys[i + 1];
    if (i < 0 || after === undefined) return xs[i] === when ? value : null;
    return value === null || after === null ? value ?? null : value + ((after - value) * (when - xs[i])) / (xs[i + 1] - xs[i] || 1);
  }

  /** Times without a good or uncertain value of a pen within the view, [from, to]. */
  gaps(pen) {
    const out = [], items = this.drawn(pen), end = Math.min(this.to, this.now || this.to);
    let open = this.from;
    for (const item of items) {
      if (item.low !== null) {
        if (open !== null && item.at > open && item.at > this.from) out.push([Math.max(open, this.from), Math.min(item.at, this.to)]);
        open = null;
      }
      if (item.last === null && open === null) open = item.at;
    }
    const last = items.at(-1);
    if (open === null && last && end - last.at > KEPT) open = last.at;
    if (open !== null && end > open) out.push([Math.max(open, this.from), end]);
    return out.filter(([a, b]) => b > a && a < this.to && b > this.from);
  }

  // ---- scales -------------------------------------------------------------------------------------------------

  shown() { return this.pens.filter((pen) => pen.on); }
  scaleOf(pen) { return "y" + pen.scale; }
  on(scale) { return this.shown().filter((pen) => this.scaleOf(pen) === scale); }

  /** Scales in use, that of the selected pen first. */
  scales() {
    const pens = this.shown(), chosen = pens.filter((pen) => pen.tag === this.selected);
    return [...new Set([...chosen, ...pens].map((pen) => this.scaleOf(pen)))];
  }

  range(scale) {
    const pens = this.on(scale), known = pens.filter((pen) => pen.low !== null && pen.high !== null);
    let low = Infinity, high = -Infinity;
    const note = (...values) => { for (const y of values) if (y !== null && y !== undefined) { low = Math.min(low, y); high = Math.max(high, y); } };
    for (const pen of pens) for (const items of [this.drawn(pen), pen.ghost ?? []]) {
      let before = null;
      for (const item of items) {
        if (item.at >= this.from && item.at <= this.to) note(item.low, item.high, before);
        before = item.at < this.from ? item.last : null;
      }
    }
    if (pens.some((pen) => Object.keys(pen.texts).length)) return Number.isFinite(low) ? [Math.min(0, low) - 0.3, Math.max(1, high) + 0.3] : [-0.3, 1.3];
    if (this.axis === "scale" || !Number.isFinite(low)) for (const pen of known) note(pen.low, pen.high);
    if (!Number.isFinite(low)) return [0, 1];
    if (this.axis === "auto") {
      note(0);
      for (const pen of known) if (!this.mini || pen === this.pens[0]) note(pen.normal ? Math.min(pen.high, pen.normal[1]) : null);
    }
    const least = Math.max(2 * 10 ** -Math.max(0, ...pens.map((pen) => pen.decimals)), ...known.map((pen) => (pen.high - pen.low) / 50));
    const floor = low >= 0 && known.length === pens.length && known.every((pen) => pen.low >= 0) ? 0 : -Infinity; // what cannot be negative has no scale below 0
    if (high - low < least) [low, high] = [Math.max(floor, (low + high - least) / 2), Math.max(floor + least, (low + high + least) / 2)];
    if (this.axis !== "scale") { const air = (high - low) * 0.04; low = Math.max(floor, low - (low < 0 || this.axis === "fit" ? air : 0)); high += air; }
    const step = time.nice((high - low) / 6);
    return [Math.floor(low / step + 1e-9) * step, Math.ceil(high / step - 1e-9) * step];
  }

  // ---- room ---------------------------------------------------------------------------------------------------

  colour(name) { return getComputedStyle(this.element).getPropertyValue(name).trim(); }
  ink(pen) { return this.colour(`--pen-${((pen.number - 1) % 6) + 1}`); }
  get below() { return this.mini ? -44 : this.shift ? 18 : 0; }

  font(strong, size, scale = 1) { return `${strong ? 600 : 400} ${size * scale}px ${getComputedStyle(this.element).fontFamily}`; }

  measured(text, size, strong = false) {
    measuring.font = this.font(strong, size);
    return measuring.measureText(text).width;
  }

  /** `text` without its middle, as far as it is wider than `most`: names of a machine differ at their ends. */
  fitted(text, most, size, strong) {
    let out = text;
    for (let left = text.length - 1; left > 1 && this.measured(out, size, strong) > most; left--)
      out = `${text.slice(0, Math.ceil(left / 2)).trimEnd()}…${text.slice(-Math.floor(left / 2)).trimStart()}`;
    return out;
  }

  /** Room above and at the right of the plot [px]: names stand there, none on a curve; on a narrow screen only their markers do. */
  margins(width, scales) {
    if (this.mini) return [22, 26];
    const widths = this.shown().map((pen) => Math.max(this.measured(pen.label, 13, true), this.measured(pen.machine, 12)));
    return [scales.length > 1 ? 40 : 26, width < NARROW ? 24 : Math.min(Math.ceil(Math.max(40, ...widths)) + 52, Math.floor(width * 0.3))];
  }

  // ---- drawing ------------------------------------------------------------------------------------------------

  rebuild() { this.shape = ""; this.draw(); }

  /** Draw everything as it stands. */
  draw() {
    const width = Math.floor(this.element.clientWidth), height = Math.floor(this.element.clientHeight);
    if (width < 60 || height < 60 || !this.pens.length) return;
    const pens = this.shown(), scales = this.scales(), room = this.mini || width < NARROW ? 2 : width >= 860 ? 4 : 3, margins = this.margins(width, scales);
    const shape = JSON.stringify([pens.map((pen) => pen.tag), scales, room, this.below, margins]);
    this.ranges = Object.fromEntries(scales.map((scale) => [scale, this.range(scale)]));
    this.lines = [...(this.shift ? pens.map((pen) => ({ pen, thin: true })) : []), ...pens.map((pen) => ({ pen })), ...(pens.length ? [] : [{ pen: this.pens[0], none: true }])];
    const data = [null, ...this.lines.map(({ pen, thin, none }) => (none ? [[], []] : thin ? this.points(pen, pen.ghost ?? []) : pen.line = this.points(pen)))];
    if (shape !== this.shape) {
      this.plot?.destroy();
      this.shape = shape;
      this.plot = new uPlot(this.layout(width, height, scales, room, margins), data, this.element);
    } else if (this.plot.width !== width || this.plot.height !== height) this.plot.setSize({ width, height });
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: this.from / 1e6, max: this.to / 1e6 });
      for (const scale of scales) { const [min, max] = this.ranges[scale]; this.plot.setScale(scale, { min, max }); }
    });
    this.element.dispatchEvent(new CustomEvent("drawn"));
  }

  layout(width, height, scales, room, margins) {
    const font = this.font(false, 12), stroke = this.colour("--text-2"), grid = { stroke: this.colour("--grid") + "47", width: 1 }, none = { show: false };
    const least = this.mini ? 40 : Math.max(40, 14 + this.measured(this.texts.quality, 12)); // width of the first axis [px]
    return {
      width, height, mode: 2, pxAlign: false, legend: none, cursor: none, padding: [...margins, 0, 0],
      series: [{}, ...this.lines.map(({ pen, thin }) => ({
        label: pen.label, show: pen.on, points: none, facets: [{ scale: "x", auto: false }, { scale: this.scaleOf(pen), auto: false }],
        stroke: this.ink(pen), fill: this.ink(pen) + "38", ...(thin ? { width: 1, dash: THIN, alpha: 0.6 } : { width: 2, dash: DASHES[pen.number - 1] }),
        paths: (plot, i, first, last) => (last < first ? null : { ...linear(plot, i, first, last), fill: thin ? null : this.band(plot, pen) }),
      }))],
      scales: {
        x: { time: false, auto: false, range: (plot, min, max) => [min, max] },
        ...Object.fromEntries([...scales, this.scaleOf(this.pens[0])].map((scale) => [scale, { auto: false, range: (plot, min, max) => [min ?? 0, max ?? 1] }])),
      },
      axes: [
        {
          scale: "x", font, stroke, size: 66 + this.below, gap: this.mini ? 8 : 4, ticks: none, grid, space: 20,
          splits: (plot) => time.ticks(this.from, this.to, Math.max(2, Math.floor(plot.bbox.width / uPlot.pxRatio / (this.mini ? 120 : 84))), this.zone).map((at) => at / 1e6),
          values: (plot, splits) => time.labels(splits.map((at) => at * 1e6), this.zone, this.lang),
        },
        ...scales.slice(0, room).map((scale, index) => ({
          scale, font, stroke, side: 3, ticks: none, gap: 6, space: this.mini ? 30 : 44, grid: { show: index === 0, ...grid },
          ...(scale.startsWith("yenum:") ? { incrs: [1, 2, 5, 10, 20, 50] } : {}),
          size: (plot, values) => Math.max(index ? 40 : least, 14 + Math.max(0, ...(values ?? []).map((one) => one.length)) * 7),
          values: (plot, splits, axis, space, step) => splits.map((y) => format.number(y, time.decimals(step), this.lang)),
        })),
      ],
      hooks: { drawClear: [(plot) => this.ground(plot)], draw: [(plot) => this.above(plot)] },
    };
  }

  /** Between the smallest and the largest value of each column, as far as the next one; never across columns without samples. */
  band(plot, pen) {
    const path = new Path2D(), X = (at) => plot.valToPos(at / 1e6, "x", true), Y = (value) => plot.valToPos(value, this.scaleOf(pen), true), items = this.drawn(pen);
    items.forEach((a, i) => {
      const b = items[i + 1];
      if (pen.stepped || !b || a.last === null || b.first === null) return;
      const far = pen.step && b.at - a.at > 1.5 * pen.step, end = far ? { ...a, at: Math.min(a.at + pen.step, b.at) } : b;
      if (a.low === a.high && end.low === end.high) return;
      path.moveTo(X(a.at), Y(a.high));
      path.lineTo(X(end.at), Y(end.high));
      path.lineTo(X(end.at), Y(end.low));
      path.lineTo(X(a.at), Y(a.low));
      path.closePath();
    });
    return path;
  }

  /** What lies under the curves: ground, normal band and limits of the selected pen, its gaps. */
  ground(plot) {
    const { ctx, bbox: { left, top, width, height } } = plot, pen = this.pen(this.selected);
    ctx.save();
    ctx.fillStyle = this.colour("--inset");
    ctx.fillRect(left, top, width, height);
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    if (pen?.on && plot.scales[this.scaleOf(pen)]?.min != null) {
      const Y = (value) => plot.valToPos(value, this.scaleOf(pen), true);
      if (pen.normal) {
        ctx.fillStyle = this.colour("--norm") + "73";
        ctx.fillRect(left, Y(pen.normal[1]), width, Y(pen.normal[0]) - Y(pen.normal[1]));
      }
      for (const limit of this.mini ? [] : pen.limits ?? []) this.rule(plot, [left, Y(limit), left + width, Y(limit)], { dash: [2, 4] });
      for (const [a, b] of this.gaps(pen)) this.hatch(plot, a, b);
    }
    ctx.restore();
  }

  hatch(plot, a, b) {
    const { ctx, bbox: { top, height } } = plot, [x, end] = [a, b].map((at) => plot.valToPos(at / 1e6, "x", true));
    ctx.save();
    ctx.beginPath();
    ctx.rect(x, top, end - x, height);
    ctx.clip();
    for (let at = x - height; at < end; at += 7 * uPlot.pxRatio) this.rule(plot, [at, top + height, at + height, top], { colour: this.colour("--grid") + "80" });
    ctx.restore();
    for (const edge of [x, end]) this.rule(plot, [edge, top, edge, top + height], { colour: this.colour("--line") });
  }

  above(plot) {
    plot.ctx.save();
    this.changes(plot);
    if (!this.mini) for (const part of [this.gapLabels, this.markers, this.other, this.flags, this.strip, this.alarms, this.dots]) part.call(this, plot);
    this.units(plot);
    this.names(plot);
    plot.ctx.restore();
  }

  // ---- what is written and drawn on it ----------------------------------------------------------------------------

  text({ ctx }, text, x, y, { align = "left", colour = "--text-2", strong = false, size = strong ? 13 : 12, halo = false } = {}) {
    const ratio = uPlot.pxRatio;
    ctx.font = this.font(strong, size, ratio);
    ctx.textAlign = align;
    ctx.textBaseline = "middle";
    if (halo) {
      Object.assign(ctx, { strokeStyle: this.colour("--inset"), lineWidth: 4 * ratio, lineJoin: "round" });
      ctx.setLineDash([]);
      ctx.strokeText(text, x, y);
    }
    ctx.fillStyle = this.colour(colour);
    ctx.fillText(text, x, y);
    return ctx.measureText(text).width;
  }

  /** A line through `places` [x, y, x, y, …]. */
  rule({ ctx }, places, { colour = this.colour("--outline"), width = 1, dash = [] } = {}) {
    ctx.strokeStyle = colour;
    ctx.lineWidth = width * uPlot.pxRatio;
    ctx.setLineDash(dash.map((one) => one * uPlot.pxRatio));
    ctx.beginPath();
    for (let i = 0; i < places.length; i += 2) i ? ctx.lineTo(places[i], places[i + 1]) : ctx.moveTo(places[i], places[i + 1]);
    ctx.stroke();
  }

  /** A shape `d` with the middle `cx`, `cy` at x, y. */
  sign({ ctx }, d, x, y, { fill = this.colour("--inset"), stroke = this.colour("--outline"), width = 1.25, scale = 1, cx = 0, cy = 0 }) {
    const size = scale * uPlot.pxRatio, path = new Path2D(d);
    ctx.save();
    ctx.translate(x - cx * size, y - cy * size);
    ctx.scale(size, size);
    Object.assign(ctx, { fillStyle: fill, strokeStyle: stroke, lineWidth: width / scale });
    ctx.setLineDash([]);
    ctx.fill(path);
    ctx.stroke(path);
    ctx.restore();
  }

  marker(plot, pen, x, y, size = 3.5) {
    pen.mark ??= document.querySelector(`.pl-mk.p${pen.number}`).getAttribute("d");
    this.sign(plot, pen.mark, x, y, { stroke: this.ink(pen), width: 1.75, scale: size / 4.5, cx: 16, cy: 7 });
  }

  /** A vertical rule where the clock was put forward or back. */
  changes(plot) {
    const { bbox: { top, height } } = plot, ratio = uPlot.pxRatio;
    for (const { at, before, after } of time.changes(this.from, this.to, this.zone)) {
      const x = plot.valToPos(at / 1e6, "x", true);
      this.rule(plot, [x, top, x, top + height], { width: 1.5, dash: [6, 3] });
      if (!this.mini) this.text(plot, `${this.texts.clock_change} ${before} → ${after}`, x + 5 * ratio, top + 10 * ratio, { halo: true });
    }
  }

  gapLabels(plot) {
    const pen = this.pen(this.selected), { ctx, bbox } = plot, ratio = uPlot.pxRatio, y = bbox.top + bbox.height - 26 * ratio;
    const written = []; // where two have no room that of the longer gap is: the hatch says the other one, too
    for (const [a, b] of pen?.on ? this.gaps(pen).sort(([a, b], [c, d]) => d - c - b + a) : []) {
      const [x, end] = [a, b].map((at) => plot.valToPos(at / 1e6, "x", true));
      if (end - x < 14 * ratio) continue;
      const text = `${this.texts.no_data} ${format.duration((b - a) / 1e6, this.lang)}`, wide = (this.measured(text, 12) + 14) * ratio;
      const middle = Math.min(Math.max((x + end) / 2, bbox.left + wide / 2), bbox.left + bbox.width - wide / 2);
      if (written.some(([at, other]) => Math.abs(at - middle) < (other + wide) / 2 + 4 * ratio)) continue;
      written.push([middle, wide]);
      ctx.fillStyle = this.colour("--inset");
      ctx.fillRect(middle - wide / 2, y - 10 * ratio, wide, 20 * ratio);
      const [l, t, r, d] = [middle - wide / 2, y - 10 * ratio, middle + wide / 2, y + 10 * ratio];
      this.rule(plot, [l, t, r, t, r, d, l, d, l, t], { colour: this.colour("--line") });
      this.text(plot, text, middle, y, { align: "center" });
    }
  }

  /** Markers on the curves, those of different pens at different places. */
  markers(plot) {
    const { left, width } = plot.bbox, every = MARKER_EVERY * uPlot.pxRatio;
    for (const pen of this.shown())
      for (let x = left + every * (0.25 + pen.number / 10); x < left + width; x += every) {
        const value = this.at(pen, plot.posToVal(x, "x", true) * 1e6);
        if (value !== null) this.marker(plot, pen, x, plot.valToPos(value, this.scaleOf(pen), true));
      }
  }

  /** Each curve's name beside its right end, none on top of another; on a small chart its letter. */
  names(plot) {
    const { bbox } = plot, ratio = uPlot.pxRatio, edge = bbox.left + bbox.width, bottom = bbox.top + bbox.height, labels = [];
    const room = (plot.width - 8) * ratio - edge, narrow = !this.mini && room < 40 * ratio, double = !narrow && !this.mini && this.shown().length * 33 * ratio < bbox.height;
    const alone = new Set(this.shown().map((pen) => pen.machine)).size < 2; // then which machine it is tells nothing
    for (const pen of this.shown()) {
      const item = this.drawn(pen).findLast(({ at, last }) => at <= this.to && last !== null);
      if (!item || item.at < this.from) continue;
      const end = Math.min(Math.max(plot.valToPos(item.last, this.scaleOf(pen), true), bbox.top), bottom);
      labels.push({ pen, x: plot.valToPos(item.at / 1e6, "x", true), end, y: end, half: (double && pen.machine ? 16 : narrow || this.mini ? 7 : 9) * ratio });
    }
    labels.sort((a, b) => a.y - b.y);
    labels.forEach((one, i) => { one.y = Math.max(one.y, i ? labels[i - 1].y + labels[i - 1].half + one.half : bbox.top + one.half); });
    for (let i = labels.length - 1, last = bottom; i >= 0; i--) {
      labels[i].y = Math.min(labels[i].y, last - labels[i].half);
      last = labels[i].y - labels[i].half;
    }
    const strong = { colour: "--text", strong: true }, most = room / ratio - 40, lines = labels.map(({ pen: { machine, label, name } }) => !double || !machine
      ? ["", alone ? label : name] : alone && label.includes(": ") ? label.split(/: (.*)/s) : [machine, label]);
    const words = narrow || this.mini ? [] : apart(lines.map((one) => one[1]), (text) => this.fitted(text, most, 13, true));
    for (const [i, { pen, x, end, y }] of labels.entries()) {
      if (this.mini) { this.text(plot, pen.letter, edge + 6 * ratio, y, strong); continue; }
      const from = edge + 2 * ratio, to = from + (narrow ? 6 : 10) * ratio, left = to + 25 * ratio, colour = this.ink(pen);
      this.rule(plot, x < edge - 3 * ratio ? [from, end, to, y] : [Math.min(x, edge), end, from, end, to, y], { colour });
      if (narrow) { this.marker(plot, pen, to + 5 * ratio, y); continue; }
      this.rule(plot, [to, y, to + 20 * ratio, y], { colour, width: 2, dash: DASHES[pen.number - 1] });
      this.marker(plot, pen, to + 10 * ratio, y);
      if (lines[i][0]) this.text(plot, this.fitted(lines[i][0], most, 12), left, y - 8 * ratio);
      this.text(plot, words[i], left, y + (lines[i][0] ? 7 : 0) * ratio, strong);
    }
  }

  /** The axis of time of the other period below that of this one, and which period it is over the plot. */
  other(plot) {
    if (!this.shift) return;
    const { bbox } = plot, ratio = uPlot.pxRatio, y = bbox.top + bbox.height + 25 * ratio, end = bbox.left - 6 * ratio, ats = plot.axes[0]._splits;
    const words = time.labels(ats.map((at) => at * 1e6 - this.shift), this.zone, this.lang);
    ats.forEach((at, i) => this.text(plot, words[i], plot.valToPos(at, "x", true), y, { align: "center" }));
    this.rule(plot, [end - 26 * ratio, y, end, y], { colour: this.colour("--text-2"), dash: THIN });
    this.text(plot, this.texts.other.replace("{period}", this.otherPeriod()), bbox.left + bbox.width, bbox.top - 12 * ratio, { align: "right" });
  }

  otherPeriod() {
    const [from, to] = [this.from - this.shift, this.to - this.shift];
    return `${format.date(from, this.zone, this.lang)} ${time.period(from, to, this.zone, this.lang)}`;
  }

  /** Quality of the selected pen below the axis: full = good, hatched = uncertain, nothing = bad or not recorded. */
  strip(plot) {
    const pen = this.pen(this.selected), { ctx, bbox } = plot, ratio = uPlot.pxRatio, y = bbox.top + bbox.height + (27 + this.below) * ratio;
    this.text(plot, this.texts.quality, bbox.left - 6 * ratio, y + 2.5 * ratio, { align: "right" });
    const X = (at) => Math.min(Math.max(plot.valToPos(at / 1e6, "x", true), bbox.left), bbox.left + bbox.width), items = pen?.on ? this.drawn(pen) : [];
    ctx.fillStyle = this.colour("--line");
    items.forEach((item, i) => {
      const next = items[i + 1], a = X(item.at), b = next ? X(next.at) : a;
      if (item.last === null || b <= a) return;
      const level = item.level === 2 ? next.level : item.level;
      if (level === 1) for (let x = a; x < b; x += 4 * ratio) ctx.fillRect(x, y, Math.min(2 * ratio, b - x), 5 * ratio);
      else ctx.fillRect(a, y, b - a + 0.5, 5 * ratio);
    });
  }

  /** Alarms on the axis of time, in the shape and colour of their priority. */
  alarms(plot) {
    const { bbox } = plot, ratio = uPlot.pxRatio, y = bbox.top + bbox.height + (48 + this.below) * ratio;
    for (const { time: at, priority } of this.marks) {
      if (at < this.from || at > this.to) continue;
      const x = plot.valToPos(at / 1e6, "x", true), lower = { 2: 1.5, 3: -1 }[priority] ?? 0.5;
      this.sign(plot, ALARMS[priority], x, y, { fill: this.colour(`--alm-${priority}`) });
      this.text(plot, String(priority), x, y + lower * ratio, { align: "center", colour: `--alm-${priority}-on`, strong: true, size: 8 });
    }
  }

  /** Notes and rulers: a rule with a flag, which a note has within the plot, as the list beside numbers it, and a ruler over it. */
  flags(plot) {
    const { ctx, bbox: { left, top, width, height } } = plot, ratio = uPlot.pxRatio, rulers = Object.entries(this.rulers).map(([name, at]) => ({ at, number: name.toUpperCase(), over: true }));
    for (const { at, number, over } of [...this.notes, ...rulers]) {
      if (at === null || at < this.from || at > this.to) continue;
      const x = plot.valToPos(at / 1e6, "x", true), wide = over ? 28 * ratio : (10 + 7 * number.length) * ratio;
      const begin = over ? x - wide / 2 : x + wide > left + width ? x - wide : x, y = over ? top - 20 * ratio : top;
      this.rule(plot, [x, top, x, top + height], { width: over ? 1.5 : 1 });
      ctx.fillStyle = this.colour("--outline");
      ctx.fillRect(begin, y, wide, (over ? 20 : 18) * ratio);
      this.text(plot, number, begin + wide / 2, y + 9.5 * ratio, { align: "center", colour: "--inset", strong: true });
    }
  }

  /** Units over their axes, and which pens these are of when there are several: letters, or markers over the unit. */
  units(plot) {
    const ratio = uPlot.pxRatio, { top } = plot.bbox, several = this.scales().length > 1;
    for (const [i, axis] of plot.axes.slice(1).entries()) {
      const pens = this.on(axis.scale), text = pens[0]?.unit || (pens.length === 1 ? pens[0].label : ""), right = (axis._pos - 6) * ratio, y = top - 12 * ratio;
      const width = this.text(plot, this.fitted(text, Math.max(34, axis._pos - (plot.axes[i + 2]?._pos ?? 0) - 8), 12), right, y, { align: "right" });
      if (this.mini) this.text(plot, pens.map((pen) => pen.letter).join(" "), right - 4 * ratio - width, y, { align: "right", colour: "--text", strong: true });
      else if (several) pens.slice(0, 3).forEach((pen, i) => this.marker(plot, pen, right - (4 + 12 * i) * ratio, top - 28 * ratio));
    }
  }

  /** Where the rulers cut the curves. */
  dots(plot) {
    for (const at of Object.values(this.rulers)) for (const pen of at >= this.from && at <= this.to ? this.shown() : []) {
      const value = this.at(pen, at);
      if (value !== null) this.marker(plot, pen, plot.valToPos(at / 1e6, "x", true), plot.valToPos(value, this.scaleOf(pen), true), 4.5);
    }
  }
}
