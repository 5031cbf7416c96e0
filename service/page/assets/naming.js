// How sessions are named, and what a form keeps while its view is left.

import { choice } from "./dom.js";

const RULES = [["day-subject", "day and subject"], ["day", "day"], ["subject", "subject"], ["", "as typed"]];

/** A choice of the rule by which the input `session` follows the input `subject`. */
export function naming(session, subject) {
  const today = new Date().toLocaleDateString("sv");
  const follow = () => {
    const who = letters(subject.value);
    const named = { "day-subject": who ? `${today}-${who}` : today, day: today, subject: who || today }[rule.value];
    if (named) session.value = named.slice(0, 64);
  };
  const rule = choice(RULES, "day-subject", follow);
  subject.addEventListener("input", follow);
  session.addEventListener("input", () => { rule.value = ""; });
  return { rule, follow };
}

/** A name as files may have it: without accents, and a dash for what is no letter or digit. */
function letters(words) {
  return words.normalize("NFKD").replace(/\p{M}/gu, "").replace(/[^A-Za-z0-9_.]+/g, "-").replace(/^[-_.]+|-+$/g, "");
}

/** Have inputs, by name, keep their values in this tab when the view is left or loaded again. */
export function kept(place, inputs) {
  const known = JSON.parse(sessionStorage.getItem(place) ?? "{}");
  const keep = () => sessionStorage.setItem(place, JSON.stringify(Object.fromEntries(Object.entries(inputs).map(([name, input]) => [name, input.value]))));
  for (const [name, input] of Object.entries(inputs)) {
    if (name in known) input.value = known[name];
    input.addEventListener("input", keep);
    input.addEventListener("change", keep);
  }
}
