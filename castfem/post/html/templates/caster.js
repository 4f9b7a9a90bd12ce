"use strict";
(function () {
  const known = JSON.parse(document.getElementById("strand").textContent);
  const range = document.getElementById("clock");
  const head = document.getElementById("head");
  const choice = document.getElementById("shown");
  const figures = Array.from(document.querySelectorAll("figure.chart"));
  const pieces = Array.from(document.querySelectorAll("#side polygon"));
  const places = pieces.map(function (piece) { return Number(piece.dataset.at); });

  function across(x, size) { return size.left + (size.width - size.left - size.right) * x / known.length; }

  function path(x, y, limits, size) {
    let found = "";
    let drawing = false;
    x.forEach(function (place, i) {
      if (y[i] === null) { drawing = false; return; }
      const share = (y[i] - limits[0]) / (limits[1] - limits[0]);
      const up = size.height - size.bottom - (size.height - size.top - size.bottom) * share;
      found += (drawing ? "L" : "M") + across(place, size).toFixed(1) + " " + up.toFixed(1);
      drawing = true;
    });
    return found;
  }

  function between(x, y, at) {
    for (let i = 1; i < x.length; i += 1) {
      if (x[i] >= at && x[i - 1] <= at) {
        if (y[i] === null || y[i - 1] === null) { return null; }
        return y[i - 1] + (y[i] - y[i - 1]) * (at - x[i - 1]) / (x[i] - x[i - 1] || 1);
      }
    }
    return null;
  }

  function paint(instant, pool) {
    const panel = known.panels.find(function (one) { return one.names.includes(choice.value); });
    const limits = panel.limits;
    const shades = known.palette.length;
    pieces.forEach(function (piece, i) {
      const value = between(instant.x, instant[choice.value], places[i]);
      let colour = "#e3e7eb";
      if (value !== null) {
        const share = (value - limits[0]) / (limits[1] - limits[0]);
        colour = known.palette[Math.min(shades - 1, Math.max(0, Math.floor(shades * share)))];
      }
      piece.setAttribute("fill", colour);
      piece.setAttribute("stroke", colour);
    });
    const end = document.getElementById("pool");
    const nearest = pool === null ? -1 : places.findIndex(function (at) { return at >= pool; });
    end.setAttribute("visibility", nearest < 0 ? "hidden" : "visible");
    if (nearest >= 0) { end.setAttribute("points", pieces[nearest].getAttribute("points")); }
    document.getElementById("low").textContent = String(limits[0]);
    document.getElementById("high").textContent = String(limits[1]);
  }

  function draw() {
    const instant = known.instants[Number(range.value)];
    const pool = known.pool[Number(range.value)];
    head.textContent = known.heads[Number(range.value)];
    figures.forEach(function (figure, i) {
      const panel = known.panels[i];
      const size = JSON.parse(figure.dataset.size);
      figure.querySelectorAll("path").forEach(function (line, j) {
        line.setAttribute("d", path(instant.x, instant[panel.names[j]], panel.limits, size));
      });
      const cursor = figure.querySelector(".cursor");
      cursor.setAttribute("visibility", pool === null ? "hidden" : "visible");
      if (pool !== null) {
        cursor.setAttribute("x1", across(pool, size));
        cursor.setAttribute("x2", across(pool, size));
      }
    });
    if (pieces.length) { paint(instant, pool); }
  }

  range.addEventListener("input", draw);
  if (choice) { choice.addEventListener("change", draw); }
  draw();
}());
