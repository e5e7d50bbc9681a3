// Parts of a screen that are fetched again when what they are made of has changed, and rows of tables as dialogs.
//   data-refetch      address of the part; with data-tags: the content is replaced when one of these tags shows another value
//   data-row          address of a row as a dialog
const HEADERS = { "HX-Request": "true" };
const { commands } = window.pogon;
const fetched = new Map(); // part → {made: what it was made of, busy, again}

document.addEventListener("tags", ({ target, detail }) => {
  if (target.dataset.refetch === undefined) return;
  const of = Object.values(detail).map(({ value, state }) => (state === "bad" ? "bad" : value)).join(" ");
  const part = fetched.get(target) ?? { of: "", busy: false, again: false };
  fetched.set(target, part);
  if (part.of === of) return;
  part.of = of;
  fetchPart(target, part);
});

/** Fetch a part again, from where its data-refetch points now. */
function again(element) {
  const part = fetched.get(element) ?? { of: "", busy: false, again: false };
  fetched.set(element, part);
  return fetchPart(element, part);
}

async function fetchPart(element, part) {
  if (part.busy) { part.again = true; return; }
  part.busy = true;
  const html = await text(element.dataset.refetch);
  if (html !== null && html.trim() !== element.made) {
    element.made = html.trim();
    const inside = element.contains(document.activeElement), { id, dataset: { row: focused } } = document.activeElement;
    const place = element.querySelector(".scroll")?.scrollTop;
    element.innerHTML = html;
    if (place) element.querySelector(".scroll")?.scrollTo(0, place);
    if (inside && id && element.querySelector(`#${CSS.escape(id)}`)) document.getElementById(id).focus();
    else if (inside && focused !== undefined) element.querySelector(`[data-row="${CSS.escape(focused)}"]`)?.focus();
    document.dispatchEvent(new Event("pogon:drawn"));
    element.dispatchEvent(new CustomEvent("part", { bubbles: true }));
  }
  part.busy = false;
  if (part.again && element.isConnected) {
    part.again = false;
    setTimeout(() => fetchPart(element, part), 50);
  }
}

/** What `url` answers, or null when nobody does; a refusal is said. */
async function text(url, tell = false) {
  try {
    const answer = await fetch(url, { headers: HEADERS, signal: AbortSignal.timeout(5000) });
    if (answer.ok) return await answer.text();
    if (tell) commands.told(new DOMParser().parseFromString(await answer.text(), "text/html").querySelector("[data-message]")?.textContent.trim() ?? "", "error");
  } catch {
    if (tell) commands.told(document.getElementById("message").dataset.network, "error");
  }
  return null;
}

/** Open the row at `url` over the page. */
async function openRow(url) {
  const html = await text(url, true);
  const found = html && new DOMParser().parseFromString(html, "text/html").querySelector("dialog");
  if (!found) return;
  const dialog = document.importNode(found, true), close = commands.open(dialog);
  dialog.addEventListener("click", ({ target }) => { if (target.closest("[data-close], [data-arguments]:not([aria-disabled])")) close(); });
  dialog.addEventListener("keydown", (event) => { if (event.key === "Escape" && !document.querySelector("#overlay [data-ask]")) close(); });
}

document.addEventListener("click", (event) => {
  const button = event.target.closest?.("[data-row]");
  if (button) openRow(button.dataset.row);
});

window.pogon.parts = { openRow, again };
