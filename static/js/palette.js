// Search over everything, and help: both open at once, so that a key is theirs and presses nothing behind them; what they say is fetched.
// What is typed goes to the server by htmx; arrows choose, Enter goes there. Both are about what was typed: until that is answered they
// wait, so that nobody is led to what an earlier letter found.
import { present } from "./commands.js";
const STEPS = ["Enter", "ArrowDown", "ArrowUp"];
let shown = false;

/** Show the dialog `name` over the page, once. */
export function show(name) {
  if (shown) return;
  shown = true;
  const dialog = document.importNode(document.querySelector(`template[data-shows="${name}"]`).content, true).firstElementChild;
  present(dialog, "[data-close], a[href]", () => { shown = false; });
  if (!dialog.querySelector("input")) return;
  const waiting = [], go = () => { while (waiting.length && !behind(dialog)) act(waiting.shift(), dialog); };
  dialog.addEventListener("keydown", (event) => { keys(event, dialog, waiting); });
  dialog.addEventListener("htmx:after:swap", go);
  for (const gone of ["htmx:response:error", "input"]) dialog.addEventListener(gone, () => { waiting.length = 0; });
}

window.pogon.over = show; // within the very key press that asks for it

/** What is found is not yet what was typed. */
function behind(dialog) {
  return dialog.querySelector("[data-q]")?.dataset.q !== dialog.querySelector("input").value.trim();
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
