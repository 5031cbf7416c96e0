// The rigs: how box and cameras are, tests, and taking pictures.

import { every, get, post } from "./api.js";
import { fill, h, number, problem, table } from "./dom.js";
import { capturing } from "./capture.js";
import { watch } from "./job.js";
import { live } from "./live.js";

const TESTS = [
  ["self-test", "Self-test", "Looks at box, clock, interlock, cameras and disk. Fires nothing."],
  ["dry-run", "Dry run", "All of a capture up to the firing. Fires nothing."],
  ["sync-check", "Synchronisation", "Fires, files nothing, and measures each camera's lag."],
];
const STATES = { ready: "good", busy: "warn", degraded: "bad", closed: "bad" };

/** The view of all rigs. */
export async function rig(root, _more, signal) {
  const { items } = await get("/v1/rigs", signal);
  if (!items.length) {
    fill(root, h("h1", {}, "No rig yet"),
      h("p", {}, "Give the service a station file, which names the trigger box and the cameras: ",
        h("code", {}, "rigwright serve --station station.toml"), ". The folder ",
        h("code", {}, "examples/station"), " has one whose devices exist only in the program."));
    return;
  }
  const panels = items.map((one) => panel(one, signal));
  fill(root, panels.map((one) => one.element));
  every(1500, signal, async () => {
    try {
      const now = await get("/v1/rigs", signal);
      for (const one of panels) one.show(now.items.find((item) => item.name === one.name));
    } catch { /* the line above says that the service does not answer */ }
  });
}

function panel(one, signal) {
  const state = h("span", { class: "state" });
  const devices = h("div", {});
  const tested = h("div", { "aria-live": "polite" });
  const told = h("div", { "aria-live": "polite" });
  const capture = capturing(one, signal);
  const sights = live(one, signal);
  const act = async (path, said) => {
    try {
      await post(path);
      fill(told, said && h("p", { class: "good" }, said));
    } catch (error) {
      fill(told, problem(error));
    }
  };
  const abort = () => {
    capture.halt(); // before anybody is asked: what counts down must not fire after it
    return act(one.links.abort, "Aborted: all outputs are off.");
  };
  const element = h("section", { class: "rig", "aria-label": one.name },
    h("div", { class: "heading" }, h("h1", {}, one.name), state,
      h("button", { type: "button", class: "stop", onclick: abort }, "Abort: all outputs off")),
    told,
    h("div", { class: "split" }, h("div", {}, capture.element),
      h("div", {}, devices,
        h("div", { class: "row hardware" }, TESTS.map(([test, words, title]) =>
          h("button", { type: "button", class: "quiet", title, onclick: () => run(one, test, tested, signal) }, words)),
        h("button", { type: "button", class: "quiet", title: "Let the box leave its fault. Fires nothing.", onclick: () => act(one.links.reset, "The box was reset.") }, "Reset the box")),
        tested)),
    sights.element);
  let before = "";
  const show = (now) => {
    if (!now) return;
    capture.know(now);
    sights.know(now);
    const said = JSON.stringify([now.status, now.problem, now.trigger?.state, now.trigger?.interlock_closed, now.trigger?.last_problem, now.cameras.map((c) => [c.connected, c.armed, c.problem])]);
    if (said === before) return; // what has not changed is not drawn anew under the reader's hand
    before = said;
    state.textContent = now.status;
    state.className = `state ${STATES[now.status]}`;
    fill(devices, now.problem ? problem({ message: now.problem.detail, problem: now.problem }) : null, box(now), cameras(now));
  };
  show(one);
  return { element, name: one.name, show };
}

function box(now) {
  const trigger = now.trigger;
  if (!trigger) return h("p", {}, "No trigger box answers.");
  const lock = trigger.interlock_closed === null ? "" : trigger.interlock_closed ? ", interlock closed" : ", interlock open";
  return h("p", { class: trigger.interlock_closed === false || trigger.last_problem ? "warn" : "" },
    `Trigger box: ${trigger.state}${lock}. ${trigger.identity}${trigger.last_problem ? `. Last problem: ${trigger.last_problem}` : ""}`);
}

function cameras(now) {
  return table("Cameras", ["Camera", "Output", "State", ""], now.cameras.map((camera) => [
    camera.name, camera.output ?? "–",
    h("span", { class: `state ${camera.connected && !camera.problem ? "good" : "bad"}` }, camera.connected ? (camera.armed ? "armed" : "ready") : "gone"),
    camera.problem || camera.backend]));
}

async function run(one, test, place, signal) {
  try {
    const job = await post(one.links.tests, { test });
    await watch(place, job, (done) => outcome(done.result), signal);
  } catch (error) {
    if (!signal.aborted) fill(place, problem(error));
  }
}

function outcome(result) {
  const lags = Object.values(result.lags);
  return [
    h("p", { class: result.ok ? "good" : "bad" }, result.ok ? "All is well." : result.why_not || "Not all is well."),
    result.checks.length ? table("Looked at", ["What", "", ""], result.checks.map((check) => [check.name, mark(check.ok), check.text])) : null,
    result.ready.length ? h("p", {}, `Ready: ${result.ready.join(", ")}.`) : null,
    lags.length ? table("Lag from edge to exposure", ["Camera", "Lag", "Jitter", "Known to"], lags.map((lag) =>
      [lag.camera, number(lag.lag_us, "µs"), number(lag.jitter_us, "µs"), `± ${number(lag.uncertainty_us, "µs")}`])) : null,
    result.faults.length ? h("ul", {}, result.faults.map((fault) => h("li", {}, fault.text))) : null,
  ];
}

function mark(ok) {
  return h("span", { class: `state ${ok ? "good" : "bad"}` }, ok ? "good" : "fault");
}
