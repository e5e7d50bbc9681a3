// The definition of a sequence while it is edited: the answer to what was sent before takes nothing away that was typed since.
// An input's default is what the server knows of it; what differs from that was typed by the person and not sent yet.
const text = () => document.getElementById("ed-text");
const inputs = (form) => [...(form?.querySelectorAll("input[id]:not([type=hidden]), select[id]") ?? [])];
const settled = (one) => (one.matches("select") ? [...one.options].find((option) => option.defaultSelected)?.value ?? "" : one.defaultValue);

/** The server took `value` of an input: from here on that is what it knows. */
function settle(one, value) {
  if (one.matches("select")) for (const option of one.options) option.defaultSelected = option.value === value;
  else {
    const shown = one.value;
    one.defaultValue = value;
    if (one.value !== shown) one.value = shown;
  }
}

/** Where `now` differs from `base`: [from, to) of base, and what stands there instead. */
function change(base, now) {
  let from = 0, tail = 0;
  const most = Math.min(base.length, now.length);
  while (from < most && base[from] === now[from]) from++;
  while (tail < most - from && base[base.length - 1 - tail] === now[now.length - 1 - tail]) tail++;
  return { from, to: base.length - tail, text: now.slice(from, now.length - tail) };
}

/** What was typed into `base`, in `theirs` as well; where both changed the same place, what was typed. `at` moves along. */
function merged(base, theirs, mine, at) {
  const typed = change(base, mine), other = change(base, theirs), shift = other.text.length - (other.to - other.from);
  if (typed.to <= other.from) return { text: theirs.slice(0, typed.from) + typed.text + theirs.slice(typed.to), at };
  if (other.to > typed.from) return { text: mine, at };
  const [from, to] = [typed.from + shift, typed.to + shift];
  return { text: theirs.slice(0, from) + typed.text + theirs.slice(to), at: at + shift };
}

/** The text as the form made it, in place: who types there keeps the cursor and what was typed. */
function renew(area, fresh) {
  const theirs = fresh.value, mine = area.value, scrolled = area.scrollTop, ends = [area.selectionStart, area.selectionEnd];
  const own = mine !== area.defaultValue;
  const result = own ? ends.map((at) => merged(area.defaultValue, theirs, mine, at)) : [{ text: theirs, at: ends[0] }, { text: theirs, at: ends[1] }];
  area.defaultValue = theirs;
  area.value = result[0].text;
  area.setSelectionRange(result[0].at, result[1].at);
  area.scrollTop = scrolled;
}

/** The form as the text made it, with what was typed into the one that it replaces; whether there was anything. */
function carry(old, fresh) {
  let any = false;
  for (const one of inputs(old)) {
    const now = fresh.querySelector(`#${CSS.escape(one.id)}`);
    if (!now || one.value === settled(one)) continue;
    now.value = one.value;
    any = true;
  }
  return any;
}

// ---- what was sent is known ----------------------------------------------------------------------------------------------------------

// Form and text are one draft, so one is asked about after the other (hx-sync), each with what stands there when its turn has come:
// what waited from a form that an answer has replaced since is carried on by the new one.
const sent = new WeakMap();
document.addEventListener("htmx:before:request", (event) => {
  const { ctx } = event.detail, source = ctx.sourceElement;
  if (!source.matches(".ed-textf, #ed-fields")) return;
  if (!source.isConnected) return void event.preventDefault();
  ctx.target = document.getElementById("ed-problems"); // the one that it was queued for may have been replaced
  ctx.request.body = new URLSearchParams(new FormData(source));
  sent.set(ctx, ctx.request.body);
});

/** Of an answer that is good: what its request said is no longer only the person's. */
function acknowledge(ctx) {
  const body = sent.get(ctx), source = ctx.sourceElement;
  if (!body || ctx.response?.status >= 400) return;
  if (source.matches(".ed-textf") && body.has("text")) text().defaultValue = body.get("text").replaceAll("\r\n", "\n");
  if (source.id === "ed-fields") for (const one of inputs(source)) if (body.has(one.name)) settle(one, body.get(one.name));
}

let kept = null;
document.addEventListener("htmx:before:swap", ({ detail: { ctx, tasks } }) => {
  if (!ctx.sourceElement?.matches(".ed-textf, #ed-fields")) return;
  acknowledge(ctx);
  for (const task of [...tasks]) {
    const area = task.fragment?.querySelector("#ed-text"), form = task.fragment?.querySelector("#ed-form");
    if (area && text()) {
      renew(text(), area);
      tasks.splice(tasks.indexOf(task), 1);
    } else if (form) {
      const focus = document.activeElement?.closest("#ed-form") ? document.activeElement : null;
      kept = { any: carry(document.getElementById("ed-form"), form), focus: focus?.id ?? "", ends: null };
      if (focus?.matches("input:not([type=checkbox])")) kept.ends = [focus.selectionStart, focus.selectionEnd];
    }
  }
});

document.addEventListener("htmx:after:swap", () => {
  if (!kept) return;
  const { any, focus, ends } = kept, one = focus && document.getElementById(focus);
  kept = null;
  if (one) {
    one.focus({ preventScroll: true });
    if (ends) one.setSelectionRange(...ends);
  }
  if (any) document.getElementById("ed-fields")?.dispatchEvent(new Event("input", { bubbles: true }));
});
