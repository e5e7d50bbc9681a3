// The page of trends: range, rulers, pens. Its address always is the view, so that it can be sent to somebody.
import { answered, parsed } from "./fetched.js";
import { Chart } from "./chart.js";
import * as format from "./format.js";
import * as picture from "./trend_picture.js"; // with the page: pictures are taken without the server, too
import { now, page } from "./values.js";
import * as time from "./time_axis.js";

const holder = document.querySelector("[data-trend]"), begun = JSON.parse(holder.dataset.trend), { texts } = begun;
const canvas = holder.querySelector("[data-canvas]"), say = holder.querySelector("[data-say]");
const one = (selector) => document.querySelector(selector), all = (selector) => [...document.querySelectorAll(selector)];
const { lang, zone } = page, LIMIT = 60000; // of an answer [ms]
const LEAST = 1e6, MOST = 3660 * 86400e6, SETTLED = 150;
const UNITS = { s: 1e6, m: 60e6, h: 3600e6, d: 86400e6 };
for (const pen of begun.pens) pen.name = pen.machine ? `${pen.machine} · ${pen.label}` : pen.label;

const tags = begun.pens.map((pen) => pen.tag).join(",");
const state = {
  live: begun.span !== null, span: begun.span === null ? begun.to - begun.from : begun.span * 1e6,
  from: begun.from, to: begun.to, selected: begun.selected, a: begun.a, b: begun.b, axis: begun.axis, paused: 0, under: begun.under === null ? 0 : begun.under * 1e6,
};
let connected = false, missed = false;
const chart = canvas && new Chart(canvas, begun.pens, { zone, lang, texts });

// ---- the address ----------------------------------------------------------------------------------------------

function span() { return state.span % 1e6 ? `${Math.max(1, Math.round(state.span / 1e6))}s` : written(state.span); }

/** A length of time [µs] as an address says it. */
function written(length) {
  const [unit, size] = Object.entries(UNITS).reverse().find(([, each]) => length % each === 0) ?? ["s", 1e6];
  return length === 86400e6 ? "24h" : `${Math.round(length / size * 1000) / 1000}${unit}`;
}
const iso = (at) => new Date(at / 1000).toISOString().replace(".000Z", "Z");

/** The view as an address says it. */
function said() {
  const off = begun.pens.filter((pen) => !pen.on).map((pen) => pen.tag).join(",");
  return Object.entries({
    tags, span: state.live && span(), from: !state.live && iso(state.from), to: !state.live && iso(state.to), off,
    pen: state.selected !== begun.pens[0].tag && state.selected, axis: state.axis !== "auto" && state.axis,
    a: state.a !== null && iso(state.a), b: state.b !== null && iso(state.b), under: state.under && written(state.under),
  }).filter(([, value]) => value).map(([name, value]) => `${name}=${encodeURIComponent(value).replaceAll("%2C", ",").replaceAll("%3A", ":")}`).join("&");
}

/** The view stands in the address and in the field that every part of the page is asked with; the field tells the server when it has rested. */
let told = "", writing = 0;
function remember() {
  const here = said();
  if (here === told) return;
  one("#view").value = told = here;
  one("#view").dispatchEvent(new Event("view"));
  clearTimeout(writing);
  writing = setTimeout(() => history.replaceState(null, "", `/trends?${here}`), 100);
}

// ---- fetching -------------------------------------------------------------------------------------------------

