// Orders to a drive (data-order): each gets an identity and a fresh nonce before htmx sends its form; tried again it is the same order.
// While somebody types into a part of the page that is drawn anew, it stays as it is.
import { identity, nonce } from "./commands.js";

document.addEventListener("input", ({ target }) => {
  const part = target.closest?.("form[data-order]")?.closest("[data-part]");
  if (part) part.dataset.dirty = "";
});

document.addEventListener("submit", async (event) => {
  const form = event.target.closest?.("form[data-order]");
  if (!form || form.dataset.ready !== undefined) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  if (form.dataset.busy !== undefined) return;
  form.dataset.busy = "";
  form.elements.id.value ||= identity();
  form.elements.nonce.value = await nonce();
  form.dataset.ready = "";
  form.requestSubmit(event.submitter);
  delete form.dataset.ready;
  delete form.dataset.busy;
}, true);
