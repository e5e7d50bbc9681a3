// The axis of time in the plant's zone: where ticks stand, what they say, where the clock was changed. Times are µs UTC.
import { date, clockTime, offset } from "./format.js";

const SECOND = 1e6, MINUTE = 60e6, HOUR = 3600e6, DAY = 86400e6;
const STEPS = [
  ...[1, 2, 5, 10, 15, 30].map((n) => n * SECOND), ...[1, 2, 5, 10, 15, 30].map((n) => n * MINUTE),
  ...[1, 2, 3, 6, 12].map((n) => n * HOUR), ...[1, 2, 7, 14, 30, 90, 180, 365, 730].map((n) => n * DAY),
];
const shift = (at, zone) => offset(at, zone) * MINUTE;

/** A round number of at least `step`. */
export function nice(step) {
  if (!(step > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(step));
  return [1, 2, 2.5, 5, 10].map((n) => n * power).find((n) => n >= step * (1 - 1e-9));
}

/** Decimals that multiples of `step` need. */
export function decimals(step) {
  for (let n = 0; n < 8; n++) if (Math.abs(step * 10 ** n - Math.round(step * 10 ** n)) < 1e-6 * 10 ** n * step) return n;
  return 8;
}

/** Round local times from `from` to `to`, about `count` of them; a day of 23 or 25 hours has its own. */
export function ticks(from, to, count, zone) {
  const step = STEPS.find((one) => (to - from) / one <= count) ?? Math.ceil((to - from) / count / (365 * DAY)) * 365 * DAY;
  const out = [];
  if (step <= HOUR) { // offsets are whole multiples of a quarter of an hour: the same steps fit on both sides of a change
    const slip = shift(from, zone) % step;
    for (let at = Math.ceil((from + slip) / step) * step - slip; at <= to; at += step) out.push(at);
    return out;
  }
  let local = Math.ceil((from + shift(from, zone)) / step) * step;
  if (step % DAY === 0) { // days from the first of January, so that they do not move while the view does
    const first = Date.UTC(new Date((from + shift(from, zone)) / 1e3).getUTCFullYear(), 0, 1) * 1e3;
    local = first + Math.ceil((from + shift(from, zone) - first) / step) * step;
  }
  for (; ; local += step) {
    const guess = local - shift(local - shift(from, zone), zone), at = local - shift(guess, zone);
    if (at > to) return out;
    if (at >= from && at > (out.at(-1) ?? -Infinity)) out.push(at);
  }
}

/** What ticks say: seconds only where they are needed, the date at midnight, the repeated hour of autumn with A and B. */
export function labels(ats, zone, lang) {
  const step = ats.length > 1 ? ats[1] - ats[0] : HOUR;
  return ats.map((at) => {
    const midnight = clockTime(at, zone, { withOffset: false }) === "00:00:00";
    if (step >= 20 * HOUR || (midnight && step >= MINUTE)) return date(at, zone, lang, { year: step > 40 * DAY });
    const again = shift(at + HOUR, zone) < shift(at, zone) || shift(at - HOUR, zone) > shift(at, zone);
    const mark = again ? (shift(at + HOUR, zone) < shift(at, zone) ? "A" : "B") : "";
    return clockTime(at, zone, { seconds: step < MINUTE, withOffset: false }) + mark;
  });
}

const written = (minutes) => `${minutes < 0 ? "−" : "+"}${String(Math.floor(Math.abs(minutes) / 60)).padStart(2, "0")}:${String(Math.abs(minutes) % 60).padStart(2, "0")}`;

/** Where the clock was changed between `from` and `to`: {at, before, after} with the offsets to UTC. */
export function changes(from, to, zone) {
  const out = [];
  for (let at = from; at < to; at += 7 * DAY) {
    let low = at, high = Math.min(at + 7 * DAY, to);
    const before = offset(low, zone), after = offset(high, zone);
    if (before === after) continue;
    while (high - low > SECOND) {
      const middle = Math.floor((low + high) / 2);
      if (offset(middle, zone) === before) low = middle; else high = middle;
    }
    out.push({ at: Math.round(high / MINUTE) * MINUTE, before: written(before), after: written(after) });
  }
  return out;
}

/** The range as one line: times alone within one day of today's kind, else with dates; `whole`: dates and years in any case. */
export function period(from, to, zone, lang, whole = false) {
  const seconds = to - from < 10 * MINUTE + 1 || from % MINUTE !== 0 && to - from < HOUR;
  const one = (at) => clockTime(at, zone, { seconds });
  if (date(from, zone, lang) === date(to, zone, lang)) return `${whole ? `${date(to, zone, lang)} ` : ""}${one(from)} – ${one(to)}`;
  const short = (at) => `${date(at, zone, lang, { year: whole })} ${clockTime(at, zone, { seconds: false })}`;
  return `${short(from)} – ${short(to)}`;
}
