"use strict";
(async () => {
  // What looks into a scene needs WebGL; the still pictures stand in for it.
  const seesScenes = () => {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
  };
  if (!seesScenes()) document.body.classList.add("stilled");
  const unpacked = (id) => {
    const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
    const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(plain).text();
  };
  const put = (text, attributes) => document.head.append(Object.assign(document.createElement("script"), { ...attributes, textContent: text }));
  put(await unpacked("packed"), { type: "application/json", id: "figures" });
  put(await unpacked("plotly"), {});
})().then(() => {
$script
}).catch((fault) => {
  document.body.classList.add("stilled");
  document.body.dataset.ready = "failed";
  const note = document.createElement("p");
  note.className = "fault";
  note.textContent = "The figures cannot be drawn here: " + fault.message + ". Use a newer browser.";
  document.querySelector("main").prepend(note);
});
