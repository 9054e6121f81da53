(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { one, all, spanOf, place, value, addCursor, setBox, framesAt, makeWalk } = widgets;

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
  const pictureOf = (key) =>
    data.pictures[key] || one(`.case img[data-picture="${key}"]`)?.getAttribute("src");

  const step = (at) => data.steps[at];
  const { show } = walk
    ? makeWalk(walk, { step, pictureOf, onShow: (shown) => showPlace(shown.query) })
    : { show: () => {} };
  const showNearest = (query) => {
    let best = 0;
    data.steps.forEach((step, at) => {
      if (Math.abs(step.query - query) < Math.abs(data.steps[best].query - query)) best = at;
    });
    show(best);
  };
  if (walk) show(Number(one('[data-walk="slider"]').value));

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
  matrix.addEventListener("pointermove", (event) => {
    const pair = framesAt(matrix, matrixSpan, event);
    if (!pair) return;
    const score = scoreAt(...pair);
    readout.textContent =
      `query ${pair[0]}, reference ${pair[1]}` + (score === null ? "" : `: ${score.toFixed(3)}`);
    readout.title = data.names ? `${data.names.q[pair[0]]} and ${data.names.r[pair[1]]}` : "";
  });
  matrix.addEventListener("click", (event) => {
    const pair = framesAt(matrix, matrixSpan, event);
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
