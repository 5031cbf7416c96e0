// Mount plans: how the cameras of a design are held.

import { all, get, post } from "./api.js";
import { choice, field, figures, fill, frame, h, number, percent, problem, table } from "./dom.js";
import { watch } from "./job.js";
import { completed, files, links } from "./joblist.js";

const KINDS = [["t-slot", "Frame of t-slot profiles"], ["plate", "Plate with posts"], ["arc", "Arc"], ["tripods", "Tripods"]];

/** The form with the plans there are (`new`, and a design), or one plan. */
export async function build(root, [id, wanted], signal) {
  if (id && id !== "new") await one(root, id, signal);
  else await form(root, wanted, signal);
}

async function form(root, wanted, signal) {
  const [made, plans] = await Promise.all([all("/v1/designs", signal), all("/v1/plans", signal)]);
  const designs = completed(made, (job) => `${job.result.name || "Design"}, ${job.result.cameras} cameras`);
  const which = choice(designs, wanted ?? designs[0]?.[0]);
  const kind = choice(KINDS, "t-slot");
  const said = h("div", {});
  const go = async (event) => {
    event.preventDefault();
    try {
      const job = await post("/v1/plans", { design_id: which.value, mount: { kind: kind.value } });
      location.hash = `#/build/${job.id}`;
    } catch (error) {
      fill(said, problem(error));
    }
  };
  fill(root, h("h1", {}, "Plan a mount"),
    designs.length ? h("form", { class: "card configure", onsubmit: go }, h("div", { class: "fields" }, field("Design", which), field("Built of", kind)),
      h("button", { type: "submit", class: "main" }, "Plan it"), said)
      : h("p", {}, "There is no finished design yet. ", h("a", { href: "#/design" }, "Make one"), "."),
    h("h2", {}, "Plans"), links(plans, "build", (job) => (job.result ? `${job.result.name || "Plan"}, ${job.result.system}` : "Plan")));
}

async function one(root, id, signal) {
  const place = h("div", {});
  fill(root, h("p", {}, h("a", { href: "#/build" }, "All plans")), h("h1", {}, "Mount plan"), place);
  await watch(place, await get(`/v1/plans/${encodeURIComponent(id)}`, signal), (job) => outcome(job, signal), signal);
}

async function outcome(job, signal) {
  const { result } = job;
  const { built } = result.price;
  return [
    h("p", { class: result.buildable && built.feasible ? "good" : "bad" }, result.buildable
      ? built.feasible ? "Nothing clashes, and every limit is kept as it is set." : `As it is set, it breaks ${built.broken.join(", ")}.`
      : "It cannot be built so."),
    result.clashes.length ? table("In each other's way", ["", "", "Clearance", "Wanted"], result.clashes.map((clash) =>
      [clash.one, clash.other, number(clash.clearance_mm, "mm"), number(clash.required_mm, "mm")])) : null,
    figures([["Sigma, median", number(1000 * built.sigma_median_mm, "µm")], ["Lost by building", percent(Math.max(0, result.price.sigma_loss))],
      ["Rigs that keep the limits", percent(result.yield_share)], ["Profile", number(result.member_length_mm / 1000, "m")], ["Printed wedges", result.wedges], ["Parts", result.parts]]),
    h("p", {}, h("a", { class: "button main", href: `${job.links.self}/archive`, download: true }, "Everything as a ZIP")),
    frame("Plan", `${job.links.self}/report`),
    await files(job, signal),
  ];
}
