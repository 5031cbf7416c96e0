// Forms that ask the service for work.

import { fill, h, problem } from "./dom.js";

/** A form whose button asks for something and then goes there; or what is lacking for it. */
export function asking(title, words, inputs, lacking, ask) {
  const said = h("div", { "aria-live": "polite" });
  const go = async (event) => {
    event.preventDefault();
    try {
      location.hash = await ask();
    } catch (error) {
      fill(said, problem(error));
    }
  };
  return h("form", { class: "card configure", onsubmit: go }, h("h2", {}, title),
    lacking ? h("p", {}, lacking) : [h("div", { class: "fields" }, inputs), h("button", { type: "submit", class: "main" }, words), said]);
}
