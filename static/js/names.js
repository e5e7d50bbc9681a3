// Names of curves where there is little room.

/** `names` as `fit` shortens them; where that leaves two alike, what names of one machine have in common goes first, at the end before the beginning. */
export function apart(names, fit) {
  const short = names.map(fit), parts = names.map((name) => name.split(/(?<= · |, |: )/));
  if (new Set(short).size === new Set(names).size) return short;
  return parts.map((own, i) => {
    const alike = parts.filter((one, k) => names[k] !== names[i] && (short[k] === short[i] || one[0] === own[0]));
    const said = (from, to) => own.slice(from, to).join("").replace(/( ·|[,:]) $/, "") + (to < own.length ? "…" : "");
    let from = 0, to = own.length;
    while (alike.length && to > 1 && alike.every((one) => one.at(to - own.length - 1) === own[to - 1])) to--;
    while (alike.length && from < to - 1 && fit(said(from, to)) !== said(from, to) && alike.every((one) => one[from] === own[from])) from++;
    return fit(said(from, to));
  });
}
