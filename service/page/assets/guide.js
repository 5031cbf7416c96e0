// While targets are photographed: which part of each camera's field is still empty.

import { get, pause } from "./api.js";
import { choice, field, fill, h, percent, problem } from "./dom.js";

const NS = "http://www.w3.org/2000/svg";
const SIDE = 5;
const WORDS = [["top left", "top", "top right"], ["left", "middle", "right"], ["bottom left", "bottom", "bottom right"]];

/** A card that follows a session as it grows, once it is opened. */
export function guide(targets, sessions, signal) {
  const set = choice(targets.map((one) => [one.id, one.name || "Targets"]), targets[0]?.id);
  const session = choice(sessions.map(({ name }) => [name, name]), sessions.at(-1)?.name);
  const told = h("p", { class: "note", role: "status" });
  const grid = h("div", { class: "sheet" });
  let run = new AbortController();
  const begin = () => {
    run.abort();
    run = new AbortController();
    fill(grid);
    if (element.open) followed(session.value, set.value, told, grid, AbortSignal.any([signal, run.signal]));
  };
  const element = h("details", { class: "card", ontoggle: begin }, h("summary", {}, "Where are targets still lacking?"),
    targets.length && sessions.length
      ? [h("div", { class: "fields" }, field("Session", session, "Go on capturing into it: this follows."), field("Targets", set)), told, grid]
      : h("p", {}, "Give targets below, and capture them once, under Rig."));
  session.addEventListener("change", begin);
  set.addEventListener("change", begin);
  return element;
}

/** Whether a calibration would take a picture. */
function counts(frame, id, rejected) {
  const out = rejected.some((mark) => mark.capture_id === id && [null, frame.camera].includes(mark.camera) && [null, frame.shot].includes(mark.shot));
  return !frame.raw && frame.status !== "incomplete" && !out;
}

/** Look at each picture of the session once, the newest captures as they come. */
async function followed(session, set, told, place, signal) {
  const own = `/v1/sessions/${encodeURIComponent(session)}`;
  const cameras = new Map();
  const looked = new Set();
  try {
    while (!signal.aborted) {
      const [{ captures }, { rejected }] = await Promise.all([get(own, signal), get(`${own}/marks`, signal)]);
      for (const { capture_id: id } of captures.filter((one) => !looked.has(one.capture_id))) {
        const record = await get(`${own}/captures/${encodeURIComponent(id)}`, signal);
        for (const frame of record.frames.filter((one) => counts(one, id, rejected))) {
          told.textContent = `Looking at ${frame.camera} of ${id} …`;
          const path = frame.file.path.split("/").map(encodeURIComponent).join("/");
          const seen = await get(`${own}/fields/${path}?target_set_id=${encodeURIComponent(set)}`, signal);
          const cells = cameras.get(seen.camera) ?? new Set();
          for (const [column, row] of seen.cells) cells.add(row * SIDE + column);
          cameras.set(seen.camera, cells);
          fill(place, [...cameras].sort().map(([name, filled]) => picture(name, filled)));
        }
        looked.add(id);
      }
      told.textContent = `${looked.size} ${looked.size === 1 ? "capture" : "captures"} looked at. ${next(cameras)}`;
      await pause(3000, signal);
    }
  } catch (error) {
    if (!signal.aborted) fill(told, problem(error));
  }
}

/** Where to hold the plate next: the camera with most that is empty. */
function next(cameras) {
  const [emptiest] = [...cameras].sort((one, other) => one[1].size - other[1].size);
  if (!emptiest) return "";
  const [name, filled] = emptiest;
  if (filled.size === SIDE * SIDE) return "Every camera's field is full.";
  const counts = new Map();
  for (let cell = 0; cell < SIDE * SIDE; cell += 1) {
    if (filled.has(cell)) continue;
    const words = WORDS[third(Math.floor(cell / SIDE))][third(cell % SIDE)];
    counts.set(words, (counts.get(words) ?? 0) + 1);
  }
  const [[where]] = [...counts].sort((one, other) => other[1] - one[1]);
  return `Next: hold the plate ${where} in the picture of ${name}.`;
}

function third(k) {
  return k < 2 ? 0 : k < 3 ? 1 : 2;
}

function picture(name, filled) {
  const svg = document.createElementNS(NS, "svg");
  svg.setAttribute("viewBox", `0 0 ${SIDE * 30} ${SIDE * 20}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("class", "cells");
  svg.setAttribute("aria-label", `Field of ${name}: targets in ${filled.size} of ${SIDE * SIDE} cells`);
  for (let cell = 0; cell < SIDE * SIDE; cell += 1) {
    const made = document.createElementNS(NS, "rect");
    for (const [key, value] of Object.entries({ x: 30 * (cell % SIDE) + 1, y: 20 * Math.floor(cell / SIDE) + 1, width: 28, height: 18, class: filled.has(cell) ? "full" : "" })) made.setAttribute(key, value);
    svg.append(made);
  }
  return h("figure", {}, svg, h("figcaption", {}, name, h("span", {}, percent(filled.size / SIDE ** 2))));
}