let asking = null, asked = 0, settle = 0;
async function load() {
  asking?.abort();
  const mine = (asking = new AbortController());
  asked = performance.now();
  const [from, to] = view(), width = Math.min(4000, Math.max(100, Math.round(chart.plot?.over.clientWidth || canvas.clientWidth - 80)));
  const ask = (back) => answered(`/history/series?tags=${tags}&from=${Math.floor(from - back)}&to=${Math.ceil(to - back)}&width=${width}`,
    { limit: LIMIT, signal: mine.signal });
  const got = await Promise.all([ask(0), ...(state.under ? [ask(state.under)] : [])]);
  if (mine.signal.aborted) return;
  if (!got.every((one) => one?.ok)) {
    const refused = got.find((one) => one && !one.ok), words = refused && parsed(refused.text).querySelector("[data-message]")?.textContent.trim();
    return tell("error", words || texts.unavailable);
  }
  const [answer, other = null] = got.map(({ text }) => JSON.parse(text));
  chart.take(answer);
  chart.under(other, state.under);
  const known = answer.series.some((series) => series.first?.some((value) => value !== null));
  const silent = answer.now - answer.alive > 15e6 && state.live;
  tell(silent ? "note" : known || chart.pens.some((pen) => pen.fresh.some(({ at }) => at >= from && at <= now() && at <= to + 1e6)) ? "ready" : "empty",
    silent ? texts.not_recorded.replace("{time}", format.momentOrTime(answer.alive, zone, lang, answer.now)) : texts.empty_range);
  const columns = Math.max(0, ...answer.series.map((series) => series.time.length));
  one("[data-points]").textContent = columns ? texts.points.replace("{n}", format.number(columns, 0, lang)) : "";
  holder.dataset.loaded = String(Number(holder.dataset.loaded ?? 0) + 1);
  draw();
  holder.dispatchEvent(new Event("seen")); // numbers, alarms and notes are asked for by their own attributes
}

/** Flags are those of the list of notes, marks those of the list of alarms, however they came. */
function annotations() {
  document.addEventListener("htmx:after:swap", () => {
    chart.notes = all("[data-note]").map(({ dataset }) => ({ at: Number(dataset.at), number: dataset.note }));
    chart.marks = all("[data-alarm-marks] [data-mark]").map(({ dataset }) => ({ time: Number(dataset.at), priority: Number(dataset.mark) }));
    draw();
  });
  one("[data-notes-place]")?.addEventListener("click", ({ target }) => {
    const at = Number(target.closest("[data-note-at]")?.dataset.noteAt);
    if (at) moveRuler("a", at);
  });
}

/** What was chosen in a menu, as the server understood it: a range, another period, rulers [µs]. */
function menus() {
  document.addEventListener("trend", ({ target, detail: { from, to, ...rest } }) => {
    target.closest("details").open = false;
    Object.assign(state, rest);
    if (from) look(from, to); else changed();
  });
}

function tell(how, words) {
  holder.dataset.state = how;
  if (how !== "ready") say.textContent = words;
}

function changed() {
  clearTimeout(settle);
  settle = setTimeout(load, SETTLED);
  draw();
}

// ---- the view -------------------------------------------------------------------------------------------------

const view = () => (state.live ? [now() - state.span, now()] : [state.from, state.to]);

function draw() {
  const [from, to] = view();
  Object.assign(chart, { from, to, now: now(), holds: connected, axis: state.axis, selected: state.selected, rulers: { a: state.a, b: state.b } });
  chart.draw();
  one("[data-period]").textContent = time.period(from, to, zone, lang);
  one("[data-day]").textContent = format.day(to, zone, lang);
  one("[data-live-edge]").setAttribute("aria-pressed", String(state.live));
  for (const button of all("[data-span]")) button.setAttribute("aria-pressed", String(state.live && button.dataset.span === span()));
  for (const button of all("[data-select]")) button.setAttribute("aria-pressed", String(button.closest("[data-pen]").dataset.pen === state.selected));
  canvas.setAttribute("aria-label", `${texts.chart}: ${chart.shown().map((pen) => pen.name).join(", ")}, ${one("[data-period]").textContent}`);
  placeRulers();
  remember();
}

/** Look at another range; `live` follows the present. */
function look(from, to, live = false) {
  const length = Math.min(Math.max(to - from, LEAST), MOST), middle = (from + to) / 2, present = now();
  if (to - from !== length) [from, to] = [middle - length / 2, middle + length / 2];
  if (!live && from > present - length * 0.05) [from, to] = [present - length, present];
  if (live) Object.assign(state, { live: true, span: Math.round(length / 1e6) * 1e6 || LEAST, paused: 0 });
  else Object.assign(state, { live: false, span: length, from: Math.round(from / 1000) * 1000, to: Math.round(to / 1000) * 1000, paused: state.live ? performance.now() : state.paused || performance.now() });
  changed();
}

