"use strict";
(() => {
  const { figure } = JSON.parse(document.getElementById("figures").textContent);
  const config = { responsive: true, displaylogo: false, scrollZoom: true, plotlyServerURL: "" };
  Plotly.newPlot("surface-3d", figure.data, figure.layout, config)
    .then(() => { document.body.dataset.ready = "yes"; })
    .catch((fault) => {
      document.body.dataset.ready = "failed";
      document.getElementById("surface-3d").textContent = "The figure cannot be drawn here: " + fault.message + ". Open the page in a browser with WebGL.";
    });
})();
