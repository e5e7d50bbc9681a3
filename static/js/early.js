// What is done on a page while its scripts are still on their way waits, and is done once they are all there: no press is in vain.
// What the browser does by itself (a link, a box, a form with an address: Stop and every command) waits for nothing.
(() => {
  const KINDS = ["click", "input", "change", "toggle", "submit"];
  let waiting = []; // in the order in which they came; of presses the last alone
  const by_itself = ({ target, type }) => type === "submit" ? target.hasAttribute("action") || !target.matches("[hx-get], [hx-post]")
    : type === "click" && target.closest("a[href], label, summary, input, select, textarea, button:not([type=button])");
  function wait(event) {
    if (!(event.target instanceof Element) || by_itself(event)) return;
    event.stopImmediatePropagation();
    if (event.type === "submit") event.preventDefault();
    waiting = waiting.filter(({ target, type }) => type !== event.type || (target !== event.target && type !== "click")).concat(event);
  }
  for (const kind of KINDS) document.addEventListener(kind, wait, true);
  addEventListener("DOMContentLoaded", () => {
    for (const kind of KINDS) document.removeEventListener(kind, wait, true);
    setTimeout(() => {
      for (const event of waiting)
        event.type === "submit" ? event.target.requestSubmit(event.submitter) : event.target.dispatchEvent(new event.constructor(event.type, event));
    });
  });
})();
