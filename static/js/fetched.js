// Parts of a page that the server draws: fetched whole or not at all, and kept as they are now although an answer gets lost.
const AGAIN = 2000; // after an answer that did not come, or not whole [ms]
const PAUSE = 50; // between two that follow one another [ms]
const LATER = [408, 425, 429]; // and all of 5xx: the same question may be answered another time

/** Ask for `path`: `{ html }` is what came; null when nobody answers, it breaks off or it is refused, and `again` says whether to ask once more. */
async function ask(path, limit) {
  try {
    const answer = await fetch(path, { headers: { "HX-Request": "true" }, signal: AbortSignal.timeout(limit) });
    const html = await answer.text(); // a request may break off, and its time may end, after the head came
    const taken = answer.ok && !answer.redirected;
    return { html: taken ? html : null, again: answer.status >= 500 || LATER.includes(answer.status) };
  } catch {
    return { html: null, again: true };
  }
}

/** A fragment as a document. */
export const parsed = (html) => new DOMParser().parseFromString(html, "text/html");

/** A function that has `draw` take what `path()` answers now, and that path: one question at a time, one more after it when it was called
 *  meanwhile, and again later when the answer got lost. That nobody answers at all the page says by itself. */
export function renewing(path, draw, limit = 8000) {
  let busy = false, again = false, timer = 0;
  return async function renew() {
    clearTimeout(timer);
    const asked = path();
    if (busy || !asked) { again = busy; return; }
    busy = true;
    again = false;
    const got = await ask(asked, limit);
    busy = false;
    if (got.html !== null) draw(got.html, asked);
    if (again || got.again) timer = setTimeout(renew, again ? PAUSE : AGAIN);
  };
}
