// Charts, tables that sort, filter and can be saved, and the choice of light or dark: for every page, and for the report.
"use strict";

const eureka = (() => {
  // --- light or dark -------------------------------------------------------------------------------------------------

  const root = document.documentElement;
  const kept = { // a file that is opened by itself may have no storage
    get: (name) => { try { return localStorage.getItem(name); } catch { return null; } },
    set: (name, value) => { try { localStorage.setItem(name, value); } catch { /* it is the choice of this page alone */ } },
  };
  const wishes = matchMedia("(prefers-color-scheme: dark)");
  if (kept.get("theme")) root.dataset.theme = kept.get("theme");

  function turn() {
    root.dataset.theme = (root.dataset.theme ?? (wishes.matches ? "dark" : "light")) === "dark" ? "light" : "dark";
    kept.set("theme", root.dataset.theme);
    repaint();
  }

  // --- charts --------------------------------------------------------------------------------------------------------

  const HEIGHT = 230;
  const drawn = new Map(); // figure -> { plot, chart, hidden }

  function short(value) {
    if (value == null) return "–";
    const size = Math.abs(value);
    return size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(2) : String(Number(value.toPrecision(4)));
  }

  const called = (chart, place) => chart.names[place] ?? `${chart.x_label} ${short(chart.xs[place])}`;
  let smooth = Number(kept.get("smooth") ?? 0); // what every slider stands at
  const columns = (chart) => [chart.xs, ...chart.lines.map(({ values }) => (chart.x_label === "epoch" ? smoothed(values) : values))];

  /** An exponential average, corrected for its beginning at zero (arXiv 1412.6980, section 3). */
  function smoothed(values) {
    let sum = 0, weight = 0;
    if (!smooth) return values;
    return values.map((value) => {
      if (value == null) return value;
      sum = smooth * sum + (1 - smooth) * value;
      weight = smooth * weight + (1 - smooth);
      return sum / weight;
    });
  }
  const kinds = ({ lines }) => JSON.stringify(lines.map(({ name, kind, color }) => [name, kind, color]));

  /** Twelve colours cannot all be told apart, by some eyes fewer: every four of them have other dashes. */
  const DASHES = [[], [11, 4], [3, 3]];
  const block = (line) => (line.kind === "dots" ? 0 : Math.floor(line.color / 4));

  /** One place has no line: a level is a point there. */
  const alone = (plot) => plot.data[0].length < 2;

  function series(line, stroke) {
    const common = { label: line.name, stroke, width: 1.75, dash: DASHES[block(line)] };
    switch (line.kind) {
      case "dots": return { ...common, paths: () => null, points: { show: true, size: 7, fill: stroke } };
      case "dashed": return { ...common, dash: [6, 5], spanGaps: true, points: { show: alone } };
      case "steps": return { ...common, paths: uPlot.paths.stepped({ align: 1 }), spanGaps: true, points: { show: alone } };
      default: return { ...common, points: { size: 5, show: (plot, index, from, to) => to - from < 12 } };
    }
  }

  const WHOLE = [0, 1, 2, 3, 4, 5, 6, 7, 8].flatMap((power) => [1, 2, 5].map((digit) => digit * 10 ** power));

  /** Of so many places those that have room for a word, and null for the others. */
  const spaced = (plot, places) => places.map((place, index) => (index % Math.ceil(places.length * 46 / plot.width) ? null : place));

  function axes(chart, ink, line) {
    const common = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1, size: 4 }, font: "11px system-ui, sans-serif" };
    const x = { ...common, size: 30, space: 60, values: (_, splits) => splits.map((split) => (split == null ? "" : short(split))) };
    if (chart().xs.every(Number.isInteger)) x.incrs = WHOLE;
    if (chart().bounds.length) {
      const one = () => chart().bounds.length === 1; // generation: its slots are told apart
      x.splits = () => (one() ? chart().xs : chart().bounds);
      x.filter = spaced;
      x.values = (_, splits) => splits.map((place) => (one() ? chart().names[place] : chart().names[place]?.replace(/^g(\d+)s.*$/, "gen. $1")) ?? "");
    }
    const y = { ...common, size: (_, values) => 16 + 6.5 * Math.max(3, ...(values ?? []).map((value) => value.length)), values: (_, splits) => splits.map(short) };
    return [x, y];
  }

  /** A box beside the pointer says what stands there. */
  function tip(chart) {
    const box = document.createElement("div");
    box.className = "tip";
    box.hidden = true;
    return {
      hooks: {
        init: (plot) => plot.over.append(box),
        setCursor: (plot) => {
          const place = plot.cursor.idx;
          box.hidden = place == null || plot.cursor.left < 0;
          if (box.hidden) return;
          const said = plot.series.slice(1).map((one, index) => [one.show, one.label, chart().lines[index].values[place]]);
          box.textContent = [called(chart(), place), ...said.filter(([show, , value]) => show && value != null).map(([, label, value]) => `${label}: ${short(value)}`)].join("\n");
          const right = plot.cursor.left > plot.over.clientWidth / 2;
          box.style.left = right ? "" : `${plot.cursor.left + 12}px`;
          box.style.right = right ? `${plot.over.clientWidth - plot.cursor.left + 12}px` : "";
          box.style.top = "4px";
        },
      },
    };
  }

  function legend(figure, state) {
    const list = figure.querySelector(".legend");
    list.replaceChildren(...state.chart.lines.map((line, index) => {
      const button = document.createElement("button");
      const sign = document.createElement("i");
      sign.className = `h${line.color} ${line.kind} d${block(line)}`;
      button.type = "button";
      button.append(sign, line.name);
      button.setAttribute("aria-pressed", String(!state.hidden.has(line.name)));
      button.addEventListener("click", () => {
        const show = state.hidden.delete(line.name) || !state.hidden.add(line.name);
        button.setAttribute("aria-pressed", String(show));
        state.plot.setSeries(index + 1, { show });
      });
      const stand = (place) => state.plot.setSeries(place, { focus: true });
      button.addEventListener("pointerenter", () => stand(index + 1));
      button.addEventListener("focus", () => { if (button.matches(":focus-visible")) stand(index + 1); });
      for (const end of ["pointerleave", "blur"]) button.addEventListener(end, () => stand(null));
      return button;
    }));
    return [...list.querySelectorAll("i")].map((sign) => getComputedStyle(sign).color);
  }

  /** Of all charts of F that stand side by side, so that heights compare. */
  function span() {
    const known = [...document.querySelectorAll("main.side .chart[data-shared]")].flatMap(({ dataset }) => JSON.parse(dataset.chart).lines.flatMap((line) => line.values)).filter((value) => value != null);
    return room(null, Math.min(...known), Math.max(...known));
  }

  /** What a vertical axis spans; a level line is in its middle. */
  function room(_, low, high) {
    const beyond = Math.abs(low) / 10 || 1;
    return low == null || low < high ? uPlot.rangeNum(low ?? 0, high ?? 1, .1, true) : [low - beyond, high + beyond];
  }

  function draw(figure) {
    const state = drawn.get(figure) ?? { hidden: new Set() };
    state.plot?.destroy();
    state.chart = JSON.parse(figure.dataset.chart);
    const place = figure.querySelector(".plot");
    const colors = legend(figure, state);
    const ink = getComputedStyle(figure.querySelector("figcaption")).color, line = getComputedStyle(figure).outlineColor;
    const options = {
      width: place.clientWidth || 400,
      height: HEIGHT,
      scales: { x: { time: false, range: state.chart.names.length ? (_, low, high) => [low - .6, high + .6] : undefined }, y: { range: "shared" in figure.dataset && figure.closest("main.side") ? span : room } },
      legend: { show: false },
      focus: { alpha: .2 },
      cursor: { drag: { x: true, y: false }, points: { size: 7 } },
      axes: axes(() => state.chart, ink, line),
      series: [{}, ...state.chart.lines.map((one, index) => ({ ...series(one, colors[index]), show: !state.hidden.has(one.name) }))],
      plugins: [tip(() => state.chart)],
    };
    state.plot = new uPlot(options, columns(state.chart), place);
    drawn.set(figure, state);
    follows(figure, state);
  }

  /** The place whose point the pointer is at, within as many pixels. */
  function pointed({ chart, plot }, reach) {
    const { idx, left, top } = plot.cursor;
    const near = ({ kind, values }, index) => kind === "dots" && plot.series[index + 1].show && values[idx] != null
      && Math.hypot(plot.valToPos(chart.xs[idx], "x") - left, plot.valToPos(values[idx], "y") - top) < reach;
    return idx != null && chart.lines.some(near) ? idx : null;
  }

  /** A click on a candidate's point leads to it; the end of a drag, which zooms, does not. A finger, which cannot point
      without a click, reads with the first one. */
  function follows(figure, state) {
    if (!figure.dataset.at) return;
    const { over } = state.plot;
    let from = 0, finger = false, read = null;
    over.addEventListener("pointerdown", (event) => { from = event.clientX; finger = event.pointerType === "touch"; });
    over.addEventListener("mousemove", () => { over.style.cursor = pointed(state, 14) === null ? "" : "pointer"; });
    over.addEventListener("click", (event) => {
      const place = Math.abs(event.clientX - from) < 4 ? pointed(state, finger ? 24 : 14) : null;
      if (place !== null && (!finger || place === read)) location.href = figure.dataset.at + state.chart.names[place];
      read = place;
    });
  }

  /** What has left the page keeps its canvas until it is let go. */
  function forget() {
    for (const [figure, { plot }] of drawn) if (!figure.isConnected) { plot.destroy(); drawn.delete(figure); }
  }
  function repaint() { forget(); drawn.forEach((_, figure) => draw(figure)); }
  wishes.addEventListener("change", repaint);
  matchMedia("print").addEventListener("change", repaint); // paper is light

  const seen = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      seen.unobserve(target);
      if (!drawn.has(target)) draw(target);
    }
  }, { rootMargin: "300px" });
  const fits = new ResizeObserver((entries) => {
    for (const { target } of entries) {
      const plot = drawn.get(target.closest(".chart"))?.plot;
      if (plot && target.clientWidth && plot.width !== target.clientWidth) plot.setSize({ width: target.clientWidth, height: HEIGHT });
    }
  });

  /** The numbers and words of a fresh figure for one that is drawn: what a person zoomed into or hid stays so. */
  function update(figure, fresh) {
    const state = drawn.get(figure);
    figure.dataset.chart = fresh.dataset.chart;
    figure.querySelector(".plot").setAttribute("aria-label", fresh.querySelector(".plot").getAttribute("aria-label"));
    figure.querySelector(".note")?.remove();
    figure.append(...fresh.querySelectorAll(".note"));
    const chart = JSON.parse(fresh.dataset.chart);
    if (kinds(chart) !== kinds(state.chart)) return draw(figure);
    const { min, max } = state.plot.scales.x;
    const whole = state.chart.xs;
    const zoomed = min > whole[0] || max < whole.at(-1);
    state.chart = chart;
    state.plot.setData(columns(chart), !zoomed);
    if (zoomed) state.plot.redraw();
  }

  // --- tables --------------------------------------------------------------------------------------------------------

  const orders = new Map(); // table id -> { column, down }

  function sort(table) {
    const order = orders.get(table.id);
    if (!order) return;
    // The cells of a run that cannot be read are one, which says why.
    const key = (row) => { const cell = row.cells[order.column]; return cell?.dataset.value ?? cell?.textContent.trim() ?? ""; };
    const number = (text) => (text === "" || text === "-" || Number.isNaN(Number(text)) ? null : Number(text));
    const rows = [...table.tBodies[0].rows].map((row) => [key(row), row]);
    const counts = rows.some(([text]) => number(text) !== null);
    rows.sort(([a], [b]) => {
      if (!counts) return (a === "") - (b === "") || (order.down ? -1 : 1) * a.localeCompare(b);
      const [x, y] = [number(a), number(b)]; // what has no number comes last, whichever way
      return x === null || y === null ? (x === null) - (y === null) : (order.down ? y - x : x - y);
    });
    table.tBodies[0].append(...rows.map(([, row]) => row));
    [...table.tHead.rows[0].cells].forEach((cell, index) => {
      if (index === order.column) cell.setAttribute("aria-sort", order.down ? "descending" : "ascending");
      else cell.removeAttribute("aria-sort");
    });
  }

  function filter(table) {
    const tools = document.querySelectorAll(`[data-filter="${table.id}"]`);
    for (const row of table.tBodies[0].rows) {
      row.hidden = [...tools].some(({ value, dataset: { column } }) => {
        const text = (column ? row.querySelector(`[data-column="${column}"]`)?.textContent.trim() : row.textContent) ?? "";
        return value && !(column ? text === value : text.toLowerCase().includes(value.toLowerCase()));
      });
    }
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("button.sort");
    if (!button) return;
    const cell = button.closest("th"), table = cell.closest("table");
    const before = orders.get(table.id);
    // Numbers are most often looked at from the highest down.
    orders.set(table.id, { column: cell.cellIndex, down: before?.column === cell.cellIndex ? !before.down : "down" in button.dataset });
    sort(table);
  });
  document.addEventListener("input", ({ target }) => {
    const table = target.dataset?.filter && document.getElementById(target.dataset.filter);
    if (table) filter(table);
  });

  /** The rows that are shown, as a file. A text that a spreadsheet would take for a formula gets an apostrophe. */
  function save(table) {
    const text = (cell) => (cell.matches(".why") ? null : cell.querySelector("a")?.textContent ?? cell.dataset.value) ?? cell.textContent.replace(/\s+/g, " ").replace(/ [↕↑↓]$/, "").trim();
    const safe = (said) => (/^[=+\-@]/.test(said) && Number.isNaN(Number(said)) ? `'${said}` : said);
    const rows = [...table.rows].filter((row) => !row.hidden).map((row) =>
      [...row.cells].slice(table.querySelector("thead td") ? 1 : 0).map((cell) => `"${safe(text(cell)).replaceAll('"', '""')}"`).join(","));
    const link = Object.assign(document.createElement("a"), { download: `${table.id}.csv`, href: URL.createObjectURL(new Blob([rows.join("\n"), "\n"], { type: "text/csv" })) });
    link.click();
    URL.revokeObjectURL(link.href);
  }

  document.addEventListener("click", ({ target }) => {
    const table = target.dataset?.save && document.getElementById(target.dataset.save);
    if (table) save(table);
  });

  // --- whatever came into the page -----------------------------------------------------------------------------------

  /** Only what can be scrolled is a stop of the keyboard's. */
  const stops = new ResizeObserver((entries) => {
    for (const { target } of entries) target.tabIndex = target.scrollWidth > target.clientWidth || target.scrollHeight > target.clientHeight ? 0 : -1;
  });

  function dress(part) {
    forget();
    for (const box of part.querySelectorAll(".scroll, pre[tabindex]")) stops.observe(box);
    for (const slider of part.querySelectorAll(".smooth input")) slider.value = smooth;
    for (const figure of part.querySelectorAll(".chart")) if (!drawn.has(figure)) { seen.observe(figure); fits.observe(figure.querySelector(".plot")); }
    for (const table of part.querySelectorAll("table.all")) { sort(table); filter(table); }
  }

  /** What an address names is shown whole. */
  function unfold() {
    const fold = document.getElementById(location.hash.slice(1))?.querySelector("details.all");
    if (fold) fold.open = true;
  }

  addEventListener("hashchange", unfold);
  unfold();
  addEventListener("beforeprint", () => document.querySelectorAll(".chart").forEach((figure) => { if (!drawn.has(figure) && figure.checkVisibility()) draw(figure); }));
  document.getElementById("theme")?.addEventListener("click", turn);
  document.addEventListener("input", ({ target }) => {
    if (!target.matches(".smooth input")) return;
    smooth = Number(target.value);
    kept.set("smooth", target.value);
    document.querySelectorAll(".smooth input").forEach((slider) => { slider.value = smooth; });
    repaint();
  });
  dress(document);
  return { dress, update, of: (figure) => drawn.get(figure) };
})();
