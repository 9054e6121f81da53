"use strict";
// What the pages of all reports share.
const widgets = (() => {
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

  // Where in a panel a pointer is, as fractions; may lie outside [0, 1).
  const fractionsAt = (plot, span, event) => {
    const box = plot.getBoundingClientRect();
    return [
      ((event.clientX - box.left) / box.width - span.left) / span.width,
      ((event.clientY - box.top) / box.height - span.top) / span.height,
    ];
  };
  // The pair [query, reference] of a matrix that a pointer is at, or null.
  const framesAt = (plot, span, event) => {
    const [x, y] = fractionsAt(plot, span, event);
    if (x < 0 || x >= 1 || y < 0 || y >= 1) return null;
    return [Math.round(value(span.y, y)), Math.round(value(span.x, x))];
  };

  // Three pictures side by side that a slider, two buttons or a click elsewhere step through.
  // `step(at)` gives one window or undefined, `pictureOf(key)` an address or undefined.
  const makeWalk = (walk, { step, pictureOf, onShow }) => {
    const slider = one('[data-walk="slider"]', walk);
    const fill = (slot, role, frame, absent) => {
      const figure = one(".picture." + slot, walk);
      if (!figure) return;
      const source = frame && pictureOf(frame.key);
      const shown = document.createElement(source ? "img" : "div");
      if (source) {
        shown.src = source;
        shown.alt = `${role} frame ${frame.number}${frame.name ? ", " + frame.name : ""}`;
      } else {
        shown.className = "absent";
        shown.textContent = frame ? `frame ${frame.number}` : absent;
      }
      figure.firstElementChild.replaceWith(shown);
      one(".number", figure).textContent = frame ? `frame ${frame.number}` : "";
      one(".name", figure).textContent = frame ? frame.name : "";
    };
    const show = (at) => {
      const current = step(at);
      if (!current) return;
      slider.value = at;
      slider.setAttribute("aria-valuetext", `query frame ${current.query}, ${current.verdictText}`);
      const verdict = one('[data-walk="verdict"]', walk);
      verdict.textContent = current.verdictText;
      verdict.className = "verdict " + current.verdict;
      one('[data-walk="facts"]', walk).textContent = current.factsText;
      fill("query", "Query", current.frames.query, "");
      fill("matched", "Matched", current.frames.matched, "no match");
      fill("true", "True", current.frames.true, current.noTruth || "not in the map");
      onShow(current, at);
    };
    const move = (by) => show(Number(slider.value) + by);
    slider.addEventListener("input", () => show(Number(slider.value)));
    one('[data-walk="previous"]', walk).addEventListener("click", () => move(-1));
    one('[data-walk="next"]', walk).addEventListener("click", () => move(1));
    return { show, move };
  };

  return { one, all, spanOf, place, value, addCursor, setBox, fractionsAt, framesAt, makeWalk };
})();
