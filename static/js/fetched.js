// What the server answers, asked for whole or not at all; parts of a page that it draws are kept as they are now although an answer gets lost.
const AGAIN = 2000; // after an answer that did not come, or not whole [ms]
const PAUSE = 50; // between two that follow one another [ms]
const LATER = [408, 425, 429]; // and all of 5xx: the same question may be answered another time
const csrf = () => document.querySelector("[name=csrf]")?.value ?? ""; // any token of this session is good

/** The answer of `url` with all its text, null when nobody answers or it breaks off, which it may after the head came; `fields` are posted. */
export async function answered(url, { fields, limit = 8000, keepalive = false } = {}) {
  const body = fields && new URLSearchParams(fields);
  body?.set("csrf", csrf());
  try {
    const answer = await fetch(url, { method: body ? "POST" : "GET", body, keepalive, headers: { "HX-Request": "true" }, signal: AbortSignal.timeout(limit) });
    const { ok, status, headers, redirected } = answer;
    return { ok, status, headers, redirected, url: answer.url, text: await answer.text() };
  } catch {
    return null;
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
    const got = await answered(asked, { limit });
    busy = false;
    if (got?.ok && !got.redirected) draw(got.text, asked);
    if (again || !got || got.status >= 500 || LATER.includes(got.status)) timer = setTimeout(renew, again ? PAUSE : AGAIN);
  };
}
