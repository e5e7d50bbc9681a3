// The products of a line, to scale. Every slot of the table has its group. What it draws hangs on its head, and only the head is moved: the
// box grows from there, so that its thick edge cannot leave it. Where there is no way from here to there (another product, a jump, head and
// tail changed about) nothing glides.
import { number } from "../js/format.js";
import { openRow } from "../js/commands.js";

const JUMP = 60; // user units: further than any belt carries a product between two drawings
const STATE = { LOST: 5 };
const lang = document.body.dataset.lang;
const valued = (tag) => (tag && tag.state !== "bad" && tag.state !== "none" && typeof tag.value === "number" ? tag.value : null);
const round = (value) => Math.round(value * 100) / 100;
const move = (element, x, width) => {
  element.style.transform = `translate(${round(x)}px,0)`;
  if (width !== undefined) element.style.width = `${round(width)}px`;
};

/** A slot of the table, empty as yet, with what is drawn of it. */
function parts(group) {
  const [body, dts, box, cross, text, alarm] = [".p-body", ".p-dts", ".p-box", ".p-x", ".p-id", ".p-alm"].map((part) => group.querySelector(part));
  return { group, body, dts, box, cross, text, alarm, cells: {}, id: 0, edge: 0, backwards: false };
}

class Line {
  constructor(svg) {
    this.svg = svg;
    this.machine = svg.dataset.machine;
    this.factor = +svg.dataset.factor;
    this.start = +svg.dataset.start;
    this.ends = svg.dataset.ends.split(" ").map(Number);
    this.facts = {};
    this.products = new Map([...svg.querySelectorAll(".prod")].map((group) => [group, parts(group)]));
    this.chosen = 0;
    this.waiting = null;
    this.gap = svg.querySelector(".c-gap");
    svg.addEventListener("tags", ({ target, detail }) => {
      if (target === svg) this.facts = detail;
      else if (target.dataset.slot) this.take(target, detail);
      this.later();
    });
    svg.addEventListener("click", ({ target }) => this.open(target.closest(".prod")));
    svg.addEventListener("keydown", (event) => {
      const group = event.target.closest?.(".prod");
      if (!group || (event.key !== "Enter" && event.key !== " ")) return;
      event.preventDefault();
      if (!event.repeat) this.open(group);
    });
  }

  at(mm) { return this.start + this.factor * mm; }

  fact(key) { return valued(this.facts[key]); }

  take(group, detail) {
    const cells = {};
    for (const [key, tag] of Object.entries(detail)) cells[(/\bmarking_/.test(key) ? "read" : "") + key.slice(key.lastIndexOf("_") + 1)] = tag;
    this.products.get(group).cells = cells;
  }

  /** Once for all that changed in one go. */
  later() {
    this.waiting ??= Promise.resolve().then(() => { this.waiting = null; this.draw(); });
  }

  draw() {
    const known = Object.entries(this.facts).find(([key]) => key.endsWith("_generation"))?.[1];
    if (known) this.svg.dataset.q = known.state;
    const shown = [];
    for (const product of this.products.values()) if (this.place(product)) shown.push(product);
    this.label(shown);
    this.measure(shown);
  }

  /** Put a product where it is; false when its slot is empty or nothing is known of it. */
  place(product) {
    const { group, cells } = product, id = valued(cells.id), head = valued(cells.head), tail = valued(cells.tail) ?? head;
    if (!id || head === null) {
      if (product.id) group.setAttribute("display", "none");
      product.id = 0;
      return false;
    }
    const left = this.at(Math.min(head, tail)), right = this.at(Math.max(head, tail)), width = Math.max(right - left, 2);
    const backwards = head < tail || (head === tail && valued(cells.direction) === 1);
    const fresh = product.id !== id, edge = backwards ? left : left + width;
    group.classList.toggle("still", fresh || backwards !== product.backwards || Math.abs(edge - product.edge) > JUMP);
    if (fresh) {
      group.removeAttribute("display");
      product.text.textContent = String(id);
      product.inked = 0;
    }
    Object.assign(product, { id, edge, backwards, left, right: left + width, middle: left + width / 2 });
    const state = valued(cells.state) ?? 0;
    group.dataset.state = String(state);
    this.name(product);
    group.dataset.q = cells.head.state === "good" ? cells.id.state : cells.head.state;
    group.classList.toggle("chosen", id === this.chosen);
    group.classList.toggle("backwards", backwards);
    move(product.body, edge);
    product.box.style.width = `${round(width)}px`;
    product.dts.style.width = `${round(Math.abs(this.fact(`stop_distance_${this.belt(head)}`) ?? 0) * this.factor)}px`;
    if (state === STATE.LOST) product.cross.setAttribute("d", `M0 88L${round(width)} 130M0 130L${round(width)} 88`);
    return true;
  }

