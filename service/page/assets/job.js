// A job while it goes on: how far, how long yet, what it costs so far, and a way to stop it.

import { ended, follow, post } from "./api.js";
import { fill, h, number, problem } from "./dom.js";

/**
 * Show a job until it has ended, then what `result(job)` makes of it. A job that failed shows its
 * problem; a result that there is all the same is shown below it.
 */
export async function watch(root, job, result, signal) {
  const began = Date.now();
  const bar = h("progress", { max: 1, value: 0, "aria-label": "Progress" });
  const words = h("p", { class: "stage", role: "status" });
  const costs = [];
  const curve = h("div", { class: "curve" });
  const stop = h("button", { type: "button", class: "quiet", onclick: () => halt(job, stop, root) }, "Stop it");
  const going = h("div", { class: "going" }, bar, words, curve, stop);
  fill(root, going);
  await follow(job, (now) => {
    job = now;
    if (ended(job)) return;
    const at = job.progress;
    bar.value = at?.fraction ?? 0;
    words.textContent = at ? `${at.stage}, ${Math.round(at.fraction * 100)} %${left(began, at.fraction)}`
      : job.status === "running" ? "begins" : "waits for its turn";
    if (at?.cost > 0) {
      costs.push([at.fraction, at.cost]);
      fill(curve, sparkline(costs));
    }
  }, signal);
  if (signal.aborted) return;
  const said = job.status === "completed" ? null
    : job.status === "cancelled" ? h("p", { class: "note" }, "It was stopped.")
    : problem({ message: job.problem?.detail ?? `it was ${job.status}`, problem: job.problem });
  fill(root, said, job.result ? await result(job) : null);
}

async function halt(job, button, root) {
  button.disabled = true;
  try {
    await post(job.links.cancel);
    button.textContent = "Stopping";
  } catch (error) {
    root.append(problem(error));
  }
}

function left(began, fraction) {
  const seconds = (Date.now() - began) / 1000;
  if (fraction < 0.08 || seconds < 3) return "";
  const more = seconds * (1 - fraction) / fraction;
  return more < 90 ? `, about ${Math.ceil(more / 5) * 5} s left` : `, about ${Math.ceil(more / 60)} min left`;
}

/** The cost so far over the share of the work, its logarithm upwards. */
function sparkline(costs) {
  const ns = "http://www.w3.org/2000/svg";
  const heights = costs.map(([, cost]) => Math.log10(cost));
  const low = Math.min(...heights);
  const span = Math.max(...heights) - low || 1;
  const svg = document.createElementNS(ns, "svg");
  svg.setAttribute("viewBox", "0 0 200 50");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", `Cost, now ${number(costs.at(-1)[1])} square millimetres`);
  const line = document.createElementNS(ns, "polyline");
  line.setAttribute("points", costs.map(([at], k) => `${(200 * at).toFixed(1)},${(46 - 42 * (heights[k] - low) / span).toFixed(1)}`).join(" "));
  svg.append(line);
  return svg;
}