function pan(part) {
  const [from, to] = view(), by = (to - from) * part;
  if (part > 0 && to + by >= now()) look(now() - (to - from), now(), true);
  else look(from + by, to + by);
}

/** Zoom by a factor around a time; the live edge stays when nothing else is asked for. */
function zoom(factor, around = null) {
  const [from, to] = view();
  if (around === null && state.live) return look(to - (to - from) * factor, to, true);
  const at = around ?? (from + to) / 2;
  look(at - (at - from) * factor, at + (to - at) * factor);
}

const goLive = () => look(now() - state.span, now(), true);

// ---- rulers and numbers ---------------------------------------------------------------------------------------

function handle(button) {
  const name = button.dataset.ruler;
  button.addEventListener("pointerdown", (event) => {
    event.stopPropagation();
    button.setPointerCapture(event.pointerId);
    button.dataset.held = "";
  });
  button.addEventListener("pointermove", (event) => { if ("held" in button.dataset) moveRuler(name, timeAt(event)); });
  for (const end of ["pointerup", "pointercancel"]) button.addEventListener(end, () => { delete button.dataset.held; });
  button.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, PageDown: -10, PageUp: 10 }[event.key];
    if (event.key === "Delete" || event.key === "Backspace") moveRuler(name, null);
    else if (step) moveRuler(name, state[name] + ((chart.to - chart.from) / (chart.plot?.over.clientWidth || 800)) * step * (event.shiftKey ? 10 : 1));
    else return;
    event.preventDefault();
    event.stopPropagation();
  });
}

function moveRuler(name, at) {
  if (state.live && at !== null) { const [from, to] = view(); look(from, to); }
  state[name] = at === null ? null : Math.round(Math.min(Math.max(at, chart.from), chart.to) / 1000) * 1000;
  changed();
}

/** The nearest sample of the selected pen within 6 px, else the time itself. */
function snapped(at) {
  const pen = chart.pen(state.selected), reach = ((chart.to - chart.from) / (chart.plot?.over.clientWidth || 800)) * 6;
  let best = at, distance = reach;
  for (const item of pen?.items ?? []) if (Math.abs(item.at - at) < distance) [best, distance] = [item.at, Math.abs(item.at - at)];
  return best;
}

function placeRulers() {
  const on = state.a !== null || state.b !== null;
  one("[data-rulers]").setAttribute("aria-pressed", String(on));
  for (const button of all("[data-ruler]")) {
    const at = state[button.dataset.ruler], { plot } = chart;
    button.hidden = at === null || !plot || at < chart.from || at > chart.to;
    if (button.hidden) continue;
    button.style.transform = `translateX(${plot.over.offsetLeft + plot.valToPos(at / 1e6, "x")}px)`;
    button.style.setProperty("--top", `${plot.over.offsetTop}px`);
    for (const [attribute, value] of [["valuemin", chart.from], ["valuemax", chart.to], ["valuenow", at]]) button.setAttribute(`aria-${attribute}`, String(Math.round(value / 1000)));
    button.setAttribute("aria-valuetext", format.dateTime(at, zone, lang, now()));
  }
  const shown = (at) => (at === null ? "" : ` ${format.clockTime(at, zone)}`);
  one("[data-col=a]").textContent = `A${shown(state.a)}`; // at once, while one is dragged; the numbers follow
  one("[data-col=b]").textContent = `B${shown(state.b)}`;
}

// ---- pointer and keys -----------------------------------------------------------------------------------------

const timeAt = (event) => {
  const { over } = chart.plot, box = over.getBoundingClientRect();
  return chart.from + ((chart.to - chart.from) * Math.min(Math.max(event.clientX - box.left, 0), box.width)) / box.width;
};

