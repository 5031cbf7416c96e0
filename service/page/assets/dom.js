// Making elements. Text is only ever text here: no name that somebody typed becomes markup.

/** An element with attributes, listeners (keys that begin with "on") and children. */
export function h(tag, given = {}, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(given)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key === "value" || key === "checked" || key === "disabled") made[key] = value;
    else if (value === true) made.setAttribute(key, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(key, value);
  }
  fill(made, ...children);
  return made;
}

/** Put children into an element, in place of what was there. */
export function fill(element, ...children) {
  element.replaceChildren(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** A table: heads, then rows of cells (text or elements). */
export function table(caption, heads, rows) {
  return h("div", { class: "wide" }, h("table", {},
    caption ? h("caption", {}, caption) : null,
    h("thead", {}, h("tr", {}, heads.map((head) => h("th", { scope: "col" }, head)))),
    h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell) => h("td", {}, cell)))))));
}

/** A labelled field; `help` is said below it and to screen readers. */
export function field(label, input, help = "") {
  const id = `f${++field.count}`;
  input.id = id;
  if (help) input.setAttribute("aria-describedby", `${id}h`);
  return h("div", { class: "field" }, h("label", { for: id }, label), input,
    help ? h("small", { id: `${id}h` }, help) : null);
}
field.count = 0;

/** A choice among pairs of value and words. */
export function choice(pairs, chosen, onchange = () => {}) {
  const made = h("select", { onchange }, pairs.map(([value, words]) => h("option", { value }, words)));
  if (chosen !== undefined) made.value = chosen;
  return made;
}

/** A number with its unit, null as a dash; `digits` are significant ones. */
export function number(value, unit = "", digits = 3) {
  if (value === null || value === undefined) return "–";
  const shown = Number(value).toLocaleString("en", { maximumSignificantDigits: digits, useGrouping: false });
  return unit ? `${shown} ${unit}` : shown;
}

/** A share as percent, never rounded up to a hundred. */
export function percent(share) {
  if (share === null || share === undefined) return "–";
  return `${(Math.floor(share * 10000 + 1e-9) / 100).toLocaleString("en")} %`;
}

/** When something was, as the reader's clock has it. */
export function when(iso) {
  return iso ? new Date(iso).toLocaleString() : "–";
}

/** A few figures side by side. */
export function figures(pairs) {
  return h("dl", { class: "figures" }, pairs.map(([words, value]) => h("div", {}, h("dt", {}, words), h("dd", {}, value))));
}

/** Words of a problem, with what to do. */
export function problem(error) {
  const more = error.problem?.errors?.map((fault) => h("li", {}, `${fault.location}: ${fault.message}`)) ?? [];
  return h("div", { class: "problem", role: "alert" }, h("p", {}, error.message), more.length ? h("ul", {}, more) : null);
}

/** A report in its own frame: it may draw, but knows nothing of this page. */
export function frame(title, address) {
  return h("div", { class: "framed" },
    h("p", {}, h("a", { href: address, target: "_blank", rel: "noopener" }, `${title} in a tab of its own`)),
    h("iframe", { src: address, title, sandbox: "allow-scripts allow-downloads", loading: "lazy" }));
}
