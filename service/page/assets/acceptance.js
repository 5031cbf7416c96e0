// Acceptance: a calibrated bar along seven lines says whether the rig measures lengths as it should.

import { post } from "./api.js";
import { choice, field, figures, h, number, table } from "./dom.js";
import { asking } from "./asking.js";
import { files } from "./joblist.js";

const OUTCOMES = { passed: "green", failed: "red", incomplete: "yellow" };

/** The form; `source` makes a chosen entry of `pictures` what is asked for. */
export function acceptForm(known, targets, pictures, source) {
  const which = choice(known, known[0]?.[0]);
  const bar = choice(targets.map((one) => [one.id, one.name || "Targets"]), targets[0]?.id);
  const from = choice(pictures, pictures[0]?.[0]);
  const operator = h("input", { maxlength: 100, autocomplete: "off" });
  const degrees = h("input", { type: "number", step: "any", min: -50, max: 100 });
  const lacking = !known.length ? "There is no calibration to test yet." : !targets.length ? "Give the bar's target file first, below."
    : !pictures.length ? "Capture the bar along seven lines first, under Rig." : "";
  return asking("Acceptance: does it measure lengths rightly?", "Test it", [field("Calibration to test", which), field("Bar", bar, "The target set of a bar with calibrated lengths."),
    field("Pictures of the bar", from), field("Tested by", operator), field("Temperature, °C", degrees)], lacking, async () => {
    const asked = { calibration_id: which.value, target_set_id: bar.value, pictures: source(from.value), operator: operator.value,
      temperature_degc: degrees.value === "" ? null : Number(degrees.value) };
    return `#/calibration/acceptances/${(await post("/v1/acceptances", asked)).id}`;
  });
}

/** What came of a test. */
export async function accepted(job, signal) {
  const { result } = job;
  return [
    h("div", { class: `light ${OUTCOMES[result.outcome]}` }, h("strong", {}, result.outcome), h("p", {}, result.text)),
    result.missing.length ? h("p", { class: "warn" }, `Missing: ${result.missing.join(", ")}.`) : null,
    result.notes.length ? h("ul", {}, result.notes.map((note) => h("li", {}, note))) : null,
    figures([["Lines", result.lines], ["Largest error", number(result.largest_um, "µm")], ["RMS", number(result.rms_um, "µm")]]),
    h("p", {}, h("a", { class: "button main", href: `${job.links.self}/certificate`, target: "_blank", rel: "noopener" }, "Certificate (PDF)")),
    table("Lengths", ["Line", "Calibrated", "Measured", "Error", "Permitted", ""], result.lengths.map((one) => [
      `${one.line}: ${one.first} to ${one.second}`, number(one.calibrated_mm, "mm", 7), number(one.measured_mm, "mm", 7), number(one.error_um, "µm"), number(one.limit_um, "µm"),
      h("span", { class: `state ${one.within ? "good" : "bad"}` }, one.within ? "within" : "beyond")])),
    await files(job, signal)];
}
