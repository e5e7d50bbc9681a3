// Parts of a screen that are fetched again when what they are made of has changed, and rows of tables as dialogs.
//   data-refetch      address of the part; with data-tags: the content is replaced when one of these tags shows another value
//   data-row          address of a row as a dialog
import { fetchDialog } from "./commands.js";
import { renewing } from "./fetched.js";

const LIMIT = 5000; // [ms]
const PRESS = 1000; // who holds a button longer than this clicks no more, and what is shown has to be true [ms]
const parts = new Map(); // part → {of: what it was made of, renew}

document.addEventListener("tags", ({ target, detail }) => {
  if (target.dataset.refetch === undefined) return;
  const of = Object.values(detail).map(({ value, state }) => (state === "bad" ? "bad" : value)).join(" ");
  const part = partOf(target);
  if (part.of === of) return;
  part.of = of;
  part.renew();
});

/** Fetch a part again, from where its data-refetch points now. */
export const again = (element) => partOf(element).renew();

function partOf(element) {
  if (!parts.has(element))
    parts.set(element, { of: "", renew: renewing(() => element.isConnected && element.dataset.refetch, (html) => draw(element, html), LIMIT) });
  return parts.get(element);
}

let pressed = null, holding = 0; // what the pointer went down on
const waiting = new Map(); // part → what it will be drawn as when the pointer is up

document.addEventListener("pointerdown", ({ target }) => { pressed = target; holding = setTimeout(released, PRESS); }, true);
for (const end of ["pointerup", "pointercancel"]) document.addEventListener(end, () => setTimeout(released), true); // after the click that follows

function released() {
  clearTimeout(holding);
  pressed = null;
  const late = [...waiting];
  waiting.clear();
  for (const [element, html] of late) draw(element, html);
}

/** Show what the server drew; under a pointer that is down it waits, as a button that is replaced between press and release gets no click. */
function draw(element, html) {
  if (element.contains(pressed)) { waiting.set(element, html); return; }
  if (html.trim() === element.made) return;
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

/** Open the row at `url` over the page. */
export const openRow = (url) => fetchDialog(url, "[data-close], [data-arguments]:not([aria-disabled])");

document.addEventListener("click", (event) => {
  const button = event.target.closest?.("[data-row]");
  if (button) openRow(button.dataset.row);
});
