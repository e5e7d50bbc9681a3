// Commands: a press fetches a fresh nonce, posts, and draws what became of it. Whatever has a data-part is drawn anew in place, so that
// focus, what is being typed and what is being held survive; everybody's column is fetched again when the revision tag of its machine changes.
import { answered, parsed } from "./fetched.js";
import { number } from "./format.js";
import { now } from "./values.js";

const body = document.body, lang = body.dataset.lang;
const ANSWER = 12000, STOP_ANSWER = 3000, LOCK = 500, EDIT = 60000, ASK = 30000;
const offline = () => body.dataset.live === "offline";
const roots = () => [...document.querySelectorAll("[data-operation]")];
const rootOf = (element) => element.closest("[data-operation]") ?? document.querySelector(`[data-operation="${machineOf(element)}"]`) ?? document.querySelector("[data-operation]");
export const textsOf = (element) => JSON.parse(rootOf(element)?.dataset.texts ?? "{}");
const named = (element) => element.dataset.command ?? element.dataset.hold ?? element.dataset.setpoint ?? element.dataset.ask ?? "";
function machineOf(element) { return named(element).split(".")[0]; }
export const identity = () => crypto.randomUUID?.() ?? Array.from(crypto.getRandomValues(new Uint8Array(16)), (n) => n.toString(16).padStart(2, "0")).join("");

// ---- nonces: one is fetched when a button goes down, so that no command ever fails for an old one ----------------------------------

let waiting = null, stops = 0;

/** Have a nonce ready for the click that follows. */
export const prepare = () => { waiting ??= { at: performance.now(), nonce: fetchNonce() }; };

async function fetchNonce() {
  const got = await answered("/nonce", { limit: 3000 });
  return got?.ok ? JSON.parse(got.text).nonce : "";
}

/** A nonce that is good now; each is used once. None when a Stop came since it was asked for: what was pressed before it is not carried out. */
export async function nonce() {
  const held = waiting, before = stops;
  waiting = null;
  const got = (held && performance.now() - held.at < 4000 && (await held.nonce)) || (await fetchNonce());
  return stops === before ? got : "";
}

// ---- answers ------------------------------------------------------------------------------------------------------------------------

/** Draw an answer: its parts, its line, what it asks back. Returns the element it asks with, or nothing. */
export function take(answer, near) {
  const inside = parsed(answer.text);
  patch(inside);
  const line = inside.querySelector("[data-message]");
  if (line) {
    const kind = line.dataset.kind ?? (answer.ok ? "info" : "error");
    (line.dataset.time ? told : window.pogon.say)(line.textContent.trim(), kind, line.dataset.time);
    if (kind === "error" && near) hint(near, line.dataset.hint ?? line.textContent.trim(), line.dataset.field);
  }
  const asks = inside.querySelector("[data-ask]");
  if (asks) ask(document.importNode(asks, true), near);
  return asks;
}

// An answer that htmx puts nowhere (hx-swap="none") is drawn by its parts; an order that was taken is not tried again.
document.addEventListener("htmx:after:request", ({ detail: { ctx } }) => {
  const { sourceElement: form, swap, response } = ctx;
  if (swap !== "none" || (response.status >= 400 && form.dataset.renewed !== undefined)) return;
  if (response.status < 400) {
    delete form.closest("[data-part]")?.dataset.dirty;
    if (form.elements?.id) form.elements.id.value = "";
  }
  take({ ok: response.status < 400, text: ctx.text }, form);
});

/** Say `text` in the message line, to who hears the page, too. */
export function told(text, kind, time) {
  document.getElementById("message").role = kind === "error" ? "alert" : "status";
  window.pogon.say(text, kind, time);
}

/** Say `text` at a field or in a dialog; the input named `wrong` is framed as what it is about, and no other. */
function hint(near, text, wrong = "") {
  const place = near.querySelector("[data-hint]");
  if (place) place.textContent = text;
  for (const one of near.querySelectorAll(".in [name]")) {
    one.ariaInvalid = one.name === wrong ? "true" : null;
    one.closest(".in").classList.toggle("bad", one.name === wrong);
  }
}

