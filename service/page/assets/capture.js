// Taking a capture: names, countdown, fire, abort, and the pictures as soon as they are there.

import { at, follow, get, pause, post } from "./api.js";
import { field, fill, h, problem } from "./dom.js";
import { watch } from "./job.js";
import { replaced } from "./judged.js";
import { kept, naming } from "./naming.js";
import { sheet } from "./pictures.js";

/** The form and the result for one rig. `know` is told how the rig is now. */
export function capturing(rig, signal) {
  const session = h("input", { pattern: "[A-Za-z0-9][A-Za-z0-9_.\\-]{0,63}", required: true, autocomplete: "off" });
  const subject = h("input", { maxlength: 200, autocomplete: "off" });
  const operator = h("input", { maxlength: 200, autocomplete: "off" });
  const shots = h("input", { type: "number", min: 1, max: 1000, value: 1 });
  const interval = h("input", { type: "number", min: 0, max: 1000000, step: "any", value: 0 });
  const countdown = h("input", { type: "number", min: 0, max: 60, value: 0 });
  const fire = h("button", { type: "submit", class: "fire hardware" }, "Fire");
  const place = h("div", { class: "result", "aria-live": "polite" });
  const others = h("p", { class: "note" });
  const { rule, follow: named } = naming(session, subject);
  kept(`capture ${rig.name}`, { session, subject, operator, shots, interval, countdown, rule });
  named();
  let own = "";
  let counting = null;
  let former = null; // what is taken again
  let aborts = Infinity; // how many there were when the countdown began

  async function go(event) {
    event.preventDefault();
    const again = former;
    former = null;
    if (counting) { halt(); return; }
    const id = captureId();
    const asked = {
      capture_id: id, session: session.value, subject: subject.value,
      operator: operator.value, shots: Number(shots.value),
      interval_us: Math.round(Number(interval.value) * 1000),
    };
    counting = new AbortController();
    const stopped = counting.signal;
    try {
      if (!await waited(Number(countdown.value), stopped)) {
        if (!signal.aborted) fill(place, h("p", { class: "note" }, "Stopped before anything fired."));
        return;
      }
      fire.disabled = true;
      own = at(`/v1/captures/${id}`);
      const job = await post(rig.links.captures, asked);
      if (stopped.aborted) await post(rig.links.abort); // the first may have come before the capture
      await watch(place, job, async (done) => {
        const taken = outcome(done);
        if (!again) return taken;
        try {
          await replaced(again.session, again.record.capture_id, id); // now that there is another
          return taken;
        } catch (error) { // the new pictures are there all the same
          return h("div", {}, taken, problem(error));
        }
      }, signal);
      if (!signal.aborted) await left(place, own, signal);
    } catch (error) {
      if (!signal.aborted) fill(place, problem(error));
    } finally {
      counting = null;
      aborts = Infinity;
      fire.disabled = false;
      fire.textContent = "Fire";
    }
  }

  /** End the countdown; what fires already is for the rig's own abort. */
  function halt() {
    counting?.abort();
  }

  /** Count down; false when it was stopped, here or by an abort at another browser. */
  async function waited(seconds, stopped) {
    if (!seconds) return true;
    ({ aborts } = await get(rig.links.self, signal));
    return await counted(seconds, fire, stopped, signal) && (await get(rig.links.self, signal)).aborts === aborts && !stopped.aborted;
  }

  function outcome(job) {
    const { record, session: name } = job.result;
    return sheet(name, record, signal, () => {
      [session.value, shots.value, interval.value] = [name, record.shots, record.interval_us / 1000];
      // Else the next capture, of somebody else perhaps, would be taken for this one's.
      if (counting || fire.disabled || !element.reportValidity()) return;
      former = { session: name, record };
      element.requestSubmit();
    });
  }

  const element = h("form", { class: "capture", onsubmit: go },
    h("p", { class: "note reader" }, "Your key may look and stop. To fire, sign in with one of scope hardware."),
    h("div", { class: "fields hardware" }, field("Session", session, "One folder of captures, for a subject or a day."),
      field("Named by", rule), field("Subject", subject, "Told to a new session; one that is there keeps its own."), field("Operator", operator, "Who fires: told to whoever else presses Fire meanwhile."), field("Shots", shots), field("Between shots, ms", interval),
      field("Countdown, s", countdown)),
    fire, others, place);

  return { element, halt, know: (now) => {
    if (now.aborts > aborts) halt();
    const busy = now.status === "busy";
    if (!counting) fire.disabled = busy || now.status === "closed";
    const other = busy && now.doing && now.doing !== own;
    others.textContent = other ? `The rig is at work${now.asked_by ? ` for ${now.asked_by}` : ""}.` : "";
    if (other && now.doing.startsWith(at("/v1/captures/"))) {
      own = now.doing; // shown here as well: everybody at the rig sees the last capture
      shown(place, now.doing, outcome, signal);
    }
  } };
}

function captureId() {
  // To the millisecond: ids sort in the order in which they were fired.
  const now = new Date().toISOString().replace(/[-:]/g, "").replace(/[T.]/g, "-").slice(0, 19);
  return `${now}-${Math.random().toString(36).slice(2, 6)}`;
}

/** Count down on the button; false when it was pressed again, or the view was left. */
async function counted(seconds, button, stopped, gone) {
  for (let more = seconds; more > 0; more -= 1) {
    button.textContent = `${more} – press to stop`;
    await pause(1000, stopped);
    if (stopped.aborted || gone.aborted) return false;
  }
  button.textContent = "Firing";
  return true;
}

async function shown(place, path, outcome, signal) {
  try {
    await follow(await get(path, signal), () => {}, signal);
    const job = await get(path, signal);
    fill(place, job.result ? outcome(job) : problem({ message: job.problem?.detail ?? job.status }));
    if (!job.result) await left(place, path, signal);
  } catch { /* its own view tells */ }
}

/** What a capture that failed left in its session all the same. */
async function left(place, path, signal) {
  const job = await get(path, signal);
  if (job.result || job.status !== "failed") return;
  const id = job.id;
  const { items } = await get("/v1/sessions", signal);
  for (const { name } of items) {
    const found = await get(`/v1/sessions/${encodeURIComponent(name)}`, signal).catch(() => null);
    if (!found?.captures.some((capture) => capture.capture_id === id)) continue;
    const record = await get(`/v1/sessions/${encodeURIComponent(name)}/captures/${encodeURIComponent(id)}`, signal);
    place.append(...sheet(name, record, signal));
    return;
  }
}
