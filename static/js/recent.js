// The last ten minutes of a page: what sparklines show before the page was opened, and the small trend of a machine. One request for all.
import { answered } from "./fetched.js";
import { now, page } from "./values.js";

const SPAN = 600e6, AGAIN = 60000, LIMIT = 15000;
const { lang, zone } = page;
let heard = 0;

/** What the history answers; null when it does not. */
async function ask(path) {
  const answer = await answered(path, { limit: LIMIT });
  return answer?.ok ? JSON.parse(answer.text) : null;
}

/** Give the sparklines on the page their past. */
async function sparklines() {
  const names = [...new Set([...document.querySelectorAll("[data-line]")].map((line) => line.dataset.tag))].slice(0, 200);
  const detail = names.length ? await ask(`/trends/recent?tags=${names.join(",")}`) : null; // the history is down: the curves grow from what arrives
  if (detail) document.dispatchEvent(new CustomEvent("pogon:past", { detail }));
}

function panel(element, Chart) {
  const pens = JSON.parse(element.dataset.panel);
  const chart = new Chart(element, pens, { zone, lang, mini: true, texts: {} });
  const load = async () => {
    const width = Math.max(100, element.clientWidth - 60), to = now();
    const got = await ask(`/history/series?tags=${pens.map((pen) => pen.tag).join(",")}&from=${to - SPAN}&to=${to}&width=${width}`);
    if (got) chart.take(got);
    element.dataset.state = got ? "ready" : "error";
    draw();
  };
  const draw = () => {
    Object.assign(chart, { from: now() - SPAN, to: now(), now: now(), holds: document.body.dataset.live !== "offline" });
    chart.draw();
  };
  chart.follow(now);
  setInterval(() => { if (!document.hidden && document.body.dataset.live !== "offline") draw(); }, 500);
  return load;
}

let panels = [], since = 0;

/** The program that draws curves comes only to pages that have some. */
async function begin() {
  const elements = [...document.querySelectorAll("[data-panel]")];
  if (!elements.length) return;
  const { Chart } = await import("./chart.js");
  panels = elements.map((element) => panel(element, Chart));
  for (const load of panels) load();
}

function loadAll() {
  sparklines();
  for (const load of panels) load();
}

document.addEventListener("pogon:frame", () => {
  const first = !heard, back = performance.now() - heard > 3000;
  heard = performance.now();
  if (first) begin();
  if (first || back || performance.now() - since > AGAIN) { since = performance.now(); loadAll(); }
});
document.addEventListener("pogon:drawn", () => sparklines());
document.addEventListener("visibilitychange", () => { if (!document.hidden && heard) loadAll(); });
