// Numbers of several machines as one: the footer says how much is forced in the whole plant.
//   data-sum          with data-tags: the sum of what is known, with a ? while something is not
const known = (tag) => tag.state !== "bad" && tag.state !== "none" && typeof tag.value === "number";

document.addEventListener("tags", ({ target, detail }) => {
  if (target.dataset.sum === undefined) return;
  const tags = Object.values(detail), sum = tags.filter(known).reduce((total, tag) => total + tag.value, 0);
  const text = tags.every(known) ? String(sum) : sum ? `${sum}?` : "?";
  if (target.textContent !== text) target.textContent = text;
  target.closest(".count")?.toggleAttribute("data-some", sum > 0);
});
