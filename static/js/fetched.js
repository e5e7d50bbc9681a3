// What the server answers, asked for whole or not at all.
const csrf = () => document.querySelector("[name=csrf]")?.value ?? ""; // any token of this session is good

/** The answer of `url` with all its text, null when nobody answers or it breaks off, which it may after the head came; `fields` are posted. */
export async function answered(url, { fields, limit = 8000, keepalive = false, signal = null } = {}) {
  const body = fields && new URLSearchParams(fields);
  body?.set("csrf", csrf());
  try {
    const late = AbortSignal.timeout(limit), ends = signal ? AbortSignal.any([signal, late]) : late;
    const answer = await fetch(url, { method: body ? "POST" : "GET", body, keepalive, headers: { "HX-Request": "true", "X-Page-Language": document.body.dataset.lang }, signal: ends });
    return { ok: answer.ok, status: answer.status, headers: answer.headers, text: await answer.text() };
  } catch {
    return null;
  }
}

/** A fragment as a document. */
export const parsed = (html) => new DOMParser().parseFromString(html, "text/html");

/** The columns of a series of /history/series: times are sent as distances, what is the same in all columns once or not at all. */
export function unpacked({ time: distances = [], first, low = first, high = first, last = first, quality, count }) {
  let at = 0;
  const each = (value, i) => (Array.isArray(value) ? value[i] : value);
  return first ? distances.map((later, i) => ({
    at: (at += later), first: first[i], low: low[i], high: high[i], last: last[i], level: each(quality, i), count: each(count, i),
  })) : [];
}
