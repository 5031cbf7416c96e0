// The page as a whole: which view is shown, and how the service is.

import { every, get } from "./api.js";
import { fill, h, problem } from "./dom.js";
import { build } from "./build.js";
import { calibration } from "./calibration.js";
import { design } from "./design.js";
import { rig } from "./rig.js";
import { sessions } from "./sessions.js";

const VIEWS = { rig, sessions, calibration, design, build };
let leave = new AbortController();

async function show() {
  leave.abort();
  leave = new AbortController();
  const { signal } = leave;
  const [name, ...more] = location.hash.replace(/^#\//, "").split("/").map(decodeURIComponent);
  const view = VIEWS[name] ?? rig;
  const root = h("div", { class: "view" });
  fill(document.getElementById("content"), root);
  for (const link of document.querySelectorAll("nav a")) {
    if (link.hash === `#/${name || "rig"}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  try {
    await view(root, more, signal);
  } catch (error) {
    if (!signal.aborted) root.append(problem(error));
  }
}

async function look(signal) {
  const told = document.getElementById("service");
  let words;
  let state;
  try {
    const health = await get("/v1/health", signal);
    const faults = Object.entries(health.subsystems).filter(([, part]) => part.status !== "ok");
    const work = health.jobs_running + health.jobs_pending;
    state = faults.length ? "warn" : "good";
    words = faults.length ? `${faults[0][0]}: ${faults[0][1].reason}` : work ? `${work} at work` : "ready";
  } catch {
    state = "bad";
    words = "The service does not answer; trying again";
  }
  if (told.textContent !== words) told.textContent = words;
  told.className = state;
}

window.addEventListener("hashchange", show);
const always = new AbortController().signal;
every(3000, always, () => look(always));
show();
