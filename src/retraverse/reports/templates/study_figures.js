// Figures: the point under the pointer, or chosen by arrow keys, is read out; a click opens its run.
(() => {
  const { one, all, spanOf, addCursor, setBox } = widgets;
  const data = JSON.parse(document.getElementById("data").textContent);
  const nearEnough = 44;

  const fraction = (range, value, log) => {
    const [a, b, v] = log ? [range[0], range[1], value].map(Math.log10) : [...range, value];
    return (v - a) / (b - a);
  };
  const at = (list, i) => (Array.isArray(list) ? list[i] : list);
  // What all lines have in common a panel says once: see page_points.py.
  const pointsOf = (panel, span) =>
    panel.lines.flatMap((line, number) =>
      line.py.map((y, i) => {
        const x = (line.px || panel.px)[i];
        return {
          line: number,
          name: data.series[line.s][0],
          technique: data.series[line.s][1],
          x,
          y,
          left: span.left + span.width * fraction(span.x, x, panel.log[0]),
          top: span.top + span.height * fraction(span.y, y, panel.log[1]),
          file: at(line.f, i),
          length: "k" in line ? at(line.k, i) : String(x),
        };
      }));
  const worded = (label, text) => {
    const [name, unit] = label.split(", ");
    return `${name ? name + " " : ""}${text}${unit === "%" ? " %" : unit ? " " + unit : ""}`;
  };

  for (const plot of all("[data-panel]")) {
    const panel = data.panels[plot.dataset.panel];
    const span = spanOf(plot);
    const readout = one("output", plot.parentElement);
    const points = pointsOf(panel, span);
    const ring = addCursor(plot, "ring");
    let current = null;

    const choose = (point) => {
      current = point;
      ring.style.visibility = point ? "visible" : "hidden";
      plot.classList.toggle("on-point", Boolean(point && point.file >= 0));
      if (!point) {
        readout.textContent = "";
        return;
      }
      setBox(ring, { left: point.left, top: point.top });
      const x = panel.ticks.length ? panel.ticks[point.x] : String(point.x);
      const parts = [worded(panel.x, x)];
      if (panel.y) parts.push(worded(panel.y, String(point.y)));
      readout.textContent = `${point.name}: ${parts.join(", ")}`;
    };
    const shown = () => points.filter((point) => widgets.isShown(point.technique));
    const nearest = (event) => {
      const box = plot.getBoundingClientRect();
      let best = null;
      let least = nearEnough;
      for (const point of shown()) {
        const apart = Math.hypot(
          box.left + point.left * box.width - event.clientX,
          box.top + point.top * box.height - event.clientY);
        if (apart < least) [best, least] = [point, apart];
      }
      return best;
    };
    const open = () => {
      if (current && current.file >= 0) widgets.openRun(current.file, current.length);
    };
    const walk = (key) => {
      const visible = shown();
      if (!visible.length) return;
      if (!visible.includes(current)) {
        choose(visible[0]);
        return;
      }
      const mine = visible.filter((point) => point.line === current.line);
      const at = mine.indexOf(current);
      if (key === "ArrowRight") choose(mine[Math.min(at + 1, mine.length - 1)]);
      if (key === "ArrowLeft") choose(mine[Math.max(at - 1, 0)]);
      if (key !== "ArrowUp" && key !== "ArrowDown") return;
      const lines = [...new Set(visible.map((point) => point.line))];
      const step = key === "ArrowDown" ? 1 : -1;
      const next = lines[lines.indexOf(current.line) + step];
      const there = visible.filter((point) => point.line === next);
      if (!there.length) return;
      choose(there.reduce((a, b) =>
        Math.abs(b.left - current.left) < Math.abs(a.left - current.left) ? b : a));
    };

    plot.addEventListener("pointermove", (event) => choose(nearest(event)));
    plot.addEventListener("pointerleave", () => choose(null));
    plot.addEventListener("blur", () => choose(null));
    plot.addEventListener("click", (event) => {
      choose(nearest(event));
      open();
    });
    plot.addEventListener("keydown", (event) => {
      if (event.key.startsWith("Arrow")) {
        event.preventDefault();
        walk(event.key);
      } else if (event.key === "Enter") {
        // Or else the key, let go, would press what the opened run puts the focus on.
        event.preventDefault();
        open();
      }
    });
    choose(null);
  }
})();
