// The parameter page: what is typed stays here until it is reviewed and written; then one request, and a result per row.
import * as commands from "./commands.js";
import { parsed } from "./fetched.js";
import { number } from "./format.js";

const lang = document.body.dataset.lang, mark = lang === "en" ? "." : ",";
const form = document.querySelector("[data-write]"), list = document.querySelector("[data-changes]");
const results = document.querySelector("[data-results]"), rows = [...document.querySelectorAll("tr[data-key]")];
const $ = (name) => document.querySelector(`.app-main [data-${name}]`);
let group = "";

/** What was typed as a number, for showing a difference; the server reads it for good. */
function typed(text) {
  const plain = text.replace(/[\s\u202f\u00a0]/g, "").replace("\u2212", "-").replace(mark, ".");
  return /^[+-]?\d*\.?\d+$|^[+-]?\d+\.$/.test(plain) ? Number(plain) : NaN;
}

const raw = (row) => {
  const text = row.querySelector("[data-raw]").textContent.trim();
  return text !== "" && Number.isFinite(Number(text)) ? Number(text) : null;
};

function changes() {
  const edited = rows.map((row) => ({ row, field: row.querySelector("[data-new]") }))
    .filter(({ field }) => field && field.value.trim() !== "");
  const keys = new Set(edited.map(({ row }) => row.dataset.key));
  return edited.map(({ row, field }) => {
    const choice = field.tagName === "SELECT", value = choice ? Number(field.value) : typed(field.value);
    // limits that come from another value of this set are for the server to judge
    const moved = row.dataset.depends.split(" ").some((key) => keys.has(key));
    const low = moved ? -Infinity : Number(row.dataset.low ?? -Infinity), high = moved ? Infinity : Number(row.dataset.high ?? Infinity);
    return { row, field, value, choice, out: !choice && !(value >= low && value <= high) };
  });
}

/** A change as a line of the review. */
function line({ row, field, value, choice, out }) {
  const { mark, name, unit, decimals, permitted, warning } = row.dataset, old = raw(row), item = $("change").content.firstElementChild.cloneNode(true);
  const was = choice ? row.querySelector(".val b").textContent : old === null ? "–" : number(old, +decimals, lang);
  const now = choice ? field.selectedOptions[0].textContent : field.value.trim();
  const part = !choice && old && Number.isFinite(value) && `${value > old ? "+" : ""}${number((100 * (value - old)) / Math.abs(old), 0, lang)}\u00a0%`;
  const texts = { mark, name, was, now, unit, part, out: out && form.dataset.out.replace("{permitted}", `${permitted} ${unit}`), warning };
  for (const place of item.querySelectorAll("[data-of]")) place.textContent = texts[place.dataset.of] || "";
  item.classList.add(out ? "rv-bad" : "rv-ok");
  return item;
}

function review() {
  const found = changes();
  list.replaceChildren(...found.map(line));
  for (const field of document.querySelectorAll("[data-new]")) field.removeAttribute("aria-invalid");
  for (const { field, out } of found) field.setAttribute("aria-invalid", String(out));
  const count = found.length;
  $("count").textContent = count;
  $("n").textContent = count || "";
  $("submit").disabled = !count || found.some(({ out }) => out);
  $("discard").disabled = !count;
  count ? (form.dataset.dirty = "") : delete form.dataset.dirty;
}

document.addEventListener("input", ({ target }) => {
  if (target.matches("[data-new]")) {
    const row = target.closest("tr");
    row.dataset.seen ??= raw(row) ?? ""; // what the person saw when the edit began
    if (target.value.trim() === "") delete row.dataset.seen;
    results.replaceChildren();
    review();
  }
  if (target.matches("[data-filter]")) filter();
});

$("discard").addEventListener("click", () => {
  for (const { row, field } of changes()) { field.value = ""; delete row.dataset.seen; }
  review();
});

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const found = changes();
  if (!found.length || form.dataset.busy !== undefined) return;
  form.dataset.busy = "";
  $("submit").disabled = $("discard").disabled = true;
  commands.told(form.dataset.writing, "info");
  const fields = new URLSearchParams({ id: commands.identity(), nonce: await commands.nonce(), reason: form.elements.reason.value });
  for (const { row, field } of found) {
    fields.append("key", row.dataset.key);
    fields.append("value", field.tagName === "SELECT" ? field.value : field.value.trim());
    fields.append("expected", row.dataset.seen ?? "");
  }
  const got = await commands.post(form.action, fields, 300000);
  delete form.dataset.busy;
  if (!got) return void (commands.told(document.getElementById("message").dataset.network, "error"), review());
  const answer = parsed(got.text).querySelector("[data-answer]");
  commands.take(got, null);
  commands.quiet(3000);
  if (answer) {
    results.replaceChildren(document.importNode(answer, true));
    for (const { row, field } of found) {
      if (results.querySelector(`[data-row="${CSS.escape(row.dataset.code)}"][data-done="yes"]`)) field.value = "";
      delete row.dataset.seen;
      if (field.value.trim() !== "") row.dataset.seen = raw(row) ?? "";
    }
    form.elements.reason.value = "";
  }
  review();
});

// ---- groups and filter --------------------------------------------------------------------------------------------------------------

function filter() {
  const words = $("filter").value.toLocaleLowerCase(lang).split(/\s+/).filter(Boolean);
  for (const row of rows) {
    const text = `${row.dataset.mark} ${row.dataset.name} ${row.querySelector(".val b").textContent}`.toLocaleLowerCase(lang);
    row.hidden = (group !== "" && row.parentElement.dataset.group !== group) || !words.every((word) => text.includes(word));
  }
}

document.addEventListener("click", (event) => {
  const link = event.target.closest?.(".p-nav [data-group]");
  if (!link) return;
  event.preventDefault();
  group = link.dataset.group;
  for (const other of document.querySelectorAll(".p-nav a")) other === link ? other.setAttribute("aria-current", "true") : other.removeAttribute("aria-current");
  history.replaceState(null, "", link.getAttribute("href"));
  filter();
});
const named = document.querySelector(`.p-nav [data-group="${CSS.escape(decodeURIComponent(location.hash.slice(1)))}"]`);
if (named && location.hash) named.click();

window.addEventListener("beforeunload", (event) => { if (form.dataset.dirty !== undefined) event.preventDefault(); });
review();
