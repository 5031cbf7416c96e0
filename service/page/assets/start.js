// The page as a whole: which view is shown, and how the service is.

import { every, get, remove } from "./api.js";
import { asked } from "./signin.js";
import { fill, h, problem } from "./dom.js";
import { build } from "./build.js";
import { calibration } from "./calibration.js";
import { design } from "./design.js";
import { rig } from "./rig.js";
import { sessions } from "./sessions.js";
import { studies } from "./studies.js";
import { surface } from "./surface.js";

const VIEWS = { rig, sessions, calibration, surface, design, studies, build };
let leave = new AbortController();
let asking = false;

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
    if (error.status === 401) await askForKey();
    else if (!signal.aborted) root.append(problem(error));
  }
}

/** In place of whatever was shown: what is behind the door asks for a key. */
async function askForKey() {
  if (asking) return;
  asking = true;
  leave.abort();
  fill(document.getElementById("who"));
  await asked(document.getElementById("content"));
  asking = false;
  await who();
  show();
}

/** Who is signed in, where the service asks for keys. */
async function who() {
  const place = document.getElementById("who");
  const { name, scope } = await get("/v1/sign-in").catch(() => ({ name: null, scope: "" }));
  if (scope === null) {
    askForKey();
    return false;
  }
  document.body.dataset.scope = scope;
  const out = async () => {
    await remove("/v1/sign-in").catch(() => {});
    askForKey();
  };
  fill(place, name ? [`${name} (${scope}) `, h("button", { type: "button", class: "quiet", onclick: out }, "Sign out")] : null);
  return true;
}

async function look(signal) {
  if (asking) return; // nobody is told anything before
  const told = document.getElementById("service");
  let words;
  let state;
  try {
    const health = await get("/v1/health", signal);
    const faults = Object.entries(health.subsystems).filter(([, part]) => part.status !== "ok");
    const work = health.jobs_running + health.jobs_pending;
    state = faults.length ? "warn" : "good";
    words = faults.length ? `${faults[0][0]}: ${faults[0][1].reason}` : work ? `${work} at work` : "ready";
  } catch (error) {
    state = "bad";
    words = error.status === 401 ? "Not signed in" : "The service does not answer; trying again";
    if (error.status === 401) askForKey();
  }
  if (told.textContent !== words) told.textContent = words;
  told.className = state;
}

window.addEventListener("hashchange", () => { if (!asking) show(); });
const always = new AbortController().signal;
if (await who()) show();
every(3000, always, () => look(always));
