// A sequence: the active step stays in view, and whose permissives are shown is chosen. Everything is drawn by the server, in parts that are
// fetched again when what they are made of changes.
const word = document.querySelector(".q-word"), list = document.getElementById("q-steps");

/** Scroll the list, and nothing else, to a row; below it the abort conditions keep their place. */
function reveal(row) {
  if (!list || list.scrollHeight <= list.clientHeight) return;
  const head = list.querySelector("thead")?.offsetHeight ?? 0, foot = list.querySelector(".q-abort")?.offsetHeight ?? 0;
  const top = row.offsetTop - head, bottom = row.offsetTop + row.offsetHeight + foot - list.clientHeight;
  if (list.scrollTop > top) list.scrollTop = top;
  else if (list.scrollTop < bottom) list.scrollTop = bottom;
}

/** The rows of active steps are the selected ones (which htmx leaves alone), that of the chosen one has a frame. */
function mark() {
  const chosen = document.querySelector(".q-asked[name=step]")?.value;
  for (const row of document.querySelectorAll("[data-row-step]")) {
    const active = "active" in row.dataset, entered = active && row.ariaSelected !== "true";
    row.ariaSelected = active || null;
    row.classList.toggle("chosen", row.dataset.rowStep === chosen);
    if (entered) reveal(row);
  }
}
document.addEventListener("htmx:after:swap", mark);
mark();

// ---- which permissives are shown ---------------------------------------------------------------------------------------------------------

document.addEventListener("click", (event) => {
  const [name, value] = event.target.closest?.("[data-asks]")?.dataset.asks.split("=") ?? [];
  if (!word || !name || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  document.querySelector(`.q-asked[name=${name}]`).value = value; // beside the part: an answer to what was asked before leaves it
  window.htmx.trigger(word, "again");
  if (name === "step" && getComputedStyle(word.parentElement).display === "block") word.scrollIntoView({ block: "nearest" });
});
