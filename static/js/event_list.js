// A list of what machines did (product passages, runs): fetched again when it changes, while nobody holds a row; the chosen one beside it.
import { parsed, renewing } from "./fetched.js";

const LIMIT = 15000, PAUSE = 1000; // least time between two fetches [ms]
const panel = document.getElementById("event-detail");
const list = () => document.getElementById("event-list");
const rows = () => [...(list()?.querySelectorAll("tr[data-row]") ?? [])];
let open = "", pressed = false, again = false, last = 0, timer = 0;

function mark() {
  for (const row of rows()) row.dataset.row === open ? row.setAttribute("aria-selected", "true") : row.removeAttribute("aria-selected");
}

function show(id) {
  open = id;
  mark();
  return renewShown();
}

const detail = () => open && list() && `${list().dataset.detail}${open}`;
const renewShown = renewing(detail, draw, LIMIT);

function draw(html, path) {
  if (path !== detail()) return;
  const top = panel.querySelector(".scroll")?.scrollTop ?? 0, same = panel.dataset.shown === open;
  panel.replaceChildren(...parsed(html).body.childNodes);
  panel.dataset.shown = open;
  const box = panel.querySelector(".scroll");
  if (same && box) box.scrollTop = top;
}

/** Soon, at most once a second, never under a finger, never on an older page. */
function refresh() {
  if (!list() || !("liveList" in list().dataset)) return;
  if (pressed) { again = true; return; }
  clearTimeout(timer);
  timer = setTimeout(take, Math.max(0, last + PAUSE - performance.now()));
}

function take() {
  if (document.hidden) return; // asked for when it is seen again
  last = performance.now();
  renewList();
}

const renewList = renewing(() => list()?.dataset.src, (html) => {
  const fresh = parsed(html).getElementById("event-list");
  if (pressed) again = true;
  else if (fresh) replace(fresh);
}, LIMIT);

function replace(fresh) {
  const before = rows().find((row) => row.dataset.row === open)?.dataset.mark;
  const focus = document.activeElement?.closest?.("#event-list tr[data-row]")?.dataset.row;
  const top = list().querySelector(".scroll").scrollTop, first = rows()[0]?.dataset.row;
  const height = list().querySelector(".scroll").scrollHeight;
  fresh.querySelector(".e-lost")?.toggleAttribute("open", list().querySelector(".e-lost[open]") !== null);
  list().replaceWith(fresh);
  const box = fresh.querySelector(".scroll");
  box.scrollTop = top && rows()[0]?.dataset.row !== first ? top + box.scrollHeight - height : top; // what is read stays where it is
  mark();
  if (focus) rows().find((row) => row.dataset.row === focus)?.querySelector(".a-open")?.focus({ preventScroll: true });
  const now = rows().find((row) => row.dataset.row === open)?.dataset.mark;
  if (open && now !== before) show(open);
  else if (!open && rows()[0]) show(rows()[0].dataset.row);
}

document.addEventListener("click", ({ target }) => {
  const row = target.closest("#event-list tr[data-row]");
  if (!row || target.closest("a")) return;
  show(row.dataset.row).then(() => { // on a phone the steps stand below the list
    if (panel.getBoundingClientRect().top > innerHeight - 80) panel.scrollIntoView({ block: "start" });
  });
});
document.addEventListener("pointerdown", ({ target }) => { pressed = Boolean(target.closest?.("#event-list tbody")); }, true);
for (const end of ["pointerup", "pointercancel"])
  document.addEventListener(end, () => setTimeout(() => {
    pressed = false;
    if (again) { again = false; refresh(); }
  }, 300), true);
document.addEventListener("visibilitychange", () => { if (!document.hidden) refresh(); });
for (const change of document.querySelectorAll(".p-change")) change.addEventListener("signal", refresh);
const first = rows()[0];
if (first) show(first.dataset.row);
