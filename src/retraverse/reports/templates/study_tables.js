// Tables: a click on a heading sorts, the boxes above choose techniques.
(() => {
  const { one, all } = widgets;

  // A cell that says nothing else sorts by its text.
  const keyOf = (row, column) => {
    const cell = row.children[column];
    return cell ? cell.dataset.v ?? cell.textContent : "";
  };
  const compare = (a, b) => {
    if (a === "" || b === "") return a === b ? 0 : a === "" ? 1 : -1;
    const [x, y] = [Number(a), Number(b)];
    if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
    return a.localeCompare(b, "en", { numeric: true });
  };
  const sort = (table, heading) => {
    const column = [...heading.parentElement.children].indexOf(heading);
    const falling = heading.getAttribute("aria-sort") === "ascending";
    for (const other of all("th[aria-sort]", table)) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const body = table.tBodies[0];
    const rows = [...body.rows].filter((row) => !row.classList.contains("absent-row"));
    rows.sort((a, b) => {
      const [x, y] = [keyOf(a, column), keyOf(b, column)];
      const missing = x === "" || y === "";
      return falling && !missing ? compare(y, x) : compare(x, y);
    });
    body.append(...rows, ...all(".absent-row", body));
  };
  for (const table of all("table.sortable")) {
    for (const button of all("button.sort", table)) {
      button.addEventListener("click", () => sort(table, button.closest("th")));
    }
  }

  const boxes = all("[data-filter]");
  const apply = (box) => {
    const technique = box.dataset.filter;
    for (const part of all(`[data-technique="${technique}"]`)) part.hidden = !box.checked;
    for (const layer of all(`.panel svg .layer-${technique}`)) {
      layer.style.display = box.checked ? "" : "none";
    }
  };
  for (const box of boxes) box.addEventListener("change", () => apply(box));
  for (const button of all("[data-filter-all]")) {
    button.addEventListener("click", () => {
      for (const box of boxes) {
        box.checked = Boolean(button.dataset.filterAll);
        apply(box);
      }
    });
  }
  widgets.isShown = (technique) => one(`[data-filter="${technique}"]`)?.checked ?? true;
})();
