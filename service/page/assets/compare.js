// Designs side by side: their figures in a table, and which is best in each.

import { field, fill, h, number, percent, table } from "./dom.js";

const FIGURES = [
  ["Cameras", (one) => one.cameras, null, (value) => value],
  ["Every limit kept", (one) => Number(one.feasible), 1, (value) => (value ? "yes" : "no")],
  ["Sigma, median", (one) => one.sigma_median_mm, -1, microns],
  ["Sigma, 95 %", (one) => one.sigma_p95_mm, -1, microns],
  ["Sigma, largest", (one) => one.sigma_max_mm, -1, microns],
  ["Views in focus", (one) => one.in_focus_share, 1, percent],
  ["Can be matched", (one) => one.matchable_share, 1, percent],
];

/** A choice of those that are done, and below it their figures beside each other. */
export function compare(jobs) {
  const done = jobs.filter((job) => job.status === "completed");
  if (done.length < 2) return null;
  const place = h("div", { "aria-live": "polite" });
  const boxes = done.map((job, k) => h("input", { type: "checkbox", checked: k < 2, onchange: show }));
  function show() {
    const chosen = done.filter((_, k) => boxes[k].checked);
    fill(place, chosen.length < 2 ? h("p", { class: "note" }, "Choose two or more.") : side(chosen));
  }
  show();
  return h("details", { class: "card" }, h("summary", {}, "Compare designs"),
    h("div", { class: "fields" }, done.map((job, k) => field(title(job), boxes[k]))), place);
}

function title(job) {
  return `${job.result.name || "Design"}, ${job.result.cameras} cameras, ${new Date(job.created_at).toLocaleTimeString()}`;
}

function side(jobs) {
  const views = [...new Set(jobs.flatMap((job) => job.result.coverage.map((row) => row.views)))].sort((a, b) => a - b);
  const seen = views.map((count) => [`Seen by ${count} or more`, (one) => one.coverage.find((row) => row.views === count)?.share ?? null, 1, percent]);
  const rows = [...FIGURES, ...seen].map(([words, of, better, show]) => {
    const values = jobs.map((job) => of(job.result) ?? null);
    const known = values.filter((value) => value !== null);
    const best = better === null || new Set(known).size < 2 ? null : Math.max(...known.map((value) => better * value)) * better;
    return [words, ...values.map((value) => (value !== null && value === best ? h("strong", { class: "state good" }, show(value)) : show(value)))];
  });
  const links = jobs.map((job) => h("a", { href: `#/design/${encodeURIComponent(job.id)}` }, title(job)));
  return [table("", ["", ...links], rows), h("p", { class: "note" }, "The best of each row is marked.")];
}

function microns(mm) {
  return mm === null ? "–" : number(1000 * mm, "µm");
}
