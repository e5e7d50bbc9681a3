// Curves over time, drawn by uPlot: each pen as the history gives it (first, low, high, last of every column), then what arrives live.
// A pen is lifted where nothing good is known; nothing is ever drawn across a gap. Times are µs UTC, on the axis of uPlot seconds.
import * as format from "./format.js";
import * as time from "./time_axis.js";

/** Dash of each pen [px]; colours are --pen-1 to --pen-6, 7 and 8 take the first two again with other dashes and markers. */
export const DASHES = [[], [8, 4], [2, 3], [8, 3, 2, 3], [12, 4], [4, 2], [14, 3, 2, 3, 2, 3], [3, 7]];
/** How far an extreme must stand out of the line to be drawn as line, not only as part of the band: pixels, and usual heights of the band. */
const STANDS_OUT = [6, 2];
const LASTS = 1e6, SCAN = 200e3; // a value unchanged for longer held; how long before its change it is known to have done so [µs]
/** A series of /history/series with all its columns: times are sent as distances, what is the same in all columns once or not at all. */
export function unpacked(series) {
  let at = 0;
  const time = (series.time ?? []).map((later) => (at += later)), each = (value) => (Array.isArray(value) ? value : time.map(() => value));
  if (!series.first) return { ...series, time };
  const { first, low = first, high = first, last = first } = series;
  return { ...series, time, first, low, high, last, quality: each(series.quality), count: each(series.count) };
}

