// Search over everything: fetched when it is asked for. What is typed goes to the server by htmx; arrows choose, Enter goes there.
// Both are about what was typed: until that is answered they wait, so that nobody is led to what an earlier letter found.
import { open, told } from "./commands.js";
let shown = null;

/** Show what `url` answers over the page, once. */
export async function show(url) {
  if (shown) return;
  shown = { close() {} };
  let html = "";
  try {
    const answer = await fetch(url, { headers: { "HX-Request": "true" }, signal: AbortSignal.timeout(5000) });
    if (answer.ok) html = await answer.text();
  } catch { /* told below */ }
  const found = new DOMParser().parseFromString(html, "text/html").querySelector("dialog");
  if (!found) {
    shown = null;
    return told(document.getElementById("message").dataset.network, "error");
  }
  const dialog = document.importNode(found, true), stop = document.querySelector(".zone .stop[data-command]");
  if (stop) dialog.dataset.operation = stop.dataset.command.split(".")[0]; // Stop stays in reach
  const shut = open(dialog);
  shown = { close() { shut(); shown = null; } };
  window.htmx.process(dialog);
  dialog.addEventListener("click", ({ target }) => { if (target.closest("[data-close], a[href]")) shown?.close(); });
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
  if (key === "Escape") shown.close();
  else if ((key === "Enter" && target.matches("input")) || key === "ArrowDown" || key === "ArrowUp") {
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
