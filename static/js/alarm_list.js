// The alarm list: fetched again when the alarms change, but never moving under a finger or a selection; durations count by themselves.
import { ask, post } from "./alarm_post.js";
import { parsed, renewing } from "./fetched.js";

const HELD = 500; // a row must have been there this long before it can be acknowledged [ms]
const changes = document.getElementById("alarm-changes"), panel = document.getElementById("alarm-detail");
const selected = document.getElementById("ack-selected"), visible = document.getElementById("ack-visible");
const list = () => document.getElementById("alarm-list");
const rows = () => [...(list()?.querySelectorAll("tr[data-row]") ?? [])];
const chosen = new Set(), seen = new Map(); // occurrences that are ticked; row → since when it can be seen
let open = "", pressed = false, merged = false, clock = 0, clockAt = 0;

// ---- time ------------------------------------------------------------------------------------------------------

const pad = (n) => String(n).padStart(2, "0");

/** As app/web/alarm_view.py writes it. */
function lasting(seconds) {
  const whole = Math.max(0, Math.floor(seconds)), days = Math.floor(whole / 86400);
  const hours = Math.floor((whole % 86400) / 3600), minutes = Math.floor((whole % 3600) / 60);
  if (days) return `${days}\u00a0d ${pad(hours)}:${pad(minutes)}`;
  return hours ? `${hours}:${pad(minutes)}:${pad(whole % 60)}` : `${pad(minutes)}:${pad(whole % 60)}`;
}

function setClock() {
  clock = Number(list()?.dataset.now ?? 0);
  clockAt = performance.now();
}

function count() {
  if (document.body.dataset.live === "offline") return;
  const now = clock / 1e6 + (performance.now() - clockAt) / 1000;
  for (const cell of list()?.querySelectorAll("[data-since]") ?? []) {
    const text = lasting(now - Number(cell.dataset.since) / 1e6);
    if (cell.textContent !== text) cell.textContent = text;
  }
}

// ---- which rows somebody can see -----------------------------------------------------------------------------------

const watcher = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) isIntersecting ? seen.has(target) || seen.set(target, performance.now()) : seen.delete(target);
  offer();
}, { threshold: 0.9 });
const inSight = () => rows().filter((row) => "unack" in row.dataset && performance.now() - (seen.get(row) ?? Infinity) >= HELD);

/** Bring the two buttons to what they would do. */
function offer() {
  if (!selected) return;
  for (const [button, number] of [[selected, chosen.size], [visible, rows().filter((row) => "unack" in row.dataset && seen.has(row)).length]]) {
    button.querySelector("b").textContent = number;
    button.setAttribute("aria-disabled", String(!number));
  }
}

// ---- fetching ------------------------------------------------------------------------------------------------------

const held = () => pressed || chosen.size > 0;

const refresh = renewing(() => list()?.dataset.src, (html) => take(parsed(html).getElementById("alarm-list")), 15000);

/** Put `fresh` in place of the list, or, while somebody works in it, only what changed in the rows that are there. */
function take(fresh) {
  if (!fresh) return;
  merged = held();
  if (merged) merge(fresh);
  else replace(fresh);
  setClock();
  if (open) renewDetail();
  else if (rows()[0]) show(rows()[0].dataset.row);
}

function merge(fresh) {
  const coming = new Map([...fresh.querySelectorAll("tr[data-row]")].map((row) => [row.dataset.row, row]));
  const mine = new Set(rows().map((row) => row.dataset.row));
  for (const row of rows()) {
    const next = coming.get(row.dataset.row);
    row.classList.toggle("a-gone", !next);
    if (!next) { tick(row, false); delete row.dataset.unack; continue; }
    const ticked = chosen.has(row.dataset.row);
    "unack" in next.dataset ? row.setAttribute("data-unack", "") : row.removeAttribute("data-unack");
    if (next.innerHTML.replace(/\d\d:\d\d</, "<") !== row.innerHTML.replace(/\d\d:\d\d</, "<")) row.replaceChildren(...next.childNodes);
    tick(row, ticked && "unack" in row.dataset);
  }
  const number = [...coming.keys()].filter((id) => !mine.has(id)).length, bar = list().querySelector(".a-new");
  bar.hidden = !number;
  bar.textContent = bar.dataset.new.replace("{n}", number);
  list().dataset.now = fresh.dataset.now;
  offer();
}