  /** What it is called, for whoever points at it or cannot see it: its identity, and the order that a scanner read of it. */
  name(product) {
    const { group, cells, id } = product;
    const order = valued(cells.readid) === id && valued(cells.readstate) === 1 ? valued(cells.readorder) : 0;
    const name = this.svg.dataset.product.replace("{id}", id) + (order ? `, ${this.svg.dataset.order.replace("{order}", order)}` : "");
    if (product.named === name) return;
    product.named = name;
    group.querySelector("title").textContent = name;
  }

  /** Number of the belt under a place. */
  belt(mm) {
    const index = this.ends.findIndex((end) => mm <= end);
    return index < 0 ? this.ends.length : index + 1;
  }

  /** Identities stand in the products; those too long for theirs stand above on two levels, one on a small screen, where there is room. */
  label(shown) {
    shown.sort((a, b) => a.left - b.left);
    const edges = [-Infinity, -Infinity];
    for (const product of shown) {
      product.inked ||= product.text.getComputedTextLength();
      const out = product.inked + 6 > product.right - product.left, half = product.inked / 2;
      const level = out ? edges.findIndex((edge) => product.middle - half >= edge + 3) : 0;
      if (out && level >= 0) edges[level] = product.middle + half;
      product.group.classList.toggle("out", out);
      product.group.dataset.level = level;
      product.alarm.style.transform = `translate(${round(product.middle)}px,${out ? 38 : 0}px)`;
      product.text.style.transform = `translate(${round(product.middle)}px,${out ? -28 - 16 * level : 0}px)`;
    }
  }

  /** The dimension between the two products of the smallest gap. */
  measure(shown) {
    const { gap } = this, size = this.fact("smallest_gap"), ids = [this.fact("gap_rear"), this.fact("gap_front")];
    const pair = shown.filter(({ id }) => ids.includes(id));
    if (size === null || pair.length !== 2) return gap.setAttribute("display", "none");
    gap.removeAttribute("display");
    const key = ids.join(), [a, b] = [pair[0].right, pair[1].left];
    gap.classList.toggle("still", gap.dataset.of !== key);
    gap.dataset.of = key;
    move(gap.querySelector(".g-a"), a);
    move(gap.querySelector(".g-b"), b);
    move(gap.querySelector(".g-l"), a, Math.max(b - a, 0));
    const text = gap.querySelector(".g-t"), written = `${number(size, size < 10 ? 1 : 0, lang)}\u00a0mm`;
    if (text.textContent !== written) text.textContent = written;
    move(text, (a + b) / 2);
  }

  open(group) {
    const product = this.products.get(group);
    if (!product?.id) return;
    this.choose(product.id);
    openRow(`${this.svg.dataset.url}/table/product/${product.id}`);
  }

  /** The product that Edit and Remove ask about. */
  choose(id) {
    this.chosen = id;
    for (const root of document.querySelectorAll(`[data-operation="${CSS.escape(this.machine)}"]`)) root.dataset.chosen = id || "";
    for (const product of this.products.values()) product.group.classList.toggle("chosen", product.id === id && id !== 0);
    this.mark();
  }

  /** The row of the chosen product; once it is gone nothing is chosen. */
  mark() {
    const rows = [...document.querySelectorAll(".prods [data-product]")];
    for (const row of rows) row.setAttribute("aria-selected", String(+row.dataset.product === this.chosen));
    if (this.chosen && rows.length && !rows.some((row) => +row.dataset.product === this.chosen)) this.choose(0);
  }
}

let lines = []; // what is on the page now: a picture that was made without the device is drawn anew when it answers
const find = () => { lines = [...document.querySelectorAll("[data-conveyor]")].map((svg) => lines.find((line) => line.svg === svg) ?? new Line(svg)); };
find();
document.addEventListener("htmx:after:swap", () => { find(); for (const line of lines) line.mark(); });
document.addEventListener("click", ({ target }) => {
  const row = target.closest?.(".prods [data-product]");
  if (row) for (const line of lines) line.choose(+row.dataset.product === line.chosen && !target.closest("[data-row]") ? 0 : +row.dataset.product);
});

// ---- hold-to-run of one belt or of all ----------------------------------------------------------------------------------------------------

document.addEventListener("change", ({ target }) => {
  if (!target.matches?.(".c-belts [name=belt]")) return;
  for (const pair of target.closest(".c-jog").querySelectorAll("[data-belt]")) pair.hidden = pair.dataset.belt !== target.value;
});
