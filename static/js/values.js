// What a value looks like: number, unit, quality, pointers and curves. static/js/live.js says when.
//   data-tag          name of the tag; alone on a text: number, unit and quality as app/web/points.py draws them
//   data-as           number | enum | time | hex | duration | text; data-decimals, data-texts (value → text), data-pattern, data-bad; data-silent: that nobody answers
//   data-map          "value:place …": with data-move (x | y), data-turn (centre), data-fill (x | y) on an SVG group
//   data-show         "1,2" | ">0" | "<0" | "bad" | "uncertain" (a stale one is): shown while it holds; data-class "name:condition;…"
//   data-signal       the value as the page was made; when it changes, the element dispatches `signal`
//   data-tags         "name name …" instead of data-tag: nothing is drawn; when some changed, the element dispatches `tags` once, with what
//                     is known of them by key: {head: {value, state, quality, source}, …}; by name where machines share a key;
//                     with hx-get or data-revision it hears `changed`, too, when one of them shows another value: the server makes something of them
//   data-signed       a number carries its plus sign
//   data-meter        role=meter: data-q and aria-value…; data-line "x0 x1": the curve of the last ten minutes
import * as format from "./format.js";

export const SPAN = 600; // what a curve shows [s]
const SETTLE = 2000; // a change too small to draw at once is drawn after this [ms]
/** What the server says of this page: kind, rev, build, lang, zone, texts. */
export const page = document.getElementById("live").dataset;
export const texts = JSON.parse(page.texts);
const { lang, zone } = page;
/** What the server's clock said last [µs UTC], and when that was [ms of this page]. */
export const server = { time: Number(document.querySelector("[data-clock]")?.dataset.now), at: performance.now() };
/** What it says now [µs UTC]. */
export const now = () => Math.round(server.time + (performance.now() - server.at) * 1000);

const fill = (pattern, values) => pattern.replace(/\{(\w+)\}/g, (_, key) => values[key]);
const tenth = (value) => Math.floor(value * 10 + 0.5) / 10;
const set = (element, name, value) => { if (element.getAttribute(name) !== value) element.setAttribute(name, value); };

// ---- what a value looks like ----------------------------------------------------------------------------------

const REASON = { NO_DATA: 1, STALE: 3, CONFIGURATION: 6 };
const level = (q) => q & 3, reason = (q) => (q >> 2) & 15;
export const state = (q, value) => {
  const s = level(q) === 0 ? "good" : level(q) === 1 ? (reason(q) === REASON.STALE ? "stale" : "uncertain")
    : reason(q) === REASON.NO_DATA ? "none" : "bad";
  return value === null && s !== "bad" ? "none" : s;
};
export const origin = (q) => (q & 0x200 ? "forced" : q & 0xc00 ? "manual" : q & 0x100 ? "sim" : "field");

function qualityWords(q) {
  const why = reason(q), from = origin(q), known = texts.reasons[why];
  let words = texts.quality[["good", "uncertain", "bad", "bad"][level(q)]];
  if (why === REASON.STALE || why === REASON.NO_DATA) words = known;
  else if (why) words = fill(texts.quality.because, { quality: words, reason: known });
  return from === "field" ? words : fill(texts.quality.from, { quality: words, origin: texts.origins[from] });
}

function write(value, as, item) {
  if (as === "enum") return item.texts[value] ?? texts.unknown.replace("{value}", value);
  if (typeof value === "string" || as === "text") return String(value);
  if (as === "time") return value >= -62135510400e6 && value < 253402128e9 ? format.momentOrTime(value, zone, lang, server.time) : texts.unknown.replace("{value}", value);
  if (as === "hex") return format.hexadecimal(value);
  if (as === "duration") return format.duration(value, lang);
  const number = format.number(value, item.decimals, lang);
  return item.signed && value > 0 && /[1-9]/.test(number) ? `+${number}` : number;
}

