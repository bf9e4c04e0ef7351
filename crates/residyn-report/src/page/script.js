"use strict";
// Draws the pictures of the report from the data in the page.
(() => {
  const report = JSON.parse(document.getElementById("report").textContent);
  const names = { measured: "measured", before: "declared model, fitted", after: "with effects", hybrid: "with effects and network" };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  // Room for the longest number next to an axis.
  const room = (plot, values) => 22 + 7.5 * Math.max(2, ...(values ?? []).map((value) => value.length));
  const axis = () => ({ stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") }, size: room });
  const options = (place, series, extra) => ({
    width: Math.max(place.clientWidth, 200),
    height: place.dataset.scatter === undefined ? 220 : 170,
    series: [{}, ...series],
    axes: [{ ...axis(), size: 32 }, axis()],
    cursor: { drag: { x: true, y: false } },
    legend: { show: true, live: false },
    ...extra,
  });

  // Measured and predicted.
  const curves = (place) => {
    const segment = report.plots.segments[place.dataset.segment];
    const tracks = segment.joints[place.dataset.joint];
    const kinds = ["measured", "before", "after", "hybrid"].filter((kind) => tracks[kind].length > 0);
    const look = {
      measured: { width: 4 },
      before: { width: 1.5, dash: [6, 4] },
      after: { width: 1.5 },
      hybrid: { width: 2, dash: [2, 5] },
    };
    const series = kinds.map((kind) => ({ label: names[kind], stroke: colour(kind), points: { show: false }, ...look[kind] }));
    return new uPlot(options(place, series, { scales: { x: { time: false } } }), [segment.time, ...kinds.map((kind) => tracks[kind])], place);
  };

  // Layers with abscissae of their own as the columns of one table, sorted.
  const merged = (layers) => {
    const lines = layers.flatMap(({ x, lines }) => lines.map(({ y }) => ({ x, y })));
    const rows = layers.flatMap(({ x }) => x.map((value, k) => [value, ...lines.map((line) => (line.x === x ? line.y[k] : null))]));
    rows.sort((a, b) => a[0] - b[0]);
    return rows[0].map((_, k) => rows.map((row) => row[k]));
  };
  const points = (kind) => ({ label: names[kind], stroke: colour(kind), paths: () => null, points: { show: true, size: 4, fill: colour(kind) } });
  const line = (kind, width, label) => ({ label, stroke: colour(kind), width, spanGaps: true, points: { show: false } });

  // The mean over runs of equally many points, over the variable.
  const mean = (x, y, runs) => {
    const order = x.map((_, k) => k).sort((a, b) => x[a] - x[b]);
    const average = (part, of) => part.reduce((sum, k) => sum + of[k], 0) / part.length;
    const size = Math.max(1, Math.ceil(order.length / runs));
    const means = [];
    for (let k = 0; k < order.length; k += size) {
      const part = order.slice(k, k + size);
      means.push([average(part, x), average(part, y)]);
    }
    return means;
  };

  // Whether the effects on a joint are more than those that are drawn by their formulas.
  const has_others = ({ joint, effects }) => {
    const added = [...report.effects, ...report.supported].filter((effect) => (effect.joints ?? [effect.joint]).includes(joint));
    return added.length > effects.flatMap((curve) => curve.effects).length;
  };

  // The residual over a variable as points; what the effects add, by the formulas of those that depend on this variable
  // alone with the band of their intervals or, if other effects act on the joint, as the averaged difference of the
  // two; and the band of the mean residual.
  const scatter = (place) => {
    const data = report.plots.residuals[place.dataset.scatter];
    const over = place.dataset.over;
    const x = data[over];
    const variable = over === "time" ? "t" : over;
    const numbered = over === "time" ? "t" : over + data.joint;
    const formula = data.effects.find((curve) => curve.variable === variable);
    const left = report.unexplained.curves.find((curve) => curve.joint === data.joint && curve.variable === numbered);
    const layers = [{ x, lines: [{ ...points("before"), y: data.before }] }];
    const bands = [];
    const band = (of, kind, label) => {
      const last = layers.reduce((sum, layer) => sum + layer.lines.length, 0);
      layers.push({ x: of.x, lines: [{ ...line(kind, 0.5, label), y: of.high }, { ...line(kind, 0.5, ""), class: "unlisted", y: of.low }] });
      bands.push({ series: [last + 1, last + 2], fill: colour(kind) + "33" });
    };
    if (data.after.length > 0) layers[0].lines.push({ ...points("after"), y: data.after });
    if (left) band(left, "after", "95 % band of what is left");
    if (formula?.low.length > 0) band(formula, "ink", "95 % band of the effect");
    if (formula) {
      layers.push({ x: formula.x, lines: [{ ...line("ink", 2, formula.effects.join(" + ")), y: formula.force }] });
    } else if (data.after.length > 0 && has_others(data)) {
      const means = mean(x, data.before.map((force, k) => force - data.after[k]), 24);
      layers.push({ x: means.map((one) => one[0]), lines: [{ ...line("ink", 2, "explained by the effects"), y: means.map((one) => one[1]) }] });
    }
    const series = layers.flatMap((layer) => layer.lines);
    return new uPlot(options(place, series, { bands, scales: { x: { time: false } } }), merged(layers), place);
  };

  // The rig in motion: a slider over its frames, and a button that moves it in real time, over and over.
  const player = document.querySelector(".motion");
  const play = ({ time, pictures, still }) => {
    const [button, slider, clock] = ["button", "input", "output"].map((name) => player.querySelector(name));
    const lines = [...player.querySelectorAll("[data-kind]")];
    const show = (frame) => {
      slider.value = frame;
      for (const line of lines) line.setAttribute("points", pictures[line.dataset.picture][line.dataset.kind][frame]);
      clock.textContent = "at " + time[frame].toFixed(2) + " s";
    };
    // When the first frame would have been shown; null while it stands.
    let began = null;
    const start = () => {
      began = performance.now() - 1000 * (time[slider.value] - time[0]);
      button.textContent = "Pause";
      requestAnimationFrame(step);
    };
    const stop = () => {
      began = null;
      button.textContent = "Play";
    };
    const step = (now) => {
      if (began === null) return;
      const next = time.findIndex((t) => t - time[0] > (now - began) / 1000);
      if (next < 0) began = now;
      show(Math.max(next - 1, 0));
      requestAnimationFrame(step);
    };
    button.addEventListener("click", () => (began === null ? start() : stop()));
    slider.addEventListener("input", () => {
      stop();
      show(slider.value);
    });
    matchMedia("print").addEventListener("change", () => {
      stop();
      show(still);
    });
  };
  if (player) play(report.plots.motion);

  // Zoom by keys: uPlot knows the mouse.
  const keys = (place, plot, event) => {
    const { min, max } = plot.scales.x;
    const [first, last] = [plot.data[0][0], plot.data[0][plot.data[0].length - 1]];
    const width = max - min;
    const to = {
      "+": [min + width / 4, max - width / 4],
      "-": [Math.max(first, min - width / 2), Math.min(last, max + width / 2)],
      ArrowLeft: [min - width / 4, max - width / 4],
      ArrowRight: [min + width / 4, max + width / 4],
      0: [first, last],
    }[event.key];
    if (!to) return;
    event.preventDefault();
    plot.setScale("x", { min: to[0], max: to[1] });
  };

  const drawn = new Map();
  const draw = (place) => {
    if (place.clientWidth === 0) return;
    drawn.get(place)?.destroy();
    drawn.set(place, place.dataset.segment === undefined ? scatter(place) : curves(place));
  };
  const places = [...document.querySelectorAll(".plot")];
  const redraw = () => places.forEach(draw);
  for (const place of places) {
    draw(place);
    place.addEventListener("keydown", (event) => drawn.has(place) && keys(place, drawn.get(place), event));
  }
  for (const details of document.querySelectorAll("details")) {
    details.addEventListener("toggle", () => details.querySelectorAll(".plot").forEach((place) => drawn.has(place) || draw(place)));
  }
  let waiting;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(redraw, 150);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  // Paper has a page for each joint.
  const parts = [...document.querySelectorAll("details.part")];
  let folded = [];
  matchMedia("print").addEventListener("change", ({ matches }) => {
    if (matches) folded = parts.filter((part) => !part.open);
    for (const part of folded) part.open = matches;
    redraw();
  });
})();
