// All talk with the service: what the page can do, any program can do the same way.

const MARK = { "X-Rigwright": "1" };
// What a proxy puts before all paths, such as "/rigwright"; links that the service gives have it.
const PREFIX = new URL(".", document.baseURI).pathname.replace(/\/$/, "");
const ENDS = ["completed", "failed", "cancelled", "interrupted"];

/** The address of a path of the service, whether it has the prefix already or not. */
export function at(path) {
  return PREFIX && !path.startsWith(`${PREFIX}/`) ? `${PREFIX}${path}` : path;
}

/** What the service answered when it could not do what was asked. */
export class Refusal extends Error {
  constructor(problem) {
    super(problem.detail || problem.title || "the service refused");
    this.problem = problem;
    this.status = problem.status;
  }
}

async function answered(response) {
  if (response.status === 204) return null;
  const body = await response.json().catch(() => ({ detail: `the service answered ${response.status}`, status: response.status }));
  if (!response.ok) throw new Refusal(body);
  return body;
}

async function ask(path, given) {
  let response;
  try {
    response = await fetch(at(path), given);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refusal({ detail: "the service does not answer; see that it runs", status: 0 });
  }
  return answered(response);
}

/** Show a key, for which this browser gets a cookie. */
export function signIn(key) {
  return post("/v1/sign-in", { key });
}

/** Read a document. */
export function get(path, signal) {
  return ask(path, { signal });
}

/** Ask for something to be done; with a key it is done once, however often it is asked. */
export function post(path, body = undefined, key = undefined) {
  const headers = { ...MARK };
  if (body !== undefined) headers["Content-Type"] = "application/json";
  if (key) headers["Idempotency-Key"] = key;
  return ask(path, { method: "POST", headers, body: body === undefined ? undefined : JSON.stringify(body) });
}

/** Remove something. */
export function remove(path) {
  return ask(path, { method: "DELETE", headers: MARK });
}

/** Send a file as it is; `tell` hears the share that is sent. */
export function upload(path, file, tell) {
  return new Promise((resolve, reject) => {
    const sending = new XMLHttpRequest();
    sending.open("POST", at(path));
    sending.setRequestHeader("Content-Type", "application/octet-stream");
    sending.setRequestHeader("X-Rigwright", "1");
    sending.upload.onprogress = (event) => event.lengthComputable && tell(event.loaded / event.total);
    sending.onerror = () => reject(new Refusal({ detail: "the service does not answer; see that it runs", status: 0 }));
    sending.onload = () => {
      let body = {};
      try { body = JSON.parse(sending.responseText); } catch { /* told below */ }
      if (sending.status < 300) resolve(body);
      else reject(new Refusal({ detail: `the service answered ${sending.status}`, ...body, status: sending.status }));
    };
    sending.send(file);
  });
}

/** Whether a job will never change again. */
export function ended(job) {
  return ENDS.includes(job.status);
}

/** All items of a list, at most a few hundred. */
export async function all(path, signal) {
  const items = [];
  let cursor = null;
  do {
    const page = await get(`${path}?limit=100${cursor ? `&cursor=${cursor}` : ""}`, signal);
    items.push(...page.items);
    cursor = page.next;
  } while (cursor && items.length < 300);
  return items;
}

/** Follow a job until it has ended: `seen` gets the job each time it changes. */
export async function follow(job, seen, signal) {
  seen(job);
  while (!ended(job) && !signal.aborted) {
    await heard(job, seen, signal);
    if (signal.aborted) return;
    try {
      job = await get(job.links.self, signal);
      seen(job);
    } catch (error) {
      if (signal.aborted || error.status === 404) throw error;
      await pause(2000); // the service is being started anew: it will know the job again
    }
  }
}

/** Listen to a job's events; ends with the job, or when the line breaks. */
function heard(job, seen, signal) {
  return new Promise((resolve) => {
    const source = new EventSource(at(job.links.events));
    const done = () => { source.close(); resolve(); };
    source.addEventListener("running", () => {
      job = { ...job, status: "running" };
      seen(job);
    });
    source.addEventListener("progress", (event) => {
      job = { ...job, status: "running", progress: JSON.parse(event.data) };
      seen(job);
    });
    for (const end of ENDS) source.addEventListener(end, done);
    source.onerror = () => { source.close(); setTimeout(resolve, 1000); };
    signal.addEventListener("abort", done, { once: true });
  });
}

/** Wait, no longer than until `signal` says to stop. */
export function pause(ms, signal = undefined) {
  return new Promise((resolve) => {
    setTimeout(resolve, ms);
    signal?.addEventListener("abort", resolve, { once: true });
  });
}

/** Do something now and every so often, until the view is left. */
export async function every(ms, signal, work) {
  while (!signal.aborted) {
    if (!document.hidden) await work();
    await pause(ms);
  }
}