// ---- drawing anew ---------------------------------------------------------------------------------------------------------------------

/** Take over every data-part of `inside` wherever the page shows it. */
function patch(inside) {
  let drawn = false;
  for (const fresh of inside.querySelectorAll("[data-part]")) {
    if (fresh.dataset.part.endsWith(".message")) { story(fresh); continue; }
    for (const old of document.querySelectorAll(`[data-part="${CSS.escape(fresh.dataset.part)}"]`)) {
      if (old.own && !["requested", "accepted"].includes(fresh.dataset.state))
        [old.own, old.elements.expected.value] = [false, fresh.querySelector("[name=expected]").value];
      if (old.dataset.dirty !== undefined || old.dataset.held !== undefined) { old.fresh = fresh; continue; } // who types or holds comes first
      drawn = renew(old, fresh) || drawn;
    }
  }
  if (drawn) document.dispatchEvent(new Event("pogon:drawn"));
  bars();
}

const SYNCED = ["data-state", "aria-disabled", "aria-pressed", "title", "data-since", "data-limit", "data-waiting", "data-holding", "role", "data-url",
  "data-command", "data-told", "formaction"]; // a switch is another command once it is on

function renew(old, fresh) {
  if (old.dataset.locked !== undefined && fresh.dataset.state === "idle") return false;
  const focused = old.contains(document.activeElement) ? document.activeElement : null;
  if (old.matches(".stop") && old.dataset.state !== fresh.dataset.state && ["requested", "accepted"].includes(fresh.dataset.state)) withdraw(machineOf(old));
  if ((old.dataset.holding === "mine") !== (fresh.dataset.holding === "mine")) told(fresh.dataset.told, "info");
  for (const name of SYNCED) {
    const value = fresh.getAttribute(name);
    if (value === old.getAttribute(name)) continue;
    value === null ? old.removeAttribute(name) : old.setAttribute(name, value);
  }
  if (old.classList.contains("cmd")) {
    old.classList.toggle("danger", fresh.classList.contains("danger"));
    old.hidden = fresh.hidden; // other parts stand hidden in one place and open in another
  }
  delete old.kept;
  if (old.innerHTML.replaceAll(' data-htmx-powered="true"', "") === fresh.innerHTML) return false; // htmx marks its own; drawn for nothing, a press got lost
  if (window.pogon.pressed(old)) return void setTimeout(() => roots().forEach(refresh), 300); // what a finger is on stays until that is up
  const key = focused && focused !== old ? [focused.id, focused.dataset.token, focused.name].find(Boolean) : "";
  const all = focused?.matches?.("input") ? [focused.selectionStart, focused.selectionEnd] : null;
  old.innerHTML = fresh.innerHTML;
  window.htmx.process(old);
  if (focused && focused !== old) {
    const again = [...old.querySelectorAll("button, input, a")].find((e) => key && [e.id, e.dataset.token, e.name].includes(key)) ?? old.querySelector("button, input");
    again?.focus();
    if (all && again?.matches("input") && again.type === "text") again.setSelectionRange(...all);
  }
  return true;
}

let silent = 0;
/** For `ms` only what went wrong replaces the line that was just said. */
export const quiet = (ms) => { silent = performance.now() + ms; };
let spoken = document.querySelector("[data-part$='.message']")?.dataset.id ?? "";

function story(fresh) {
  const { id, kind, time } = fresh.dataset;
  if (!id || id === spoken) return;
  spoken = id;
  if (performance.now() < silent && kind !== "error") return;
  told(fresh.textContent.trim(), kind, time);
}

// ---- the time of a feedback ------------------------------------------------------------------------------------------------------------

