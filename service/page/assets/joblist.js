// Lists of jobs, and files that a job made.

import { get } from "./api.js";
import { h, when } from "./dom.js";

const STATES = { completed: "good", failed: "bad", interrupted: "bad", cancelled: "warn", pending: "warn", running: "warn" };

/** Jobs, newest first, as links into a view. */
export function links(jobs, view, words) {
  return h("ul", { class: "list" }, jobs.map((job) => h("li", {},
    h("a", { href: `#/${view}/${encodeURIComponent(job.id)}` }, words(job)), " ",
    h("span", { class: `state ${STATES[job.status]}` }, job.status), " ", h("small", {}, when(job.created_at)))));
}

/** The jobs that were completed, as pairs for a choice. */
export function completed(jobs, words) {
  return jobs.filter((job) => job.status === "completed").map((job) => [job.id, `${words(job)}, ${when(job.created_at)}`]);
}

/** Links to all files of a job. */
export async function files(job, signal) {
  const { items } = await get(job.links.files, signal);
  return h("details", {}, h("summary", {}, `${items.length} files`),
    h("ul", {}, items.map((file) => h("li", {}, h("a", { href: file.href, download: true }, file.name), ` ${size(file.size_bytes)}`))));
}

function size(bytes) {
  return bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
