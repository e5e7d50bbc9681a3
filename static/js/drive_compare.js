// A parameter file goes to the server in pieces, because no request is long; the answer to the last one is the comparison.
import { answered, parsed } from "./fetched.js";

const form = document.querySelector("[data-compare-file]"), said = form.querySelector("[data-said]"), pick = form.querySelector("[type=file]");

const say = (text) => { said.textContent = text; said.hidden = !text; };

/** `text` as a form sends it, in pieces of at most `most` signs; none ends within a character. */
const pieces = (text, most) => String(new URLSearchParams({ text })).slice("text=".length).match(new RegExp(`.{1,${most}}(?<!%.?)(?!%[89AB])`, "g")) ?? [""];

async function send(file) {
  const text = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(await file.arrayBuffer()), parts = pieces(text, form.dataset.piece);
  for (const [n, part] of parts.entries()) {
    const fields = new URLSearchParams(`text=${part}&part=${n + 1}&parts=${parts.length}`);
    fields.append("name", file.name);
    const answer = await answered(form.action, { fields, limit: 60000 });
    if (!answer?.ok) return say(parsed(answer?.text ?? "").body.textContent.trim().slice(0, 200) || form.dataset.failed);
  }
  location.assign(form.elements.next.value);
}

pick.addEventListener("change", async () => {
  const [file] = pick.files;
  if (!file) return;
  form.querySelector("[data-chosen]").textContent = file.name;
  say("");
  if (file.size > Number(form.dataset.largest)) return say(form.dataset.large.replace("{}", file.size));
  pick.disabled = true;
  await send(file).catch((error) => say(error instanceof TypeError ? form.dataset.encoding : form.dataset.failed));
  pick.disabled = false;
  pick.value = "";
});
