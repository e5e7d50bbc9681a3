// Search over everything: fetched when it is asked for. What is typed goes to the server by htmx; arrows choose, Enter goes there.
// Both are about what was typed: until that is answered they wait, so that nobody is led to what an earlier letter found.
import { fetchDialog } from "./commands.js";
const STEPS = ["Enter", "ArrowDown", "ArrowUp"];
let shown = null;

/** Show what `url` answers over the page, once; `typed` are the keys that were pressed before it came. */
export async function show(url, typed = []) {
  if (shown) return;
  shown = {};
  shown = await fetchDialog(url, "[data-close], a[href]", () => { shown = null; });
  if (!shown) return;
  if (typed.includes("Escape")) return void shown.close();
  const { dialog } = shown, waiting = [], input = dialog.querySelector("input");
  const go = () => { while (waiting.length && !behind(dialog)) act(waiting.shift(), dialog); };
  dialog.addEventListener("keydown", (event) => { keys(event, dialog, waiting); });
  dialog.addEventListener("htmx:after:swap", go);
  for (const gone of ["htmx:response:error", "input"]) dialog.addEventListener(gone, () => { waiting.length = 0; });
  if (!input || !typed.length) return;
  for (const key of typed) input.value = key === "Backspace" ? input.value.slice(0, -1) : input.value + (key.length === 1 ? key : "");
  input.dispatchEvent(new Event("input", { bubbles: true }));
  waiting.push(...typed.filter((key) => STEPS.includes(key)));
  go();
}

/** What is found is not yet what was typed. */
function behind(dialog) {
  const found = dialog.querySelector("[data-q]");
  return found !== null && found.dataset.q !== dialog.querySelector("input").value.trim();
}

function keys(event, dialog, waiting) {
  const { key, target } = event;
  if (!STEPS.includes(key) || (key === "Enter" && !target.matches("input"))) return;
  if (behind(dialog)) waiting.push(key); else if (!act(key, dialog)) return;
  event.preventDefault();
  event.stopPropagation();
}

/** Do what `key` means; false when there is nothing to do it with. */
function act(key, dialog) {
  const hits = [...dialog.querySelectorAll("[role=option]")], now = hits.findIndex((hit) => hit.ariaSelected === "true");
  if (!hits.length) return false;
  const next = hits[(Math.max(now, 0) + (key === "ArrowDown" ? 1 : -1) + hits.length) % hits.length];
  if (key === "Enter") { hits[now]?.click(); return true; }
  for (const hit of hits) hit.ariaSelected = String(hit === next);
  next.scrollIntoView({ block: "nearest" });
  dialog.querySelector("input")?.setAttribute("aria-activedescendant", next.id);
  return true;
}
