// The surface that a capture's pictures show, and how far it is from a reference.

import { all, get, post } from "./api.js";
import { choice, field, figures, fill, frame, h, number, percent, table } from "./dom.js";
import { asking } from "./asking.js";
import { watch } from "./job.js";
import { completed, files, links } from "./joblist.js";

/** All of it, one reconstruction (`reconstructions`) or one comparison (`comparisons`). */
export async function surface(root, [what, id], signal) {
  const shown = { reconstructions: ["Surface", reconstructed], comparisons: ["Map of errors", compared] }[what];
  if (!shown) {
    await overview(root, signal);
    return;
  }
  const place = h("div", {});
  fill(root, h("p", {}, h("a", { href: "#/surface" }, "All surfaces")), h("h1", {}, shown[0]), place);
  await watch(place, await get(`/v1/${what}/${encodeURIComponent(id)}`, signal), (job) => shown[1](job, signal), signal);
}

async function overview(root, signal) {
  const [sessions, calibrated, designed, made, scans, comparisons] = await Promise.all([
    get("/v1/sessions", signal),
    all("/v1/calibrations", signal), all("/v1/designs", signal), all("/v1/reconstructions", signal),
    all("/v1/scans", signal), all("/v1/comparisons", signal)]);
  const calibrations = completed(calibrated, (job) => `Calibration of ${job.result.cameras.length} cameras`);
  const designs = completed(designed, (job) => `${job.result.name || "Design"}, as designed`);
  const surfaces = completed(made, named);
  const cameras = [...calibrations.map(([id, words]) => [`c${id}`, words]), ...designs.map(([id, words]) => [`d${id}`, words])];
  fill(root, h("h1", {}, "Surfaces"),
    h("div", { class: "split" }, reconstructForm(sessions.items, cameras, signal), compareForm(surfaces, scans)),
    h("h2", {}, "Reconstructions"), links(made, "surface/reconstructions", (job) => (job.result ? named(job) : "Reconstruction")),
    h("h2", {}, "Comparisons"), links(comparisons, "surface/comparisons", (job) => (job.result ? `median ${number(job.result.median_absolute_mm, "mm")}` : "Comparison")));
}

function named(job) {
  return `${job.result.frame}, ${job.result.points.toLocaleString("en")} points`;
}

function reconstructForm(sessions, cameras, signal) {
  const lacking = !sessions.length ? "Take a capture first, under Rig."
    : !cameras.length ? "It must be known where the cameras stand: calibrate them, or design the rig here." : "";
  const capture = choice([]);
  const list = async () => {
    const held = await get(`/v1/sessions/${encodeURIComponent(session.value)}`, signal).catch(() => ({ captures: [] }));
    fill(capture, held.captures.length ? held.captures.toReversed().map(({ capture_id: id }) => h("option", { value: id }, id))
      : h("option", { value: "" }, "none in this session"));
  };
  const session = choice(sessions.map(({ name }) => [name, name]), sessions.at(-1)?.name, list);
  const where = choice(cameras, cameras[0]?.[0]);
  if (!lacking) list();
  return asking("Make a surface", "Reconstruct", [field("Session", session), field("Capture", capture), field("Cameras", where)], lacking, async () => {
    if (!capture.value) throw new Error(`session ${session.value} holds no capture; choose another`);
    const asked = { pictures: { session: session.value, captures: [capture.value] } };
    asked[where.value.startsWith("c") ? "calibration_id" : "design_id"] = where.value.slice(1);
    return `#/surface/reconstructions/${(await post("/v1/reconstructions", asked)).id}`;
  });
}

function compareForm(surfaces, scans) {
  const lacking = !surfaces.length ? "There is no surface yet." : !scans.length ? "Give the reference under Design, as a scan." : "";
  const which = choice(surfaces, surfaces[0]?.[0]);
  const reference = choice(scans.map((scan) => [scan.id, scan.filename]), scans[0]?.id);
  const align = choice([["best-fit", "put it where it fits best"], ["none", "leave it where it is"], ["best-fit-scale", "fit its size as well"]], "best-fit");
  return asking("How true is it?", "Compare", [field("Surface", which), field("Reference", reference, "In millimetres."), field("Before", align)], lacking, async () => {
    const asked = { cloud: { reconstruction_id: which.value }, reference_scan_id: reference.value, align: align.value };
    return `#/surface/comparisons/${(await post("/v1/comparisons", asked)).id}`;
  });
}

async function reconstructed(job, signal) {
  const { result } = job;
  return [
    result.without_pictures.length ? h("p", { class: "warn" }, `No picture from ${result.without_pictures.join(", ")}.`) : null,
    figures([["Points", result.points.toLocaleString("en")], ["A point is known to", number(result.sigma_median_mm, "mm")],
      ["Seen by", `${result.views_median} cameras`], ["Surface", number(result.mesh_area_mm2 / 100, "cm²")]]),
    frame("The surface, to turn", `${job.links.self}/report`),
    table("Cameras", ["Camera", "Tried", "Matched", "Points"], result.cameras.map((one) => [one.camera, one.tried, one.measured, one.points])),
    await files(job, signal)];
}

async function compared(job, signal) {
  const { result } = job;
  return [
    figures([["Median distance", number(result.median_absolute_mm, "mm")], ["Bias", number(result.bias_mm, "mm")], ["RMS", number(result.rms_mm, "mm")],
      ...result.reached_percent.slice(0, 2).map(({ at, value }) => [`Reached within ${number(at, "mm")}`, percent(value / 100)])]),
    result.converged ? null : h("p", { class: "warn" }, "The fit did not come to its end."),
    frame("Map of errors", `${job.links.self}/report`), await files(job, signal)];
}
