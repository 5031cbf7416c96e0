"use strict";
(() => {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const { figure, ways } = JSON.parse(document.getElementById("figures").textContent);
  const place = document.getElementById("plan-3d");
  const slider = document.getElementById("apart");
  const config = { responsive: true, displaylogo: false, scrollZoom: true, plotlyServerURL: "",
    modeBarButtonsToRemove: ["tableRotation", "resetCameraLastSave3d", "hoverClosest3d"] };
  const flat = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)" };

  const recolour = () => {
    const style = getComputedStyle(document.documentElement);
    const update = { "font.color": style.getPropertyValue("--ink").trim(), "font.family": getComputedStyle(document.body).fontFamily };
    for (const axis of "xyz") update[`scene.${axis}axis.gridcolor`] = style.getPropertyValue("--line").trim();
    return Plotly.relayout(place, update);
  };

  // Where the parts stand when the rig is whole stays as it came: every position of the slider counts from there.
  const draw = (share) => {
    const rows = place.data.map((trace, i) => (ways[trace.name] ? i : -1)).filter((i) => i >= 0);
    const update = {};
    ["x", "y", "z"].forEach((axis, k) => {
      update[axis] = rows.map((i) => {
        const { at, way } = ways[place.data[i].name];
        return at[k].map((v, p) => v + share * way[k][p]);
      });
    });
    return Plotly.restyle(place, update, rows);
  };

  let wanted = null;
  let busy = false;
  // Restyling takes longer than a slider moves: only the latest position is drawn.
  const follow = async () => {
    if (busy) return;
    busy = true;
    while (wanted !== null) {
      const share = wanted;
      wanted = null;
      await draw(share);
      place.dataset.apart = share;
    }
    busy = false;
  };

  const start = async () => {
    await Plotly.newPlot(place, figure.data, { ...figure.layout, ...flat }, config);
    await recolour();
    slider.addEventListener("input", () => { wanted = slider.valueAsNumber / 100; follow(); });
    dark.addEventListener("change", recolour);
    const shown = JSON.parse(document.body.dataset.view);
    shown.traces = place.data.length;
    shown.canvases = document.querySelectorAll("canvas").length;
    document.body.dataset.view = JSON.stringify(shown);
    document.body.dataset.ready = "yes";
  };

  start().catch((fault) => {
    document.body.dataset.ready = "failed";
    const note = document.createElement("p");
    note.className = "fault";
    note.textContent = "The figure cannot be drawn here: " + fault.message + ". The tables below are complete. Open the page in a browser with WebGL.";
    document.querySelector("main").prepend(note);
  });
})();
