// Live values: one socket per page keeps everything that carries a data-tag true (docs/api.md, static/js/values.js).
import { age, clockTime, day } from "./format.js";
import { SPAN, badge, now, origin, page, server, state, texts, ways } from "./values.js";

// Silent for 2 s is delayed; after 3 s the page looks disconnected, and the check itself may be late by 100 ms.
const DELAYED = 2000, OFFLINE = 2900, MOVE = 100, TEXT = 200, PAUSES = [0, 250, 1000, 2000, 4000];
const OURS = "[data-command], [data-hold], [data-set], [data-token], [data-offline-off]"; // what nobody can press without the server
const body = document.body, named = document.querySelector("[data-who]")?.dataset;
const tags = new Map(); // name → what is known of the tag and what is bound to it
let byHandle = new Map(), socket = null, rev = null, counted = null;
let heard = performance.now(), tries = 0, retry = 0, timer = 0, moved = 0, written = 0, fresh = false, opened = 0, ready = false, again = 0;

// ---- binding --------------------------------------------------------------------------------------------------

const keyOf = (name) => name.slice(name.indexOf(".") + 1);

/** Bind everything with a data-tag below `root` that is not bound yet. */
export function bind(root = document) {
  for (const tag of tags.values()) tag.items = tag.items.filter(({ element }) => element.isConnected);
  for (const element of root.querySelectorAll("[data-tag], [data-tags]")) {
    const data = element.dataset, names = data.tags?.trim().split(/\s+/) ?? [data.tag];
    if (tags.get(names[0])?.items.some((item) => item.element === element)) continue;
    const found = ways(element), several = new Set(names.map(keyOf)).size < names.length; // the same point of several machines
    for (const name of names) {
      let tag = tags.get(name);
      if (!tag) {
        tag = { name, value: null, quality: 6, state: "none", source: "field", known: false, items: [], kept: [], since: 0 };
        tags.set(name, tag);
      }
      if (data.age) tag.since = performance.now() - data.age * 1000;
      for (const item of found) if (item.tags) item.tags[several ? name : keyOf(name)] = tag;
      tag.items.push(...found);
      tag.curve ||= found.some((item) => item.curve);
      if (tag.known) draw(tag, () => true);
    }
  }
}

const draw = (tag, wanted) => { for (const item of tag.items) if (!item.curve && wanted(item)) item.draw(item, tag); };

function take(handle, value, quality) {
  const tag = byHandle.get(handle);
  if (!tag) return;
  const next = state(quality, value);
  if (next === "stale" && tag.state !== "stale" && !(tag.since && !tag.known)) tag.since = performance.now() - 1000 * (staleAfter(tag) || 0);
  if (next !== "stale") tag.since = 0;
  Object.assign(tag, { value, quality, state: next, source: origin(quality), known: true, move: true, text: true });
}

const staleAfter = (tag) => Math.max(0, ...tag.items.map(({ element }) => +(element.dataset.stale ?? 0)));

/** Moving things at most ten times a second, numbers five times; timers, so that a hidden tab keeps up. */
function redraw() {
  timer = 0;
  if (body.dataset.live === "offline") return;
  const now = performance.now(), textDue = now - written >= TEXT - 5;
  moved = now;
  if (textDue) written = now;
  let left = false;
  for (const tag of tags.values()) {
    if (tag.move) { tag.move = false; draw(tag, (item) => item.moves); }
    if (tag.text && textDue) { tag.text = false; draw(tag, (item) => !item.moves); }
    left ||= tag.text;
  }
  if (left) wake();
}

const wake = () => { timer ||= setTimeout(redraw, Math.max(0, moved + MOVE - performance.now())); };

/** Once a second: ages, samples and curves, and what was too small to draw at once. */
function tick() {
  const now = Math.floor(performance.now() / 1000), current = body.dataset.live !== "offline";
  for (const tag of tags.values()) {
    if (tag.curve && tag.known) {
      const usable = current && tag.state !== "bad" && tag.state !== "none" && tag.state !== "stale" && typeof tag.value === "number";
      if (usable || tag.kept.at(-1)?.[1] !== null) tag.kept.push([now, usable ? tag.value : null]);
      while (tag.kept.length > 1 && tag.kept[1][0] < now - SPAN) tag.kept.shift(); // what held at the left edge stays
      for (const item of tag.items) if (item.curve) item.draw(item, tag);
    }
    if (current && tag.known)
      for (const item of tag.items) {
        if (item.late) item.draw(item, tag);
        else if (tag.state === "stale" && item.element.classList.contains("val")) badge(item.element, tag);
      }
  }
}

