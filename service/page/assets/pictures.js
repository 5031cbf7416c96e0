// A capture's pictures as a contact sheet, with what is to be said of them.

import { at } from "./api.js";
import { h, table } from "./dom.js";
import { judged } from "./judged.js";

const SHOWN = ["image/jpeg", "image/png", "image/webp", "image/gif", "image/avif"];
const VERDICTS = { synchronised: "good", "not-synchronised": "bad", undecided: "warn", unproven: "warn" };

/** Where a file of a session is. */
export function address(session, path) {
  return at(`/v1/sessions/${encodeURIComponent(session)}/files/${path.split("/").map(encodeURIComponent).join("/")}`);
}

/**
 * All of a capture: verdict, faults, pictures by shot with what is to be said of each, and those
 * that are missing. `again` takes it once more, where that can be.
 */
export function sheet(session, record, signal, again = null) {
  const judging = judged(session, record);
  const lacking = Object.entries(record.missing);
  const faults = record.faults.filter((fault) => fault.kind !== "missing");
  const made = [
    h("div", { class: "heading" }, h("h2", {}, `${record.capture_id}`),
      h("span", { class: `state ${record.state === "complete" ? "good" : "bad"}` }, record.state),
      h("span", { class: `state ${VERDICTS[record.verdict.state]}` }, record.verdict.state),
      again ? h("button", { type: "button", class: "quiet hardware", title: "Fires again as it was, and rejects this one", onclick: again }, "Retake") : null,
      judging.capture),
    judging.told,
    h("p", {}, record.verdict.text),
    lacking.length ? h("p", { class: "bad" }, `No picture from ${lacking.map(([camera]) => camera).join(", ")}.`) : null,
    faults.length ? h("ul", {}, faults.map((fault) => h("li", {}, fault.text))) : null,
    h("div", { class: "sheet", "aria-live": "off" }, record.frames.filter((frame) => !frame.raw).map((frame) => picture(session, record, frame, judging))),
    h("details", {}, h("summary", {}, "When each camera exposed"),
      table("", ["Camera", "Told by", "Lag", "Skew"], record.cameras.map((camera) =>
        [camera.name, camera.sync_class, us(camera.lag_us, camera.lag_uncertainty_us), us(camera.skew_us, camera.skew_uncertainty_us)]))),
  ];
  judging.begin(signal);
  return made;
}

function picture(session, record, frame, judging) {
  const where = address(session, frame.file.path);
  const words = record.shots > 1 ? `${frame.camera}, shot ${frame.shot}` : frame.camera;
  const seen = SHOWN.includes(frame.media_type)
    ? h("img", { src: where, alt: `Picture of ${words}`, loading: "lazy", decoding: "async" })
    : h("span", { class: "noimage" }, frame.media_type);
  const { elements, of } = judging.add(frame, words);
  return of(h("figure", {}, h("a", { href: where, target: "_blank", rel: "noopener" }, seen),
    h("figcaption", {}, words, frame.status === "ok" ? null : h("span", { class: "state bad" }, frame.status)),
    h("div", { class: "judged" }, elements)));
}

function us(value, uncertainty) {
  if (value === null) return "–";
  return `${Math.round(value)} µs${uncertainty === null ? "" : ` ± ${Math.max(1, Math.round(uncertainty))}`}`;
}
