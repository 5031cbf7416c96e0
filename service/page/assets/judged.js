// What is thought of pictures that are there: sharp or not, whole or not, rejected or not.

import { get, post } from "./api.js";
import { fill, h, problem } from "./dom.js";

/**
 * Marks and looks for the pictures of one capture. `add(frame, words)` gives what stands below a
 * picture, `capture` is the mark of them all, `begin(signal)` asks the service.
 */
export function judged(session, record) {
  const own = `/v1/sessions/${encodeURIComponent(session)}`;
  const told = h("div", { "aria-live": "polite" });
  const pictures = [];
  let marks = [];
  const place = (frame) => (frame ? { camera: frame.camera, shot: frame.shot } : {});
  const marked = (frame) => marks.some((mark) => mark.capture_id === record.capture_id
    && mark.camera === (frame?.camera ?? null) && mark.shot === (frame?.shot ?? null));
  const buttons = [];

  function show() {
    for (const { button, frame, words, figure } of buttons) {
      const is = marked(frame);
      button.setAttribute("aria-pressed", String(is));
      button.textContent = is ? `Rejected${words}` : `Reject${words}`;
      figure?.classList.toggle("rejected", is || marked(null));
    }
  }

  function toggle(frame, words, name) {
    const button = h("button", { type: "button", class: "quiet mark configure", title: name, "aria-pressed": "false", onclick: async () => {
      try {
        ({ rejected: marks } = await post(`${own}/captures/${encodeURIComponent(record.capture_id)}/${marked(frame) ? "accept" : "reject"}`, place(frame)));
        fill(told);
      } catch (error) {
        fill(told, problem(error));
      }
      show();
    } }, `Reject${words}`);
    const one = { button, frame, words, figure: null };
    buttons.push(one);
    return one;
  }

  function add(frame, words) {
    const said = h("span", { class: "looks" });
    const mark = toggle(frame, "", `Reject the picture of ${words}; it stays in the session`);
    mark.button.setAttribute("aria-label", `Reject the picture of ${words}`);
    pictures.push({ frame, said });
    return { elements: [said, mark.button], of: (figure) => { mark.figure = figure; return figure; } };
  }

  async function begin(signal) {
    try {
      ({ rejected: marks } = await get(`${own}/marks`, signal));
      show();
      for (const { frame, said } of pictures) {
        if (signal.aborted) return;
        const path = frame.file.path.split("/").map(encodeURIComponent).join("/");
        fill(said, looks(await get(`${own}/looks/${path}`, signal)));
      }
    } catch (error) {
      if (!signal.aborted) fill(told, problem(error));
    }
  }

  return { told, add, begin, capture: toggle(null, " the capture", "All its pictures; they stay in the session").button };
}

function looks(look) {
  return [
    look.sharp === null ? h("span", { class: "state note" }, look.image_size_px ? "no edges" : "unreadable here")
      : state(look.sharp, look.sharp ? "sharp" : "not sharp", `Edges spread by ${look.blur_px.toFixed(1)} px`),
    state(look.whole, look.whole ? "whole" : "not whole", ""),
    look.warnings.map((words) => h("span", { class: "state warn", title: words }, words.split(":")[0])),
  ];
}

function state(good, words, title) {
  return h("span", { class: `state ${good ? "good" : "bad"}`, title: title || false }, words);
}

/** Reject a capture that another one takes the place of. */
export function replaced(session, capture, by) {
  return post(`/v1/sessions/${encodeURIComponent(session)}/captures/${encodeURIComponent(capture)}/reject`, { why: `taken again as ${by}` });
}
