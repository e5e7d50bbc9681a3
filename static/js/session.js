// Idling: a person at the page keeps the session active; a minute before it only watches, the message line says so.
import { answered } from "./fetched.js";

const menu = document.querySelector("[data-idle-in]"), TOUCH = 30000, WARNING = 60000;
let until = performance.now() + menu.dataset.idleIn * 1000, told = 0, warned = false;

async function active() {
  const now = performance.now();
  if (now - told < TOUCH && !warned) return;
  told = now;
  const answer = await answered("/session/active", { fields: {}, limit: 5000 });
  if (!answer) return void (told = 0); // the server is away; the page says that by itself
  if (!answer.ok || answer.headers.get("X-Idle") === "1") return location.reload();
  until = performance.now() + Number(answer.text) * 1000;
  if (warned) window.pogon.say("", "info");
  warned = false;
}
for (const kind of ["pointerdown", "keydown"]) document.addEventListener(kind, active, { passive: true });

setInterval(() => {
  const left = until - performance.now();
  if (left <= 0) {
    if (document.body.dataset.live !== "offline") location.reload();
    until = performance.now() + 30000;
  } else if (left <= WARNING) {
    warned = true;
    window.pogon.say(menu.dataset.idleSoon.replace("{seconds}", String(Math.ceil(left / 1000))), "info");
  }
}, 1000);
