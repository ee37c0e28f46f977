"use strict";
(() => {
  const WIDTH = 10000, HEIGHT = 4000;
  const SHOWN = innerWidth < 560 ? 50 : 200;
  const all = (query, root = document) => [...root.querySelectorAll(query)];
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
  const short = (value) => {
    const digits = Math.max(0, Math.min(3, 2 - Math.floor(Math.log10(Math.max(value, 1e-9)))));
    return value.toFixed(digits);
  };

  // ---- the table: sorted by a head, filtered by the controls, the first rows shown ----
  const table = document.getElementById("list");
  const rows = table ? all("tbody tr", table) : [];
  const records = rows.map((row, k) => ({
    row, k, classes: row.classList,
    cells: [...row.cells].map((cell) => cell.dataset.v ?? cell.textContent),
  }));
  const asNumber = (text) => (text.trim() === "" ? NaN : Number(text));
  let order = records, limit = SHOWN;
  const control = (id) => document.getElementById(id);
  const column = (key) => table.querySelector(`th[data-key="${key}"]`)?.cellIndex;
  const [logs, configs, groups] = table ? ["log", "config", "group"].map(column) : [];
  const wanted = (id) => control(id)?.value ?? "";
  const matches = ({ cells, classes }) => {
    const state = wanted("state"), text = wanted("find").trim().toLowerCase();
    if (state === "failed" && classes.contains("fine") && !classes.contains("regressed")) return false;
    if (state && state !== "failed" && !classes.contains(state)) return false;
    if (wanted("group") && `=${cells[groups]}` !== wanted("group")) return false;
    if (wanted("config") && `=${cells[configs]}` !== wanted("config")) return false;
    return text.split(/\s+/).every((word) => cells.some((cell) => cell.toLowerCase().includes(word)));
  };
  const apply = () => {
    const found = order.filter(matches);
    const seen = new Set(found.slice(0, limit));
    for (const record of records) record.row.hidden = !seen.has(record);
    control("count").textContent = found.length === records.length
      ? `${records.length} rows` : `${found.length} of ${records.length} rows`;
    const more = control("more");
    more.hidden = found.length <= limit;
    more.textContent = `show all ${found.length}`;
  };
  const sort = (head, k) => {
    const before = head.getAttribute("aria-sort");
    for (const other of all("th[aria-sort]", table)) other.removeAttribute("aria-sort");
    const numbers = records.some(({ cells }) => Number.isFinite(asNumber(cells[k])));
    // Figures begin with the largest, names with the first.
    const first = numbers ? "descending" : "ascending";
    const turned = first === "descending" ? "ascending" : "descending";
    const way = before === first ? turned : first;
    head.setAttribute("aria-sort", way);
    const sign = way === "ascending" ? 1 : -1;
    const key = numbers ? records.map(({ cells }) => asNumber(cells[k])) : null;
    const names = new Intl.Collator(undefined, { numeric: true });
    order = [...records].sort((a, b) => {
      if (!numbers) return sign * names.compare(a.cells[k], b.cells[k]) || a.k - b.k;
      const [x, y] = [key[a.k], key[b.k]];
      if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y) || a.k - b.k;
      return sign * (x - y) || a.k - b.k;
    });
    table.tBodies[0].append(...order.map(({ row }) => row));
    apply();
  };
  if (table) {
    for (const button of all("th button", table)) {
      button.addEventListener("click", () => sort(button.parentNode, Number(button.dataset.column)));
    }
    const form = document.querySelector(".controls");
    form.hidden = false;
    form.addEventListener("input", () => { limit = SHOWN; apply(); });
    form.addEventListener("submit", (event) => event.preventDefault());
    control("more").addEventListener("click", () => { limit = Infinity; apply(); });
    apply();
  }

  // ---- the pictures: what is drawn is read back ----
  const follow = (figure, show, hide) => {
    const plot = figure.querySelector(".plot");
    const at = (event) => {
      const frame = plot.getBoundingClientRect();
      show(clamp((event.clientX - frame.left) / frame.width, 0, 1),
        clamp((event.clientY - frame.top) / frame.height, 0, 1), frame);
    };
    for (const kind of ["pointermove", "pointerdown"]) plot.addEventListener(kind, at);
    plot.addEventListener("pointerleave", hide);
    return plot;
  };
  const value = (figure, share) => {
    const [low, high] = [Number(figure.dataset.low), Number(figure.dataset.high)];
    return low * (high / low) ** share;
  };

  for (const figure of all(".shares")) {
    const outputs = all("output", figure), cursor = figure.querySelector(".cursor");
    const readout = figure.querySelector(".readout");
    const curves = all("path.now", figure).map((path) => {
      const steps = path.getAttribute("d").split("H").slice(1, -1);
      return steps.map((step) => step.split("V").map(Number));
    });
    follow(figure, (x) => {
      cursor.style.display = "block";
      cursor.style.left = `${x * 100}%`;
      curves.forEach((steps, k) => {
        let y = HEIGHT;
        for (const [a, b] of steps) { if (a > x * WIDTH) break; y = b; }
        outputs[k].textContent = `${Math.round((1 - y / HEIGHT) * 100)} %`;
      });
      readout.textContent = `of the logs are under ${short(value(figure, x))} ${figure.dataset.unit}`;
    }, () => {
      cursor.style.display = "none";
      readout.textContent = "";
      for (const output of outputs) output.textContent = "";
    });
  }

  for (const figure of all(".pairs")) {
    const readout = figure.querySelector(".readout");
    const dot = document.createElement("i");
    dot.className = "dot";
    const points = all("path.points", figure).flatMap((path) => {
      const numbers = path.dataset.rows.split(" ").map(Number);
      return path.getAttribute("d").split("M").slice(1).map((part, k) => {
        const [x, y] = part.split(/[ h]/).map(Number);
        return { x: x / WIDTH, y: y / HEIGHT, k: numbers[k] };
      });
    });
    let best = null;
    const plot = follow(figure, (x, y, frame) => {
      let least = Infinity;
      for (const point of points) {
        const off = ((point.x - x) * frame.width) ** 2 + ((point.y - y) * frame.height) ** 2;
        if (off < least) { least = off; best = point; }
      }
      if (!best || !records[best.k]) return;
      const { cells } = records[best.k];
      dot.style.display = "block";
      dot.style.left = `${best.x * 100}%`;
      dot.style.top = `${best.y * 100}%`;
      const name = configs === undefined ? cells[logs] : `${cells[logs]}, ${cells[configs]}`;
      readout.textContent = `${name}: ${short(value(figure, best.x))} before, `
        + `${short(value(figure, 1 - best.y))} ${figure.dataset.unit} now`;
    }, () => { dot.style.display = "none"; readout.textContent = ""; });
    plot.append(dot);
    // A click shows the log in the table.
    plot.addEventListener("click", () => {
      if (!best || !records[best.k]) return;
      control("find").value = records[best.k].cells[logs];
      apply();
      document.getElementById("logs").scrollIntoView({ behavior: "smooth" });
    });
  }
})();
