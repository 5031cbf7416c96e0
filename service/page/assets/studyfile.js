// A study as its file says it: the file, its rig files, and the scans of its heads that are here.

import { post } from "./api.js";
import { field, figures, fill, h, problem } from "./dom.js";

const KIND = /^\s*schema\s*=\s*["']rigwright\.study\//m;

/** A place for the files. `chosen()` are the ids of heads for a study whose file names none. */
export function fromFiles(scans, chosen, begin) {
  const files = h("input", { type: "file", accept: ".toml", multiple: true });
  const place = h("div", { "aria-live": "polite" });
  files.addEventListener("change", async () => {
    try {
      const given = await Promise.all([...files.files].map(async (file) => ({ name: file.name, text: await file.text() })));
      const [study] = given.filter((one) => KIND.test(one.text));
      if (!study) throw new Error("None of these files is a study file; choose one together with the rig files that it names.");
      shown(place, await post("/v1/study-files", { study, rigs: given.filter((one) => one !== study) }), scans, chosen, begin);
    } catch (error) {
      fill(place, problem(error));
    }
    files.value = ""; // the same file, put right, can be chosen again
  });
  return h("details", {}, h("summary", {}, "From a study file"),
    field("Study file and its rig files", files, "All at once, as they are for the command."), place);
}

function shown(place, read, scans, chosen, begin) {
  const found = read.heads.map((name) => scans.find((scan) => scan.filename === name));
  const missing = read.heads.filter((_, k) => !found[k]);
  const grid = Object.entries(read.study.grid ?? {}).map(([choice, values]) => [choice, values.join(", ")]);
  const go = async (event) => {
    event.target.disabled = true;
    try {
      await begin({ study: read.study, rigs: read.rigs, scan_ids: read.heads.length ? found.map((scan) => scan.id) : chosen() });
    } catch (error) {
      fill(place, problem(error));
    }
  };
  fill(place, figures([["Study", read.study.name ?? "study"], ["Rigs", read.rigs.length], ...grid, ["Heads", read.heads.join(", ") || "those chosen above"]]),
    missing.length ? h("p", { class: "bad" }, `Not here: ${missing.join(", ")}. `, h("a", { href: "#/design" }, "Give it under Design"), ".")
      : h("button", { type: "button", class: "main", onclick: go }, "Compare as the file says"));
}