function replace(fresh) {
  const focus = document.activeElement?.closest?.("tr[data-row]")?.dataset.row, kind = document.activeElement?.className;
  const box = list().parentElement, top = box.scrollTop, old = new Map(rows().map((row) => [row.dataset.row, seen.get(row)]));
  const order = rows().map((row) => row.dataset.row).join();
  watcher.disconnect();
  seen.clear();
  list().replaceWith(fresh);
  box.scrollTop = top;
  const stays = order === rows().map((row) => row.dataset.row).join();
  for (const row of rows()) {
    if (stays && old.get(row.dataset.row)) seen.set(row, old.get(row.dataset.row));
    row.toggleAttribute("aria-selected", false);
    if (row.dataset.row === open) row.setAttribute("aria-selected", "true");
    watcher.observe(row);
  }
  if (focus) rows().find((row) => row.dataset.row === focus)?.querySelector(`.${CSS.escape(kind.split(" ")[0])}`)?.focus();
  offer();
}

// ---- what people do --------------------------------------------------------------------------------------------------

function tick(row, on) {
  const box = row.querySelector(".ck");
  if (box) box.checked = on;
  on ? chosen.add(row.dataset.row) : chosen.delete(row.dataset.row);
}

function show(occurrence) {
  open = occurrence;
  for (const row of rows()) row.dataset.row === open ? row.setAttribute("aria-selected", "true") : row.removeAttribute("aria-selected");
  panel?.setAttribute("hx-get", `/alarms/detail/${open}`);
  if (panel) window.htmx.trigger(panel, "again");
}

let drawnDetail = "";
function renewDetail() {
  const row = rows().find((one) => one.dataset.row === open && !one.classList.contains("a-gone"));
  const now = row ? row.querySelector(".alm")?.dataset.state + row.querySelector(".a-st").textContent : "";
  if (now && now !== drawnDetail) show(open);
  drawnDetail = now;
}

async function acknowledge(occurrences) {
  const taken = await post("/alarms/acknowledge", occurrences.map((one) => ["occurrence", one]));
  if (taken) for (const row of rows()) if (occurrences.includes(row.dataset.row)) tick(row, false);
  refresh();
}

// Shelved, taken out of service, brought back, reset: what one looked at may be another alarm now.
document.addEventListener("htmx:after:request", ({ target, detail: { ctx } }) => {
  if (!/^alarm-/.test(target.id) || !target.matches("form") || ctx.response.status >= 400) return;
  if (target.id !== "alarm-reset") drawnDetail = open = "";
  refresh();
});

document.addEventListener("click", async (event) => {
  const target = event.target;
  const button = target.closest("[data-ack]"), row = target.closest("tr[data-row]");
  if (button) {
    event.preventDefault();
    if (performance.now() - (seen.get(row) ?? Infinity) >= HELD) acknowledge([button.value]);
  } else if (target.closest("#ack-selected")) {
    event.preventDefault();
    if (chosen.size) acknowledge([...chosen]);
  } else if (target.closest("#ack-visible")) {
    const wanted = inSight().map((one) => one.dataset.row), dialog = document.getElementById("ack-confirm");
    if (wanted.length && await ask(dialog, dialog.querySelector("[data-question]").dataset.question.replace("{n}", wanted.length))) acknowledge(wanted);
  } else if (target.closest(".a-new")) {
    for (const one of rows()) tick(one, false);
    refresh();
  } else if (row && !target.closest("input, a, button:not(.a-open)")) show(row.dataset.row);
});
document.addEventListener("change", ({ target }) => {
  if (target.matches(".alist .ck")) {
    tick(target.closest("tr"), target.checked);
    offer();
    if (!held()) refresh();
  } else if (target.matches("select[data-filter]") && !document.querySelector(".a-menu [name=since]")) target.form.requestSubmit();
});
document.addEventListener("pointerdown", ({ target }) => { pressed = Boolean(target.closest?.("#alarm-list tbody")); }, true);
for (const end of ["pointerup", "pointercancel"])
  document.addEventListener(end, () => setTimeout(() => {
    const was = pressed;
    pressed = false;
    if (was && merged && !held()) refresh();
  }, 300), true);
document.addEventListener("visibilitychange", () => { if (!document.hidden && !held()) refresh(); });

if (list()) {
  changes?.addEventListener("signal", refresh);
  for (const box of list().querySelectorAll(".ck:checked")) chosen.add(box.value);
  for (const row of rows()) watcher.observe(row);
  setClock();
  setInterval(count, 1000);
  const first = rows()[0];
  if (first) addEventListener("DOMContentLoaded", () => show(first.dataset.row)); // htmx begins then, too
}
