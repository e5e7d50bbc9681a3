// Idling: a person at the page keeps the session active; a minute before it only watches, the message line says so.
(() => {
  "use strict";
  const menu = document.querySelector("[data-idle-in]");
  if (!menu) return;
  const TOUCH = 30000, WARNING = 60000;
  let until = performance.now() + menu.dataset.idleIn * 1000, told = 0, warned = false;

  async function active() {
    const now = performance.now();
    if (now - told < TOUCH && !warned) return;
    told = now;
    try {
      const answer = await fetch("/session/active", { method: "POST", headers: { "X-CSRF-Token": menu.querySelector('[name="csrf"]').value }, signal: AbortSignal.timeout(5000) });
      if (!answer.ok || answer.headers.get("X-Idle") === "1") return location.reload();
      until = performance.now() + Number(await answer.text()) * 1000;
      if (warned) window.pogon.say("", "info");
      warned = false;
    } catch {
      told = 0; // the server is away; the page says that by itself
    }
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
})();
