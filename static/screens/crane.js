// The circular lift as it was: where the load went, and how far beside its circle over the angle. Each lift begins with an empty sheet;
// a page that is opened later begins with the last one of the history.
import { answered, unpacked } from "../js/fetched.js";
import { quantity } from "../js/format.js";
import { page } from "../js/values.js";

const MOST = 1500, FINE = 0.05; // points of a trace; a point nearer than this adds nothing [units]
const PAST = "-10m", COLUMNS = 1500; // how far back a lift is looked for, in how many columns
const MOVES = new Set([1, 2, 3, 4]); // phases in which the load is on its way

for (const sheet of document.querySelectorAll("[data-arc]")) {
  const path = sheet.querySelector("[data-arc-path]"), error = sheet.querySelector("[data-arc-error]");
  const radius = Number(sheet.dataset.radius) || 1, k = 200 / radius;
  sheet.querySelector("[data-arc-radius]").textContent = `R ${quantity(radius, 0, "mm", page.lang)}`;
  let before = null, begun = false, seen = [], last = null;

  const draw = () => {
    path.setAttribute("d", line(seen.map(({ x, y }) => [x, y])));
    error.setAttribute("d", line(seen.map(({ angle, off }) => [34 + Math.min(92, Math.max(-2, angle)) * 250 / 90, 66 - Math.min(20, Math.max(-20, off)) * 2.8])));
  };
  const add = (angle, off) => { // the load as it is on its circle: at this angle, so far beside it
    const turn = angle * Math.PI / 180, reach = (radius + off) * k;
    const point = { angle, off, x: 20 + reach * Math.cos(turn), y: 220 - reach * Math.sin(turn) };
    if (last && Math.hypot(point.x - last.x, point.y - last.y) < FINE && Math.abs(off - last.off) < FINE) return;
    last = point;
    seen.push(point);
    if (seen.length > MOST) seen = seen.filter((_, n) => n % 2);
  };

  const names = sheet.dataset.tags.split(" ").filter((name) => /\.(angle|radial_error)$/.test(name));
  past(names).then((points) => { // before what has arrived meanwhile
    if (begun) return;
    const later = seen;
    [seen, last] = [[], null];
    for (const [angle, off] of points) add(angle, off);
    seen.push(...later);
    draw();
  });

  sheet.addEventListener("tags", ({ detail }) => {
    const number = (key) => { const tag = detail[key]; return tag && tag.state !== "bad" && typeof tag.value === "number" ? tag.value : null; };
    const phase = number("path_phase"), angle = number("angle"), off = number("radial_error");
    if (phase === null) return;
    if (MOVES.has(phase) && !MOVES.has(before) && before !== null) [begun, seen, last] = [true, [], null];
    before = phase;
    if (angle === null || off === null || !MOVES.has(phase)) return;
    add(angle, off);
    draw();
  });
}

/** Angle and deviation of the last lift that the history has. */
async function past(names) {
  const answer = await answered(`/history/series?tags=${names.join(",")}&from=${PAST}&width=${COLUMNS}`);
  if (!answer?.ok) return []; // the history is down, or too slow: the trace grows from what arrives
  const [angles, errors] = JSON.parse(answer.text).series.map(unpacked);
  const end = angles.findLastIndex(({ last }) => last !== null);
  const start = angles.findLastIndex(({ last }, n) => n < end && last === null) + 1;
  return angles.slice(start, end + 1).map(({ at, last }) => [last, errors.findLast((one) => one.at <= at)?.last ?? 0]);
}

/** A line through these points; a part that leaps is drawn, too: it says that something was not seen. */
function line(points) {
  return points.map(([x, y], n) => `${n ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");
}
