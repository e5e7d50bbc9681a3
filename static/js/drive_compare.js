// A parameter file goes to the server in pieces, because no request is long; the answer to the last one is the comparison.
const form = document.querySelector("[data-compare-file]"), said = form.querySelector("[data-said]"), pick = form.querySelector("[type=file]");

const say = (text) => { said.textContent = text; said.hidden = !text; };

const pieces = (text, most) => { // a character may take nine signs on its way
  const found = [""];
  let length = 0;
  for (const sign of text) {
    const more = /[\w.\-*]/.test(sign) ? 1 : encodeURIComponent(sign).length;
    if (length + more > most) { found.push(""); length = 0; }
    found[found.length - 1] += sign;
    length += more;
  }
  return found;
};

pick.addEventListener("change", async () => {
  const [file] = pick.files;
  if (!file) return;
  form.querySelector("[data-chosen]").textContent = file.name;
  say("");
  if (file.size > Number(form.dataset.largest)) return say(form.dataset.large.replace("{}", file.size));
  pick.disabled = true;
  try {
    const bytes = new Uint8Array(await file.arrayBuffer());
    let text; try { text = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes); } catch { return say(form.dataset.encoding); }
    const parts = pieces(text, Number(form.dataset.piece));
    for (const [n, part] of parts.entries()) {
      const body = new URLSearchParams({ csrf: form.elements.csrf.value, text: part, name: file.name, part: n + 1, parts: parts.length });
      const answer = await fetch(form.action, { method: "POST", body, headers: { "HX-Request": "true" } });
      if (!answer.ok) return say((await answer.text()).replace(/<[^>]*>/g, " ").trim().slice(0, 200) || form.dataset.failed);
    }
    location.assign(form.elements.next.value);
  } catch {
    say(form.dataset.failed);
  } finally {
    pick.disabled = false;
    pick.value = "";
  }
});