function bars() {
  for (const button of document.querySelectorAll("[data-since]")) {
    const limit = Number(button.dataset.limit), passed = Math.max(0, Math.min(limit, (now() - button.dataset.since) / 1e6));
    const bar = button.querySelector(".bar"), line = button.querySelector("small:not([data-why])");
    bar?.style.setProperty("--done", (passed / limit).toFixed(3));
    const written = (seconds) => number(seconds, seconds < 10 ? 1 : 0, lang);
    if (line && !offline()) line.textContent = button.dataset.waiting.replace("{elapsed}", written(passed)).replace("{limit}", written(limit));
  }
}
setInterval(bars, 100);
setInterval(() => {
  for (const element of document.querySelectorAll("[data-left]")) {
    const left = Math.max(0, Number(element.dataset.left) - 0.25);
    element.dataset.left = left.toFixed(2);
    element.textContent = `${Math.ceil(left)}\u00a0s`;
  }
}, 250);

// ---- fetching again when something changed ---------------------------------------------------------------------------------------------

/** Fetch what `root` shows anew; what stands on the page twice is asked for once. */
function refresh(root) {
  const first = document.querySelector(`[data-operation][hx-get="${CSS.escape(root.getAttribute("hx-get"))}"]`);
  if (first) window.htmx.trigger(first, "again");
}

document.addEventListener("changed", ({ target }) => {
  const root = target.matches("[data-revision]") && target.closest("[data-operation]");
  if (root) refresh(root);
}, true);

document.addEventListener("pogon:live", ({ detail }) => { if (detail === "live") roots().forEach(refresh); });

// ---- buttons ------------------------------------------------------------------------------------------------------------------------------

let repeated = false;
document.addEventListener("keydown", (event) => {
  repeated = event.repeat;
  if (event.repeat && (event.key === "Enter" || event.key === " ") && event.target.closest?.("[data-command], [data-set], [data-token]")) event.preventDefault();
}, true);
document.addEventListener("keyup", () => { repeated = false; }, true);
const SENDS = "[data-command]:not(.stop), [data-set], .dlg [type=submit], .review-form button, .ask button";
document.addEventListener("pointerdown", ({ target }) => { if (!offline() && target.closest?.(SENDS)) prepare(); });

document.addEventListener("click", (event) => {
  const button = event.target.closest?.("[data-command], [data-faceplate], [data-cancel], [data-arguments], button[data-row]");
  if (!button || event.ctrlKey || event.metaKey) return;
  if (button.matches("[data-cancel]")) return button.closest("[data-ask]")?.cancel?.();
  if (button.matches("[data-faceplate]") && offline()) return;
  event.preventDefault();
  if (button.matches("[data-faceplate]")) return fetchDialog(button.getAttribute("href"));
  if (button.matches("[data-row]")) return openRow(button.dataset.row);
  if (button.getAttribute("aria-disabled") === "true") {
    const text = button.querySelector("small")?.textContent || button.title;
    if (text) told(`${(button.querySelector(".cmd-t")?.firstChild ?? button).textContent.trim()}: ${text}`, "error");
    return;
  }
  if (repeated) return;
  if (button.matches("[data-arguments]")) return askFor(button);
  press(button);
});

/** Open what asks for the arguments of a command; some commands are about the row that is chosen on the page. */
async function askFor(button) {
  let url = button.dataset.arguments;
  if (button.dataset.needsRow !== undefined) {
    const { chosen } = rootOf(button)?.dataset ?? {};
    if (!chosen) return told(button.dataset.needsRow, "error");
    url += `?${button.dataset.argument}=${chosen}`;
  }
  const got = await over(url);
  if (got !== undefined) got ? take(got, null) : told(textsOf(button).no_answer, "error");
}

/** The answer of `url`, which is going to stand over the page; undefined when something else is on its way there, as the second click of two is. */
async function over(url) {
  const place = document.getElementById("overlay");
  if (place.ariaBusy) return;
  place.ariaBusy = "true";
  const got = await answered(url, { limit: 5000 });
  place.ariaBusy = null;
  return got;
}

const pressing = new Set();

