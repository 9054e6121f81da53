// The view of one run: its numbers, matrix and matches. Its file is loaded when first asked for.
(() => {
  const { one, all, place, setBox, addCursor, makeWalk } = widgets;
  const data = JSON.parse(document.getElementById("data").textContent);
  const dialog = document.getElementById("run");
  const slot = (name) => one(`[data-run-slot="${name}"]`, dialog);
  const loaded = {};
  const waiting = {};

  // The run files call this.
  window.openedRuns = (name, value) => {
    loaded[name] = value;
    for (const resume of waiting[name] || []) resume(value);
    delete waiting[name];
  };
  const load = (name, resume) => {
    if (loaded[name]) {
      resume(loaded[name]);
      return;
    }
    if (waiting[name]) {
      waiting[name].push(resume);
      return;
    }
    waiting[name] = [resume];
    const script = document.createElement("script");
    script.src = `runs/${name}.js`;
    script.addEventListener("error", () => {
      delete waiting[name];
      slot("title").textContent = "This run's file is not beside the page";
      slot("place").textContent = `runs/${name}.js could not be read. Keep the folder together.`;
    });
    document.head.append(script);
  };

  const element = (tag, text, className) => {
    const made = document.createElement(tag);
    if (text !== undefined) made.textContent = text;
    if (className) made.className = className;
    return made;
  };
  // "t_VPR" with its index set as such.
  const indexed = (made, text) => {
    const [head, tail] = /^[tPRK]_/.test(text) ? text.split("_") : [text, ""];
    made.textContent = head;
    if (tail) made.append(element("sub", tail));
    return made;
  };

  let group = null;
  let matches = null;
  let steps = [];
  let marker = null;
  let truthKnown = false;

  const picture = (entry, number) =>
    number < 0 ? null : { key: entry ? entry[0] : "", number, name: entry ? entry[1] : "" };
  const stepAt = (at) => {
    const i = steps[at];
    if (i === undefined) return undefined;
    const [query, reference] = [matches.q[i], matches.r[i]];
    const truth = matches.t.length ? matches.t[i] : -1;
    const seen = matches.p[i] || [];
    const verdict = reference < 0 ? "refused" : matches.c[i] ? "correct" : "wrong";
    const off = truth >= 0 && reference >= 0 ? Math.abs(truth - reference) : null;
    const texts = {
      correct: "correct",
      wrong: off === null ? "wrong" : `wrong, ${off} frames off`,
      refused: "no match",
    };
    const length = matches.k.length ? ` · K = ${matches.k[i]}` : "";
    const frames = `query ${query} → ${reference < 0 ? "no match" : "map " + reference}`;
    return {
      query,
      reference,
      verdict,
      verdictText: texts[verdict],
      factsText: `${frames} · score ${matches.s[i].toPrecision(3)}${length}`.replace("-", "−"),
      noTruth: truthKnown ? "not in the map" : "not known",
      frames: {
        query: picture(seen[0], query),
        matched: picture(seen[1], reference),
        true: picture(seen[2], truth),
      },
    };
  };
  const walk = makeWalk(slot("walk"), {
    step: stepAt,
    pictureOf: (key) => key || undefined,
    onShow: (step) => {
      if (!marker || !group.matrix) return;
      const [rows] = group.matrix.shape;
      setBox(marker, { left: 0, width: 1, top: place([0, rows], step.query + 0.5), height: "1px" });
    },
  });

  const chosen = () => {
    const everything = matches.q.map((_, at) => at);
    const which = slot("which").value;
    if (which === "wrong") return everything.filter((at) => !matches.c[at]);
    if (which === "pictures") return everything.filter((at) => matches.p[at]);
    return everything;
  };
  const showSteps = () => {
    steps = chosen();
    one('[data-walk="slider"]', dialog).max = Math.max(steps.length - 1, 0);
    if (steps.length) {
      walk.show(0);
      return;
    }
    one('[data-walk="verdict"]', dialog).textContent = "";
    one('[data-walk="verdict"]', dialog).className = "";
    one('[data-walk="facts"]', dialog).textContent = "No answer of this run is wrong.";
  };
  slot("which").addEventListener("change", showSteps);

  const showNearest = (query) => {
    if (!steps.length) return;
    let best = 0;
    steps.forEach((i, at) => {
      const apart = (j) => Math.abs(matches.q[j] - query);
      if (apart(i) < apart(steps[best])) best = at;
    });
    walk.show(best);
  };

  const draw = () => {
    const matrix = group.matrix;
    slot("matrix").hidden = !matrix;
    if (!matrix) return;
    const [rows, columns] = matrix.shape;
    const plot = slot("plot");
    const cells = element("img");
    cells.src = matrix.uri;
    cells.alt = `Similarity matrix of ${rows} query frames by ${columns} map frames`;
    plot.replaceChildren(cells);
    plot.style.aspectRatio = `${columns} / ${Math.min(Math.max(rows, columns / 2.5), columns * 1.15)}`;
    slot("low").textContent = matrix.low.toPrecision(3);
    slot("high").textContent = matrix.high.toPrecision(3);
    slot("block").textContent =
      Math.max(...matrix.block) > 1
        ? `Drawn as means over ${matrix.block[0]} × ${matrix.block[1]} pairs.`
        : "";
    const canvas = element("canvas", undefined, "layer-matches");
    canvas.width = canvas.height = 900;
    canvas.setAttribute("aria-hidden", "true");
    plot.append(canvas);
    marker = addCursor(plot, "on-matrix");
    if (matches) drawAnswers(canvas, rows, columns);
  };
  const drawAnswers = (canvas, rows, columns) => {
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const colours = ["--astray-mark", "--matched-mark"].map((name) => style.getPropertyValue(name));
    const size = Math.min(Math.max(1400 / rows, 3), 9);
    for (const right of [1, 0]) {
      pen.fillStyle = pen.strokeStyle = colours[right];
      pen.lineWidth = 3;
      matches.q.forEach((query, at) => {
        if (matches.c[at] !== right || matches.r[at] < 0) return;
        const [x, y] = [900 * (matches.r[at] + 0.5) / columns, 900 * (query + 0.5) / rows];
        pen.beginPath();
        if (right) {
          pen.arc(x, y, size, 0, 7);
          pen.fill();
        } else {
          pen.moveTo(x - size, y - size);
          pen.lineTo(x + size, y + size);
          pen.moveTo(x - size, y + size);
          pen.lineTo(x + size, y - size);
          pen.stroke();
        }
      });
    }
  };
  slot("plot").addEventListener("click", (event) => {
    if (!matches) return;
    const box = slot("plot").getBoundingClientRect();
    showNearest(Math.floor(((event.clientY - box.top) / box.height) * group.matrix.shape[0]));
  });

  const keyFigures = [["accuracy", "interval"], ["AUC", ""], ["query picture", ""], ["t_VPR", ""]];
  const showNumbers = (values) => {
    const texts = Object.fromEntries(data.numbers.map(([name], at) => [name, values[at + 2]]));
    slot("key-figures").replaceChildren(...keyFigures.map(([name, note]) => {
      const box = element("div");
      const value = element("dd");
      value.append(element("span", texts[name], "figure-value"));
      if (note) value.append(element("span", texts[note], "figure-note"));
      box.append(indexed(element("dt"), name), value);
      return box;
    }));
    slot("numbers").replaceChildren(...data.numbers.map(([name, meaning], at) => {
      const row = element("tr");
      const head = indexed(element("th"), name);
      head.scope = "row";
      row.append(head, element("td", values[at + 2], "value"), element("td", meaning, "definition"));
      return row;
    }));
  };
  const showSettings = (identity) => {
    const rows = [["Run", identity], ...group.settings, ...group.provenance];
    slot("settings").replaceChildren(
      ...rows.flatMap(([name, value]) => [element("dt", name), element("dd", value, "code")]));
  };

  const showRun = (length) => {
    const values = group.runs[length];
    slot("place").textContent = `${values[0]} · ${group.place} · ${group.measured}`;
    showNumbers(values);
    showSettings(values[1]);
    matches = group.matches[length] || null;
    slot("walk").hidden = !matches;
    slot("problem").textContent = matches
      ? ""
      : `Matches are kept for K = ${Object.keys(group.matches).join(", ")}: choose one of them.`;
    draw();
    if (!matches) return;
    const pictured = Object.keys(matches.p).length;
    truthKnown = group.truth;
    const which = slot("which");
    one('[value="pictures"]', which).disabled = !pictured;
    which.value = pictured ? "pictures" : "all";
    slot("walk").classList.toggle("without-pictures", !pictured);
    slot("walk-text").textContent = pictured
      ? `${pictured} of ${matches.q.length} windows with pictures, as they were compressed.`
      : "The pictures were not at hand when this page was written.";
    showSteps();
  };

  const fillLengths = (length) => {
    const select = slot("lengths");
    select.replaceChildren(...Object.keys(group.runs).map((name) => {
      const kept = group.matches[name] ? " · with matches" : "";
      const option = element("option", (group.runs[name][0]) + kept);
      option.value = name;
      return option;
    }));
    select.value = length;
  };
  slot("lengths").addEventListener("change", () => showRun(slot("lengths").value));

  widgets.openRun = (file, length) => {
    slot("title").textContent = "Loading the run …";
    if (!dialog.open) dialog.showModal();
    slot("title").focus();
    load(data.files[file][0], (value) => {
      group = value;
      slot("title").textContent = group.title;
      fillLengths(length);
      showRun(length);
      dialog.scrollTop = 0;
    });
  };

  dialog.addEventListener("keydown", (event) => {
    const typing = event.target.closest("select, input, summary");
    if (typing || (event.key !== "ArrowLeft" && event.key !== "ArrowRight") || !matches) return;
    event.preventDefault();
    walk.move(event.key === "ArrowRight" ? 1 : -1);
  });
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  const openLink = (link) => {
    const cut = link.indexOf("/");
    widgets.openRun(Number(link.slice(0, cut)), link.slice(cut + 1));
  };
  const lengthWords = (length) => (/^\d+$/.test(length) ? `K = ${length}` : `${length} K`);
  const sayWhatOpens = (event) => {
    const button = event.target.closest?.("[data-run]");
    if (!button || button.title) return;
    const cut = button.dataset.run.indexOf("/");
    const [, name, place] = data.files[Number(button.dataset.run.slice(0, cut))];
    const length = lengthWords(button.dataset.run.slice(cut + 1));
    button.title = `Open the run: ${data.names[name]}, ${length}, ${data.places[place]}`;
  };
  for (const event of ["pointerover", "focusin"]) document.addEventListener(event, sayWhatOpens);
  for (const button of all(".match-case .open-run")) {
    button.addEventListener("click", () => openLink(button.dataset.run));
  }
  for (const row of all("table.sortable tbody tr")) {
    row.addEventListener("click", (event) => {
      const button = event.target.closest(".open-run") || one(".open-run", row);
      if (button && !window.getSelection().toString()) openLink(button.dataset.run);
    });
    row.classList.toggle("opens", Boolean(one(".open-run", row)));
  }
})();
