"use strict";
(function () {
  function data(id) { return JSON.parse(document.getElementById(id).textContent); }

  function nearest(curve, x) {
    let best = null;
    let away = Infinity;
    for (let i = 0; i < curve.x.length; i += 1) {
      const distance = Math.abs(curve.x[i] - x);
      if (distance < away) { away = distance; best = curve.y[i]; }
    }
    return best;
  }

  function inside(polygon, x, y) {
    let odd = false;
    for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i, i += 1) {
      const [ax, ay] = polygon[i];
      const [bx, by] = polygon[j];
      if ((ay > y) !== (by > y) && x < (bx - ax) * (y - ay) / (by - ay) + ax) { odd = !odd; }
    }
    return odd;
  }

  document.querySelectorAll("figure.chart").forEach(function (figure) {
    const svg = figure.querySelector("svg[role]");
    const cursor = figure.querySelector(".cursor");
    const values = figure.querySelectorAll(".value");
    const at = figure.querySelector(".at");
    const known = data(figure.dataset.chart);
    const left = LEFT, right = WIDTH - RIGHT;
    svg.addEventListener("pointermove", function (event) {
      const box = svg.getBoundingClientRect();
      const place = (event.clientX - box.left) * WIDTH / box.width;
      const share = Math.min(1, Math.max(0, (place - left) / (right - left)));
      const x = known.x[0] + share * (known.x[1] - known.x[0]);
      const drawn = left + share * (right - left);
      cursor.setAttribute("x1", drawn);
      cursor.setAttribute("x2", drawn);
      cursor.setAttribute("visibility", "visible");
      known.curves.forEach(function (curve, i) {
        const y = nearest(curve, x);
        values[i].textContent = y === null ? "-" : String(Number(y.toPrecision(4)));
      });
      at.textContent = "at " + PLACE;
    });
    svg.addEventListener("pointerleave", function () {
      cursor.setAttribute("visibility", "hidden");
      values.forEach(function (value) { value.textContent = ""; });
      at.textContent = "";
    });
  });

  document.querySelectorAll("figure.slice").forEach(function (figure) {
    const known = data(figure.dataset.slice);
    const cells = figure.querySelectorAll("defs polygon");
    const range = figure.querySelector("input");
    const choice = figure.querySelector("select");
    const told = figure.querySelector("output");
    const pointed = figure.querySelector(".pointed");
    const corners = Array.from(cells, function (cell) {
      return cell.getAttribute("points").split(" ").map(function (pair) { return pair.split(",").map(Number); });
    });
    const decoded = known.fields.map(function (field) {
      const text = atob(field.values);
      const found = new Uint16Array(text.length / 2);
      for (let i = 0; i < found.length; i += 1) {
        found[i] = text.charCodeAt(2 * i) + 256 * text.charCodeAt(2 * i + 1);
      }
      return found;
    });

    function draw() {
      const field = known.fields[Number(choice.value)];
      const values = decoded[Number(choice.value)];
      const start = Number(range.value) * cells.length;
      const shades = field.palette.length;
      cells.forEach(function (cell, i) {
        cell.setAttribute("fill", field.palette[Math.min(shades - 1, Math.floor(shades * values[start + i] / 65536))]);
      });
      told.textContent = known.places[Number(range.value)];
      figure.querySelector(".shown").textContent = field.name;
      figure.querySelector(".low").textContent = field.ends[0];
      figure.querySelector(".high").textContent = field.ends[1] + " " + field.unit;
      figure.querySelectorAll(".scale rect").forEach(function (rect, i) { rect.setAttribute("fill", field.palette[i]); });
    }

    range.addEventListener("input", draw);
    choice.addEventListener("change", draw);
    figure.querySelector("svg[role]").addEventListener("pointermove", function (event) {
      const svg = event.currentTarget;
      const box = svg.getBoundingClientRect();
      const view = svg.viewBox.baseVal;
      let x = view.x + (event.clientX - box.left) * view.width / box.width;
      let y = view.y + (event.clientY - box.top) * view.height / box.height;
      if (known.mirrors.length > 1) { x = Math.max(Math.abs(x), 0.01); }
      if (known.mirrors.length > 2) { y = -Math.max(Math.abs(y), 0.01); }
      const field = known.fields[Number(choice.value)];
      const i = corners.findIndex(function (polygon) { return inside(polygon, x, y); });
      let found = "";
      if (i >= 0) {
        const level = decoded[Number(choice.value)][Number(range.value) * cells.length + i];
        const value = field.low + (field.high - field.low) * level / 65535;
        found = field.name + " " + Number(value.toPrecision(4)) + " " + field.unit;
      }
      pointed.textContent = found;
    });
  });
}());
