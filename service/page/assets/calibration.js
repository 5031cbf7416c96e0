// Calibration and check: targets to print, cameras as they are, and the light that says whether they moved.

import { all, get, post, upload } from "./api.js";
import { choice, field, figures, fill, frame, h, number, percent, problem, table } from "./dom.js";
import { accepted, acceptForm } from "./acceptance.js";
import { guide } from "./guide.js";
import { asking } from "./asking.js";
import { watch } from "./job.js";
import { completed, files, links } from "./joblist.js";

/** All of it, or one calibration (`calibration`), check (`check`) or target set (`targets`). */
export async function calibration(root, [what, id], signal) {
  const back = h("p", {}, h("a", { href: "#/calibration" }, "Calibration and check"));
  const place = h("div", {});
  if (what === "calibrations") {
    fill(root, back, h("h1", {}, "Calibration"), place);
    await watch(place, await get(`/v1/calibrations/${encodeURIComponent(id)}`, signal), (job) => calibrated(job, signal), signal);
  } else if (what === "checks") {
    fill(root, back, h("h1", {}, "Check"), place);
    await watch(place, await get(`/v1/checks/${encodeURIComponent(id)}`, signal), (job) => checked(job, signal), signal);
  } else if (what === "acceptances") {
    fill(root, back, h("h1", {}, "Acceptance test"), place);
    await watch(place, await get(`/v1/acceptances/${encodeURIComponent(id)}`, signal), (job) => accepted(job, signal), signal);
  } else await overview(root, signal);
}

async function overview(root, signal) {
  const [targets, sets, sessions, designed, calibrations, checks, acceptances] = await Promise.all([
    all("/v1/target-sets", signal), all("/v1/picture-sets", signal), get("/v1/sessions", signal),
    all("/v1/designs", signal), all("/v1/calibrations", signal), all("/v1/checks", signal), all("/v1/acceptances", signal)]);
  const designs = completed(designed, (job) => `${job.result.name || "Design"}, ${job.result.cameras} cameras`);
  const known = completed(calibrations, fit);
  const pictures = [...sessions.items.map(({ name }) => [`s${name}`, `Session ${name}`]), ...sets.map((set) => [`p${set.id}`, `Pictures ${set.filename ?? set.id}`])];
  fill(root, h("h1", {}, "Calibration and check"),
    h("div", { class: "split" }, checkForm(known, pictures), calibrateForm(targets, pictures, designs)),
    guide(targets, sessions.items, signal),
    acceptForm(known, targets, pictures, source),
    h("section", { class: "card" }, h("h2", {}, "Targets and pictures"), targetsForm(designs, () => overview(root, signal)), given(root, signal), h("ul", { class: "list" }, targets.map((set) => sheets(set, signal)))),
    h("h2", {}, "Checks"), links(checks, "calibration/checks", (job) => (job.result ? `${job.result.light}: ${job.result.text.slice(0, 90)}` : "Check")),
    h("h2", {}, "Acceptance tests"), links(acceptances, "calibration/acceptances", (job) => (job.result ? `${job.result.outcome}: ${job.result.text.slice(0, 90)}` : "Acceptance test")),
    h("h2", {}, "Calibrations"), links(calibrations, "calibration/calibrations", (job) => (job.result ? fit(job) : "Calibration")));
}

function fit(job) {
  return `${job.result.cameras.length} cameras, ${number(job.result.rms_px)} px`;
}

function source(value) {
  return value.startsWith("s") ? { session: value.slice(1) } : { picture_set_id: value.slice(1) };
}

function checkForm(known, pictures) {
  const which = choice(known, known[0]?.[0]);
  const from = choice(pictures, pictures[0]?.[0]);
  const lacking = !known.length ? "There is no calibration to check against yet." : !pictures.length ? "Capture the targets first, under Rig, or give pictures below." : "";
  return asking("Check: is it still as it was?", "Check", [field("Calibration", which), field("Pictures of targets", from)], lacking, async () => {
    const job = await post("/v1/checks", { calibration_id: which.value, pictures: source(from.value) });
    return `#/calibration/checks/${job.id}`;
  });
}

function calibrateForm(targets, pictures, designs) {
  const set = choice(targets.map((one) => [one.id, `${one.name || "Targets"}, ${one.targets} targets`]), targets[0]?.id);
  const from = choice(pictures, pictures[0]?.[0]);
  const start = choice([["", "nothing"], ...designs], designs[0]?.[0] ?? "");
  const name = h("input", { maxlength: 100 });
  const lacking = !targets.length ? "Give or propose targets first, below." : !pictures.length ? "Capture the targets in ten places or more first, under Rig, or give pictures below." : "";
  return asking("Calibrate", "Calibrate", [field("Targets", set), field("Pictures of them", from), field("Begin from", start), field("Name", name)], lacking, async () => {
    const asked = { target_set_id: set.value, pictures: source(from.value), name: name.value };
    if (start.value) asked.design_id = start.value;
    const job = await post("/v1/calibrations", asked);
    return `#/calibration/calibrations/${job.id}`;
  });
}

