// Search over everything: fetched when it is asked for. What is typed goes to the server by htmx; arrows choose, Enter goes there.
const { open, told } = window.pogon.commands;
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
  dialog.addEventListener("keydown", (event) => { keys(event, dialog); });
}

function keys(event, dialog) {
  const hits = [...dialog.querySelectorAll("[role=option]")], now = hits.findIndex((hit) => hit.ariaSelected === "true");
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (event.key === "Escape") shown.close();
  else if (event.key === "Enter" && hits[now] && event.target.matches("input")) hits[now].click();
  else if (step && hits.length) choose(hits, (Math.max(now, 0) + step + hits.length) % hits.length, dialog);
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function choose(hits, next, dialog) {
  hits.forEach((hit, index) => { hit.ariaSelected = String(index === next); });
  hits[next].scrollIntoView({ block: "nearest" });
  dialog.querySelector("input")?.setAttribute("aria-activedescendant", hits[next].id);
}