function place(map, value) {
  if (value <= map[0][0]) return tenth(map[0][1]);
  for (let i = 1; i < map.length; i++) {
    const [a, x] = map[i - 1], [b, y] = map[i];
    if (value <= b) return tenth(x + ((y - x) * (value - a)) / (b - a));
  }
  return tenth(map[map.length - 1][1]);
}

function holds(condition, tag) {
  const parts = condition.split(",").map((part) => part.trim());
  if (tag.state === "bad" || tag.state === "none" || typeof tag.value !== "number") return parts.includes("bad");
  return parts.some((part) => part !== "bad" && (part[0] === ">" ? tag.value > +part.slice(1)
    : part[0] === "<" ? tag.value < +part.slice(1) : part === "uncertain" ? tag.state !== "good" : tag.value === +part));
}

// ---- what is drawn --------------------------------------------------------------------------------------------

function drawText(item, tag) {
  const { element } = item, data = element.dataset, foreign = reason(tag.quality) === REASON.CONFIGURATION;
  const bad = foreign && data.silent !== undefined ? texts.misplaced : data.bad;
  const text = tag.state === "bad" ? bad ?? format.NO_VALUE : tag.state === "none" ? bad ?? format.NO_DATA_YET : write(tag.value, data.as, item);
  if (item.settles && tag.state === item.state && item.drawn !== undefined && text !== item.text
    && Math.abs(tag.value - item.drawn) < format.deadBand(item.decimals) && performance.now() - item.at < SETTLE) {
    item.late = true;
    return;
  }
  item.late = false;
  if (text !== item.text || tag.state !== item.state) [item.at, item.drawn] = [performance.now(), tag.value];
  item.text = text;
  item.state = tag.state;
  const box = element.classList.contains("val");
  const target = box ? element.querySelector("b") : element;
  const shown = data.pattern && tag.state !== "bad" && tag.state !== "none" ? data.pattern.replace("{}", text) : text;
  if (target.textContent !== shown) target.textContent = shown;
  set(element, "data-q", tag.state);
  set(element, "data-src", tag.source);
  if (!box) return;
  if (data.label) {
    const name = fill(texts.name, { label: data.label, value: text, unit: data.words ?? "", quality: qualityWords(tag.quality) });
    set(element, "aria-label", name.replace(" ,", ","));
  }
  badge(element, tag);
}

export function badge(element, tag) {
  const letters = tag.state === "bad" ? "BAD" : tag.state === "stale" ? format.age((performance.now() - tag.since) / 1000)
    : tag.source === "forced" ? "F" : tag.source === "manual" ? "M"
    : tag.source === "sim" && element.classList.contains("boxed") ? "S" : "";
  let sign = element.querySelector(".badge");
  if (!letters) return sign?.remove();
  if (!sign) {
    sign = document.createElement("span");
    element.append(sign);
  }
  const look = "badge" + (tag.state === "stale" ? " soft" : letters === "F" ? " solid" : letters === "M" ? " dot" : "");
  if (sign.className !== look) sign.className = look;
  if (sign.textContent !== letters) sign.textContent = letters;
}

function drawShown(item, tag) {
  const on = holds(item.element.dataset.show, tag);
  if (item.element instanceof SVGElement) on ? item.element.removeAttribute("display") : set(item.element, "display", "none");
  else item.element.hidden = !on;
}

function drawClass(item, tag) {
  for (const rule of item.element.dataset.class.split(";")) {
    const [name, condition] = rule.split(":");
    item.element.classList.toggle(name.trim(), holds(condition, tag));
  }
}

function drawMoved(item, tag) {
  if (typeof tag.value !== "number" || tag.state === "bad" || tag.state === "none") return;
  const { element, map } = item, at = place(map, tag.value), { turn, move } = element.dataset;
  if (at === item.at) return;
  item.at = at;
  if (turn !== undefined) {
    const [x, y] = turn.split(" ");
    element.style.transform = `translate(${x}px,${y}px) rotate(${at}deg) translate(${-x}px,${-y}px)`;
  } else if (move !== undefined) {
    element.style.transform = move === "y" ? `translate(0,${at}px)` : `translate(${at}px,0)`;
  } else element.style.transform = element.dataset.fill === "y" ? `scaleY(${at})` : `scaleX(${at})`;
}

