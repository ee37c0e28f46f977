"use strict";
(() => {
  // The lines that are drawn are the data: read them back, then move one cursor through all of them.
  const WIDTH = 10000, HEIGHT = 4000;
  const all = (query, root = document) => [...root.querySelectorAll(query)];
  const list = (text) => (text ? text.split(" ").map(Number) : []);
  const readPath = (path) => path.getAttribute("d").split("M").slice(1)
    .map((part) => part.split("L").map((pair) => pair.split(" ").map(Number)));

  // Index of the last value that is not above x; -1 before the first.
  const below = (values, x) => {
    let low = -1, high = values.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (values[middle] <= x) low = middle; else high = middle;
    }
    return low;
  };
  const interpolate = (xs, ys, x) => {
    if (!xs.length || x < xs[0] || x > xs[xs.length - 1]) return null;
    const k = Math.min(below(xs, x), xs.length - 2);
    if (k < 0) return ys[0];
    const span = xs[k + 1] - xs[k];
    return span > 0 ? ys[k] + (x - xs[k]) / span * (ys[k + 1] - ys[k]) : ys[k + 1];
  };
  const written = (value, step) => {
    const digits = Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)));
    return value.toFixed(digits).replace("-", "\u2212");
  };

  // Parts {x, y} with the times t that the path carries, if it does.
  const withTimes = (path, parts) => {
    if (!path.dataset.t) return parts;
    const times = list(path.dataset.t);
    let k = 0;
    return parts.map((part) => ({ ...part, t: part.x.map(() => times[k++]) }));
  };
  const covering = (parts, t) => parts.find(({ t: ts }) => t >= ts[0] && t <= ts[ts.length - 1]);

  const panels = all(".panel").map((figure) => {
    const data = figure.dataset;
    const [x0, x1, y0, y1] = [data.x0, data.x1, data.y0, data.y1].map(Number);
    const outputs = all("output", figure);
    const curves = all("path.curve", figure).map((path) => withTimes(path, readPath(path).map((part) => ({
      x: part.map(([x]) => x0 + x / WIDTH * (x1 - x0)),
      y: part.map(([, y]) => y0 + (1 - y / HEIGHT) * (y1 - y0)),
    }))));
    const timed = curves.find((parts) => parts.length && parts[0].t);
    // The band is drawn first but stands last in the legend.
    const bands = all("path.c-expected", figure).length;
    return {
      figure, x0, x1, step: Number(data.step), outputs,
      unit: figure.querySelector("h3 small").textContent,
      plot: figure.querySelector(".plot"), cursor: figure.querySelector(".cursor"),
      curves: [...curves.slice(bands), ...curves.slice(0, bands)],
      // Where x is not the time: the parts that tell the x of a time.
      timed: timed ?? null,
    };
  });

  const map = document.querySelector(".map");
  const mapPlot = map.querySelector(".plot");
  const drawing = map.querySelector("svg");
  const { width: mapWidth, height: mapHeight } = drawing.viewBox.baseVal;
  let view = { x: 0, y: 0, width: mapWidth, height: mapHeight };
  const place = (element, x, y) => {
    element.style.left = `${(x - view.x) / view.width * 100}%`;
    element.style.top = `${(y - view.y) / view.height * 100}%`;
  };
  const readout = map.querySelector(".readout");
  const equal = "equal" in map.dataset; // several trajectories: each is named with its own error
  const tracks = all("path.curve", map).map((path) => {
    const parts = withTimes(path, readPath(path).map((part) => ({
      x: part.map(([x]) => x), y: part.map(([, y]) => y),
    })));
    const role = [...path.classList].find((name) => name.startsWith("c-"));
    return { path, role, parts, dot: map.querySelector(`.dot.${role}`) };
  });

  const show = (t) => {
    for (const panel of panels) {
      const leg = panel.timed && covering(panel.timed, t);
      const x = !panel.timed ? t : leg ? interpolate(leg.t, leg.x, t) : null;
      const seen = x !== null && x >= panel.x0 && x <= panel.x1;
      panel.cursor.style.display = seen ? "block" : "none";
      if (seen) panel.cursor.style.left = `${(x - panel.x0) / (panel.x1 - panel.x0) * 100}%`;
      panel.outputs.forEach((output, k) => {
        let value = null;
        for (const part of seen ? panel.curves[k] : []) {
          value = (part.t ? interpolate(part.t, part.y, t) : interpolate(part.x, part.y, x)) ?? value;
        }
        output.textContent = value === null ? "" : written(value, panel.step);
      });
    }
    for (const { parts, dot } of tracks) {
      if (!dot) continue;
      const part = covering(parts, t);
      dot.style.display = part ? "block" : "none";
      if (!part) continue;
      place(dot, interpolate(part.t, part.x, t), interpolate(part.t, part.y, t));
    }
    const first = panels[0];
    const values = first.outputs.flatMap((output, k) => {
      if (!output.textContent || (k && !equal)) return [];
      const name = equal ? output.parentNode.childNodes[1].textContent.trim() : "error";
      return [` \u00b7 ${name} ${output.textContent}\u00a0${first.unit}`];
    });
    readout.textContent = `${t.toFixed(1)} s${values.join("")}`;
    document.documentElement.dataset.time = t.toFixed(3);
  };

  let wanted = null;
  const at = (t) => {
    if (wanted === null) requestAnimationFrame(() => { const next = wanted; wanted = null; show(next); });
    wanted = t;
  };
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

  for (const panel of panels) {
    // The instant of an x; of several the one that is nearest to the cursor.
    const toTime = (x) => {
      if (!panel.timed) return x;
      const now = Number(document.documentElement.dataset.time ?? panels[0].x0);
      let best = null;
      for (const { t, x: xs } of panel.timed) {
        for (let k = 0; k + 1 < xs.length; k++) {
          const span = xs[k + 1] - xs[k];
          if (x < Math.min(xs[k], xs[k + 1]) || x > Math.max(xs[k], xs[k + 1])) continue;
          const at = span ? t[k] + (x - xs[k]) / span * (t[k + 1] - t[k]) : t[k];
          if (best === null || Math.abs(at - now) < Math.abs(best - now)) best = at;
        }
      }
      return best;
    };
    const follow = (event) => {
      const frame = panel.plot.getBoundingClientRect();
      const share = clamp((event.clientX - frame.left) / frame.width, 0, 1);
      const t = toTime(panel.x0 + share * (panel.x1 - panel.x0));
      if (t !== null) at(t);
    };
    panel.plot.addEventListener("pointermove", follow);
    panel.plot.addEventListener("pointerdown", follow);
    panel.plot.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!way) return;
      event.preventDefault();
      const span = panels[0].x1 - panels[0].x0;
      const now = Number(document.documentElement.dataset.time ?? panels[0].x0);
      at(clamp(now + way * span / (event.shiftKey ? 20 : 200), panels[0].x0, panels[0].x1));
    });
  }

  // On the map: the nearest place on a track that is shown, and its instant; where lines lie on one
  // another (within `near`) it is the vehicle's own.
  const nearest = (x, y, near) => {
    let best = Infinity, time = null;
    for (const { path, role, parts } of [...tracks].reverse()) {
      if (path.classList.contains("hidden")) continue;
      if (role !== "c-ours" && best < near * near) break;
      for (const part of parts) {
        for (let k = 0; k < part.t.length; k++) {
          const j = Math.min(k + 1, part.t.length - 1);
          const dx = part.x[j] - part.x[k], dy = part.y[j] - part.y[k], size = dx * dx + dy * dy;
          const s = size > 0 ? clamp(((x - part.x[k]) * dx + (y - part.y[k]) * dy) / size, 0, 1) : 0;
          const off = (part.x[k] + s * dx - x) ** 2 + (part.y[k] + s * dy - y) ** 2;
          if (off < best) { best = off; time = part.t[k] + s * (part.t[j] - part.t[k]); }
        }
      }
    }
    return time;
  };
  let dragged = null;
  const onMap = (event) => {
    if (event.target.dataset.zoom || dragged) return;
    if (event.target.dataset.at) { at(Number(event.target.dataset.at)); return; }
    const frame = mapPlot.getBoundingClientRect();
    const unit = view.width / frame.width;
    const t = nearest(view.x + (event.clientX - frame.left) * unit,
      view.y + (event.clientY - frame.top) * unit, 6 * unit);
    if (t !== null) at(t);
  };
  mapPlot.addEventListener("pointermove", onMap);
  mapPlot.addEventListener("pointerdown", onMap);

  // Zoom by the buttons, a double click, or the wheel with Ctrl; drag to move.
  const scale = map.querySelector(".scale");
  const marks = all(".mark", map).map((mark) => ({
    mark, x: parseFloat(mark.style.left) / 100 * mapWidth, y: parseFloat(mark.style.top) / 100 * mapHeight,
  }));
  const look = (x, y, width) => {
    const height = width / mapWidth * mapHeight;
    view = { width, height, x: clamp(x, 0, mapWidth - width), y: clamp(y, 0, mapHeight - height) };
    drawing.setAttribute("viewBox", `${view.x} ${view.y} ${width} ${height}`);
    mapPlot.classList.toggle("zoomed", width < mapWidth);
    for (const { mark, x: left, y: top } of marks) place(mark, left, top);
    const rough = width / 60, power = 10 ** Math.floor(Math.log10(rough)); // m; 10 units each
    const bar = power * [1, 2, 5, 10].find((factor) => factor * power >= rough * (1 - 1e-9));
    scale.style.width = `${bar * 10 / width * 100}%`;
    scale.textContent = bar >= 1000 ? `${bar / 1000} km` : `${+bar.toPrecision(3)} m`;
    if (document.documentElement.dataset.time) show(Number(document.documentElement.dataset.time));
  };
  const zoom = (factor, x, y) => {
    const width = clamp(view.width / factor, mapWidth / 256, mapWidth);
    const share = width / view.width;
    look(x - (x - view.x) * share, y - (y - view.y) * share, width);
  };
  const under = (event) => {
    const frame = mapPlot.getBoundingClientRect(), unit = view.width / frame.width;
    return [view.x + (event.clientX - frame.left) * unit, view.y + (event.clientY - frame.top) * unit];
  };
  for (const button of all("button[data-zoom]", map)) {
    button.addEventListener("click", () => {
      const dot = tracks.find(({ role }) => role === "c-ours").dot;
      const at = dot && dot.style.display === "block" ? [dot.style.left, dot.style.top] : ["50%", "50%"];
      const [x, y] = at.map((text) => parseFloat(text) / 100);
      const inside = x >= 0 && x <= 1 && y >= 0 && y <= 1;
      zoom(Number(button.dataset.zoom), view.x + (inside ? x : 0.5) * view.width,
        view.y + (inside ? y : 0.5) * view.height);
    });
  }
  mapPlot.addEventListener("dblclick", (event) => {
    if (!event.target.dataset.zoom) zoom(2, ...under(event));
  });
  mapPlot.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(2 ** (-event.deltaY / 200), ...under(event));
  }, { passive: false });
  mapPlot.addEventListener("pointerdown", (event) => {
    if (view.width < mapWidth && !event.target.dataset.zoom) dragged = under(event);
  });
  addEventListener("pointermove", (event) => {
    if (!dragged) return;
    const [x, y] = under(event);
    look(view.x + dragged[0] - x, view.y + dragged[1] - y, view.width);
  });
  for (const kind of ["pointerup", "pointercancel"]) addEventListener(kind, () => { dragged = null; });

  for (const input of all("input[data-role]", map)) {
    const apply = () => {
      for (const { path, role, dot } of tracks) {
        if (role !== `c-${input.dataset.role}`) continue;
        path.classList.toggle("hidden", !input.checked);
        if (dot) dot.style.visibility = input.checked ? "" : "hidden";
      }
    };
    input.addEventListener("change", apply);
    apply();
  }
})();