// ---- the connection -------------------------------------------------------------------------------------------

function connection(next) {
  if (next === body.dataset.live) return;
  body.dataset.live = next;
  if (next === "offline") {
    for (const tag of tags.values())
      for (const { element } of tag.items) if (element.dataset.q) element.dataset.q = "stale";
    for (const button of document.querySelectorAll(OURS)) refuse(button);
  } else {
    for (const button of document.querySelectorAll(OURS)) allow(button);
    for (const tag of tags.values()) Object.assign(tag, { move: tag.known, text: tag.known });
    for (const tag of tags.values()) if (tag.known) draw(tag, () => true);
  }
  document.dispatchEvent(new CustomEvent("pogon:live", { detail: next }));
}

// The message line says since when nothing is known; what it replaces comes back, but a Stop that was not delivered stays said.
const line = document.getElementById("message"), said = () => line.querySelector("span").textContent;
let before = null, told = "";
document.addEventListener("pogon:live", ({ detail }) => {
  if (detail === "offline") {
    before = [said(), line.dataset.kind, line.querySelector("time").textContent];
    told = line.dataset.stale.replace("{time}", clockTime(server.time, page.zone));
    window.pogon.say(told, "error");
  } else if (before) {
    if ([told, line.dataset.network].includes(said())) window.pogon.say(...before);
    before = null;
  }
});

/** Offline every command says why it cannot be pressed; Stop stays and says what it will do. */
function refuse(button) {
  const line = button.querySelector("small"), stop = button.classList.contains("stop");
  if (stop && button.getAttribute("aria-disabled") === "true") return; // whoever may not stop it may not stop it now
  button.kept = { disabled: button.getAttribute("aria-disabled"), text: line?.textContent };
  if (line) line.textContent = stop ? texts.tried : texts.no_connection;
  if (!stop) button.setAttribute("aria-disabled", "true");
}

function allow(button) {
  if (!button.kept) return;
  const { disabled, text } = button.kept, line = button.querySelector("small");
  if (line) line.textContent = text;
  disabled === null ? button.removeAttribute("aria-disabled") : button.setAttribute("aria-disabled", disabled);
  delete button.kept;
}

function watch() {
  const silent = performance.now() - heard;
  if (silent >= OFFLINE) {
    connection("offline");
    for (const element of document.querySelectorAll("[data-offline-age]")) element.textContent = age(silent / 1000);
    if (socket?.readyState === WebSocket.OPEN && performance.now() - Math.max(heard, opened) >= OFFLINE + 1000) drop();
  } else if (silent >= DELAYED && body.dataset.live === "live") connection("delayed");
}

function drop() {
  const old = socket;
  socket = null;
  fresh = false;
  if (old) { old.onclose = old.onmessage = old.onopen = null; old.close(); }
  const pause = Math.min(PAUSES[Math.min(tries++, PAUSES.length - 1)] * (0.75 + Math.random() / 2), 5000);
  retry = setTimeout(open, pause);
}

function open() {
  document.querySelector(".off-re")?.removeAttribute("hidden"); // nobody else tries
  clearTimeout(retry);
  const here = new WebSocket(location.origin.replace(/^http/, "ws") + "/live");
  socket = here;
  here.onopen = () => {
    opened = performance.now();
    here.send(JSON.stringify({ subscribe: page.kind, rev: +page.rev }));
  };
  let refused = "";
  here.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    if (message.error) gone((refused = message.error) === "unknown_kind");
    else receive(message);
    if (refused === "not_allowed" && rev !== null) renew(true, named?.ended); // it was allowed when the page came
  };
  here.onclose = here.onerror = () => {
    if (socket !== here) return;
    if (!refused) gone(false);
    drop();
  };
  retry = setTimeout(() => socket === here && here.readyState !== WebSocket.OPEN && drop(), 4000);
}

/** The server knows this page no more: its machine, or its screen, was taken out of the plant. It is asked for further on, it may come back. */
function gone(is) {
  if (is) connection("offline");
  body.toggleAttribute("data-gone", is && document.querySelector(".off-gone") !== null);
}

