// Orders from the list of drive parameters: each gets an identity and a fresh nonce before htmx sends its form.
import * as commands from "./commands.js";

document.addEventListener("submit", async (event) => {
  const form = event.target.closest?.("form[data-order]");
  if (!form || form.dataset.ready !== undefined) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  if (form.dataset.busy !== undefined) return;
  form.dataset.busy = "";
  form.elements.id.value ||= commands.identity();
  form.elements.nonce.value = await commands.nonce();
  form.dataset.ready = "";
  form.requestSubmit();
  delete form.dataset.ready;
  delete form.dataset.busy;
}, true);
