// A rig file as a form: fields with units and help, drawn from an example and the schema of rigs.

import { fill, h } from "./dom.js";

const UNITS = [["_mm2", "mm²"], ["_mm", "mm"], ["_um", "µm"], ["_px", "px"], ["_deg", "°"], ["_us", "µs"], ["_s", "s"], ["_kg", "kg"], ["_g", "g"]];
const HIDDEN = ["schema", "name", "cameras"];

/** A form for `rig`; `schema` is what a rig may say. `read()` gives the rig as it was filled in. */
export function rigForm(rig, schema) {
  const now = structuredClone(rig);
  const element = h("div", { class: "rigform" });
  fill(element, groups(now, schema, schema.$defs));
  return { element, read: () => structuredClone(now) };
}

/** Follow references and the "or null" of optional parts to the object that is described. */
function resolve(shape, shapes) {
  let found = shape ?? {};
  for (let depth = 0; depth < 8; depth += 1) {
    if (found.$ref) found = { ...shapes[found.$ref.split("/").at(-1)], description: found.description ?? shapes[found.$ref.split("/").at(-1)]?.description };
    else if (found.anyOf) found = found.anyOf.find((one) => one.type !== "null") ?? {};
    else if (found.allOf?.length === 1) [found] = found.allOf;
    else break;
  }
  return found;
}

/** Plain values of an object first, then a group for each part. */
function groups(values, shape, shapes) {
  const entries = Object.entries(values).filter(([key]) => !HIDDEN.includes(key));
  const plain = entries.filter(([, value]) => isPlain(value)).map(([key]) => input(values, key, shape.properties?.[key], shapes));
  const parts = entries.filter(([, value]) => !isPlain(value)).map(([key]) => part(values, key, shape.properties?.[key], shapes));
  return [plain.length ? h("div", { class: "fields" }, plain) : null, parts];
}

function isPlain(value) {
  return typeof value !== "object" || value === null || (Array.isArray(value) && value.every((one) => typeof one !== "object"));
}

function part(values, key, described, shapes) {
  const value = values[key];
  const shape = resolve(described, shapes);
  const inner = Array.isArray(value)
    ? value.map((one, k) => h("fieldset", {}, h("legend", {}, `${label(key)} ${k + 1}`), groups(one, resolve(shape.items, shapes), shapes)))
    : groups(value, shape, shapes);
  return h("details", { open: ["camera", "limits", "stand_off", "base_height"].includes(key) },
    h("summary", {}, label(key), value.enabled === false ? h("small", {}, " (off)") : null),
    shape.description ? h("p", { class: "note" }, firstSentence(shape.description)) : null, inner);
}

function input(values, key, described, shapes) {
  const value = values[key];
  const help = firstSentence(described?.description ?? resolve(described, shapes).description ?? "");
  const made = h("input", {});
  if (typeof value === "boolean") {
    made.type = "checkbox";
    made.checked = value;
    made.addEventListener("change", () => { values[key] = made.checked; });
  } else if (typeof value === "number") {
    made.type = "number";
    made.step = "any";
    made.value = value;
    made.addEventListener("input", () => { values[key] = made.value === "" ? null : Number(made.value); });
  } else if (Array.isArray(value)) {
    made.value = value.join(", ");
    const numbers = value.every((one) => typeof one === "number");
    made.addEventListener("input", () => {
      const words = made.value.split(",").map((word) => word.trim()).filter(Boolean);
      values[key] = numbers ? words.map(Number) : words;
    });
  } else {
    made.value = value ?? "";
    made.addEventListener("input", () => { values[key] = made.value; });
  }
  made.id = `rig${input.count += 1}`;
  return h("div", { class: "field" }, h("label", { for: made.id }, label(key)), made, help ? h("small", {}, help) : null);
}
input.count = 0;

function label(key) {
  for (const [end, unit] of UNITS) {
    if (key.endsWith(end)) return `${words(key.slice(0, -end.length))}, ${unit}`;
  }
  return words(key);
}

function words(key) {
  const plain = key.replaceAll("_", " ");
  return plain.charAt(0).toUpperCase() + plain.slice(1);
}

function firstSentence(text) {
  return text.replaceAll("`", "").split(/(?<=\.)\s/)[0];
}
