// Panel mode: a screen that is only touched gets its keys from the page itself. A field that takes a number gets a numeric keypad, any
// other one a keyboard in the letters of the language. Both write into the field as a keyboard does, and leave Stop and alarms in sight.
const place = document.getElementById("keypad"), [name, value, keys] = place.querySelectorAll("span, output, .kp-keys");
const FIELDS = "input:not([type=checkbox], [type=radio], [type=file], [type=hidden], [type=submit]), textarea";
let field = null, kind = "", upper = false, signs = false;

const numeric = (one) => one.type === "number" || ["decimal", "numeric"].includes(one.dataset.mode) || one.classList.contains("moment");

document.addEventListener("focusin", ({ target }) => {
  if (!target.matches?.(FIELDS) || target.readOnly || target.disabled) return hide();
  target.dataset.mode ??= target.getAttribute("inputmode") ?? "";
  target.inputMode = "none"; // the keys of the system stay away
  field = target;
  kind = numeric(field) ? "number" : "text";
  upper = signs = false;
  if (kind === "number" && !field.classList.contains("moment")) field.select();
  draw();
});
document.addEventListener("focusout", ({ relatedTarget }) => { if (!relatedTarget?.matches?.(FIELDS)) hide(); });
document.addEventListener("input", ({ target }) => { if (target === field) told(); });
document.querySelector("[data-go-back]")?.addEventListener("click", () => history.back());
if (document.activeElement?.matches(FIELDS)) document.activeElement.dispatchEvent(new FocusEvent("focusin", { bubbles: true }));

function hide() {
  field = null;
  place.hidden = true;
  delete document.body.dataset.keypad;
}

/** The keys that fit the field: digits with or without a fraction, a moment, letters, signs or, with ▲, the rarer ones. */
function layout() {
  if (kind === "text") return !signs ? "letters" : upper ? "more" : "signs";
  if (field.classList.contains("moment")) return "moment";
  return field.dataset.mode === "numeric" || field.type === "number" ? "whole" : "number";
}

function draw() {
  name.textContent = field.labels?.[0]?.innerText.trim() || field.getAttribute("aria-label") || field.placeholder || "";
  keys.replaceChildren(document.querySelector(`[data-layout=${layout()}]`).content.cloneNode(true));
  if (upper && !signs) for (const button of keys.querySelectorAll("[data-key]")) button.textContent = button.dataset.key = button.dataset.key.toUpperCase();
  keys.querySelector("[data-key='▲']")?.setAttribute("aria-pressed", String(upper));
  place.dataset.kind = kind;
  place.hidden = false;
  place.removeAttribute("data-seen");
  place.toggleAttribute("data-seen", kind === "text" && seen());
  document.body.dataset.keypad = kind;
  told();
  field.scrollIntoView({ block: "nearest" });
}

/** The field itself is in sight: what it says need not be said again. */
function seen() {
  const { left, top, width, height } = field.getBoundingClientRect();
  return document.elementFromPoint(left + width / 2, top + height / 2) === field;
}

/** What is typed, above the keys: they may lie over the field. */
function told() {
  if (field) value.textContent = field.type === "password" ? "•".repeat(field.value.length) : field.value;
}

place.addEventListener("pointerdown", (event) => event.preventDefault()); // the field keeps the focus
place.addEventListener("click", ({ target }) => {
  const sign = target.closest("[data-key]")?.dataset.key;
  if (!sign || !field) return;
  if (sign === "×") return field.blur();
  if (sign === "✓") return enter();
  if (sign === "▲" || sign === "123" || sign === "abc") {
    if (sign === "▲") upper = !upper; else [signs, upper] = [!signs, false];
    return draw();
  }
  write(sign === "—" ? " " : sign);
  if (upper) { upper = false; draw(); }
});

/** Put `sign` where the cursor is, as a key does. */
function write(sign) {
  const { value, maxLength } = field, whole = field.type === "number"; // such a field tells no cursor
  let from = whole ? value.length : field.selectionStart, to = whole ? value.length : field.selectionEnd, put = sign;
  if (whole && field.fresh !== value && sign !== "←") from = 0; // the first digit takes the place of what was there
  if (sign === "C" && kind === "number") [from, to, put] = [0, value.length, ""];
  else if (sign === "±") [from, to, put] = /^[-−]/.test(value) ? [0, 1, ""] : [0, 0, "-"];
  else if (sign === "←") [from, put] = [from === to ? Math.max(0, from - 1) : from, ""];
  const next = value.slice(0, from) + put + value.slice(to);
  if (maxLength >= 0 && next.length > maxLength && next.length > value.length) return;
  field.value = next;
  field.fresh = field.value;
  const at = sign === "±" ? next.length : from + put.length;
  if (!whole) field.setSelectionRange(at, at);
  field.dispatchEvent(new Event("input", { bubbles: true }));
}

function enter() {
  const down = new KeyboardEvent("keydown", { key: "Enter", bubbles: true, cancelable: true }), { form } = field;
  const go = field.dispatchEvent(down);
  if (!field) return; // the press closed what it was in
  if (field.matches("textarea")) return write("\n");
  field.dispatchEvent(new Event("change", { bubbles: true }));
  if (go && form) form.requestSubmit();
  if (go) field?.blur();
}
