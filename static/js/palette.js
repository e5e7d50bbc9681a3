// Search over everything: fetched when it is asked for. What is typed goes to the server by htmx; arrows choose, Enter goes there.
// Both are about what was typed: until that is answered they wait, so that nobody is led to what an earlier letter found.
import { fetchDialog } from "./commands.js";
let shown = null;

/** Show what `url` answers over the page, once. */
export async function show(url) {
  if (shown) return;
  shown = {};
  shown = await fetchDialog(url, "[data-close], a[href]", () => { shown = null; });
  if (!shown) return;
  const { dialog } = shown;
  const waiting = [];
  dialog.addEventListener("keydown", (event) => { keys(event, dialog, waiting); });
  dialog.addEventListener("htmx:after:swap", () => {
    while (waiting.length && !behind(dialog)) act(waiting.shift(), dialog);
  });
  for (const gone of ["htmx:response:error", "htmx:error", "input"]) dialog.addEventListener(gone, () => { waiting.length = 0; });
}

/** What is found is not yet what was typed. */
function behind(dialog) {
  const found = dialog.querySelector("[data-q]");
  return found !== null && found.dataset.q !== dialog.querySelector("input").value.trim();
}

function keys(event, dialog, waiting) {
  const { key, target } = event;
  if ((key === "Enter" && target.matches("input")) || key === "ArrowDown" || key === "ArrowUp") {
    if (behind(dialog)) waiting.push(key); else if (!act(key, dialog)) return;
  } else return;
  event.preventDefault();
  event.stopPropagation();
}

/** Do what `key` means; false when there is nothing to do it with. */
function act(key, dialog) {
  const hits = [...dialog.querySelectorAll("[role=option]")], now = hits.findIndex((hit) => hit.ariaSelected === "true");
  if (!hits.length) return false;
  if (key === "Enter") hits[now]?.click();
  else choose(hits, (Math.max(now, 0) + (key === "ArrowDown" ? 1 : -1) + hits.length) % hits.length, dialog);
  return true;
}

function choose(hits, next, dialog) {
  hits.forEach((hit, index) => { hit.ariaSelected = String(index === next); });
  hits[next].scrollIntoView({ block: "nearest" });
  dialog.querySelector("input")?.setAttribute("aria-activedescendant", hits[next].id);
}
