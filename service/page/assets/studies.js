// Studies: many rigs over a grid of choices, what they say together, and the one to build.

import { all, get, post } from "./api.js";
import { choice, field, figures, fill, frame, h, number, problem } from "./dom.js";
import { watch } from "./job.js";
import { files, links } from "./joblist.js";
import { rigForm } from "./rigform.js";
import { fromFiles } from "./studyfile.js";

const FORMS = [["", "as the rig says"], ["free", "free"], ["symmetric", "symmetric"], ["free symmetric", "both"]];

/** The form with the studies there are, or one of them. */
export async function studies(root, [id], signal) {
  if (id) await one(root, id, signal);
  else await form(root, signal);
}

async function form(root, signal) {
  const [scans, rigs, schema, made] = await Promise.all([
    all("/v1/scans", signal), get("/v1/rig-examples", signal), get("/v1/rig-schema", signal), all("/v1/studies", signal)]);
  const name = h("input", { maxlength: 100, value: "How many cameras?" });
  const heads = scans.map((scan, k) => h("input", { type: "checkbox", value: scan.id, checked: k === 0 }));
  const cameras = list("5, 6, 7");
  const distances = list("");
  const seeds = list("");
  const forms = choice(FORMS, "");
  const starts = h("input", { type: "number", min: 1, max: 100, value: 2 });
  let limits = rigForm(rigs.items[0].rig, schema);
  const place = h("div", {}, limits.element);
  const example = choice(rigs.items.map(({ name: words, rig }, k) => [k, rig.name ?? words]), 0, () => {
    limits = rigForm(rigs.items[Number(example.value)].rig, schema);
    fill(place, limits.element);
  });
  const said = h("div", { "aria-live": "polite" });
  const start = h("button", { type: "submit", class: "main" }, "Compare them");
  const chosen = () => heads.filter((box) => box.checked).map((box) => box.value);
  const go = async (event) => {
    event.preventDefault();
    start.disabled = true;
    try {
      const grid = { cameras: numbers(cameras), design_distance_mm: numbers(distances), seed: numbers(seeds), form: forms.value.split(" ").filter(Boolean) };
      const asked = Object.fromEntries(Object.entries(grid).filter(([, values]) => values.length));
      await begin({ study: { name: name.value, starts: Number(starts.value), grid: asked }, rigs: [limits.read()], scan_ids: chosen() });
    } catch (error) {
      fill(said, problem(error));
      start.disabled = false;
    }
  };
  fill(root, h("h1", {}, "Studies"),
    scans.length ? h("form", { class: "card configure", onsubmit: go, novalidate: true }, h("h2", {}, "Compare rigs"),
      h("fieldset", {}, h("legend", {}, "Heads"), heads.map((box, k) => h("p", { class: "row" }, labelled(box, scans[k].filename)))),
      h("div", { class: "fields" }, field("Name", name), field("Cameras", cameras, "How many, with commas: each is tried."),
        field("Distances of neighbours, mm", distances, "Left empty: as the limits let them stand."),
        field("Form", forms), field("Seeds", seeds, "Several show how much of a difference is chance."),
        field("Starts of each design", starts), field("Begin with", example)),
      place, start, said, fromFiles(scans, chosen, begin))
      : h("p", {}, "There is no scan yet. ", h("a", { href: "#/design" }, "Give one under Design"), "."),
    h("h2", {}, "Studies there are"),
    links(made, "studies", (job) => (job.result ? `${job.result.name}, ${job.result.designs} designs` : "Study")));
}

async function begin(asked) {
  const job = await post("/v1/studies", asked, `page-${Date.now()}-${Math.random()}`);
  location.hash = `#/studies/${encodeURIComponent(job.id)}`;
}

function list(value) {
  return h("input", { value, pattern: "[0-9., ]*", inputmode: "decimal", autocomplete: "off" });
}

function numbers(input) {
  return input.value.split(/[,\s]+/).filter(Boolean).map(Number);
}

function labelled(box, words) {
  box.id = `head${box.value}`;
  return [box, h("label", { for: box.id }, words)];
}

async function one(root, id, signal) {
  const place = h("div", {});
  fill(root, h("p", {}, h("a", { href: "#/studies" }, "All studies")), h("h1", {}, "Study"), place);
  await watch(place, await get(`/v1/studies/${encodeURIComponent(id)}`, signal), (job) => outcome(job, signal), signal);
}

async function outcome(job, signal) {
  const { result } = job;
  const { recommended } = result;
  return [
    h("p", { class: recommended ? "good" : "warn" }, recommended ? `Recommended: ${recommended.choice}. ${result.why}` : result.why),
    figures([["Designs", result.designs], ["Hold every limit", result.feasible], ["On the front", result.on_front], ["Known before", result.reused],
      ...(recommended ? [["Sigma, median", number(1000 * recommended.sigma_median_mm, "µm")], ["Sigma, 95 %", number(1000 * recommended.sigma_p95_mm, "µm")]] : [])]),
    recommended ? await designing(job, signal) : null,
    frame("The study", `${job.links.self}/report`),
    await files(job, signal),
  ];
}

/** A button that has the recommended rig designed in full, for one of the scans that are here. */
async function designing(job, signal) {
  const scans = await all("/v1/scans", signal);
  const head = choice(scans.map((scan) => [scan.id, scan.filename]), scans.find((scan) => scan.filename === job.result.recommended.head)?.id ?? scans[0]?.id);
  const said = h("div", { "aria-live": "polite" });
  const go = async () => {
    try {
      const { rig } = await get(`${job.links.self}/recommended`);
      const design = await post("/v1/designs", { scan_id: head.value, rig });
      location.hash = `#/design/${encodeURIComponent(design.id)}`;
    } catch (error) {
      fill(said, problem(error));
    }
  };
  return scans.length ? h("div", { class: "configure" }, h("div", { class: "row" }, field("For", head),
    h("button", { type: "button", class: "main", onclick: go }, "Design the recommended rig")), said) : null;
}