/** One press is one command: a second one while the first is on its way, or within half a second, is the same press. */
async function press(button, answer = {}) {
  const name = named(button), one = `${name} ${button.value}`, stop = button.classList.contains("stop");
  if (pressing.has(one)) return;
  pressing.add(one);
  const began = performance.now(), url = button.getAttribute("formaction"), line = button.querySelector("small");
  const texts = textsOf(button), same = document.querySelectorAll(`[data-command="${CSS.escape(name)}"]`);
  const before = { state: button.dataset.state, line: line?.textContent };
  for (const one of same) { one.dataset.locked = ""; one.dataset.state = "requested"; }
  if (line && !button.kept) line.textContent = texts.sending;
  if (stop) withdraw(machineOf(button));
  const fields = { id: identity(), ...answer };
  if (button.name) fields[button.name] = button.value; // an argument that the button itself stands for
  if (!stop) fields.nonce = await nonce();
  const got = await answered(url, { fields, limit: stop ? STOP_ANSWER : ANSWER });
  for (const one of document.querySelectorAll(`[data-command="${CSS.escape(name)}"]`)) delete one.dataset.locked;
  let pause = LOCK;
  if (got) {
    const asked = take(got, null);
    current(button, got, asked);
    if (asked) { // nothing was done yet
      pause = 0;
      for (const one of same) one.dataset.state = before.state;
      if (line) line.textContent = before.line;
    }
  } else {
    const text = stop ? texts.not_delivered : texts.no_answer;
    for (const one of same) one.dataset.state = "failed";
    if (line) line.textContent = text;
    told(`${button.querySelector(".cmd-t").firstChild.textContent}: ${text}`, "error");
  }
  setTimeout(() => pressing.delete(one), Math.max(0, (got ? pause : 0) - (performance.now() - began)));
}

/** An answer may be older than what was heard since: what became of the command is asked once more. */
function current(element, answer, asks) {
  const root = answer.ok && !asks && rootOf(element);
  if (!root) return;
  spoken = "";
  refresh(root);
}

// ---- setpoints ----------------------------------------------------------------------------------------------------------------------------

const timers = new WeakMap();

document.addEventListener("input", ({ target }) => {
  const field = target.closest?.("[data-setpoint]");
  if (!field) return;
  field.dataset.dirty = "";
  hint(field, "");
  clearTimeout(timers.get(field));
  timers.set(field, setTimeout(() => { clean(field); hint(field, textsOf(field).discarded); }, EDIT));
});

document.addEventListener("click", ({ target }) => {
  const back = target.closest?.("[data-former]"), field = back?.closest("[data-setpoint]");
  if (!field || offline()) return;
  field.elements.argument.value = back.dataset.former; // as if typed: reviewed and read back as every value
  field.dataset.dirty = "";
  field.requestSubmit();
});

/** What was typed is over: the field shows what the machine has. */
function clean(field) {
  clearTimeout(timers.get(field));
  delete field.dataset.dirty;
  review(field)?.replaceChildren();
  if (field.fresh) renew(field, field.fresh);
  for (const input of field.querySelectorAll("input")) input.value = input.defaultValue;
  hint(field, "");
  delete field.fresh;
  const root = rootOf(field);
  if (root) refresh(root);
}

const review = (field) => field.nextElementSibling; // the place of the card, after the form

document.addEventListener("keydown", (event) => {
  const field = event.target.closest?.("[data-setpoint]");
  if (field && event.key === "Escape" && field.dataset.dirty !== undefined) clean(field);
  else if (event.target.closest?.("[data-setpoint] input") && event.key === "Enter") prepare();
});

document.addEventListener("submit", (event) => {
  const form = event.target;
  if (form.matches("[data-setpoint]")) {
    event.preventDefault();
    submit(form);
  } else if (form.matches(".review-form, .ask form")) {
    event.preventDefault();
    confirm(form, event.submitter);
  }
});