function receive(message) {
  if (message.hello) return welcome(message.hello);
  if (message.hold) return document.dispatchEvent(new CustomEvent("pogon:hold", { detail: message.hold }));
  if (!message.v) return;
  if (message.rev !== rev) { // the plant was read anew: other handles
    rev = message.rev;
    fresh = false;
    return socket.send(JSON.stringify({ subscribe: page.kind, rev: +page.rev }));
  }
  if (message.full) fresh = true;
  else if (!fresh || message.n !== counted + 1) {
    if (fresh) socket.send('{"snapshot":true}');
    fresh = false;
    return;
  }
  counted = message.n;
  server.time = message.t;
  heard = server.at = performance.now();
  tries = 0;
  for (const [handle, value, quality] of message.v) take(handle, value, quality);
  const changed = message.v.map(([handle]) => byHandle.get(handle)).filter(Boolean);
  document.dispatchEvent(new CustomEvent("pogon:frame", { detail: { time: message.t, changed } }));
  if (body.dataset.live === "live") wake();
  else if (ready) connection("live");
}

function welcome(hello) {
  gone(false);
  rev = hello.rev;
  fresh = false;
  byHandle = new Map();
  for (const [name, handle] of Object.entries(hello.handles)) {
    const tag = tags.get(name);
    if (tag) byHandle.set(handle, tag);
  }
  const other = named && hello.who !== undefined && hello.who !== named.who; // the session ended, or somebody else signed in
  if (other || rev !== +page.rev || (page.build && hello.build !== page.build)) renew(other || rev !== +page.rev, other && named.ended);
}

/** The page is older than the server, or somebody else's: reload it when nobody types or holds anything, else only say so, or `why`. */
function renew(other, why) {
  const busy = document.querySelector("dialog[open], [data-held], [data-dirty]") || document.activeElement?.matches("input:not([type=radio]), select, textarea");
  if (other && !busy) return location.reload();
  if (why) window.pogon.say((body.dataset.ended = why), "error");
  else for (const element of document.querySelectorAll("[data-outdated]")) element.hidden = false;
  clearTimeout(again);
  if (other) again = setTimeout(() => renew(true, why), 2000);
}

// ---- the clock: the server's, in the plant's zone ---------------------------------------------------------------

const face = document.querySelector("[data-clock]");
setInterval(() => {
  const time = clockTime(now(), page.zone, { withOffset: false });
  if (time === face.textContent) return;
  face.textContent = time;
  document.querySelector("[data-date]").textContent = day(now(), page.zone, page.lang);
}, 200);

/** For other scripts: what the page knows of a tag now, or undefined. */
export const current = (name) => tags.get(name);

bind();
open();
document.addEventListener("DOMContentLoaded", () => { // every script of the page runs by now: what looks alive answers to a press
  ready = true;
  if (fresh) connection("live");
});
setInterval(watch, 100);
setInterval(tick, 1000);
document.addEventListener("htmx:after:swap", () => { // what was only changed in place (morph) shows what the server knew, until it is drawn
  for (const tag of tags.values()) for (const item of tag.items) delete item.at;
  bind();
  if (body.dataset.live !== "offline") for (const tag of tags.values()) if (tag.known) draw(tag, () => true);
  subscribeAgain();
});
document.addEventListener("pogon:drawn", () => { bind(); subscribeAgain(); });
// What hold-to-run sends goes at once or not at all.
document.addEventListener("pogon:send", ({ detail }) => {
  detail.sent = socket?.readyState === WebSocket.OPEN && socket.bufferedAmount === 0;
  if (detail.sent) socket.send(JSON.stringify(detail.message));
});
// What sparklines were before this page was opened (static/js/recent.js).
document.addEventListener("pogon:past", ({ detail }) => {
  const here = performance.now() / 1000;
  for (const [name, points] of Object.entries(detail.series)) {
    const tag = tags.get(name);
    if (!tag) continue;
    const past = points.map(([at, value]) => [here - (detail.now - at) / 1e6, value]), last = past.at(-1)?.[0] ?? -Infinity;
    tag.kept = [...past, ...tag.kept.filter(([at]) => at > last)];
    for (const item of tag.items) if (item.curve) item.draw(item, tag);
  }
});
document.addEventListener("visibilitychange", () => {
  if (!document.hidden && performance.now() - heard > 1500 && socket?.readyState === WebSocket.OPEN) socket.send('{"snapshot":true}');
});

/** New elements may name tags of this page that nothing showed before: ask for their handles. */
function subscribeAgain() {
  const bound = new Set([...byHandle.values()].map((tag) => tag.name));
  if (socket?.readyState === WebSocket.OPEN && [...tags.keys()].some((name) => !bound.has(name)))
    socket.send(JSON.stringify({ subscribe: page.kind, rev: +page.rev }));
}
