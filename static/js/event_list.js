// A list of what machines did (product passages, runs): fetched again when it changes, while nobody holds a row; the chosen one beside it.
const PAUSE = 1000; // least time between two fetches [ms]
const panel = document.getElementById("event-detail");
const list = () => document.getElementById("event-list");
const rows = () => [...(list()?.querySelectorAll("tr[data-row]") ?? [])];
let open = "", pressed = false, busy = false, again = false, last = 0, timer = 0;

async function fetched(path) {
  try {
    const answer = await fetch(path, { headers: { "HX-Request": "true" }, signal: AbortSignal.timeout(15000) });
    return answer.ok && !answer.redirected ? new DOMParser().parseFromString(await answer.text(), "text/html") : null;
  } catch {
    return null; // the page says by itself that nobody answers
  }
}

function mark() {
  for (const row of rows()) row.dataset.row === open ? row.setAttribute("aria-selected", "true") : row.removeAttribute("aria-selected");
}

async function show(id) {
  open = id;
  mark();
  const page = await fetched(`${list().dataset.detail}${id}`);
  if (!page || open !== id) return;
  const top = panel.querySelector(".scroll")?.scrollTop ?? 0, same = panel.dataset.shown === id;
  panel.replaceChildren(...page.body.childNodes);
  panel.dataset.shown = id;
  const box = panel.querySelector(".scroll");
  if (same && box) box.scrollTop = top;
}

/** Soon, at most once a second, never under a finger, never on an older page. */
function refresh() {
  if (!list() || !("liveList" in list().dataset)) return;
  if (busy || pressed) { again = true; return; }
  clearTimeout(timer);
  timer = setTimeout(take, Math.max(0, last + PAUSE - performance.now()));
}

async function take() {
  if (document.hidden) { again = true; return; }
  busy = true;
  last = performance.now();
  const page = await fetched(list().dataset.src), fresh = page?.getElementById("event-list");
  if (fresh && !pressed) replace(fresh);
  busy = false;
  if (again) { again = false; refresh(); }
}

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
