"use strict";
(() => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const config = { responsive: true, displaylogo: false, scrollZoom: false, plotlyServerURL: "",
    modeBarButtonsToRemove: ["tableRotation", "resetCameraLastSave3d", "select2d", "lasso2d", "autoScale2d", "hoverClosest3d"] };

  const theme = () => {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim();
    const card = style.getPropertyValue("--card").trim();
    return { "font.color": ink, "font.family": getComputedStyle(document.body).fontFamily,
      "hoverlabel.bgcolor": card, "hoverlabel.font.color": ink, "hoverlabel.bordercolor": style.getPropertyValue("--line").trim(),
      line: style.getPropertyValue("--line").trim() };
  };
  const flat = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)" };

  // Texts drawn inside a scene do not inherit the layout's colour.
  const recolour = (place) => {
    const { line, ...update } = theme();
    if (place.layout.scene) for (const axis of "xyz") update[`scene.${axis}axis.gridcolor`] = line;
    const texts = place.data.map((trace, i) => (trace.mode === "text" ? i : -1)).filter((i) => i >= 0);
    const done = Plotly.relayout(place, update);
    return texts.length ? done.then(() => Plotly.restyle(place, { "textfont.color": update["font.color"] }, texts)) : done;
  };

  const draw = async (key) => {
    const place = document.getElementById(key);
    const figure = figures[key];
    const scene = figure.layout.scene;
    if (scene && document.body.classList.contains("stilled")) return null;
    if (scene && place.clientWidth < 560) {
      for (const axis of "xyz") scene.camera.eye[axis] *= 1.35;
    }
    // Over a map the toolbar would hide its colour scale.
    await Plotly.newPlot(place, figure.data, { ...figure.layout, ...flat }, scene ? config : { ...config, displayModeBar: false });
    await recolour(place);
    return place;
  };

  // Both ellipsoid figures turn together, so that they stay comparable.
  const together = (one, other) => {
    let following = false;
    const follow = (from, to) => from.on("plotly_relayout", (change) => {
      if (following || !change["scene.camera"]) return;
      following = true;
      Plotly.relayout(to, { "scene.camera": change["scene.camera"] }).finally(() => { following = false; });
    });
    follow(one, other);
    follow(other, one);
  };

  const start = async () => {
    const places = {};
    for (const key of Object.keys(figures)) places[key] = await draw(key);
    if (places["ellipsoids-before"]) together(places["ellipsoids-before"], places["ellipsoids-after"]);
    const all = Object.values(places).filter((place) => place);
    dark.addEventListener("change", () => all.forEach(recolour));
    const shown = JSON.parse(document.body.dataset.view);
    shown.figures = all.length;
    shown.traces = places["rig-3d"] ? places["rig-3d"].data.length : 0;
    shown.canvases = document.querySelectorAll("canvas").length;
    document.body.dataset.view = JSON.stringify(shown);
    document.body.dataset.ready = "yes";
  };

  start().catch((fault) => {
    document.body.dataset.ready = "failed";
    const note = document.createElement("p");
    note.className = "fault";
    note.textContent = "The figures cannot be drawn here: " + fault.message + ". The tables below are complete.";
    document.querySelector("main").prepend(note);
  });
})();
