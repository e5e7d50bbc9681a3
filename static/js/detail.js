// Beside a list of rows all that the chosen one says: fetched when a row is chosen, and again when it says something else (data-mark).
const panel = document.querySelector("[data-detail]");
let open = "", shown = "", before = "", revealed = false;

export const rows = () => [...(panel ? document.querySelectorAll("tr[data-row]") : [])];

export function forget() { open = ""; } // the next answer of the list begins at its first row

function show(row) {
  panel.setAttribute("hx-swap", row.dataset.row === open ? "innerMorph" : "innerHTML"); // what was typed about this one stays, and is not said of another
  [open, before] = [row.dataset.row, row.dataset.mark];
  panel.setAttribute("hx-get", panel.dataset.detail + open);
  window.htmx.trigger(panel, "again");
  mark();
}

function mark() { for (const row of rows()) row.ariaSelected = row.dataset.row === open || null; }

document.addEventListener("click", ({ target }) => {
  const row = target.closest("tr[data-row]");
  if (!panel || !row || target.closest("input, a, button:not(.a-open)")) return;
  show(row);
  revealed = "reveals" in panel.dataset;
});

document.addEventListener("htmx:after:swap", ({ target }) => {
  const [first] = rows();
  if (target === panel) {
    if (shown !== open) panel.querySelector(".scroll")?.scrollTo(0, 0);
    shown = open;
    if (revealed && panel.getBoundingClientRect().top > innerHeight - 80) panel.scrollIntoView({ block: "start" }); // on a phone it stands below the list
    revealed = false;
  } else if (first ? target.contains(first) : target.dataset.renewed === "list") {
    const row = open ? rows().find((one) => one.dataset.row === open) : first;
    if (shown && !row) window.htmx.trigger(panel, "again"); // it stands in another list now, or is over: the panel says which
    row && (!open || row.dataset.mark !== before) ? show(row) : mark();
  }
});

if (rows().length) addEventListener("DOMContentLoaded", () => show(rows()[0])); // htmx begins then, too
