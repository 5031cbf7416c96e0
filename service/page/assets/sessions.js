// Sessions: what was photographed, to look at, prove whole and take away.

import { at, get, post, remove } from "./api.js";
import { fill, h, problem, table, when } from "./dom.js";
import { address, sheet } from "./pictures.js";

/** The list of sessions, or one of them. */
export async function sessions(root, [name], signal) {
  if (name) await one(root, name, signal);
  else await list(root, signal);
}

async function list(root, signal) {
  const [{ items }, gone] = await Promise.all([get("/v1/sessions", signal), get("/v1/removed-sessions", signal)]);
  const rows = h("div", {});
  const show = (words) => {
    const found = items.filter((item) => item.name.toLowerCase().includes(words.toLowerCase()));
    fill(rows, found.length ? h("ul", { class: "list" }, found.map((item) => h("li", {}, h("a", { href: `#/sessions/${encodeURIComponent(item.name)}` }, item.name))))
      : h("p", {}, items.length ? "No session has such a name." : "Nothing was captured yet. Take a capture under Rig."));
  };
  fill(root, h("h1", {}, "Sessions"),
    items.length > 5 ? h("input", { type: "search", placeholder: "Search", "aria-label": "Search sessions", oninput: (event) => show(event.target.value) }) : null, rows, deleted(root, gone.items, signal));
  show("");
}

/** What was deleted and can still be restored. */
function deleted(root, items, signal) {
  if (!items.length) return null;
  const told = h("div", { "aria-live": "polite" });
  const act = async (work) => {
    try {
      await work();
      await list(root, signal);
    } catch (error) {
      fill(told, problem(error));
    }
  };
  return h("details", {}, h("summary", {}, `Deleted, restorable: ${items.length}`), told,
    h("ul", { class: "list" }, items.map((item) => h("li", { class: "row" }, `${item.name}, until ${when(item.until)}`,
      h("button", { type: "button", class: "quiet configure", "aria-label": `Restore ${item.name}`, onclick: () => act(() => post(item.links.restore)) }, "Restore"),
      twice("Erase now", `Erase ${item.name} for good?`, "Erase for good", () => act(() => remove(item.links.self)))))));
}

/** A button that asks once more before it does anything. */
function twice(words, question, sure, act) {
  const place = h("span", { class: "row configure" });
  const ask = () => {
    const no = h("button", { type: "button", class: "quiet", onclick: begin }, "Keep it");
    fill(place, h("span", { role: "alert" }, question), h("button", { type: "button", class: "stop", onclick: act }, sure), no);
    no.focus();
  };
  const begin = () => fill(place, h("button", { type: "button", class: "quiet", onclick: ask }, words));
  begin();
  return place;
}

async function one(root, name, signal) {
  const own = `/v1/sessions/${encodeURIComponent(name)}`;
  const session = await get(own, signal);
  const proof = h("div", { "aria-live": "polite" });
  const captures = session.captures.toReversed().map((entry) => capture(name, own, entry, signal));
  fill(root, h("p", {}, h("a", { href: "#/sessions" }, "All sessions")),
    h("div", { class: "heading" }, h("h1", {}, name),
      h("button", { type: "button", class: "quiet", onclick: () => prove(own, proof) }, "Prove it whole"),
      session.captures.length ? h("a", { class: "button", href: at(`${own}/archive`), download: true }, "All of it as a ZIP") : null,
      twice("Delete", `Delete ${name} and its ${session.captures.length} captures? For some days it can be restored.`, "Delete it", async () => {
        try {
          await remove(own);
          location.hash = "#/sessions";
        } catch (error) {
          fill(proof, problem(error));
        }
      })),
    proof,
    session.captures.length ? captures : h("p", {}, "It holds no capture."),
    h("details", {}, h("summary", {}, "Tables and rig files"),
      h("ul", {}, [...session.rig, ...session.tables].map((file) => h("li", {}, h("a", { href: address(name, file.path), download: true }, file.path))))));
  captures[0]?.setAttribute("open", "");
}

/** A capture that shows its pictures when it is opened. */
function capture(name, own, entry, signal) {
  const place = h("div", {});
  let loaded = false;
  const open = async () => {
    if (loaded) return;
    loaded = true;
    try {
      const record = await get(`${own}/captures/${encodeURIComponent(entry.capture_id)}`, signal);
      fill(place, sheet(name, record, signal));
    } catch (error) {
      loaded = false;
      if (!signal.aborted) fill(place, problem(error));
    }
  };
  return h("details", { class: "card", ontoggle: (event) => event.target.open && open() },
    h("summary", {}, `${entry.capture_id}, ${when(entry.fired_at)}, ${entry.pictures} pictures `,
      h("span", { class: `state ${entry.state === "complete" ? "good" : "bad"}` }, entry.state)), place);
}

async function prove(own, place) {
  fill(place, h("p", {}, "Reading every file …"));
  try {
    const proof = await post(`${own}/verify`);
    fill(place, h("p", { class: proof.whole ? "good" : "bad" }, proof.whole
      ? `Whole: ${proof.captures} capture${proof.captures === 1 ? "" : "s"}${proof.partial ? ` (${proof.partial} partial: pictures are missing)` : ""}, ${proof.files} files, ${(proof.bytes / 1e6).toFixed(1)} MB, each as it was filed.`
      : "Not as it was filed:"),
    proof.whole ? null : table("", ["File", "What"], proof.findings.map((finding) => [finding.path, finding.text])));
  } catch (error) {
    fill(place, problem(error));
  }
}
