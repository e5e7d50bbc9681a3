// A sequence: which step is active, how many permissives are there, whose permissives are shown. Everything else is drawn by the server, in
// parts that are fetched again when what they are made of changes.
const word = document.querySelector(".q-word"), list = document.getElementById("q-steps");
const CHECK = '<svg class="ic"><use href="{}"/></svg>';
const check = document.querySelector(".q-list [href*='#i-check']")?.getAttribute("href");
const usable = (tag) => tag && tag.state !== "bad" && tag.state !== "none" && typeof tag.value === "number";
const valued = (tag) => (usable(tag) ? tag.value : null);
const ones = (value) => { let n = 0; for (let rest = value & 0xffff; rest; rest &= rest - 1) n++; return n; };

/** The box and the number of a word: a check when nothing is missing, F while something is forced, else empty and heavy. */
function tally(link, detail) {
  const tags = Object.entries(detail), of = (end) => tags.find(([key]) => key.endsWith(end))?.[1];
  const known = valued(of("_word")), forced = valued(of("_forced")) ?? 0;
  const count = known === null ? null : ones(known), box = link.querySelector(".tickbox"), text = link.querySelector(".num");
  box.className = `tickbox${count === null ? "" : forced ? " f" : count < 16 ? " no" : ""}`;
  if (count === null) box.textContent = "?";
  else if (forced) box.textContent = "F";
  else if (count < 16) box.textContent = "";
  else if (check) box.innerHTML = CHECK.replace("{}", check);
  text.textContent = `${count ?? "?"}/16`;
  text.classList.toggle("miss", count !== null && count < 16);
  link.setAttribute("aria-label", link.dataset.says.replace("{n}", count ?? "?"));
}

/** The row of the active step is the selected one, and in view. */
function mark(row, detail) {
  const state = valued(Object.values(detail)[0]), active = [1, 2, 4, 5, 6].includes(state);
  if (active === (row.getAttribute("aria-selected") === "true")) return;
  active ? row.setAttribute("aria-selected", "true") : row.removeAttribute("aria-selected");
  if (active) reveal(row);
}

/** Scroll the list, and nothing else, to a row; below it the abort conditions keep their place. */
function reveal(row) {
  if (!list || list.scrollHeight <= list.clientHeight) return;
  const head = list.querySelector("thead")?.offsetHeight ?? 0, foot = list.querySelector(".q-abort")?.offsetHeight ?? 0;
  const top = row.offsetTop - head, bottom = row.offsetTop + row.offsetHeight + foot - list.clientHeight;
  if (list.scrollTop > top) list.scrollTop = top;
  else if (list.scrollTop < bottom) list.scrollTop = bottom;
}

document.addEventListener("tags", ({ target, detail }) => {
  if (target.matches(".q-perm")) tally(target, detail);
  else if (target.dataset.rowStep) mark(target, detail);
});

// ---- which permissives are shown ---------------------------------------------------------------------------------------------------------

document.addEventListener("click", (event) => {
  const [name, value] = event.target.closest?.("[data-asks]")?.dataset.asks.split("=") ?? [];
  if (!word || !name || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  document.querySelector(`.q-asked[name=${name}]`).value = value; // beside the part: an answer to what was asked before leaves it
  window.htmx.trigger(word, "again");
  if (name === "step" && getComputedStyle(word.parentElement).display === "block") word.scrollIntoView({ block: "nearest" });
});

document.addEventListener("htmx:after:swap", () => {
  const chosen = document.querySelector(".q-asked[name=step]")?.value;
  for (const row of document.querySelectorAll("[data-row-step]")) row.classList.toggle("chosen", row.dataset.rowStep === chosen);
});

// ---- steps or statistics -------------------------------------------------------------------------------------------------------------------

const tabs = [...document.querySelectorAll(".q-tabs [role=tab]")];

function choose(tab) {
  for (const one of tabs) {
    const on = one === tab;
    one.setAttribute("aria-selected", String(on));
    one.tabIndex = on ? 0 : -1;
    document.getElementById(one.getAttribute("aria-controls")).hidden = !on;
  }
}

for (const tab of tabs) {
  tab.addEventListener("click", () => choose(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = tabs[(tabs.indexOf(tab) + step + tabs.length) % tabs.length];
    choose(next);
    next.focus();
  });
}

const active = list?.querySelector("[aria-selected=true]");
if (active) reveal(active);
