// The door: a key is asked for where others than this machine can reach the service.

import { signIn } from "./api.js";
import { field, fill, h, problem } from "./dom.js";

/** Ask for a key until one is right. */
export function asked(place) {
  return new Promise((resolve) => {
    const key = h("input", { type: "password", required: true, autocomplete: "current-password", maxlength: 200 });
    const told = h("div", { "aria-live": "polite" });
    const go = async (event) => {
      event.preventDefault();
      try {
        await signIn(key.value.trim());
        resolve();
      } catch (error) {
        fill(told, problem(error));
        key.select();
      }
    };
    fill(place, h("form", { class: "card door", onsubmit: go },
      h("h1", {}, "Sign in"),
      field("Your key", key, "Whoever runs the service makes one: rigwright keys add NAME"),
      h("div", { class: "row" }, h("button", { type: "submit", class: "main" }, "Sign in")), told));
    key.focus();
  });
}