async function submit(form) {
  const { value } = form.elements.argument, one = `${named(form)} ${value}`;
  if (form.querySelector("[data-set]").ariaDisabled === "true") return told(form.querySelector("[data-hint]").textContent || textsOf(form).no_answer, "error");
  if (pressing.has(one)) return; // the same press; another value is another one, and goes when the one before was answered
  pressing.add(one);
  form.underway = send(form, value, form.underway);
  const got = await form.underway;
  setTimeout(() => pressing.delete(one), got?.ok ? LOCK : 0);
}

async function send(form, value, before) {
  await before;
  hint(form, textsOf(form).sending);
  review(form)?.replaceChildren();
  const fields = { id: identity(), nonce: await nonce(), argument: value, expected: form.own ? "" : form.elements.expected.value };
  const got = await answered(form.getAttribute("action"), { fields, limit: ANSWER });
  settle(form, got, value);
  return got;
}

/** The answer to `value`: accepted, asked back, or why not; then what was typed stays for another try, as what was typed since does. */
function settle(form, got, value) {
  hint(form, got ? "" : textsOf(form).no_answer);
  if (!got) return told(textsOf(form).no_answer, "error");
  const typed = form.elements.argument.value;
  if (got.ok) {
    if (typed === value) {
      delete form.dataset.dirty;
      clearTimeout(timers.get(form));
      delete form.fresh;
    }
    form.own = true; // until it is seen what became of it, a change of what the machine has is one's own
    return current(form, got, take(got, null));
  }
  if (!take(got, form) && got.headers.has("X-Value-Told")) form.elements.expected.value = (form.fresh ?? form).querySelector("[name=expected]").value;
  form.elements.argument.value = typed;
}

// ---- what the gate asks back ----------------------------------------------------------------------------------------------------------------

/** Show `element`: the card of a value at its field, everything else as a dialog. Both close by themselves, as cancelled. */
function ask(element, near) {
  document.dispatchEvent(new Event("pogon:dialog"));
  const field = element.field = element.matches("[data-card]") && near?.matches?.("[data-setpoint]") ? near : null;
  const place = field && review(field);
  let began = performance.now();
  const closes = element.querySelector("[data-closes]");
  element.addEventListener("input", () => { [began] = [performance.now(), hint(element, "")]; }); // who types is still there
  const timer = setInterval(() => {
    if (!element.isConnected) return clearInterval(timer); // another card took its place
    const left = ASK - (performance.now() - began);
    if (closes) closes.textContent = closes.dataset.closes.replace("{n}", Math.max(0, Math.ceil(left / 1000)));
    if (left > 0) return;
    element.cancel();
    told(textsOf(element).cancelled, "info");
  }, 250);
  let close = () => place?.replaceChildren();
  element.cancel = () => {
    clearInterval(timer);
    close();
    if (field) field.elements.argument.focus();
  };
  if (place) {
    place.replaceChildren(element);
    element.querySelector("[data-first], button")?.focus();
  } else close = open(element);
}

// What is missing in a dialog is said there in the language of the page; a browser would say it in its own.
document.addEventListener("invalid", (event) => {
  const { target } = event, asked = target.closest("[data-ask]");
  if (asked) event.preventDefault();
  if (target !== asked?.querySelector(".in :invalid")) return;
  hint(asked, textsOf(asked).required.replace("{label}", target.labels[0].firstChild.textContent.trim()), target.name);
  target.focus();
}, true);

/** A stop, whoever gave it, is the answer to every open question about the machine, and to every press whose nonce is still on its way. */
function withdraw(machine) {
  [waiting, stops] = [null, stops + 1];
  for (const asked of document.querySelectorAll("[data-ask]")) if (machineOf(asked) === machine) asked.cancel?.();
}

