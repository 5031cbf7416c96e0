// Limits that contradict each other: a button for each that helps if it alone gives way.

import { get, post } from "./api.js";
import { fill, h, number, problem, table } from "./dom.js";

// What to add to which number of a rig file, times what the limit gives way by.
const NUMBERS = {
  base_height_min: ["base_height", "min", -1], base_height_max: ["base_height", "max", 1],
  base_height_neighbour: ["base_height", "neighbour_max", 1],
  base_height_mean_min: ["base_height", "mean_min", -1], base_height_mean_max: ["base_height", "mean_max", 1],
  incidence_mean: ["incidence", "mean_max_deg", 1], frame: ["frame", "margin_px", -1],
  centring: ["centring", "tolerance_px", 1], spacing: ["spacing", "tolerance_mm", 1], gsd: ["gsd", "max_mm", 1],
  stand_off_min: ["stand_off", "min_mm", -1], stand_off_max: ["stand_off", "max_mm", 1],
  body_clearance: ["bodies", "clearance_mm", -1], sight_line: ["sight_lines", "clearance_mm", -1],
};
const MORE = 1.02; // a limit that is met to the last digit is hard to find a rig for

/** A rig with one limit that gives way; null where no number of it can. */
export function relaxed(rig, { family, give_alone: give }) {
  if (!give) return null;
  const made = structuredClone(rig);
  const tier = family.match(/^coverage_(\d+)$/);
  if (tier) {
    const found = made.limits?.coverage?.tier?.find((one) => one.views === Number(tier[1]));
    if (!found) return null;
    found.share = Math.max(0, found.share - MORE * give);
    return made;
  }
  const [part, key, sign] = NUMBERS[family] ?? [];
  const now = made.limits?.[part]?.[key];
  if (typeof now !== "number" || now + sign * MORE * give < 0) return null;
  made.limits[part][key] = now + sign * MORE * give;
  return made;
}

/** The conflicts of a design as a table, with what can be tried. */
export async function conflicts(job, signal) {
  const { rig } = await get(`${job.links.self}/design`, signal);
  const said = h("div", { "aria-live": "polite" });
  const rows = job.result.conflicts.map((one) => {
    const made = relaxed(rig, one);
    return [one.family.replaceAll("_", " "), number(one.give, one.unit), number(one.give_alone, one.unit), made && h("button", {
      type: "button", class: "quiet configure", title: "Designs anew with this limit relaxed, all others as they are",
      onclick: async (event) => {
        event.target.disabled = true;
        try {
          const again = await post("/v1/designs", { scan_id: job.scan_id, rig: made });
          location.hash = `#/design/${again.id}`;
        } catch (error) {
          event.target.disabled = false;
          fill(said, problem(error));
        }
      } }, `Relax it by ${number(one.give_alone * MORE, one.unit)}`)];
  });
  return [table("What would have to give way", ["Limit", "With the others", "Alone", ""], rows), said];
}