/** Targets and pictures that are there already, as files. */
function given(root, signal) {
  const said = h("div", { "aria-live": "polite" });
  const taken = (accept, send) => h("input", { type: "file", accept, onchange: async (event) => {
    const [file] = event.target.files;
    if (!file) return;
    fill(said, h("p", {}, `Reading ${file.name} …`));
    try {
      await send(file);
      await overview(root, signal);
    } catch (error) {
      event.target.value = ""; // the same file, put right, can be chosen again
      fill(said, problem(error));
    }
  } });
  return h("div", { class: "configure" }, h("div", { class: "fields" },
    field("Target file", taken(".toml", async (file) => post("/v1/target-files", { name: file.name, text: await file.text() })), "Targets that are there already, as TOML."),
    field("Pictures", taken(".zip", (file) => upload(`/v1/picture-sets?filename=${encodeURIComponent(file.name)}`, file, () => {})),
      "A ZIP with a folder for each camera; pictures of one moment have the same name.")), said);
}

function targetsForm(designs, again) {
  const which = choice(designs, designs[0]?.[0]);
  const said = h("div", {});
  if (!designs.length) return h("p", { class: "note" }, "With a design, targets that suit its cameras are proposed here, to be printed.");
  return h("div", { class: "row configure" }, field("For the cameras of", which), h("button", { type: "button", class: "quiet", onclick: async () => {
    try {
      const made = await post("/v1/target-set-proposals", { design_id: which.value });
      fill(said, h("p", { class: "good" }, `${made.target_set.targets} targets.`), h("ul", {}, made.notes.map((note) => h("li", {}, note))),
        h("button", { type: "button", class: "quiet", onclick: again }, "Show them below"));
    } catch (error) {
      fill(said, problem(error));
    }
  } }, "Propose targets"), said);
}

function sheets(set, signal) {
  const place = h("ul", {});
  return h("li", {}, h("details", { ontoggle: async (event) => {
    if (!event.target.open || place.children.length) return;
    try {
      const { items } = await get(set.links.sheets, signal);
      fill(place, items.map((sheet) => h("li", {}, h("a", { href: sheet.href, download: true }, sheet.name), ` (${sheet.carrier})`)));
    } catch (error) {
      fill(place, problem(error));
    }
  } }, h("summary", {}, `${set.name || "Targets"}, ${set.targets} targets`), place));
}

async function calibrated(job, signal) {
  const { result } = job;
  return [
    h("p", { class: result.converged ? "good" : "bad" }, result.converged ? "The adjustment came to its end." : `Not converged: ${result.why_stopped}`),
    result.warnings.length ? h("ul", { class: "warn" }, result.warnings.map((one) => h("li", {}, one))) : null,
    figures([["Cameras", result.cameras.length], ["Fit", number(result.rms_px, "px")], ["Halves differ by", number(result.cross_validation, "sigma")], ["Size from", result.scale]]),
    table("Cameras", ["Camera", "Points", "Fit", "Focal length", "Field covered", "Position known to"], result.cameras.map((camera) => [
      camera.name, camera.points, number(camera.rms_px, "px"), `${number(camera.focal_length_px, "", 6)} ± ${number(camera.focal_sigma_px, "px", 2)}`,
      percent(camera.coverage), number(camera.position_sigma_mm, "mm", 2)])),
    h("p", {}, h("a", { href: `${job.links.self}/history`, target: "_blank", rel: "noopener" }, "All checks against it as a curve")),
    frame("Report", `${job.links.self}/report`), await files(job, signal)];
}

async function checked(job, signal) {
  const { result } = job;
  return [
    h("div", { class: `light ${result.light}` }, h("strong", {}, result.light), h("p", {}, result.text)),
    result.findings.length ? table("What was found", ["", "Whose", "At the subject"], result.findings.map((one) =>
      [h("span", { class: `state ${{ green: "good", yellow: "warn", red: "bad" }[one.light]}` }, one.kind), one.subjects.join(", "), number(one.effect_mm === null ? null : 1000 * one.effect_mm, "µm")])) : null,
    table("Cameras", ["Camera", "Verdict", "Points", "Fit", "Could hide"], result.cameras.map((camera) =>
      [camera.name, camera.reason ? `${camera.verdict} (${camera.reason})` : camera.verdict, camera.points, number(camera.rms_px, "px"), number(camera.hidden_mm === null ? null : 1000 * camera.hidden_mm, "µm", 2)])),
    frame("Report", `${job.links.self}/report`), await files(job, signal)];
}
