// The last ten minutes of a page: what sparklines show before the page was opened, and the small trend of a machine. One request for all.
import { answered } from "./fetched.js";
import { page } from "./values.js";

const SPAN = 600e6, AGAIN = 60000, LIMIT = 15000;
const { lang, zone } = page;
let heard = [0, 0];
const now = () => heard[0] + (performance.now() - heard[1]) * 1000;

/** What the history answers; an error when it does not. */
async function ask(path) {
  const answer = await answered(path, { limit: LIMIT });
  if (!answer?.ok) throw new Error(path);
  return JSON.parse(answer.text);
}

/** Give the sparklines on the page their past. */
export async function sparklines(root = document) {
  const names = [...new Set([...root.querySelectorAll("[data-line]")].map((line) => line.dataset.tag))].slice(0, 200);
  if (!names.length) return;
  try {
    document.dispatchEvent(new CustomEvent("pogon:past", { detail: await ask(`/trends/recent?tags=${names.join(",")}`) }));
  } catch { /* the history is down: the curves grow from what arrives */ }
}

function panel(element, Chart) {
  const pens = JSON.parse(element.dataset.panel);
  const chart = new Chart(element, pens, { zone, lang, mini: true, texts: {} });
  const load = async () => {
    const width = Math.max(100, element.clientWidth - 60), to = Math.ceil(now());
    try {
      chart.take(await ask(`/history/series?tags=${pens.map((pen) => pen.tag).join(",")}&from=${to - SPAN}&to=${to}&width=${width}`));
      element.dataset.state = "ready";
    } catch {
      element.dataset.state = "error";
    }
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

let panels = [];

/** The program that draws curves comes only to pages that have some. */
async function begin() {
  const elements = [...document.querySelectorAll("[data-panel]")];
  if (!elements.length) return;
  const { Chart } = await import("./chart.js");
  panels = elements.map((element) => panel(element, Chart));
  for (const load of panels) load();
}

const loadAll = () => { sparklines(); for (const load of panels) load(); };
let since = 0;
document.addEventListener("pogon:frame", ({ detail }) => {
  const first = !heard[0], back = performance.now() - heard[1] > 3000;
  heard = [detail.time, performance.now()];
  if (first) begin();
  if (first || back || performance.now() - since > AGAIN) { since = performance.now(); loadAll(); }
});
document.addEventListener("pogon:drawn", () => sparklines());
document.addEventListener("visibilitychange", () => { if (!document.hidden && heard[0]) loadAll(); });
