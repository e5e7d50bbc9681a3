// Forms whose answer draws parts of the page anew; an order (data-order) gets an identity and a fresh nonce first. While somebody types into
// a part it stays as it is.
import * as commands from "./commands.js";

const partOf = (element) => element.closest("form")?.closest("[data-part]");
const said = (form) => commands.textsOf(form).no_answer;

document.addEventListener("input", ({ target }) => {
  if (target.closest?.("form[data-parts]")) partOf(target).dataset.dirty = "";
});

document.addEventListener("submit", async (event) => {
  const form = event.target.closest?.("form[data-parts]");
  if (!form) return;
  event.preventDefault();
  const why = form.querySelector("[data-why]");
  if (form.querySelector("[aria-disabled=true]")) {
    if (why) commands.told(why.textContent.trim(), "error");
    return;
  }
  if (form.dataset.busy !== undefined) return;
  form.dataset.busy = "";
  const fields = Object.fromEntries(new FormData(form));
  if (form.dataset.order !== undefined) {
    form.dataset.identity ||= commands.identity();
    Object.assign(fields, { id: form.dataset.identity, nonce: await commands.nonce() });
  }
  const answer = await commands.post(form.getAttribute("action"), fields, 20000);
  delete form.dataset.busy;
  if (!answer) return commands.told(said(form), "error");
  if (answer.ok) { // the order was taken, or its part says why not
    delete form.dataset.identity;
    delete partOf(form)?.dataset.dirty;
  }
  commands.take(answer, form);
});
