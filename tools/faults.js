// What is wrong with the layout of the page as it stands, in words: cut, shortened, overlapping, beyond the edge. Evaluated in the page.
() => {
  const faults = new Set(), w = document.documentElement.clientWidth;
  const short = (e) => e.tagName.toLowerCase() + (e.id ? '#' + e.id : '') + [...e.classList].map((c) => '.' + c).join('');
  const name = (e) => short(e) + ' "' + e.textContent.trim().replace(/\s+/g, ' ').slice(0, 40) + '"';
  const shown = (e) => e.getClientRects().length && getComputedStyle(e).visibility !== 'hidden'
    && !e.closest('svg, .vh, [hidden], details:not([open]) > :not(summary), .skip');
  const moves = (e) => { // whether a reader can bring it into view
    for (let p = e.parentElement; p && p !== document.body; p = p.parentElement)
      if (/(auto|scroll)/.test(getComputedStyle(p).overflowX) && p.scrollWidth > p.clientWidth) return true;
    return false;
  };
  const floats = (e) => { // in front of what scrolls, on purpose
    for (let p = e; p && p !== document.body; p = p.parentElement)
      if (/(fixed|sticky)/.test(getComputedStyle(p).position)) return true;
    return false;
  };
  const clipped = (e) => { // what of it the scrolling around it leaves to see
    const box = e.getBoundingClientRect(), r = { left: box.left, top: box.top, right: box.right, bottom: box.bottom };
    for (let p = e.parentElement; p && p !== document.body; p = p.parentElement) {
      if (!/(auto|scroll|hidden|clip)/.test(getComputedStyle(p).overflowX + getComputedStyle(p).overflowY)) continue;
      const o = p.getBoundingClientRect();
      r.left = Math.max(r.left, o.left); r.top = Math.max(r.top, o.top);
      r.right = Math.min(r.right, o.right); r.bottom = Math.min(r.bottom, o.bottom);
    }
    return r;
  };
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
  if (document.documentElement.scrollWidth > w + 1)
    faults.add('the page scrolls sideways by ' + (document.documentElement.scrollWidth - w) + ', as far as '
      + [...document.querySelectorAll('body *')].filter((e) => shown(e) && e.getBoundingClientRect().right > w + 1).map(short).slice(-1));
  const head = [...document.querySelectorAll('.head > :not(.head-r), .head-r > *')].filter((e) => shown(e)).map((e) => [short(e), e.getBoundingClientRect()]);
  head.forEach(([a, p], i) => head.slice(i + 1).forEach(([b, q]) => {
    if (p.left < q.right - 1 && q.left < p.right - 1 && p.top < q.bottom - 1 && q.top < p.bottom - 1) faults.add('overlap: ' + a + ' and ' + b);
  }));
  const texts = [...document.querySelectorAll('body *')].filter((e) =>
    shown(e) && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()));
  for (const e of texts) {
    const t = written(e);
    if (t.width <= 2 || t.height <= 2) continue;
    if ((t.right > w + 1 || t.left < -1) && !moves(e) && !floats(e)) faults.add('beyond the edge: ' + name(e));
    for (let p = e; p && p !== document.body; p = p.parentElement) {
      const s = getComputedStyle(p), o = p.getBoundingClientRect();
      if (/(auto|scroll)/.test(s.overflowX + s.overflowY)) break;
      if (!/(hidden|clip)/.test(s.overflowX + s.overflowY)) continue;
      if (o.width <= 2 || o.height <= 2) break;
      const sideways = t.right > o.right + 2 || t.left < o.left - 2;
      const way = sideways ? 'sideways' : t.bottom > o.bottom + 3 || t.top < o.top - 3 ? 'in height' : '';
      if (way) {
        faults.add((s.textOverflow === 'ellipsis' ? 'shortened ' : 'cut off ') + way + ' by ' + short(p) + ': ' + name(e));
        break;
      }
    }
  }
  for (const e of texts) { // a word may part at a hyphen, into pieces that are still read
    if (/mono/i.test(getComputedStyle(e).fontFamily)) continue;
    const least = parseFloat(getComputedStyle(e).fontSize);
    for (const n of [...e.childNodes].filter((one) => one.nodeType === 3)) for (const word of n.textContent.matchAll(/[\p{L}\u00ad]{4,}/gu)) {
      if (word[0].includes('\u00ad')) continue;
      const range = document.createRange();
      range.setStart(n, word.index);
      range.setEnd(n, word.index + word[0].length);
      const lines = [...range.getClientRects()].filter((r) => r.width > 0);
      if (lines.length > 2 || (lines.length > 1 && lines.some((r) => r.width < least))) faults.add('broken word: ' + word[0] + ' in ' + name(e));
    }
  }
  for (const e of document.querySelectorAll('body *')) {
    if (!shown(e) || !e.textContent.trim() && e.tagName !== 'INPUT') continue;
    const s = getComputedStyle(e);
    if (s.textOverflow === 'ellipsis' && s.overflowX !== 'visible' && e.scrollWidth > e.clientWidth + 1) faults.add('shortened: ' + name(e));
    if (s.webkitLineClamp !== 'none' && e.scrollHeight > e.clientHeight + 2) faults.add('lines left out: ' + name(e));
  }
  const pressed = [...document.querySelectorAll('button, a.btn, a.ib, summary, select, input:not([type=hidden])')]
    .filter((e) => shown(e) && !floats(e));
  const over = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2
    && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 2;
  for (const e of pressed) { // at its edges nothing else lies over it
    const o = e.getBoundingClientRect(), r = clipped(e), y = (Math.max(r.top, 0) + Math.min(r.bottom, innerHeight)) / 2;
    if (r.bottom - r.top < o.height / 2 || y < 2 || y > innerHeight - 2 || moves(e)) continue;
    for (const x of [o.left + 4, o.right - 4]) {
      const top = document.elementFromPoint(x, y);
      if (top && !e.contains(top) && !top.contains(e) && !floats(top)) faults.add('covered by ' + short(top) + ': ' + name(e));
    }
  }
  pressed.forEach((a, i) => pressed.slice(i + 1).forEach((b) => {
    if (!a.contains(b) && !b.contains(a) && over(clipped(a), clipped(b))) faults.add('overlap: ' + name(a) + ' and ' + name(b));
  }));
  const leaves = texts.filter((e) => !floats(e) && e.children.length === 0 && !e.closest('.tabs, dialog'));
  leaves.forEach((a, i) => leaves.slice(i + 1).forEach((b) => {
    const flows = a.parentElement === b.parentElement && getComputedStyle(a).display === 'inline' && getComputedStyle(b).display === 'inline';
    if (!flows && over(clipped(a), clipped(b))) faults.add('texts overlap: ' + name(a) + ' and ' + name(b));
  }));
  for (const svg of [...document.querySelectorAll('main svg')].filter((e) => e.checkVisibility() && e.getBoundingClientRect().width > 60)) {
    const o = svg.getBoundingClientRect(), drawn = [...svg.querySelectorAll('text')].filter((e) =>
      e.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && e.textContent.trim() && getComputedStyle(e).fill !== 'none');
    for (const e of drawn) {
      const r = e.getBoundingClientRect();
      if (r.width > 2 && (r.right > o.right + 2 || r.left < o.left - 2 || r.bottom > o.bottom + 3 || r.top < o.top - 3)) faults.add('beyond its picture: ' + name(e));
    }
    drawn.forEach((a, i) => drawn.slice(i + 1).forEach((b) => {
      if (!a.contains(b) && over(a.getBoundingClientRect(), b.getBoundingClientRect())) faults.add('drawn over each other: ' + name(a) + ' and ' + name(b));
    }));
  }
  return [...faults];
}