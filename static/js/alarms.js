// Alarms on every page: banner, sound, silence, announcements, marks on tabs, tiles and pointers. The list is alarm_list.js.
//   #alarm-changes, #alarm-sound, #alarm-news   data-signal: told by static/js/values.js when their tag changes
//   data-mark-of | data-mark-area | data-mark-part | data-mark-point | data-mark-pointer   gets the symbol of the most important alarm of a
//                                 machine, an area, a part, a point (that on a pointer flashes)

const banner = document.getElementById("alarms");
const GUARD = 500, SILENCE = 5 * 60e3, POLITE = 5000, KEY = "pogon.silence";
let drawn = performance.now(); // when the banner's alarm last changed

// ---- marks ----------------------------------------------------------------------------------------------------

function symbol(priority, state, look) {
  const svg = document.getElementById("signs").content.querySelector(`.alm-${priority}`).cloneNode(true);
  svg.dataset.state = state;
  if (look) svg.classList.add(look);
  return svg;
}

/** Draw the marks that the banner brought; a sign that did not change stays as it is, so that nothing starts to flash anew. */
export function mark() {
  const now = banner.querySelector("[data-marks]");
  if (!now) return;
  const marks = JSON.parse(now.dataset.marks);
  for (const [name, table, still] of [["of", "of"], ["area", "area", true], ["part", "part", true], ["point", "point", true], ["pointer", "point"]])
    for (const place of document.querySelectorAll(`[data-mark-${name}]`)) {
      const found = marks[table][place.getAttribute(`data-mark-${name}`)];
      const state = found && (still && found[1] === "unack" ? "ack" : found[1]), is = found ? `${found[0]}${state}` : "";
      if (place.dataset.mark === is) continue;
      place.dataset.mark = is;
      place.replaceChildren(...(found ? [symbol(found[0], state, place.dataset.look)] : []));
    }
}

// ---- the banner -----------------------------------------------------------------------------------------------

const inside = document.getElementById("banner");
const shown = () => inside?.querySelector("[data-marks]")?.dataset ?? {};
let occurrence = shown().occurrence;

document.addEventListener("htmx:after:swap", ({ target }) => {
  if (target === inside) {
    if (shown().occurrence !== occurrence) drawn = performance.now();
    occurrence = shown().occurrence;
    announce();
  }
  mark();
});

// What is acknowledged is the very alarm that the banner shows; a press right after it changed was meant for another one.
banner.addEventListener("submit", (event) => {
  if (shown().occurrence === occurrence && performance.now() - drawn >= GUARD) return;
  event.preventDefault();
  event.stopPropagation();
  window.pogon.say(banner.dataset.moved);
}, true);

document.addEventListener("keydown", (event) => {
  if (event.key !== "F8" || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
  if (document.querySelector("dialog[open]")) return;
  event.preventDefault();
  const ack = document.querySelector("#ack-selected:not([aria-disabled=true])") ?? document.getElementById("banner-ack");
  ack ? ack.click() : window.pogon.say(shown().without);
});

// ---- announcements ----------------------------------------------------------------------------------------------

const news = document.getElementById("alarm-news");
let announced = news?.dataset.signal, politeAt = -POLITE, politeTimer = 0;

function announce() {
  const { text, priority } = shown();
  if (!text || news.dataset.signal === announced) return;
  announced = news.dataset.signal;
  const line = banner.dataset.announce.replace("{prio}", priority).replace("{text}", text);
  if (priority <= 2) document.getElementById("alarm-alert").textContent = line;
  else {
    clearTimeout(politeTimer);
    politeTimer = setTimeout(() => {
      politeAt = performance.now();
      document.getElementById("alarm-status").textContent = line;
    }, Math.max(0, politeAt + POLITE - performance.now()));
  }
}

// ---- sound: one tone per priority, as long as something waits ------------------------------------------------------

const TONES = { // beeps [Hz, start s, length s] and how often they come [s]
  1: { every: 1, beeps: [[1000, 0, 0.22], [760, 0.24, 0.22], [1000, 0.48, 0.22]] },
  2: { every: 2, beeps: [[820, 0, 0.2], [820, 0.3, 0.2]] },
  3: { every: 4, beeps: [[620, 0, 0.25]] },
  4: { every: 8, beeps: [[440, 0, 0.2]] },
};
const button = document.getElementById("silence"), level = document.getElementById("alarm-sound");
let context = null, sounding = 0, loop = 0, mine = !navigator.locks, turn = null, fresh = true;

/** Of several tabs one sounds: never one that the browser keeps silent, and the one that somebody looks at before those behind it. */
function claim(seen = fresh && !document.hidden) {
  if (context?.state !== "running") return turn?.abort(); // another one may be able to
  if (!navigator.locks || (turn && (mine || !seen))) return;
  turn?.abort();
  const here = turn = new AbortController(), { signal } = here, end = new Promise((done) => { signal.onabort = done; });
  const has = (is) => { if (turn === here) { [mine, turn] = [is, is ? here : null]; listen(); } };
  fresh = false;
  navigator.locks.request("pogon.sound", seen ? { steal: true } : { signal }, () => has(true) ?? end).catch(() => {}).then(() => has(false));
}

function silence() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "null");
    const left = kept ? kept.until - Date.now() : 0; // more than that is none: the clock was set back
    return left > 0 && left <= SILENCE && kept.news === news.dataset.signal ? kept : null;
  } catch { return null; }
}

