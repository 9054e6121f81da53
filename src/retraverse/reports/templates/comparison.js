"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const one = (selector, inside = document) => inside.querySelector(selector);
  const all = (selector, inside = document) => [...inside.querySelectorAll(selector)];
  document.documentElement.classList.add("js");

  // Fractions of a plot for a data value, and back.
  const spanOf = (plot) => JSON.parse(plot.dataset.span);
  const place = (range, value) => (value - range[0]) / (range[1] - range[0]);
  const value = (range, fraction) => range[0] + fraction * (range[1] - range[0]);

  const addCursor = (plot, className) => {
    const cursor = document.createElement("div");
    cursor.className = "cursor " + className;
    cursor.setAttribute("aria-hidden", "true");
    plot.append(cursor);
    return cursor;
  };
  const setBox = (cursor, box) => {
    for (const [side, fraction] of Object.entries(box)) {
      cursor.style[side] = typeof fraction === "number" ? 100 * fraction + "%" : fraction;
    }
  };

  const matrix = one('[data-plot="matrix"]');
  const matrixSpan = spanOf(matrix);
  const rowCursor = addCursor(matrix, "on-matrix");
  const routes = all('[data-plot="route"]').map((plot) => [spanOf(plot), addCursor(plot, "")]);

  const showPlace = (query) => {
    const s = matrixSpan;
    const top = s.top + s.height * place(s.y, query);
    setBox(rowCursor, { left: s.left, width: s.width, top, height: "1px" });
    for (const [span, cursor] of routes) {
      const left = span.left + span.width * place(span.x, query);
      setBox(cursor, { left, width: "1px", top: span.top, height: span.height });
    }
  };

  // The walk along the route.
  const walk = document.getElementById("walk");
  const slider = one('[data-walk="slider"]');
  const pictureOf = (key) =>
    data.pictures[key] || one(`.case img[data-picture="${key}"]`)?.getAttribute("src");

  const fill = (slot, role, frame, absent) => {
    const figure = one(".picture." + slot, walk);
    if (!figure) return;
    const shown = document.createElement(frame ? "img" : "div");
    if (frame) {
      shown.src = pictureOf(frame.key);
      shown.alt = `${role} frame ${frame.number}, ${frame.name}`;
    } else {
      shown.className = "absent";
      shown.textContent = absent;
    }
    figure.firstElementChild.replaceWith(shown);
    one(".number", figure).textContent = frame ? `frame ${frame.number}` : "";
    one(".name", figure).textContent = frame ? frame.name : "";
  };

  const show = (at) => {
    const step = data.steps[at];
    if (!step) return;
    slider.value = at;
    slider.setAttribute("aria-valuetext", `query frame ${step.query}, ${step.verdictText}`);
    const verdict = one('[data-walk="verdict"]');
    verdict.textContent = step.verdictText;
    verdict.className = "verdict " + step.verdict;
    one('[data-walk="facts"]').textContent = step.factsText;
    fill("query", "Query", step.frames.query, "");
    fill("matched", "Matched", step.frames.matched, "no match");
    fill("true", "True", step.frames.true, "not in the map");
    showPlace(step.query);
  };
  const showNearest = (query) => {
    let best = 0;
    data.steps.forEach((step, at) => {
      if (Math.abs(step.query - query) < Math.abs(data.steps[best].query - query)) best = at;
    });
    show(best);
  };
  if (walk) {
    slider.addEventListener("input", () => show(Number(slider.value)));
    one('[data-walk="previous"]').addEventListener("click", () => show(Number(slider.value) - 1));
    one('[data-walk="next"]').addEventListener("click", () => show(Number(slider.value) + 1));
    show(Number(slider.value));
  }

  // Reading the matrix under the pointer.
  const readout = one("[data-readout]");
  const scoreAt = (() => {
    if (!data.scores) return () => null;
    const bytes = Uint8Array.from(atob(data.scores.values), (letter) => letter.charCodeAt(0));
    const nReferences = Math.round(Math.abs(matrixSpan.x[1] - matrixSpan.x[0]));
    const step = (data.scores.high - data.scores.low) / 65535;
    return (query, reference) => {
      const at = 2 * (query * nReferences + reference);
      return data.scores.low + (bytes[at] + 256 * bytes[at + 1]) * step;
    };
  })();
  const frameAt = (event) => {
    const box = matrix.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width - matrixSpan.left) / matrixSpan.width;
    const y = ((event.clientY - box.top) / box.height - matrixSpan.top) / matrixSpan.height;
    if (x < 0 || x >= 1 || y < 0 || y >= 1) return null;
    return [Math.round(value(matrixSpan.y, y)), Math.round(value(matrixSpan.x, x))];
  };
  matrix.addEventListener("pointermove", (event) => {
    const pair = frameAt(event);
    if (!pair) return;
    const score = scoreAt(...pair);
    readout.textContent =
      `query ${pair[0]}, reference ${pair[1]}` + (score === null ? "" : `: ${score.toFixed(3)}`);
    readout.title = data.names ? `${data.names.q[pair[0]]} and ${data.names.r[pair[1]]}` : "";
  });
  matrix.addEventListener("click", (event) => {
    const pair = frameAt(event);
    if (pair && walk) showNearest(pair[0]);
  });
  for (const box of all("[data-layer]")) {
    box.addEventListener("change", () =>
      matrix.classList.toggle("without-" + box.dataset.layer, !box.checked));
  }

  // Enlarging a row of the sheets.
  const dialog = document.getElementById("enlarged");
  for (const row of all(".case")) {
    const enlarge = () => {
      one("[data-enlarged]", dialog).replaceChildren(
        ...[...row.children].map((child) => child.cloneNode(true)));
      dialog.showModal();
    };
    one(".enlarge", row).addEventListener("click", enlarge);
    one(".trio", row).addEventListener("click", enlarge);
  }
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
})();
