// What is wrong with the layout of the page as it stands, in words: cut, shortened, overlapping, beyond the edge. Evaluated in the page.
() => {
  const faults = new Set(), w = document.documentElement.clientWidth;
  const once = (find) => { // nothing moves meanwhile, so what was found of an element holds
    const known = new Map();
    return (e) => known.get(e) ?? (known.set(e, find(e)), known.get(e));
  };
  const short = (e) => e.tagName.toLowerCase() + (e.id ? '#' + e.id : '') + [...e.classList].map((c) => '.' + c).join('');
  const name = (e) => short(e) + ' "' + e.textContent.trim().replace(/\s+/g, ' ').slice(0, 40) + '"';
  const shown = (e) => e.getClientRects().length && getComputedStyle(e).visibility !== 'hidden'
    && getComputedStyle(e).clipPath !== 'inset(50%)' && !e.closest('svg, .vh, [hidden], details:not([open]) > :not(summary), .skip');
  const box = once((e) => e.getBoundingClientRect());
  const style = once((e) => {
    const { overflowX, overflowY, position, display, textOverflow } = getComputedStyle(e);
    return { overflowX, overflows: overflowX + overflowY, position, display, textOverflow };
  });
  const above = (e) => (e.parentElement === document.body ? null : e.parentElement);
  const shifts = once((p) => (/(auto|scroll)/.test(style(p).overflowX) && p.scrollWidth > p.clientWidth) || moves(p));
  const moves = (e) => above(e) !== null && shifts(above(e)); // whether a reader can bring it into view
  const floats = once((e) => // in front of what scrolls, on purpose
    e !== document.body && (/(fixed|sticky)/.test(style(e).position) || (above(e) !== null && floats(above(e)))));
  const meet = (a, b) => ({
    left: Math.max(a.left, b.left), top: Math.max(a.top, b.top), right: Math.min(a.right, b.right), bottom: Math.min(a.bottom, b.bottom),
  });
  const everything = { left: -Infinity, top: -Infinity, right: Infinity, bottom: Infinity };
  const view = once((p) => { // what the scrolling of an element and around it leaves to see of what is in it
    const around = above(p) ? view(above(p)) : everything;
    return /(auto|scroll|hidden|clip)/.test(style(p).overflows) ? meet(around, box(p)) : around;
  });
  const clipped = once((e) => meet(box(e), above(e) ? view(above(e)) : everything));
  const written = (e) => { // where its own words are, without those of its children
    const boxes = [...e.childNodes].filter((n) => n.nodeType === 3 && n.textContent.trim()).map((n) => {
      const range = document.createRange();
      range.selectNodeContents(n);
      return range.getBoundingClientRect();
    });
    const edge = (side, best) => best(...boxes.map((box) => box[side]));
    const r = { left: edge('left', Math.min), top: edge('top', Math.min) };
    r.right = edge('right', Math.max);
    r.bottom = edge('bottom', Math.max);
    return { ...r, width: r.right - r.left, height: r.bottom - r.top };
  };
  const over = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2;
  const overlapping = (elements, place, found) => { // of all that lie over each other; from top to bottom, so few are compared
    const placed = elements.map((e) => [e, place(e)]).sort(([, a], [, b]) => a.top - b.top);
    placed.forEach(([a, p], i) => {
      for (let k = i + 1; k < placed.length && placed[k][1].top < p.bottom; k++)
        if (over(p, placed[k][1])) found(a, placed[k][0]);
    });
  };
  const visible = [...document.querySelectorAll('body *')].filter(shown);
  if (document.documentElement.scrollWidth > w + 1)
    faults.add('the page scrolls sideways by ' + (document.documentElement.scrollWidth - w) + ', as far as '
      + visible.filter((e) => box(e).right > w + 1).map(short).slice(-1));
  const head = [...document.querySelectorAll('.head > :not(.head-r), .head-r > *')].filter((e) => shown(e)).map((e) => [short(e), e.getBoundingClientRect()]);
  head.forEach(([a, p], i) => head.slice(i + 1).forEach(([b, q]) => {
    if (p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 1 && q.top < p.bottom - 1) faults.add('overlap: ' + a + ' and ' + b);
  }));
  const texts = visible.filter((e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()));
  for (const e of texts) {
    const t = written(e);
    if (t.width <= 2 || t.height <= 2) continue;
    if ((t.right > w + 1 || t.left < -1) && !moves(e) && !floats(e)) faults.add('beyond the edge: ' + name(e));
    for (let p = e; p && p !== document.body; p = p.parentElement) {
      const s = style(p), o = box(p);
      if (/(auto|scroll)/.test(s.overflows)) break;
      if (!/(hidden|clip)/.test(s.overflows)) continue;
      if (o.width <= 2 || o.height <= 2) break;
      const sideways = t.right > o.right + 2 || t.left < o.left - 2;
      const way = sideways ? 'sideways' : t.bottom > o.bottom + 3 || t.top < o.top - 3 ? 'in height' : '';
      if (way) {
        faults.add((s.textOverflow === 'ellipsis' ? 'shortened ' : 'cut off ') + way + ' by ' + short(p) + ': ' + name(e));
        break;
      }
    }
  }
  for (const e of texts) { // nor over the cell beside its own, nor out of its panel, if nothing there scrolls
    const t = written(e), cell = e.closest('td, th'), panel = e.closest('.panel');
    if (t.width <= 2 || t.height <= 2 || floats(e)) continue;
    if (cell && (t.right > box(cell).right + 2 || t.left < box(cell).left - 2)) faults.add('beyond its cell: ' + name(e));
    const held = (p) => style(p).overflows !== 'visiblevisible' || (p !== panel && held(p.parentElement));
    if (panel && !held(e) && (t.right > box(panel).right || t.bottom > box(panel).bottom)) faults.add('beyond its panel: ' + name(e));
  }
  for (const e of texts) { // a word may part at a hyphen, into pieces that are still read
    if (/mono/i.test(getComputedStyle(e).fontFamily)) continue;
    const least = parseFloat(getComputedStyle(e).fontSize);
    for (const n of [...e.childNodes].filter((one) => one.nodeType === 3)) {
      const range = document.createRange();
      range.selectNodeContents(n);
      if (range.getClientRects().length < 2) continue; // all of it in one line
      for (const word of n.textContent.matchAll(/[\p{L}\u00ad]{4,}/gu)) {
        if (word[0].includes('\u00ad')) continue;
        range.setStart(n, word.index);
        range.setEnd(n, word.index + word[0].length);
        const lines = [...range.getClientRects()].filter((r) => r.width > 0);
        if (lines.length > 2 || (lines.length > 1 && lines.some((r) => r.width < least))) faults.add('broken word: ' + word[0] + ' in ' + name(e));
      }
    }
  }
  for (const e of visible.filter((one) => one.matches('.panel > header'))) { // what it says ends where it ends
    const end = box(e).right - parseFloat(getComputedStyle(e).paddingRight) + 1;
    if ([...e.children].some((one) => shown(one) && box(one).right > end)) faults.add('beyond the end of its head: ' + name(e));
  }
  for (const e of visible) {
    if (!e.textContent.trim() && e.tagName !== 'INPUT') continue;
    const s = getComputedStyle(e);
    if (s.textOverflow === 'ellipsis' && s.overflowX !== 'visible' && e.scrollWidth > e.clientWidth + 1) faults.add('shortened: ' + name(e));
    if (s.webkitLineClamp !== 'none' && e.scrollHeight > e.clientHeight + 2) faults.add('lines left out: ' + name(e));
  }
  const pen = document.createElement('canvas').getContext('2d');
  for (const e of visible.filter((one) => one.placeholder && !one.value)) { // what an empty field shows
    const s = getComputedStyle(e), room = e.clientWidth - parseFloat(s.paddingLeft) - parseFloat(s.paddingRight);
    pen.font = `${s.fontWeight} ${s.fontSize} ${s.fontFamily}`; // `font` itself is empty where figures have a form of their own
    if (pen.measureText(e.placeholder).width > room + 1) faults.add('cut off in its field: ' + short(e) + ' "' + e.placeholder + '"');
  }
  for (const e of visible.filter((one) => one.matches('.op-list, .f-cmd')))
    if (e.scrollWidth > e.clientWidth + 1) faults.add('commands beside their column: ' + name(e));
  const buttons = [...document.querySelectorAll('button, a.btn, a.ib, summary, select, input:not([type=hidden])')].filter(shown);
  for (const e of buttons) { // what scrolls beneath a button is not seen through it
    const { position, backgroundColor } = getComputedStyle(e);
    if (position === 'fixed' && /^transparent$|, 0\)$/.test(backgroundColor)) faults.add('seen through: ' + name(e));
  }
  const pressed = buttons.filter((e) => !floats(e));
  for (const e of pressed) { // at its edges nothing else lies over it
    const o = box(e), r = clipped(e), y = (Math.max(r.top, 0) + Math.min(r.bottom, innerHeight)) / 2;
    if (r.bottom - r.top < o.height / 2 || y < 2 || y > innerHeight - 2 || moves(e)) continue;
    for (const x of [o.left + 4, o.right - 4]) {
      const top = document.elementFromPoint(x, y);
      if (top && !e.contains(top) && !top.contains(e) && !floats(top)) faults.add('covered by ' + short(top) + ': ' + name(e));
    }
  }
  overlapping(pressed, clipped, (a, b) => {
    if (!a.contains(b) && !b.contains(a)) faults.add('overlap: ' + name(a) + ' and ' + name(b));
  });
  const leaves = texts.filter((e) => !floats(e) && e.children.length === 0 && !e.closest('.tabs, dialog'));
  const lines = (e) => [...e.getClientRects()]; // of a sentence that goes on in another line the two are boxes that meet
  overlapping(leaves, clipped, (a, b) => {
    const flows = a.parentElement === b.parentElement && style(a).display === 'inline' && style(b).display === 'inline';
    if (!flows && lines(a).some((p) => lines(b).some((q) => over(p, q)))) faults.add('texts overlap: ' + name(a) + ' and ' + name(b));
  });
  for (const svg of [...document.querySelectorAll('main svg')].filter((e) => e.checkVisibility() && e.getBoundingClientRect().width > 60)) {
    const o = svg.getBoundingClientRect(), drawn = [...svg.querySelectorAll('text')].filter((e) =>
      e.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && e.textContent.trim() && getComputedStyle(e).fill !== 'none');
    for (const e of drawn) {
      const r = e.getBoundingClientRect();
      if (r.width > 2 && (r.right > o.right + 2 || r.left < o.left - 2 || r.bottom > o.bottom + 3 || r.top < o.top - 3)) faults.add('beyond its picture: ' + name(e));
    }
    overlapping(drawn, box, (a, b) => {
      if (!a.contains(b) && !b.contains(a)) faults.add('drawn over each other: ' + name(a) + ' and ' + name(b));
    });
  }
  return [...faults];
}