// A button with `data-held-press` counts only when it was held for a moment, by finger, mouse or key: what it confirms is no slip.
const MOMENT = 1000; // [ms]
let timer = 0, counts = null; // the button that has been held long enough

const of = (event) => event.target.closest?.("[data-held-press]");

function begin(button) {
  end();
  button.dataset.pressed = "";
  timer = setTimeout(() => {
    end();
    counts = button;
    button.form.requestSubmit(button);
    counts = null;
  }, MOMENT);
}

function end() {
  clearTimeout(timer);
  for (const button of document.querySelectorAll("[data-pressed]")) delete button.dataset.pressed;
}

document.addEventListener("pointerdown", (event) => { const button = of(event); if (button && event.button === 0) begin(button); });
document.addEventListener("keydown", (event) => {
  if (!of(event) || !["Enter", " "].includes(event.key)) return;
  event.preventDefault();
  if (!event.repeat) begin(of(event));
});
for (const name of ["pointerup", "pointercancel", "keyup", "blur"]) window.addEventListener(name, end);
document.addEventListener("contextmenu", (event) => { if (of(event)) event.preventDefault(); }); // a finger that rests opens one

// A click, or Enter in a field, is too short: nothing is sent, and the dialog says what is missing.
window.addEventListener("submit", (event) => {
  const button = event.submitter;
  if (!button?.matches("[data-held-press]") || button === counts) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  const hint = event.target.querySelector("[data-hint]");
  if (hint) hint.textContent = button.dataset.heldPress;
}, true);
