// What the history answers.

/** The columns of a series of /history/series: times are sent as distances, what is the same in all columns once or not at all. */
export function unpacked({ time: distances = [], first, low = first, high = first, last = first, quality, count }) {
  let at = 0;
  const each = (value, i) => (Array.isArray(value) ? value[i] : value);
  return first ? distances.map((later, i) => ({
    at: (at += later), first: first[i], low: low[i], high: high[i], last: last[i], level: each(quality, i), count: each(count, i),
  })) : [];
}