export class Chart {
  /** Draw `pens` into `element`. options: zone, lang, mini, texts, letters (mini: names at the right end). */
  constructor(element, pens, options) {
    Object.assign(this, { element, options, pens, zone: options.zone, lang: options.lang, mini: !!options.mini });
    for (const pen of pens) Object.assign(pen, { series: null, fresh: [], items: [] });
    Object.assign(this, { from: 0, to: 1, now: 0, axis: "auto", selected: pens[0]?.tag, plot: null, shape: "" });
    element.chart = this;
    new ResizeObserver(() => this.draw()).observe(element);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.rebuild());
  }

  // ---- data ---------------------------------------------------------------------------------------------------

  pen(tag) { return this.pens.find((pen) => pen.tag === tag); }

  /** An answer of /history/series; what arrived live before its end is in it. */
  take(answer) {
    for (const packed of answer.series) {
      const pen = this.pen(packed.tag);
      if (!pen) continue;
      const series = (pen.series = unpacked(packed));
      const last = series.time?.at(-1) ?? 0;
      const held = pen.fresh.findLast(([at]) => at <= last);
      pen.fresh = pen.fresh.filter(([at]) => at > last);
      if (held && !pen.fresh.length && held[1] === null) pen.fresh.push([last + 1, null, held[2]]);
      this.weave(pen);
    }
  }

  /** A value that has just arrived, null when it is not usable; level 0 good, 1 uncertain, 2 bad. */
  append(tag, at, value, level) {
    const pen = this.pen(tag);
    if (!pen) return;
    const before = pen.fresh.at(-1) ?? null, last = pen.series?.time?.at(-1) ?? 0;
    if (at <= last || (before && at < before[0])) return;
    const series = pen.series, held = before ?? (last ? [last, series.last.at(-1), series.quality.at(-1)] : null);
    // What did not change was not sent: it held until now, and no line leads from there to here.
    if (!pen.stepped && held && held[1] !== null && value !== null && held[1] !== value && at - held[0] > LASTS) pen.fresh.push([at - SCAN, held[1], held[2]]);
    pen.fresh.push([at, value, level]);
    this.weave(pen);
  }

  /** Columns and fresh values as one list of {at, first, low, high, last, level, count}. */
  weave(pen) {
    const items = this.woven(pen.series);
    for (const [at, value, level] of pen.fresh) items.push({ at, first: value, low: value, high: value, last: value, level, count: 1 });
    pen.items = items;
  }

  woven(s) {
    const items = [];
    for (let i = 0; i < (s?.time?.length ?? 0); i++)
      items.push({ at: s.time[i], first: s.first[i], low: s.low[i], high: s.high[i], last: s.last[i], level: s.quality[i], count: s.count[i] });
    return items;
  }

  /** What holds now is drawn up to now, while values arrive. */
  drawn(pen) {
    const { items } = pen, last = items.at(-1);
    if (!this.holds || !last || last.last === null || this.now <= last.at || this.now - last.at > 630e6) return items;
    return [...items, { at: this.now, first: last.last, low: last.last, high: last.last, last: last.last, level: last.level, count: 0 }];
  }

  /** The points of a pen as uPlot gets them: seconds and values, null where the pen is lifted. */
  points(pen) {
    const xs = [], ys = [];
    let before = null;
    for (const item of this.drawn(pen)) {
      const x = item.at / 1e6;
      if (item.first === null && item.low === null) { xs.push(x); ys.push(null); before = null; continue; }
      if (item.first === null) { xs.push(x); ys.push(null); before = null; }
      if (pen.stepped && before !== null && item.first !== null && item.first !== before) { xs.push(x); ys.push(before); }
      for (const y of item.count > 1 ? [item.first, item.low, item.high, item.last] : [item.first]) {
        if (y === null) continue;
        xs.push(x);
        ys.push(y);
      }
      if (item.last === null) { xs.push(x); ys.push(null); }
      before = item.last;
    }
    return [xs, ys];
  }

  /** What the pen shows at a time: value and level, or null in a gap. */
  at(pen, at) {
    const items = this.drawn(pen);
    let low = 0, high = items.length;
    while (low < high) { const middle = (low + high) >> 1; if (items[middle].at <= at) low = middle + 1; else high = middle; }
    const before = items[low - 1], after = items[low];
    if (!before || before.last === null) return null;
    if (!after) return before.at === at ? before.last : null;
    if (pen.stepped || after.first === null) return before.last;
    return before.last + ((after.first - before.last) * (at - before.at)) / (after.at - before.at || 1);
  }

  /** Times without a good or uncertain value of a pen within the view, [from, to]. */
  gaps(pen) {
    const out = [], items = this.drawn(pen), end = Math.min(this.to, this.now || this.to);
    let open = this.from;
    for (const item of items) {
      if (item.first !== null || item.low !== null) {
        if (open !== null && item.at > open && item.at > this.from) out.push([Math.max(open, this.from), Math.min(item.at, this.to)]);
        open = null;
      }
      if (item.last === null && open === null) open = item.at;
    }
    const last = items.at(-1);
    if (open === null && last && end - last.at > 630e6) open = last.at;
    if (open !== null && end > open) out.push([Math.max(open, this.from), end]);
    return out.filter(([a, b]) => b > a && a < this.to && b > this.from);
  }

  // ---- scales -------------------------------------------------------------------------------------------------

  shown() { return this.pens.filter((pen) => pen.on); }
  scaleOf(pen) { return "y" + pen.scale; }

  /** Scales in use, that of the selected pen first. */
  scales() {
    const pens = this.shown(), chosen = pens.find((pen) => pen.tag === this.selected);
    return [...new Set([...(chosen ? [chosen] : []), ...pens].map((pen) => this.scaleOf(pen)))];
  }

  range(scale) {
    const pens = this.shown().filter((pen) => this.scaleOf(pen) === scale);
    let low = Infinity, high = -Infinity;
    const note = (...values) => { for (const y of values) if (y !== null && y !== undefined) { low = Math.min(low, y); high = Math.max(high, y); } };
    let decimals = 0, least = 0;
    for (const pen of pens) {
      for (const items of [this.drawn(pen), pen.ghost ?? []]) {
        let before = null;
        for (const item of items) {
          if (item.at >= this.from && item.at <= this.to) note(item.low, item.high, before);
          before = item.at < this.from ? item.last : null;
        }
      }
      decimals = Math.max(decimals, pen.decimals);
      if (pen.low !== null && pen.high !== null) least = Math.max(least, (pen.high - pen.low) / 50);
    }
    if (pens.some((pen) => Object.keys(pen.texts ?? {}).length)) return Number.isFinite(low) ? [Math.min(0, low) - 0.3, Math.max(1, high) + 0.3] : [-0.3, 1.3];
    const known = pens.filter((pen) => pen.low !== null && pen.high !== null);
    if (this.axis === "scale" || !Number.isFinite(low)) for (const pen of known) note(pen.low, pen.high);
    if (!Number.isFinite(low)) return [0, 1];
    if (this.axis === "auto") {
      note(0);
      for (const pen of known) if (!this.mini || pen === this.pens[0]) note(pen.normal ? Math.min(pen.high, pen.normal[1]) : null);
    }
    least = Math.max(least, 2 * 10 ** -decimals);
    if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    if (this.axis !== "scale") { const air = (high - low) * 0.04; low -= low < 0 || this.axis === "fit" ? air : 0; high += air; }
    const step = time.nice((high - low) / 6);
    return [Math.floor(low / step + 1e-9) * step, Math.ceil(high / step - 1e-9) * step];
  }

  // ---- drawing ------------------------------------------------------------------------------------------------

  colour(name) { return getComputedStyle(this.element).getPropertyValue(name).trim(); }

  /** Room above and at the right of the plot [px]. */
  margins() { return [22, 26]; }

  /** Least width of the first axis, and how much more the axis of time needs [px]. */
  get least() { return 40; }
  get below() { return 0; }

  rebuild() { this.shape = ""; this.draw(); }

  /** Draw everything as it stands. */
  draw() {
    const width = Math.floor(this.element.clientWidth), height = Math.floor(this.element.clientHeight);
    if (width < 60 || height < 60 || !this.pens.length) return;
    const pens = this.shown(), scales = this.scales();
    const room = this.mini ? 2 : width >= 860 ? 4 : width >= 560 ? 3 : 2;
    const shape = JSON.stringify([pens.map((pen) => pen.tag), scales, room, this.below, this.margins(width, scales)]);
    if (shape !== this.shape) {
      this.plot?.destroy();
      this.shape = shape;
      this.plot = new uPlot(this.layout(width, height, pens, scales, room), [null, ...(pens.length ? pens : this.pens.slice(0, 1)).map(() => [[], []])], this.element);
    } else if (this.plot.width !== width || this.plot.height !== height) this.plot.setSize({ width, height });
    const data = [null, ...pens.map((pen) => this.points(pen))];
    if (!pens.length) data.push([[], []]);
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: this.from / 1e6, max: this.to / 1e6 });
      for (const scale of scales) { const [min, max] = this.range(scale); this.plot.setScale(scale, { min, max }); }
    });
    this.element.dispatchEvent(new CustomEvent("drawn"));
  }

  layout(width, height, pens, scales, room) {
    const style = getComputedStyle(this.element), font = `12px ${style.fontFamily}`;
    const text = this.colour("--text-2"), grid = this.colour("--grid") + "47";
    const none = { show: false };
    const hidden = pens.length ? pens : this.pens.slice(0, 1);
    return {
      width, height, mode: 2, pxAlign: false, legend: none, cursor: none,
      padding: [...this.margins(width, scales), 0, 0],
      series: [{}, ...hidden.map((pen) => {
        const ink = this.colour(`--pen-${((pen.number - 1) % 6) + 1}`);
        return {
          label: pen.label, show: pen.on, points: none,
          facets: [{ scale: "x", auto: false }, { scale: this.scaleOf(pen), auto: false }],
          stroke: ink, fill: ink + "38", width: 2, dash: DASHES[pen.number - 1], paths: (plot) => this.paths(plot, pen),
        };
      })],
      scales: {
        x: { time: false, auto: false, range: (plot, min, max) => [min, max] },
        ...Object.fromEntries((scales.length ? scales : [this.scaleOf(this.pens[0])]).map((scale) => [scale, { auto: false, range: (plot, min, max) => [min ?? 0, max ?? 1] }])),
      },
      axes: [
        {
          scale: "x", font, stroke: text, size: this.mini ? 22 : 66 + this.below, gap: this.mini ? 2 : 4, ticks: none, grid: { stroke: grid, width: 1 }, space: 20,
          splits: (plot) => time.ticks(this.from, this.to, Math.max(2, Math.floor(plot.bbox.width / uPlot.pxRatio / (this.mini ? 120 : 84))), this.zone).map((at) => at / 1e6),
          values: (plot, splits) => time.labels(splits.map((at) => at * 1e6), this.zone, this.lang),
        },
        ...scales.slice(0, room).map((scale, index) => ({
          scale, font, stroke: text, side: 3, ticks: none, gap: 6, space: this.mini ? 30 : 44,
          grid: { show: index === 0, stroke: grid, width: 1 },
          ...(scale.startsWith("yenum:") ? { incrs: [1, 2, 5, 10, 20, 50] } : {}),
          size: (plot, values) => Math.max(index ? 40 : this.least, 14 + Math.max(0, ...(values ?? []).map((one) => one.length)) * 7),
          values: (plot, splits, axis, space, step) => splits.map((y) => format.number(y, time.decimals(step), this.lang)),
        })),
      ],
      hooks: { drawClear: [(plot) => this.ground(plot)], draw: [(plot) => this.above(plot)] },
    };
  }

  /** Line and band of a pen as paths, in pixels of the canvas. */
  paths(plot, pen, items = this.drawn(pen), Path = Path2D) {
    const scale = this.scaleOf(pen), ratio = uPlot.pxRatio, stroke = new Path(), fill = new Path(), places = [];
    const X = (at) => plot.valToPos(at / 1e6, "x", true), Y = (value) => plot.valToPos(value, scale, true);
    const heights = items.filter((item) => item.count > 1 && item.at >= this.from).map((item) => Y(item.low) - Y(item.high)).sort((a, b) => a - b);
    const out = Math.max(STANDS_OUT[0] * ratio, STANDS_OUT[1] * (heights[heights.length >> 1] ?? 0));
    let down = false, y0 = 0, run = [], edge = null;
    const width = pen.series?.step ?? 0;
    // A band reaches to the end of its own column, never across columns without samples.
    const reach = (at) => {
      if (edge && run.length && width && at - edge.at > 1.5 * width) {
        run.push([X(Math.min(edge.at + width, at)), edge.top, edge.bottom]);
        band();
      }
    };
    const band = () => {
      if (run.some(([, a, b]) => a !== b)) {
        run.forEach(([x, high], i) => (i ? fill.lineTo(x, high) : fill.moveTo(x, high)));
        for (const [x, , low] of run.reverse()) fill.lineTo(x, low);
        fill.closePath();
      }
      run = [];
    };
    for (const item of items) {
      if (item.first === null && item.low === null) { down = false; band(); continue; }
      const top = Y(item.high), bottom = Y(item.low), x = X(item.at);
      reach(item.at);
      edge = { at: item.at, top, bottom };
      // A column of many samples that is no higher than usual is a line in the middle of its band.
      const quiet = !pen.stepped && item.count > 3 && item.first !== null && item.last !== null && bottom - top <= out;
      const y = quiet ? (top + bottom) / 2 : Y(item.first ?? item.low), z = quiet ? y : Y(item.last ?? item.high);
      if (item.first === null) down = false;
      if (!down) { band(); stroke.moveTo(x, y); if (item.count === 1 && item.last !== null) stroke.lineTo(x + 0.01, y); }
      else if (pen.stepped) { stroke.lineTo(x, y0); stroke.lineTo(x, y); }
      else stroke.lineTo(x, y);
      if (item.count > 1) {
        if (pen.stepped || Math.min(y, z) - top > out) stroke.lineTo(x, top);
        if (pen.stepped || bottom - Math.max(y, z) > out) stroke.lineTo(x, bottom);
        stroke.lineTo(x, z);
        if (!pen.stepped) run.push([x, top, bottom]);
      } else if (!pen.stepped) run.push([x, y, y]);
      places.push([x, z]);
      y0 = z;
      down = item.last !== null;
      if (!down) band();
    }
    band();
    if (items !== pen.ghost) pen.places = places;
    return { stroke, fill, clip: null, band: null, gaps: null, flags: 0 };
  }

  /** What lies under the curves: ground, normal band and limits of the selected pen, its gaps. */
  ground(plot) {
    const { ctx, bbox } = plot, ratio = uPlot.pxRatio, pen = this.pen(this.selected);
    ctx.save();
    ctx.fillStyle = this.colour("--inset");
    ctx.fillRect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    if (pen?.on && plot.scales[this.scaleOf(pen)]?.min != null) {
      const Y = (value) => plot.valToPos(value, this.scaleOf(pen), true);
      if (pen.normal) {
        ctx.globalAlpha = 0.45;
        ctx.fillStyle = this.colour("--norm");
        ctx.fillRect(bbox.left, Y(pen.normal[1]), bbox.width, Y(pen.normal[0]) - Y(pen.normal[1]));
        ctx.globalAlpha = 1;
      }
      ctx.strokeStyle = this.colour("--outline");
      ctx.lineWidth = ratio;
      ctx.setLineDash([2 * ratio, 4 * ratio]);
      for (const limit of this.mini ? [] : pen.limits ?? []) {
        ctx.beginPath();
        ctx.moveTo(bbox.left, Y(limit));
        ctx.lineTo(bbox.left + bbox.width, Y(limit));
        ctx.stroke();
      }
      ctx.setLineDash([]);
      for (const [a, b] of this.gaps(pen)) this.hatch(plot, a, b);
    }
    ctx.restore();
  }

  hatch(plot, a, b) {
    const { ctx, bbox } = plot, ratio = uPlot.pxRatio;
    const x = plot.valToPos(a / 1e6, "x", true), end = plot.valToPos(b / 1e6, "x", true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(x, bbox.top, end - x, bbox.height);
    ctx.clip();
    ctx.strokeStyle = this.colour("--grid") + "80";
    ctx.lineWidth = ratio;
    for (let at = x - bbox.height; at < end; at += 7 * ratio) {
      ctx.beginPath();
      ctx.moveTo(at, bbox.top + bbox.height);
      ctx.lineTo(at + bbox.height, bbox.top);
      ctx.stroke();
    }
    ctx.restore();
    ctx.strokeStyle = this.colour("--line");
    ctx.lineWidth = ratio;
    for (const edge of [x, end]) { ctx.beginPath(); ctx.moveTo(edge, bbox.top); ctx.lineTo(edge, bbox.top + bbox.height); ctx.stroke(); }
  }

  above(plot) {
    const { ctx } = plot;
    ctx.save();
    ctx.setLineDash([]);
    this.changes(plot);
    this.inscribe(plot);
    ctx.restore();
  }

  text(plot, text, x, y, { align = "left", colour = "--text-2", strong = false, halo = false } = {}) {
    const { ctx } = plot, ratio = uPlot.pxRatio, family = getComputedStyle(this.element).fontFamily;
    ctx.font = `${strong ? 600 : 400} ${(strong ? 13 : 12) * ratio}px ${family}`;
    ctx.textAlign = align;
    ctx.textBaseline = "middle";
    if (halo) {
      ctx.strokeStyle = this.colour("--inset");
      ctx.lineWidth = 4 * ratio;
      ctx.lineJoin = "round";
      ctx.strokeText(text, x, y);
    }
    ctx.fillStyle = this.colour(colour);
    ctx.fillText(text, x, y);
    return ctx.measureText(text).width;
  }

  /** A vertical rule where the clock was put forward or back. */
  changes(plot) {
    const { ctx, bbox } = plot, ratio = uPlot.pxRatio;
    for (const { at, before, after } of time.changes(this.from, this.to, this.zone)) {
      const x = plot.valToPos(at / 1e6, "x", true);
      ctx.strokeStyle = this.colour("--outline");
      ctx.lineWidth = 1.5 * ratio;
      ctx.setLineDash([6 * ratio, 3 * ratio]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.setLineDash([]);
      if (!this.mini) this.text(plot, `${this.options.texts.clock_change} ${before} → ${after}`, x + 5 * ratio, bbox.top + 10 * ratio, { halo: true });
    }
  }

  /** The words on a small chart: what each axis is of, and a letter at the right end of each curve. */
  inscribe(plot) {
    const ratio = uPlot.pxRatio;
    for (const axis of plot.axes.slice(1)) {
      const pens = this.shown().filter((pen) => this.scaleOf(pen) === axis.scale), of = pens.map((pen) => pen.letter).join(" ");
      const width = this.text(plot, pens[0].unit, (axis._pos - 6) * ratio, plot.bbox.top - 11 * ratio, { align: "right" });
      this.text(plot, of, (axis._pos - 10) * ratio - width, plot.bbox.top - 11 * ratio, { align: "right", colour: "--text", strong: true });
    }
    this.letters(plot);
  }

  letters(plot) {
    const { bbox } = plot, ratio = uPlot.pxRatio, labels = [];
    for (const pen of this.shown()) {
      const place = (pen.places ?? []).at(-1);
      if (place) labels.push({ text: pen.letter, y: place[1] });
    }
    labels.sort((a, b) => a.y - b.y);
    for (let i = 1; i < labels.length; i++) labels[i].y = Math.max(labels[i].y, labels[i - 1].y + 14 * ratio);
    const bottom = bbox.top + bbox.height;
    for (let i = labels.length - 1, edge = bottom; i >= 0; i--, edge -= 14 * ratio) labels[i].y = Math.min(labels[i].y, edge);
    for (const { text, y } of labels) this.text(plot, text, bbox.left + bbox.width + 6 * ratio, y, { colour: "--text", strong: true });
  }


}
