// Forms of people: showing a password while it is typed, the caps-lock hint, buttons that leave fields out.
document.addEventListener("click", ({ target }) => {
  const button = target.closest?.("[data-reveal]");
  if (!button) return;
  const field = document.getElementById(button.dataset.reveal), shown = field.type === "text";
  field.type = shown ? "password" : "text";
  button.setAttribute("aria-pressed", String(!shown));
  field.focus();
});
const hint = document.querySelector("[data-caps]");
for (const kind of ["keydown", "keyup"])
  document.addEventListener(kind, (event) => {
    if (hint && event.target.matches?.('input[name="password"], input[name="again"], input[name="current"]'))
      hint.hidden = !event.getModifierState?.("CapsLock");
  });
document.addEventListener("submit", (event) => {
  const left = event.submitter?.dataset.without;
  if (left) for (const field of event.target.querySelectorAll(`[name="${left}"]`)) field.disabled = true;
  for (const { dataset } of event.target.querySelectorAll("[data-reveal]")) document.getElementById(dataset.reveal).type = "password";
});
