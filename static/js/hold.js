// Hold-to-run: a machine moves only while a finger, a mouse button or the space bar holds a button, and while word of that gets through.
// An aid for operating, not a safety function. Whatever is doubtful stops: the server ends the motion 500 ms after the last keep-alive, and
// behind it stands the watchdog of the drive. Nothing here ever starts again by itself.
import * as commands from "./commands.js";
import { answered } from "./fetched.js";

const EVERY = 150, SLOW = 300, LONGEST = 30000, PAUSE = 300;
let hold = null, let_go = { at: -Infinity, name: "" };

document.addEventListener("contextmenu", (event) => { if (event.target.closest?.("[data-hold]")) event.preventDefault(); });
document.addEventListener("pointerover", ({ target }) => { if (target.closest?.("[data-hold]") && document.body.dataset.live === "live") commands.prepare(); });
document.addEventListener("focusin", ({ target }) => { if (target.matches?.("[data-hold]")) commands.prepare(); });

document.addEventListener("pointerdown", (event) => {
  if (hold) return release("both");
  const button = event.target.closest?.("[data-hold]");
  if (!button || !event.isPrimary || event.button !== 0) return;
  button.setPointerCapture(event.pointerId); // a finger that slides off would never tell that it is up
  begin(button, { pointer: event.pointerId });
}, true);

document.addEventListener("keydown", (event) => {
  if (hold && event.key !== " ") return release("both");
  const button = event.target.closest?.("[data-hold]");
  if (!button || event.key !== " ") return;
  event.preventDefault();
  if (!event.repeat && !hold) begin(button, { key: " " });
});

for (const type of ["pointerup", "pointercancel", "lostpointercapture"])
  document.addEventListener(type, (event) => { if (hold && hold.pointer === event.pointerId) release(type === "pointerup" ? "released" : "left"); }, true);
document.addEventListener("pointermove", (event) => {
  if (!hold || hold.pointer !== event.pointerId) return;
  const box = hold.button.getBoundingClientRect();
  if (event.clientX < box.left || event.clientX > box.right || event.clientY < box.top || event.clientY > box.bottom) release("left");
}, true);
document.addEventListener("keyup", () => { if (hold?.key) release("released"); }, true);
document.addEventListener("focusout", ({ target }) => { if (hold && target === hold.button) release("left"); });
for (const [type, cause] of Object.entries({ blur: "left", resize: "hidden", orientationchange: "hidden", pagehide: "closed" }))
  window.addEventListener(type, () => release(cause));
document.addEventListener("freeze", () => release("hidden"));
document.addEventListener("visibilitychange", () => { if (document.hidden) release("hidden"); });
document.addEventListener("pogon:dialog", () => release("dialog"));
document.addEventListener("pogon:live", ({ detail }) => { if (detail !== "live") release("offline"); });
new MutationObserver(() => { if (hold && !hold.button.isConnected) release("left"); }).observe(document.body, { childList: true, subtree: true });

const line = (button, text) => { if (text) button.querySelector("small").textContent = text; };

async function begin(button, by) {
  const name = button.dataset.hold, texts = commands.textsOf(button);
  if (button.getAttribute("aria-disabled") === "true") {
    commands.told(`${button.querySelector(".cmd-t").firstChild.textContent}: ${button.querySelector("small").textContent}`, "error");
    return;
  }
  if (document.body.dataset.live !== "live") return commands.told(texts.no_answer, "error");
  if (let_go.name !== name && performance.now() - let_go.at < PAUSE) return;
  const mine = { button, name, ...by, lease: "", counter: 0, unanswered: 0, slow: 0, started: performance.now(), line: button.querySelector("small").textContent };
  hold = mine;
  button.dataset.held = "";
  button.dataset.state = "held";
  line(button, texts.sending);
  const got = await answered(button.dataset.url, { fields: { id: commands.identity(), nonce: await commands.nonce() }, limit: 3000 });
  if (!got?.ok || got.status === 204) {
    if (hold === mine) over(mine);
    return got ? commands.take(got, null) : commands.told(texts.no_answer, "error");
  }
  mine.lease = JSON.parse(got.text).lease;
  if (hold !== mine) return tell(mine, "released"); // already up: it never moved
  line(button, texts.moving);
  mine.timer = setInterval(beat, EVERY);
  beat();
}

/** One keep-alive. None is queued: while the last one is unanswered this one is left out. */
function beat() {
  if (!hold?.lease) return;
  const now = performance.now();
  if (now - hold.started > LONGEST) return release("longest");
  if (hold.unanswered) {
    if (now - hold.unanswered > SLOW && ++hold.slow >= 2) release("offline");
    return;
  }
  const detail = { message: { hold: { equipment: hold.name.split(".")[0], lease: hold.lease, counter: ++hold.counter } } };
  document.dispatchEvent(new CustomEvent("pogon:send", { detail }));
  if (detail.sent) hold.unanswered = now;
  else release("offline");
}

document.addEventListener("pogon:hold", ({ detail }) => {
  if (!hold || detail.lease !== hold.lease) return;
  if (detail.over) {
    over(hold);
    return commands.told(detail.over, "error");
  }
  if (detail.counter !== hold.counter) return;
  if (performance.now() - hold.unanswered <= SLOW) hold.slow = 0;
  hold.unanswered = 0;
});

function release(cause) {
  if (!hold) return;
  const mine = hold;
  over(mine);
  if (cause === "offline") commands.told(document.body.dataset.ended ?? commands.textsOf(mine.button).no_answer, "error"); // the finger is still down, and the button let go
  if (mine.lease) tell(mine, cause);
}

/** Over the socket and as one ordinary request that outlives the page; the motion ends without either. */
function tell(mine, cause) {
  document.dispatchEvent(new CustomEvent("pogon:send", { detail: { message: { hold: { lease: mine.lease, release: cause } } } }));
  answered(`/equipment/${encodeURIComponent(mine.name.split(".")[0])}/release`, { fields: { lease: mine.lease, cause }, limit: 3000, keepalive: true });
}

function over(mine) {
  hold = null;
  let_go = { at: performance.now(), name: mine.name };
  clearInterval(mine.timer);
  delete mine.button.dataset.held;
  mine.button.dataset.state = "idle";
  line(mine.button, mine.line);
}
