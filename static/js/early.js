// What is done on a page while its scripts are still on their way waits, and is done once they are all there: no press is in vain. What the
// browser does by itself waits for nothing: a link, a box, a form that needs no script, Stop. A page that hears of no script looks disconnected.
(() => {
  const KINDS = ["click", "input", "change", "toggle", "submit"], LATE = 3000, ALONE = 4000; // [ms]
  const OWN = "a[href], label, summary, input, select, textarea, .stop, button:not([type=button], [data-command])";
  const LED = "[data-setpoint], [data-order], :is([hx-get], [hx-post]):not([action])"; // forms that nobody but a script can send
  let waiting = [], doing = 0; // in the order in which they came, of presses the last alone; the timer that does them once all scripts are there
  function wait(event) {
    const { target, type } = event;
    if (!(target instanceof Element) || (type === "submit" ? !target.matches(LED) : type === "click" && target.closest(OWN))) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    waiting = waiting.filter((one) => one.type !== type || (one.target !== target && type !== "click")).concat(event);
  }
  for (const kind of KINDS) document.addEventListener(kind, wait, true);
  addEventListener("DOMContentLoaded", () => {
    for (const kind of KINDS) document.removeEventListener(kind, wait, true);
    doing = setTimeout(() => {
      for (const event of waiting) {
        const { target, type, submitter, timeStamp } = event, late = performance.now() - timeStamp > LATE || target.closest("[data-hold]");
        if (late && ["click", "submit"].includes(type)) window.pogon?.say(document.getElementById("message").dataset.tooLate, "error"); // nobody expects it any more
        else if (type === "submit") target.requestSubmit(submitter);
        else target.dispatchEvent(new event.constructor(type, event));
      }
    });
  });
  setTimeout(() => {
    if (document.body?.dataset.live !== "delayed" || (doing && !document.querySelector(".off-re").hidden)) return; // who reconnects says the rest
    document.querySelector("[data-offline-age]").textContent = document.querySelector("[data-clock]").textContent;
    document.body.dataset.live = "offline";
  }, ALONE);
})();