function beep() {
  if (context?.state !== "running") return;
  for (const [pitch, start, length] of TONES[sounding].beeps) {
    const tone = context.createOscillator(), volume = context.createGain(), at = context.currentTime + start;
    tone.frequency.value = pitch;
    tone.type = "triangle";
    volume.gain.setValueCurveAtTime([0, ...Array(8).fill(0.25), 0], at, length);
    tone.connect(volume).connect(context.destination);
    tone.start(at);
    tone.stop(at + length);
  }
}

/** Bring sound, button and its words to what is true now; a page beside the sign-in has none of them. */
function listen() {
  if (!level || !button) return;
  const wanted = Number(level.dataset.signal) || 0, quiet = silence();
  if (wanted && "sound" in banner.dataset) try { context ??= new AudioContext(); } catch { /* no audio here */ }
  claim();
  const blocked = Boolean(wanted) && !quiet && context !== null && context.state !== "running";
  const next = wanted && !quiet && mine && "sound" in banner.dataset ? wanted : 0;
  if (next !== sounding) {
    clearInterval(loop);
    sounding = next;
    if (next) {
      beep();
      loop = setInterval(beep, TONES[next].every * 1000);
    }
  }
  button.toggleAttribute("data-idle", !wanted);
  button.toggleAttribute("data-blocked", blocked);
  button.setAttribute("aria-pressed", String(Boolean(quiet && wanted)));
  const words = blocked ? banner.dataset.blocked : quiet && wanted ? banner.dataset.silent : "";
  const spoken = button.querySelector("[data-sound-state]");
  if (spoken.textContent !== words) spoken.textContent = words;
  button.title = words || button.getAttribute("aria-label");
}

button?.addEventListener("click", () => {
  if (context && context.state !== "running") return; // the press itself lets the browser sound
  const quiet = silence();
  try { localStorage.setItem(KEY, JSON.stringify(quiet ? null : { until: Date.now() + SILENCE, news: news.dataset.signal })); } catch { /* private window */ }
  listen();
});
for (const gesture of ["pointerdown", "keydown"])
  document.addEventListener(gesture, () => {
    if (context && context.state !== "running") context.resume().then(() => { claim(true); if (sounding) beep(); listen(); });
  }, { capture: true });
addEventListener("storage", ({ key }) => key === KEY && listen());
document.addEventListener("visibilitychange", () => { if (!document.hidden) claim(true); });
setInterval(listen, 1000); // silence ends by itself

// ---- what the tags say --------------------------------------------------------------------------------------------

level?.addEventListener("signal", listen);
news?.addEventListener("signal", listen);
document.addEventListener("pogon:drawn", mark);
mark();
listen();