function drawMeter(item, tag) {
  const { element } = item, { decimals, unit } = element.dataset;
  set(element, "data-q", tag.state);
  if (tag.state === "bad" || tag.state === "none") {
    set(element, "aria-valuenow", element.getAttribute("aria-valuemin")); // a meter has to have one; what is read out says that it is none
    set(element, "aria-valuetext", qualityWords(tag.quality));
  } else {
    set(element, "aria-valuenow", String(+tag.value.toPrecision(12)));
    set(element, "aria-valuetext", format.quantity(tag.value, +decimals, unit, lang));
  }
}

/** The last ten minutes, one sample a second; a gap where there was no good value. */
function drawLine(item, tag) {
  const { element, map } = item, [x0, x1] = item.ends, now = Math.floor(performance.now() / 1000);
  let path = "", down = false, last = null;
  for (const [second, value] of tag.kept) {
    if (value === null) down = false;
    else {
      last = [tenth(Math.max(x0, x1 - ((now - second) * (x1 - x0)) / SPAN)), place(map, value)];
      path += (down ? "L" : "M") + last.join(" ");
      down = true;
    }
  }
  set(element, "d", path);
  const dot = element.nextElementSibling;
  if (dot?.classList.contains("spark-end")) {
    down ? dot.removeAttribute("display") : set(dot, "display", "none");
    if (down) { set(dot, "cx", String(last[0])); set(dot, "cy", String(last[1])); }
  }
}

/** Nothing is drawn: whoever listens hears that the value is another one than the page was made with. */
function drawSignal(item, tag) {
  const { element } = item, now = String(tag.value);
  if (tag.state !== "good" || element.dataset.signal === now) return;
  element.dataset.signal = now;
  element.dispatchEvent(new CustomEvent("signal", { detail: tag.value }));
}

const told = new Set();

/** Several tags: whoever listens hears once that some of them changed, after all were taken over. */
function drawMany(item) {
  if (!told.size) queueMicrotask(() => {
    const items = [...told];
    told.clear();
    for (const item of items) {
      const { element, tags, made } = item, of = made && Object.values(tags).map(({ value, state }) => (state === "bad" ? "bad" : state === "good" ? value : `${value}?`)).join(" ");
      element.dispatchEvent(new CustomEvent("tags", { bubbles: true, detail: tags }));
      if (of !== item.of) element.dispatchEvent(new Event("changed"));
      item.of = of;
    }
  });
  told.add(item);
}

/** The ways of drawing that the attributes of `element` ask for: {draw, moves} or {draw, curve}. */
export function ways(element) {
  const data = element.dataset, found = [];
  if (data.tags !== undefined) return [{ element, draw: drawMany, moves: true, tags: {}, made: element.matches("[hx-get], [data-revision]") }];
  const map = data.map?.split(" ").map((knot) => knot.split(":").map(Number));
  const item = { element, map, decimals: +(data.decimals ?? 0), texts: data.texts ? JSON.parse(data.texts) : {}, settles: "settles" in data, signed: "signed" in data };
  if (data.signal !== undefined) found.push({ ...item, draw: drawSignal, moves: true });
  if (data.line !== undefined) found.push({ ...item, draw: drawLine, curve: true, ends: data.line.split(" ").map(Number) });
  else if (map) found.push({ ...item, draw: drawMoved, moves: true });
  if (data.meter !== undefined) found.push({ ...item, draw: drawMeter });
  if (data.show !== undefined) found.push({ ...item, draw: drawShown, moves: true });
  if (data.class !== undefined) found.push({ ...item, draw: drawClass, moves: true });
  return found.length ? found : [{ ...item, draw: drawText }];
}
