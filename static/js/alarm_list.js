// The alarm list: htmx fetches it again when the alarms change, but it never moves under a finger or a selection; durations count by themselves.
import { forget, rows } from "./detail.js";
import { now } from "./values.js";

const HELD = 500; // a row must have been there this long before it can be acknowledged [ms]
const box = document.querySelector("[hx-target='#alarm-list']");
const selected = document.getElementById("ack-selected"), visible = document.getElementById("ack-visible");
const list = () => document.getElementById("alarm-list");
const ticked = () => rows().filter((row) => row.querySelector(".ck")?.checked);
const untick = (which = "") => { for (const one of document.querySelectorAll(`.alist ${which} .ck:checked`)) one.checked = false; };
const order = () => rows().map((row) => row.dataset.row).join();
const seen = new Map(); // row → since when it can be seen
const moved = () => window.pogon.say(document.getElementById("alarms").dataset.moved);
let stood = order(), focused;

// ---- time ------------------------------------------------------------------------------------------------------

/** As app/web/alarm_view.py writes it: minutes, hours or days. */
function lasting(seconds) {
  const whole = Math.max(0, Math.floor(seconds)), days = Math.floor(whole / 86400), clock = new Date(whole * 1000).toISOString().slice(11, 19);
  return days ? `${days}\u00a0d ${clock.slice(0, 5)}` : clock.slice(whole < 3600 ? 3 : whole < 36000 ? 1 : 0);
}

function count() {
  if (document.body.dataset.live === "offline") return;
  for (const cell of list()?.querySelectorAll("[data-since]") ?? []) {
    const text = lasting((now() - Number(cell.dataset.since)) / 1e6);
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
  for (const [button, number] of [[selected, ticked().length], [visible, rows().filter((row) => "unack" in row.dataset && seen.has(row)).length]]) {
    button.querySelector("b").textContent = number;
    button.setAttribute("aria-disabled", String(!number));
  }
}

// ---- fetching ------------------------------------------------------------------------------------------------------

const refresh = () => window.htmx.trigger(box, "again");

/** While rows are ticked none of them moves: what is fresh takes their order, those that are over stay, and new ones wait. */
document.addEventListener("htmx:before:swap", ({ target, detail: { tasks } }) => {
  const fresh = tasks[0]?.fragment.querySelector("#alarm-list");
  if (target === box) focused = document.activeElement?.closest("tr[data-row]")?.dataset.row;
  if (target !== box || !fresh || !ticked().length) return;
  const still = list().cloneNode(true), coming = new Map([...fresh.querySelectorAll("tr[data-row]")].map((row) => [row.dataset.row, row]));
  for (const row of still.querySelectorAll("tr[data-row]")) {
    const next = coming.get(row.dataset.row);
    coming.delete(row.dataset.row);
    if (next) row.replaceWith(next);
    else { row.classList.add("a-gone"); delete row.dataset.unack; }
  }
  const bar = still.querySelector(".a-new");
  bar.hidden = !coming.size;
  bar.textContent = bar.dataset.new.replace("{n}", coming.size);
  fresh.replaceWith(still);
});

document.addEventListener("htmx:after:swap", ({ target }) => {
  if (target !== box) return;
  if (stood !== (stood = order())) for (const row of seen.keys()) seen.set(row, performance.now()); // another row may stand where one looks
  for (const row of seen.keys()) if (!row.isConnected) seen.delete(row);
  for (const row of rows()) watcher.observe(row);
  untick("tr:not([data-unack])");
  offer();
  if (focused && document.activeElement === document.body) // what one pressed is gone: on with its row, or from the first
    (list().querySelector(`[data-row="${CSS.escape(focused)}"] .a-open`) ?? list().querySelector(".a-open"))?.focus();
});

// ---- what people do --------------------------------------------------------------------------------------------------

// A row that one could not look at yet was not meant.
document.addEventListener("submit", (event) => {
  const row = event.target.id === "alarm-one" && event.submitter?.closest("tr[data-row]");
  if (!row || performance.now() - (seen.get(row) ?? Infinity) >= HELD) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  row.scrollIntoView({ block: "nearest" });
  moved();
}, true);

// Acknowledged, shelved, taken out of service, brought back, reset: but for the first and the last, what one looked at may be another alarm now.
document.addEventListener("htmx:after:request", ({ target, detail: { ctx } }) => {
  if (!/^alarm-/.test(target.id) || !target.matches("form")) return;
  if (ctx.response.status < 400) {
    if (target.id === "alarm-form") untick();
    if (!target.matches("[action='/alarms/acknowledge'], #alarm-reset")) forget();
  } else if (!target.matches("[action='/alarms/acknowledge']")) return;
  refresh();
});

document.addEventListener("click", ({ target }) => {
  if (target.closest("#ack-visible")) {
    const wanted = inSight(), dialog = document.getElementById("ack-confirm"), question = dialog.querySelector("[data-question]");
    if (!wanted.length) return target.closest("[aria-disabled=true]") ? undefined : moved();
    question.textContent = question.dataset.question.replace("{n}", wanted.length);
    document.querySelector("#alarm-visible select").replaceChildren(...wanted.map((one) => new Option("", one.dataset.row, true, true)));
    dialog.returnValue = "";
    dialog.showModal();
  } else if (target.closest(".a-new")) {
    untick();
    refresh();
  }
});
document.addEventListener("close", ({ target }) => {
  if (target.id === "ack-confirm" && target.returnValue === "yes") document.getElementById("alarm-visible").requestSubmit();
}, true);
document.addEventListener("change", ({ target }) => {
  if (target.matches(".alist .ck")) {
    offer();
    if (!ticked().length) refresh();
  } else if (target.matches("select[data-filter]") && !document.querySelector(".a-menu [name=since]")) target.form.requestSubmit();
});

if (list()) {
  for (const row of rows()) watcher.observe(row);
  setInterval(count, 1000);
}
