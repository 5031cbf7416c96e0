// Designs: a scan and a rig's limits in, the rig that measures best out.

import { all, get, post, upload } from "./api.js";
import { choice, field, figures, fill, frame, h, number, percent, problem } from "./dom.js";
import { compare } from "./compare.js";
import { watch } from "./job.js";
import { files, links } from "./joblist.js";
import { conflicts } from "./relax.js";
import { rigForm } from "./rigform.js";

/** The form with the designs there are, or one of them. */
export async function design(root, [id], signal) {
  if (id) await one(root, id, signal);
  else await form(root, signal);
}

const AXES = ["auto", "+x", "-x", "+y", "-y", "+z", "-z"].map((axis) => [axis, axis === "auto" ? "found by itself" : axis]);

async function form(root, signal) {
  const [scans, rigs, schema, made] = await Promise.all([
    all("/v1/scans", signal), get("/v1/rig-examples", signal), get("/v1/rig-schema", signal), all("/v1/designs", signal)]);
  const scan = scanChoice(scans);
  const count = h("input", { type: "number", min: 1, max: 500, value: rigs.items[0].rig.cameras ?? 7, required: true });
  let limits = rigForm(rigs.items[0].rig, schema);
  const place = h("div", {}, limits.element);
  const example = choice(rigs.items.map(({ name, rig }, k) => [k, rig.name ?? name]), 0, () => {
    const { rig } = rigs.items[Number(example.value)];
    limits = rigForm(rig, schema);
    count.value = rig.cameras ?? count.value;
    fill(place, limits.element);
  });
  const said = h("div", {});
  const start = h("button", { type: "submit", class: "main" }, "Design the rig");
  const go = async (event) => {
    event.preventDefault();
    if (!scan.chosen()) {
      fill(said, problem({ message: "there is no scan yet; drop one above" }));
      return;
    }
    start.disabled = true;
    try {
      const job = await post("/v1/designs", { scan_id: scan.chosen(), cameras: Number(count.value), rig: limits.read() }, `page-${Date.now()}-${Math.random()}`);
      location.hash = `#/design/${job.id}`;
    } catch (error) {
      fill(said, problem(error));
      start.disabled = false;
    }
  };
  fill(root, h("h1", {}, "Design a rig"),
    h("form", { class: "configure", onsubmit: go, novalidate: true },
      h("section", { class: "card" }, h("h2", {}, "1. The head"), scan.element),
      h("section", { class: "card" }, h("h2", {}, "2. The rig"),
        h("div", { class: "fields" }, field("Cameras", count, "How many to place."), field("Begin with", example)), place),
      h("section", { class: "card" }, h("h2", {}, "3. Start"), start, said)),
    h("h2", {}, "Designs"), compare(made),
    links(made, "design", (job) => (job.result ? `${job.result.name || "Design"}, ${job.result.cameras} cameras, sigma ${microns(job.result.sigma_median_mm)}` : "Design")));
}

/** A place to drop a scan, and the scans that are here. */
function scanChoice(scans) {
  const list = choice(scans.map((one) => [one.id, one.filename]), scans[0]?.id);
  const told = h("div", { role: "status" });
  const options = { units: choice([["auto", "found by itself"], ["mm", "mm"], ["cm", "cm"], ["m", "m"], ["inch", "inch"]], "auto"), up: choice(AXES, "auto"), front: choice(AXES, "auto") };
  const take = async (file) => {
    if (!file) return;
    const bar = h("progress", { max: 1, value: 0, "aria-label": "Upload" });
    fill(told, bar, h("span", {}, ` ${file.name}`));
    const more = Object.entries(options).map(([key, made]) => (made.value === "auto" ? "" : `&${key}=${encodeURIComponent(made.value)}`)).join("");
    try {
      const found = await upload(`/v1/scans?filename=${encodeURIComponent(file.name)}${more}`, file, (share) => {
        bar.value = share;
        if (share === 1) fill(told, h("span", {}, `Reading ${file.name} …`));
      });
      if (![...list.options].some((option) => option.value === found.id)) list.prepend(h("option", { value: found.id }, found.filename));
      list.value = found.id;
      show(found);
    } catch (error) {
      fill(told, problem(error));
    }
  };
  const show = (found) => fill(told, h("p", {}, `${found.filename}: ${found.extents_mm.map((side) => Math.round(side)).join(" x ")} mm`),
    h("ul", {}, found.notes.map((note) => h("li", {}, note.text))));
  const input = h("input", { type: "file", accept: ".glb,.gltf,.obj,.ply,.stl,.3mf,.off,.xyz", onchange: () => take(input.files[0]) });
  const drop = h("div", { class: "drop", ondragover: (event) => { event.preventDefault(); drop.classList.add("over"); },
    ondragleave: () => drop.classList.remove("over"),
    ondrop: (event) => { event.preventDefault(); drop.classList.remove("over"); take(event.dataTransfer.files[0]); } },
  field("Drop a scan here, or choose a file", input, "GLB, OBJ, PLY, STL, 3MF, OFF or XYZ."));
  list.addEventListener("change", () => show(scans.find((one) => one.id === list.value) ?? { filename: "", extents_mm: [], notes: [] }));
  if (scans.length) show(scans[0]);
  return { chosen: () => list.value, element: [drop,
    h("details", {}, h("summary", {}, "The file's units and axes"), h("div", { class: "fields" },
      field("Units", options.units), field("Up", options.up), field("Face looks along", options.front))),
    field("Scan to design for", list), told] };
}

async function one(root, id, signal) {
  const place = h("div", {});
  fill(root, h("p", {}, h("a", { href: "#/design" }, "All designs")), h("h1", {}, "Design"), place);
  await watch(place, await get(`/v1/designs/${encodeURIComponent(id)}`, signal), (job) => outcome(job, signal), signal);
}

async function outcome(job, signal) {
  const { result } = job;
  const seen = result.coverage.map(({ views, share }) => [`Seen by ${views} or more`, percent(share)]);
  return [
    h("p", { class: result.feasible ? "good" : "bad" }, result.feasible ? "Every limit is kept." : "The limits contradict each other: this is the nearest rig."),
    result.contradiction ? h("p", { class: "bad" }, result.contradiction) : null,
    result.conflicts.length ? await conflicts(job, signal) : null,
    figures([["Cameras", result.cameras], ["Sigma, median", microns(result.sigma_median_mm)], ["Sigma, 95 %", microns(result.sigma_p95_mm)], ...seen]),
    h("div", { class: "row" }, h("a", { class: "button main configure", href: `#/build/new/${encodeURIComponent(job.id)}` }, "Plan its mount"), await exportsOf(job, signal)),
    frame("Report", `${job.links.self}/report`),
    await files(job, signal),
  ];
}

async function exportsOf(job, signal) {
  const { items } = await get(`${job.links.self}/exports`, signal);
  const list = choice([["", "Cameras for …"], ...items.map((one) => [one.href, one.form ?? one.name])], "", () => {
    if (list.value) location.assign(list.value);
    list.value = "";
  });
  list.setAttribute("aria-label", "Export the cameras for another program");
  return list;
}

function microns(mm) {
  return mm === null ? "–" : number(1000 * mm, "µm");
}
