// A list of what machines did (product passages, runs): htmx fetches it again when it changes; the chosen row is shown beside it.
const panel = document.getElementById("event-detail");
const list = () => document.getElementById("event-list");
const rows = () => [...(list()?.querySelectorAll("tr[data-row]") ?? [])];
let open = "", shown = "", before = "", revealed = false;

function show(row) {
  open = row.dataset.row;
  before = row.dataset.mark;
  for (const one of rows()) one === row ? one.setAttribute("aria-selected", "true") : one.removeAttribute("aria-selected");
  panel.setAttribute("hx-get", `${list().dataset.detail}${open}`);
  window.htmx.trigger(panel, "again");
}

document.addEventListener("click", ({ target }) => {
  const row = target.closest("#event-list tr[data-row]");
  if (!row || target.closest("a")) return;
  show(row);
  revealed = true;
});

document.addEventListener("htmx:after:swap", ({ target }) => {
  if (target === panel) {
    if (shown !== open) panel.querySelector(".scroll")?.scrollTo(0, 0);
    shown = open;
    if (revealed && panel.getBoundingClientRect().top > innerHeight - 80) panel.scrollIntoView({ block: "start" }); // on a phone it stands below the list
    revealed = false;
  } else if (panel && rows().length) {
    const row = rows().find((one) => one.dataset.row === open);
    if (open ? row && row.dataset.mark !== before : true) show(row ?? rows()[0]);
  }
});

if (panel && rows().length) addEventListener("DOMContentLoaded", () => show(rows()[0])); // htmx begins then, too