function pointers() {
  const down = new Map();
  let drag = null, box = null, pinch = null;
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button || !chart.plot) return;
    down.set(event.pointerId, event.clientX);
    canvas.setPointerCapture(event.pointerId);
    const bottom = chart.plot.over.getBoundingClientRect().bottom;
    if (down.size === 2) {
      pinch = { apart: Math.abs([...down.values()][0] - [...down.values()][1]) || 1, view: view(), at: timeAt(event) };
      drag = null;
    } else drag = { x: event.clientX, view: view(), at: timeAt(event), zooms: event.clientY > bottom || event.shiftKey, moved: false };
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!down.has(event.pointerId)) return;
    down.set(event.pointerId, event.clientX);
    const width = chart.plot.over.clientWidth || 1;
    if (pinch && down.size === 2) {
      const [x, y] = [...down.values()], factor = pinch.apart / (Math.abs(x - y) || 1);
      look(pinch.at - (pinch.at - pinch.view[0]) * factor, pinch.at + (pinch.view[1] - pinch.at) * factor);
    } else if (drag && (drag.moved || Math.abs(event.clientX - drag.x) > 4)) {
      drag.moved = true;
      if (drag.zooms) {
        box ??= canvas.appendChild(Object.assign(document.createElement("div"), { className: "t-box" }));
        const { over } = chart.plot, left = over.getBoundingClientRect().left, edge = canvas.getBoundingClientRect().left;
        const [a, b] = [drag.x, event.clientX].map((x) => Math.min(Math.max(x, left), left + width)).sort((m, n) => m - n);
        Object.assign(box.style, { left: `${a - edge}px`, width: `${b - a}px`, top: `${over.offsetTop}px`, height: `${over.clientHeight}px` });
      } else {
        const by = ((drag.x - event.clientX) / width) * (drag.view[1] - drag.view[0]);
        look(drag.view[0] + by, drag.view[1] + by);
      }
    }
  });
  const end = (event) => {
    down.delete(event.pointerId);
    if (pinch && down.size < 2) pinch = null;
    else if (drag && event.type === "pointerup") {
      if (drag.zooms && drag.moved) look(...[drag.at, timeAt(event)].sort((m, n) => m - n));
      else if (!drag.moved) { const at = snapped(timeAt(event)); moveRuler(rulerOf(at), at); }
    }
    drag = null;
    box?.remove();
    box = null;
  };
  for (const type of ["pointerup", "pointercancel"]) canvas.addEventListener(type, end);
  canvas.addEventListener("dblclick", () => { Object.assign(state, { a: null, b: null }); look(now() - 600e6, now(), true); });
  canvas.addEventListener("wheel", (event) => {
    if (!chart.plot) return;
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.25 : 0.8, timeAt(event));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (event.target !== canvas || event.ctrlKey || event.altKey || event.metaKey) return;
    const { key } = event, middle = (chart.from + chart.to) / 2;
    if (key === "ArrowLeft") pan(event.shiftKey ? -1 : -0.1);
    else if (key === "ArrowRight") pan(event.shiftKey ? 1 : 0.1);
    else if (key === "+" || key === "=" || key === "ArrowUp") zoom(0.5);
    else if (key === "-" || key === "ArrowDown") zoom(2);
    else if (key === "End") goLive();
    else if (key === "a" || key === "b") moveRuler(key, snapped(middle));
    else if (key === "Escape") { Object.assign(state, { a: null, b: null }); changed(); }
    else return;
    event.preventDefault();
  });
}

/** The ruler that a press on the curves sets: A, then B, then the nearer one. */
const rulerOf = (at) => (state.a === null ? "a" : state.b === null || Math.abs(at - state.b) <= Math.abs(at - state.a) ? "b" : "a");

