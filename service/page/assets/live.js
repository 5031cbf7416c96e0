// Live pictures between captures: to aim each camera, to turn its ring, to see the light.

import { all, at, get, pause } from "./api.js";
import { choice, field, fill, h, number } from "./dom.js";

const NS = "http://www.w3.org/2000/svg";

/** The live view of one rig, which asks for nothing until it is opened. `know` hears how it is. */
export function live(rig, signal) {
  const shown = new Map();
  const grid = h("div", { class: "sheet live" });
  const told = h("p", { class: "note", role: "status" }, "");
  const which = h("select", {});
  const targets = choice([["", "nothing"]], "");
  const element = h("details", { class: "card", ontoggle: () => element.open && run() },
    h("summary", {}, "Live view"),
    h("div", { class: "fields" }, field("Camera", which),
      field("Look for", targets, "A target whose middle stands at the datum. Without one, press where you see the datum.")),
    told, grid);
  let running = false;

  async function run() {
    if (running) return;
    running = true;
    try {
      const sets = await all("/v1/target-sets", signal);
      fill(targets, [["", "nothing"], ...sets.map((set) => [set.id, set.name || "Targets"])].map(([value, words]) => h("option", { value }, words)));
      while (element.open && !signal.aborted) await round();
    } catch (error) {
      if (!signal.aborted) told.textContent = error.message;
    } finally {
      running = false;
    }
  }

  /** One look through each camera that is chosen. */
  async function round() {
    const wanted = [...shown.values()].filter((one) => !which.value || one.name === which.value);
    if (document.hidden || !wanted.length) {
      await pause(1000);
      return;
    }
    let resting = "";
    for (const one of wanted) {
      if (!element.open || signal.aborted || document.hidden) return;
      try {
        if (!(await one.look(targets.value, signal))) resting = "The rig is at work; the live view goes on when it has ended.";
      } catch (error) {
        if (signal.aborted) return;
        one.fail(error.message);
      }
    }
    told.textContent = resting;
    await pause(resting ? 1000 : wanted.length > 1 ? 100 : 420);
  }

  const know = (now) => {
    const able = now.cameras.filter((camera) => camera.previews).map((camera) => camera.name);
    element.hidden = !able.length && !shown.size;
    if (able.every((name) => shown.has(name))) return;
    for (const name of able) if (!shown.has(name)) shown.set(name, sight(rig, name));
    const chosen = which.value;
    fill(which, h("option", { value: "" }, "all, in turn"), [...shown.keys()].map((name) => h("option", { value: name }, name)));
    which.value = chosen;
    show();
  };
  const show = () => {
    grid.classList.toggle("single", which.value !== "");
    fill(grid, [...shown.values()].filter((one) => !which.value || one.name === which.value).map((one) => one.element));
  };
  which.addEventListener("change", show);
  return { element, know };
}

/** One camera: its picture, marks over it, and what is to be said of it. */
function sight(rig, name) {
  const path = `${rig.links.self}/cameras/${encodeURIComponent(name)}/preview`;
  const picture = h("img", { alt: `What ${name} sees`, width: 3, height: 2 });
  const marks = document.createElementNS(NS, "svg");
  marks.setAttribute("aria-hidden", "true");
  const aim = h("p", { class: "aim" });
  const focus = h("meter", { min: 0, max: 1, value: 0, "aria-label": `Sharpness of ${name}, of the best so far` });
  const figures = h("p", { class: "note" });
  const wrong = h("p", { class: "warn" });
  let best = 0;
  let place = null;
  const frame = h("div", { class: "sight", title: "Press where you see the datum", onclick: (event) => {
    const box = frame.getBoundingClientRect();
    place = { x: (event.clientX - box.left) / box.width, y: (event.clientY - box.top) / box.height };
    forget.hidden = false;
  } }, picture, marks);
  const forget = h("button", { type: "button", class: "quiet", hidden: true, onclick: () => { place = null; forget.hidden = true; } }, "Forget the place");
  const element = h("figure", {}, frame, h("figcaption", {}, name, forget), aim, focus, figures, wrong);

  async function look(targets, signal) {
    const asked = new URLSearchParams(place ? { x: place.x, y: place.y } : targets ? { target_set_id: targets } : {});
    const seen = await get(`${path}?${asked}`, signal);
    if (seen === null) return false;
    picture.src = at(seen.links.picture);
    await picture.decode().catch(() => {});
    frame.style.aspectRatio = `${seen.image_size_px[0]} / ${seen.image_size_px[1]}`;
    best = Math.max(best, seen.focus);
    focus.value = best ? seen.focus / best : 0;
    figures.textContent = `Sharpness ${Math.round(100 * focus.value)} % of its best here; edges spread over ${number(seen.blur_px, "px", 2)}${seen.brightened > 1 ? `; shown ${number(seen.brightened, "", 2)} times brighter` : ""}`;
    wrong.textContent = seen.warnings.join("; ");
    aim.textContent = seen.aim?.text ?? "No design tells where it should look.";
    aim.className = `aim ${seen.aim?.found_px ? (seen.aim.text.includes(":") ? "warn" : "good") : ""}`;
    drawn(marks, seen.aim);
    return true;
  }

  const fail = (words) => { wrong.textContent = words; };
  return { name, element, look, fail };
}

/** The cross where the datum should be, a ring where it is. */
function drawn(svg, aim) {
  const [width, height] = aim?.image_size_px ?? [3, 2];
  svg.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
  const arm = height / 12;
  const parts = [];
  const line = (x1, y1, x2, y2) => parts.push(part("line", { x1, y1, x2, y2, class: "cross" }));
  if (aim?.expected_px) {
    const [x, y] = aim.expected_px;
    line(x - arm, y, x + arm, y);
    line(x, y - arm, x, y + arm);
  }
  if (aim?.found_px) {
    parts.push(part("circle", { cx: aim.found_px[0], cy: aim.found_px[1], r: arm / 3, class: "found" }));
    if (aim.expected_px) parts.push(part("line", { x1: aim.expected_px[0], y1: aim.expected_px[1], x2: aim.found_px[0], y2: aim.found_px[1], class: "way" }));
  }
  svg.replaceChildren(...parts);
}

function part(tag, attributes) {
  const made = document.createElementNS(NS, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.setAttribute("vector-effect", "non-scaling-stroke");
  return made;
}
