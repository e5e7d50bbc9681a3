// How numbers, times and ages are written: the twin of app/web/format.py, to the character. A browser test sweeps both.
const GROUP = "\u202f", MINUS = "\u2212", SPACE = "\u00a0";
export const NO_VALUE = "----", NO_DATA_YET = "\u2013\u00a0\u2013";

const mark = (lang) => (lang === "en" ? "." : ",");
const pad = (whole, digits = 2) => String(whole).padStart(digits, "0");

const forms = new Map();

/** Fixed decimals, half a last digit away from zero on the shortest digits that name the number, never "−0"; beyond 2^53, where not every whole number is one here, `1.844674E19`. */
export function number(value, decimals, lang) {
  if (!Number.isFinite(value)) return NO_VALUE;
  const far = Math.abs(value) > 2 ** 53, digits = far ? 6 : decimals, notation = far ? "scientific" : "standard", form = notation + digits;
  if (!forms.has(form)) forms.set(form, new Intl.NumberFormat("en", { notation, minimumFractionDigits: digits, maximumFractionDigits: digits, signDisplay: "negative" }));
  const signs = { ",": GROUP, ".": mark(lang), "-": MINUS };
  return forms.get(form).format(String(value)).replace(/[,.-]/g, (sign) => signs[sign]); // as a text: its digits, not the nearest binary fraction
}

export const quantity = (value, decimals, unit, lang) =>
  unit ? number(value, decimals, lang) + SPACE + unit : number(value, decimals, lang);

export const hexadecimal = (value, digits = 4) => "0x" + pad(Math.round(value).toString(16).toUpperCase(), digits);

export function age(seconds) {
  const whole = Number.isFinite(seconds) ? Math.max(0, Math.floor(seconds)) : 0;
  for (const [size, unit] of [[86400, "d"], [3600, "h"], [60, "min"]])
    if (whole >= size) return Math.floor(whole / size) + SPACE + unit;
  return whole + SPACE + "s";
}

export function duration(seconds, lang) {
  if (seconds < 9.95) return quantity(Math.max(0, seconds), 1, "s", lang);
  const whole = Math.floor(seconds + 0.5);
  for (const [size, unit, small, below] of [[86400, "d", 3600, "h"], [3600, "h", 60, "min"], [60, "min", 1, "s"]])
    if (whole >= size)
      return `${Math.floor(whole / size)}${SPACE}${unit} ${pad(Math.floor((whole % size) / small))}${SPACE}${below}`;
  return whole + SPACE + "s";
}

const zones = new Map();

/** The wall clock of `zone` at `micros` (µs UTC). */
function wall(micros, zone) {
  let form = zones.get(zone);
  if (!form) {
    const two = "2-digit";
    form = new Intl.DateTimeFormat("en-GB", {
      timeZone: zone, hourCycle: "h23", year: "numeric", month: two, day: two, hour: two, minute: two, second: two,
    });
    zones.set(zone, form);
  }
  const parts = {};
  for (const { type, value } of form.formatToParts(Math.floor(micros / 1000))) parts[type] = value;
  parts.year = pad(parts.year, 4);
  return parts;
}

/** What the wall clock shows, minus UTC [min]. */
export function offset(micros, zone) {
  const w = wall(micros, zone);
  return Math.round((Date.UTC(w.year, w.month - 1, w.day, w.hour, w.minute, w.second) - Math.floor(micros / 1e6) * 1000) / 6e4);
}

/** The repeated hour of autumn with its offset, `02:30:00 +02:00`, unless without. */
export function clockTime(micros, zone, { seconds = true, withOffset = true } = {}) {
  const w = wall(micros, zone);
  return `${w.hour}:${w.minute}${seconds ? `:${w.second}` : ""}${withOffset ? repeated(micros, zone) : ""}`;
}

export function date(micros, zone, lang, { year = true } = {}) {
  const w = wall(micros, zone);
  if (lang === "en") return `${w.day}/${w.month}` + (year ? `/${w.year}` : "");
  return `${w.day}.${w.month}.` + (year ? w.year : "");
}

/** The date with its day of the week. */
export const day = (micros, zone, lang) =>
  `${new Intl.DateTimeFormat(lang, { timeZone: zone, weekday: "short" }).format(micros / 1000).replace(".", "")} ${date(micros, zone, lang)}`;

/** Its offset when the wall clock shows this time twice, else nothing: an hour or so away it shows the same with another offset. */
function repeated(micros, zone) {
  const here = offset(micros, zone), away = Math.abs(here);
  const twin = [-180, -120, -60, -30, 30, 60, 120, 180].some((minutes) => offset(micros + minutes * 6e7, zone) + minutes === here);
  return twin ? ` ${here < 0 ? "-" : "+"}${pad(Math.floor(away / 60))}:${pad(away % 60)}` : "";
}

/** Date and time: the year only when it is not that of `now`. */
export function dateTime(micros, zone, lang, now) {
  const sameYear = wall(micros, zone).year === wall(now, zone).year;
  return `${date(micros, zone, lang, { year: !sameYear })} ${clockTime(micros, zone)}`;
}

/** Time of day when it is of today, else date and time. */
export function momentOrTime(micros, zone, lang, now) {
  return date(micros, zone, lang) === date(now, zone, lang) ? clockTime(micros, zone) : dateTime(micros, zone, lang, now);
}

/** Least change that is drawn at once [EU]: half a last digit, so that no digit flickers. */
export const deadBand = (decimals) => 0.5 * 10 ** -decimals;