function tools() {
  for (const button of all("[data-span]"))
    button.addEventListener("click", () => look(now() - parseInt(button.dataset.span, 10) * UNITS[button.dataset.span.at(-1)], now(), true));
  for (const button of all("[data-go]")) button.addEventListener("click", () => pan(Number(button.dataset.go)));
  for (const button of all("[data-zoom]")) button.addEventListener("click", () => zoom(Number(button.dataset.zoom)));
  one("[data-live-edge]").addEventListener("click", goLive);
  one("[data-rulers]").addEventListener("click", () => {
    if (state.a !== null || state.b !== null) { Object.assign(state, { a: null, b: null }); return changed(); }
    const [from, to] = view();
    moveRuler("a", snapped(from + (to - from) / 3));
    moveRuler("b", snapped(from + ((to - from) * 2) / 3));
  });
  one("[data-axis]")?.addEventListener("change", ({ target }) => { state.axis = target.value; draw(); });
}

function pens() {
  one("[data-picker]").addEventListener("toggle", ({ target, newState }) => { if (newState === "open") target.querySelector("input").focus(); });
  for (const row of all("[data-pen]")) {
    const pen = chart.pen(row.dataset.pen);
    row.querySelector(".ck").addEventListener("change", ({ target }) => { pen.on = target.checked; draw(); });
    row.querySelector("[data-select]").addEventListener("click", () => { state.selected = pen.tag; draw(); });
  }
}

/** What is seen as a picture, with the numbers of the table. */
function pictures() {
  const words = (cell) => (cell.dataset.cell ? cell.firstChild.textContent : cell.textContent).replace(/\s+/g, " ").trim();
  one("[data-take]")?.addEventListener("click", async ({ target }) => {
      const kind = target.closest("[data-picture]")?.dataset.picture, prints = target.closest("[data-print]");
      if (kind || prints) one("[data-take]").open = false;
      if (prints) window.print();
      if (!kind) return;
      try {
        const table = all("#t-table tr").map((row) => [...row.cells].map(words));
        const other = chart.shift ? ` · ${texts.other.replace("{period}", chart.otherPeriod())}` : "";
        const about = {
          title: document.title, period: `${time.period(chart.from, chart.to, zone, lang, true)} · ${zone}${other}`,
          made: format.dateTime(now(), zone, lang, now()), simulated: one(".simstrip .vh")?.textContent.trim(),
        };
        const made = await picture[kind](chart, about, table);
        picture.save(kind === "svg" ? new Blob([made], { type: "image/svg+xml" }) : made, `${picture.named(chart, zone)}.${kind}`);
      } catch {
        window.pogon.say(texts.no_picture, "error");
      }
    });
  matchMedia("print").addEventListener("change", () => chart.rebuild());
}

// ---- live -----------------------------------------------------------------------------------------------------

function follow() {
  let due = 0;
  chart.follow(now);
  document.addEventListener("pogon:frame", () => {
    connected = true;
    if (missed) { missed = false; changed(); }  // what was stored meanwhile
  });
  document.addEventListener("pogon:live", ({ detail }) => {
    if (detail !== "offline") return;
    connected = false;
    missed = true;
    draw();
  });
  const beat = () => {
    if (document.hidden) return;
    const present = performance.now(), pixel = state.span / 1e3 / (chart.plot?.over.clientWidth || 800);
    if (state.live && connected && present - due >= Math.min(Math.max(pixel, 180), 5000)) { due = present; draw(); }
    const waits = ["note", "error"].includes(holder.dataset.state) ? 5000 : state.live ? Math.min(Math.max(state.span / 2e5, 5000), 60000) : Infinity;
    if (connected && present - asked > waits) load();
    if (!state.live && state.paused) one("[data-paused]").textContent = texts.paused.replace("{time}", format.age((present - state.paused) / 1000));
  };
  setInterval(beat, 100);
}

if (chart) {
  all("[data-ruler]").forEach(handle);
  pointers();
  tools();
  pens();
  annotations();
  menus();
  pictures();
  follow();
  if (!state.live) state.paused = performance.now();
  canvas.addEventListener("drawn", placeRulers);
  draw();
  load();
}
