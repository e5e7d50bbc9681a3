// The parameter page: the server reviews what is typed; here rows are found, wrong ones are marked, and nothing that was typed gets lost.
import { quiet } from "./commands.js";

const lang = document.body.dataset.lang, rows = [...document.querySelectorAll("tr[data-key]")], search = document.querySelector("[data-filter]");
let group = "";

document.addEventListener("htmx:after:swap", () => {
  for (const field of document.querySelectorAll("[data-new]")) {
    const line = document.querySelector(`[data-change="${CSS.escape(field.name)}"]`);
    field.ariaInvalid = line && String(line.matches(".rv-bad"));
  }
});
document.addEventListener("htmx:after:request", ({ detail: { ctx } }) => { if (ctx.sourceElement.matches("#p-form")) quiet(3000); });
addEventListener("beforeunload", (event) => { if (document.querySelector("[data-dirty]")) event.preventDefault(); });

// ---- groups and filter --------------------------------------------------------------------------------------------------------------

function filter() {
  const words = search.value.toLocaleLowerCase(lang).split(/\s+/).filter(Boolean);
  for (const row of rows) {
    const text = `${row.dataset.mark} ${row.dataset.name} ${row.querySelector(".val b").textContent}`.toLocaleLowerCase(lang);
    row.hidden = (group !== "" && row.parentElement.dataset.group !== group) || !words.every((word) => text.includes(word));
  }
}
search.addEventListener("input", filter);

document.addEventListener("click", (event) => {
  const link = event.target.closest?.(".p-nav [data-group]");
  if (!link) return;
  event.preventDefault();
  group = link.dataset.group;
  for (const other of document.querySelectorAll(".p-nav a")) other === link ? other.setAttribute("aria-current", "true") : other.removeAttribute("aria-current");
  history.replaceState(null, "", link.getAttribute("href"));
  filter();
});
const named = document.querySelector(`.p-nav [data-group="${CSS.escape(decodeURIComponent(location.hash.slice(1)))}"]`);
if (named && location.hash) named.click();