/** Send the answer of a person. A dialog with fields (data-keep) stays with what was typed until it is accepted. */
async function confirm(form, submitter) {
  const asked = form.closest("[data-ask]"), keeps = "keep" in asked.dataset, send = form.querySelector(".danger, .edge");
  const fields = Object.fromEntries(new FormData(form, submitter)), { field } = asked, asTyped = field?.elements.argument.value;
  delete fields.csrf;
  if (keeps && send.ariaDisabled === "true") return;
  if (keeps) [send.ariaDisabled, fields.id] = ["true", identity()];
  else asked.cancel();
  fields.nonce = await nonce();
  const got = await answered(form.getAttribute("action"), { fields, limit: ANSWER });
  if (keeps) send.ariaDisabled = null;
  if (field) return settle(field, got, asTyped);
  if (!got) {
    hint(asked, textsOf(asked).no_answer);
    return told(textsOf(asked).no_answer, "error");
  }
  if (keeps && got.ok) asked.cancel();
  current(asked, got, take(got, keeps ? asked : null));
}

document.addEventListener("keydown", (event) => {
  const asked = event.target.closest?.("[data-ask][data-level]") ?? document.querySelector("#overlay [data-ask]");
  if (!asked) return;
  if (event.key === "Escape") { event.preventDefault(); event.stopPropagation(); asked.cancel(); }
  if (event.key === "Enter" && event.target.matches("input") && asked.dataset.level >= "C3") event.preventDefault();
}, true);

// ---- dialogs: below the alarm banner, which stays in reach ------------------------------------------------------------------------------------

/** Open a dialog over the page; returns what closes it. */
export function open(dialog) {
  const overlay = document.getElementById("overlay"), back = document.activeElement;
  const scrim = document.createElement("div");
  scrim.className = "scrim";
  scrim.addEventListener("mousedown", (event) => { if (event.target === scrim) event.preventDefault(); }); // the focus stays in the dialog, which hears Escape
  scrim.append(dialog);
  const machine = dialog.dataset.operation ?? machineOf(dialog);
  const stop = !dialog.querySelector(".stop") && document.querySelector(machine ? `.stop[data-command^="${CSS.escape(machine)}."]` : ".zone .stop[data-command]");
  if (stop) {
    const also = stop.cloneNode(true); // Stop is never behind a dialog
    also.classList.add("scrim-stop");
    scrim.append(also);
  }
  overlay.append(scrim);
  window.htmx.process(dialog);
  dialog.show();
  dialog.setAttribute("aria-modal", "true");
  still();
  dialog.querySelector("[data-first]")?.focus();
  document.dispatchEvent(new Event("pogon:dialog"));
  document.dispatchEvent(new Event("pogon:drawn"));
  return () => {
    scrim.remove();
    still();
    if (back?.isConnected) back.focus();
  };
}

/** Open the row of a table at `url` over the page. */
export const openRow = (url) => fetchDialog(url, "[data-close], [data-arguments]:not([aria-disabled])");

/** What lies behind a dialog is out of reach, but for the alarm banner. */
function still() {
  const overlay = document.getElementById("overlay"), scrims = [...overlay.children], covered = scrims.length > 0;
  for (const part of document.querySelectorAll(".head, .tabs, .app-main, .foot, .skip")) part.inert = covered;
  scrims.forEach((scrim, index) => { scrim.inert = index < scrims.length - 1; });
}

/** Open the dialog that `url` answers; a click on `closing` shuts it. When there is none that is said. */
async function fetchDialog(url, closing = "[data-close]") {
  const got = await over(url), inside = parsed(got?.text ?? ""), found = got?.ok && inside.querySelector("dialog");
  if (found) present(document.importNode(found, true), closing);
  else if (got !== undefined) told(inside.querySelector("[data-message]")?.textContent.trim() || document.getElementById("message").dataset.network, "error");
}

/** Open `dialog` over the page until Escape or a click on `closing`. */
export function present(dialog, closing, closed = () => {}) {
  const shut = open(dialog), close = () => { shut(); closed(); };
  dialog.addEventListener("click", ({ target }) => { if (target.closest(closing)) close(); });
  dialog.addEventListener("keydown", ({ key }) => {
    if (key === "Escape" && !document.querySelector("#overlay [data-ask]") && !dialog.querySelector("[data-dirty]")) close();
  });
}
