// Draws the data of a report with plotly.js: see interactive.py for what is in it.
const GREY = "#8a93a0", config = {displaylogo: false, responsive: true, displayModeBar: "hover",
  modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"]};
const element = id => document.getElementById(id);

async function unpack(id) {
  const bytes = Uint8Array.from(atob(element(id).textContent), c => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

const mix = (a, b, f) => a.map((v, k) => v === null || b[k] === null ? v : v + f * (b[k] - v));
const narrow = () => window.innerWidth < 700;
const plain = {exponentformat: "power", gridcolor: "#eceff3", zeroline: false};            // 10^-4, not 100 micro
const font = {family: "system-ui, Segoe UI, Roboto, sans-serif", size: 13, color: "#1d2530"};

// The place in a run: between states k and j = k + 1, a fraction f on; stages change at once. A run may be one state.
function place(run, s) {
  const p = run.progress;
  let k = 0;
  while (k < p.length - 2 && (p[k + 1] < s || s >= 1)) k++;              // the end is the last state
  const j = Math.min(k + 1, p.length - 1), gap = p[j] - p[k], same = run.stage[k] === run.stage[j];
  return {k, j, f: !same ? 1 : gap > 0 ? Math.min(Math.max((s - p[k]) / gap, 0), 1) : 1};
}

function frame(run, s, field) {
  const {k, j, f} = place(run, s), sheet = run.sheet || run.mesh, values = sheet.fields[field];
  const line = of => (sheet[of] ? sheet[of][k] : []).map((v, i) => mix(v, sheet[of][j][i], f));
  const between = (a, b) => f < 1 && a !== null && b !== null ? a + f * (b - a) : f < 1 ? a : b;
  return {state: f < 1 ? k : j, bottom: line("bottom"), top: line("top"), start: line("start"), end: line("end"), points: line("points"), values: mix(values[k], values[j], f),
    moved: (sheet.tools || []).map(tool => between(tool.travel[k], tool.travel[j])),
    all: Object.fromEntries(Object.entries(sheet.fields).map(([name, v]) => [name, mix(v[k], v[j], f)])),
    numbers: Object.fromEntries(Object.entries(run.numbers).map(([n, v]) => [n, v[k] + f * (v[j] - v[k])])),
    travel: run.tools.map(t => t.travel[f < 1 ? k : j] === null ? null
      : t.travel[k] === null ? t.travel[j] : t.travel[k] + f * ((t.travel[j] ?? t.travel[k]) - t.travel[k])),
    stage: run.stage[f < 1 ? k : j]};
}

function limits(run, field) {
  const v = (run.sheet || run.mesh).fields[field].flat().filter(x => x !== null).sort((a, b) => a - b);
  const out = field.startsWith("wall") ? 0 : Math.floor(0.01 * v.length);     // stresses have peaks at sharp corners
  return [v[out], v[v.length - 1 - out]];
}

// Maps of a section, (r, z) -> (sr r + dr, sz z + dz), to all that is drawn of it: images in mirrors, and across the axis.
const maps = run => run.images.flatMap(([sr, sz, dr, dz]) => (run.axisymmetric ? [1, -1] : [1])
  .map(side => [v => v.map(r => side * (sr * r + dr)), v => v.map(z => sz * z + dz)]));

const format = x => x === null || x === undefined ? "" : Number(x.toPrecision(4)).toString();
const stated = (label, x) => { const [name, unit] = label.split(", "); return `${name} ${format(x)} ${unit || ""}`.trim(); };

// The closed outline of a section along an axis; positions at a fraction s of the wall, bent near the ends like these.
const around = (at, axis) => [...at.bottom[axis], ...at.end[axis].slice(1, -1), ...[...at.top[axis]].reverse(),
  ...at.start[axis].slice(1, -1).reverse()];
function through(run, at, axis, s) {
  const bulge = ([r, z]) => {
    const n = r.length - 1, dr = r[n] - r[0], dz = z[n] - z[0], along = r.map((v, k) => ((v - r[0]) * dr + (z[k] - z[0]) * dz) / (dr * dr + dz * dz));
    const k = Math.max(along.findIndex(v => v >= s), 1), f = (s - along[k - 1]) / (along[k] - along[k - 1]), v = [r, z][axis];
    return v[k - 1] + f * (v[k] - v[k - 1]) - v[0] - s * (v[n] - v[0]);
  }, [near, far] = run.sheet.weights, first = bulge(at.start), other = bulge(at.end);
  return mix(at.bottom[axis], at.top[axis], s).map((v, i) => v + near[i] * first + far[i] * other);
}

const VIRIDIS = ["#440154", "#48186a", "#472d7b", "#424086", "#3b528b", "#33638d", "#2c728e", "#26828e", "#21918c", "#1fa088", "#28ae80",
  "#3fbc73", "#5ec962", "#84d44b", "#addc30", "#d8e219", "#fde725"], PORTLAND = ["#0c3383", "#0a88ba", "#f2d338", "#f28f38", "#d91e1e"], HUES = 32;
const palette = field => field.startsWith("temperature") ? PORTLAND : field.startsWith("wall") ? [...VIRIDIS].reverse() : VIRIDIS;
function hue(scale, share) {                                               // share: 0 to 1
  const x = share * (scale.length - 1), k = Math.min(Math.floor(x), scale.length - 2);
  const [a, b] = [scale[k], scale[k + 1]].map(c => [1, 3, 5].map(i => parseInt(c.slice(i, i + 2), 16)));
  return `rgb(${mix(a, b, x - k).map(Math.round).join(",")})`;
}

// The wall as closed areas between stations, of HUES colours; areas of one colour are one trace.
function bands(run, at, field, range, rows, sides) {
  const inner = [0, 1].map(axis => Array.from({length: rows - 1}, (_, k) => through(run, at, axis, (k + 1) / rows)));
  const across = (axis, i) => [at.bottom[axis][i], ...inner[axis].map(level => level[i]), at.top[axis][i]];
  const last = at.bottom[0].length - 1, areas = Array.from({length: HUES}, () => [[], []]);
  const parts = Math.ceil(80 / last), between = (axis, i, f) => f ? mix(across(axis, i), across(axis, i + 1), f) : across(axis, i);
  for (let n = 0; n < last * parts; n++) {
    const i = Math.floor(n / parts), f = n / parts - i, v = mix([at.values[i]], [at.values[i + 1]], f + 0.5 / parts)[0];
    if (v === null || at.values[i + 1] === null) continue;
    const area = areas[Math.min(Math.max(Math.floor(HUES * (v - range[0]) / ((range[1] - range[0]) || 1)), 0), HUES - 1)];
    for (const axis of [0, 1]) {
      const from = n === 0 && at.start[axis].length ? at.start[axis] : between(axis, i, f);
      const to = n === last * parts - 1 && at.end[axis].length ? at.end[axis] : between(axis, ...(n % parts === parts - 1 ? [i + 1, 0] : [i, f + 1 / parts]));
      area[axis].push(...from, ...[...to].reverse(), from[0], null);
    }
  }
  const scale = palette(field), moved = (map, v) => { const all = map(v); return all.map((x, i) => v[i] === null ? null : x); };
  return areas.flatMap((area, k) => area[0].length ? [{type: "scatter", mode: "lines", fill: "toself", hoverinfo: "skip", showlegend: false,
    fillcolor: hue(scale, (k + 0.5) / HUES), line: {color: hue(scale, (k + 0.5) / HUES), width: 2},
    x: sides.flatMap(([right]) => moved(right, area[0])), y: sides.flatMap(([, up]) => moved(up, area[1]))}] : []);
}

function sectionTraces(run, at, field, range) {
  const sides = maps(run), traces = [];
  run.tools.forEach((tool, i) => sides.forEach(([across, up]) => {
    const t = at.travel[i], dr = (t ?? 0) * tool.moves[0], dz = (t ?? 0) * tool.moves[1];
    const x = across([...tool.line[0], ...[...tool.shell[0]].reverse()].map(r => r + dr));
    const y = up([...tool.line[1], ...[...tool.shell[1]].reverse()].map(z => z + dz));
    traces.push({type: "scatter", x, y, mode: "lines", fill: "toself", fillcolor: "#cfd5dd", hoverinfo: "name",
      line: {color: GREY, width: 1}, name: tool.name, showlegend: false, visible: t !== null});
  }));
  sides.forEach(([across, up]) => traces.push({type: "scatter", mode: "lines", fill: "toself", fillcolor: "#30405a",
    line: {color: "#30405a", width: 0.5}, hoverinfo: "skip", showlegend: false,
    x: across(around(at, 0)), y: up(around(at, 1))}));
  const [bottom, top] = [at.bottom, at.top], size = Math.max(...box(run).map(([a, b]) => b - a));
  const wall = Math.max(...bottom[0].map((r, i) => Math.hypot(top[0][i] - r, top[1][i] - bottom[1][i])));
  const rows = Math.min(Math.max(Math.ceil(wall / (0.0125 * size)), 1), 20);                // of points through the wall
  traces.push(...bands(run, at, field, range, rows, sides));
  const all = list => Array.from({length: rows}, (_, k) => list((k + 0.5) / rows)).flat();
  const [r, z] = [0, 1].map(axis => all(s => through(run, at, axis, s)));
  sides.forEach(([across, up], n) => traces.push({type: "scatter", mode: "markers", showlegend: false, hovertemplate: "%{text}<extra></extra>",
    x: across(r), y: up(z), opacity: 0,                                                     // they carry texts and the colour bar
    text: all(() => bottom[0].map((_, i) => `from ${run.sheet.from} ${format(run.sheet.material[i])}<br>` +
      Object.entries(at.all).map(([label, v]) => stated(label, v[i])).join("<br>"))),
    marker: {size: 6, color: all(() => at.values), colorscale: palette(field).map((c, k, scale) => [k / (scale.length - 1), c]), cmin: range[0],
      cmax: range[1], showscale: n === 0, colorbar: {thickness: 12, len: 0.85, outlinewidth: 0, exponentformat: "power",
      title: {text: narrow() ? "" : field, side: "right"}, ...(narrow() ? {orientation: "h", yref: "container", y: 0, yanchor: "bottom", len: 1} : {})}}}));
  return traces;
}

const paint = (field, range) => ({colorscale: field.startsWith("temperature") ? "Portland" : "Viridis",
  reversescale: field.startsWith("wall"), cmin: range[0], cmax: range[1], lighting: {ambient: 0.6, diffuse: 0.6, specular: 0.15}});

// A sheet in three dimensions: its triangles and their images, and the tools.
function mesh(run, at, field, range) {
  const image = (points, [sx, sy, sz, dx, dy, dz]) => ({x: points[0].map(x => sx * x + dx), y: points[1].map(y => sy * y + dy),
    z: points[2].map(z => sz * z + dz)}), [i, j, k] = run.mesh.triangles;
  const sheets = run.images.map((map, n) => ({type: "mesh3d", ...image(at.points, map), i, j, k, intensity: at.values,
    ...paint(field, range), showscale: n === 0, colorbar: {thickness: 12, len: 0.85, exponentformat: "power", title: {text: field, side: "right"}},
    text: at.values.map(v => stated(field, v)), hovertemplate: "%{text}<extra></extra>"}));
  const tools = run.mesh.tools.flatMap((tool, n) => tool.images.map(map => {
    const points = tool.points.map((v, axis) => v.map(x => x + (at.moved[n] ?? 0) * tool.moves[axis]));
    return {type: "mesh3d", ...image(points, map), i: tool.triangles[0], j: tool.triangles[1], k: tool.triangles[2], color: GREY,
      opacity: 0.25, hoverinfo: "name", name: tool.name, visible: at.moved[n] !== null};
  }));
  const [x, y, z, thin] = run.mesh.thinnest[at.state], label = Object.keys(run.mesh.fields)[0];
  const marks = run.images.map(map => ({type: "scatter3d", mode: "markers", ...image([[x], [y], [z]], map), showlegend: false,
    marker: {size: 5, color: "#d03030", symbol: "diamond"}, hovertemplate: `thinnest: ${stated(label, thin)}<extra></extra>`}));
  return [...tools, ...sheets, ...marks];
}

function surface(run, at, field, range) {
  const [r, z] = [0, 1].map(axis => { const line = around(at, axis); return [...line, line[0]]; });
  const edge = (of, value) => of[0].slice(1, -1).map(() => value), v = [...at.values, ...edge(at.end, at.values.at(-1)),
    ...[...at.values].reverse(), ...edge(at.start, at.values[0]), at.values[0]];
  const turn = Array.from({length: 49}, (_, i) => 1.5 * Math.PI * i / 48), size = Math.max(...r);
  const x = run.axisymmetric ? turn.map(a => r.map(q => q * Math.cos(a))) : [-1, 1].map(() => r);
  const y = run.axisymmetric ? turn.map(a => r.map(q => q * Math.sin(a))) : [-1, 1].map(s => r.map(() => s * size));
  return run.images.map(([sr, sz, dr, dz]) => ({type: "surface", x: x.map(line => line.map(r => sr * r + dr)), y,
    z: x.map(() => z.map(v => sz * v + dz)), surfacecolor: x.map(() => v), ...paint(field, range), showscale: false, hoverinfo: "skip"}));
}

// Lowest and highest coordinates of all that is drawn: (r, z), of a sheet in three dimensions (x, y, z).
function box(run) {
  const axes = run.mesh ? [0, 1, 2] : [0, 1], n = axes.length, low = axes.map(() => Infinity), high = axes.map(() => -Infinity);
  for (const of of run.mesh ? ["points"] : ["bottom", "top", "start", "end"]) for (const points of (run.mesh || run.sheet)[of])
    for (const map of run.images) for (const i of axes) for (const v of points[i]) {
      const at = map[i] * v + map[n + i];
      low[i] = Math.min(low[i], at); high[i] = Math.max(high[i], at);
    }
  if (run.axisymmetric && !run.mesh) low[0] = -high[0];
  const room = 0.06 * Math.max(...axes.map(i => high[i] - low[i]));
  return axes.map(i => [low[i] - room, high[i] + room]);
}

function process(data) {
  const runs = data.runs.filter(run => run.sheet || run.mesh);
  if (!runs.length) { element("process").remove(); return; }
  const pick = element("run"), colour = element("colour"), slider = element("slider"), play = element("play");
  runs.forEach((run, i) => pick.add(new Option(run.name, i)));
  pick.parentElement.hidden = runs.length < 2;
  let run, timer = null;
  const unit = data.length ? `, ${data.length}` : "";
  const tall = () => { const [r, z] = box(run); return (z[1] - z[0]) / (r[1] - r[0]); };
  const layout = () => ({font, margin: {l: 55, r: 10, t: 10, b: narrow() ? 110 : 45}, hovermode: "closest", showlegend: false,
    height: Math.min(narrow() ? 470 : 520, (narrow() ? 280 : 480) * tall() + (narrow() ? 180 : 110)), xaxis: {title: {text: `r${unit}`, standoff: 8}, range: box(run)[0], ...plain,
    constrain: "domain"}, yaxis: {title: `z${unit}`, range: box(run)[1], scaleanchor: "x", ...plain,
    constrain: "domain"}, plot_bgcolor: "white"});
  const scene = () => { const all = box(run), r = all[0], z = all[all.length - 1], deep = run.mesh ? all[1] : run.axisymmetric ? r : [-r[1], r[1]], height = narrow() ? 340 : 420;
    const [x, y, up] = [r, deep, z].map(v => v[1] - v[0]), unit = Math.cbrt(x * y * up);
    const half = (run.axisymmetric ? x : 0.78 * x + 0.63 * y) / unit / 2, high = 0.9 * up / unit / 2 + 0.4 * half;     // as they are seen
    const wide = Math.min((element("solid").clientWidth || height) / height, 1);
    const far = Math.max(half / wide, high) / 0.41 + half / (run.mesh ? 1 : 2);       // a box has a corner in front
    return {font, margin: {l: 0, r: 0, t: 0, b: 0}, uirevision: run.name,
    height, scene: {aspectmode: "manual", aspectratio: {x: x / unit, y: y / unit, z: up / unit}, camera: {eye: {x: 0.57 * far, y: -0.71 * far, z: 0.42 * far}},
    xaxis: {visible: false, range: r}, yaxis: {visible: false, range: deep}, zaxis: {visible: false, range: z}}}; };
  function show(solid) {
    const s = slider.value / 1000, field = colour.value, range = limits(run, field), at = frame(run, s, field);
    if (run.mesh) { Plotly.react("solid", mesh(run, at, field, range), scene(), config); }
    else Plotly.react("section", sectionTraces(run, at, field, range), layout(), config);
    element("now").textContent = [at.stage.replaceAll("_", " "), ...Object.entries(at.numbers).map(([label, v]) => stated(label, v))]
      .filter(Boolean).join(" · ");
    if (solid && !run.mesh) Plotly.react("solid", surface(run, at, field, range), scene(), config);
  }
  function choose() {
    run = runs[pick.value || 0];
    const before = colour.value;
    const fields = (run.sheet || run.mesh).fields;
    element("section").hidden = !run.sheet;
    element("section").parentElement.style.gridTemplateColumns = run.sheet ? "" : "minmax(0, 1fr)";
    colour.replaceChildren(...Object.keys(fields).map(f => new Option(f, f)));
    if (fields[before]) colour.value = before;
    element("marks").replaceChildren(...run.stages.map(stage => {
      const mark = document.createElement("span");
      mark.style.flexGrow = Math.max(stage.to - stage.from, 0.002);
      mark.textContent = stage.name; mark.title = stage.name;
      mark.onclick = () => { slider.value = 1000 * stage.to; show(true); };
      return mark;
    }));
    show(true);
  }
  slider.oninput = () => show(false);
  slider.onchange = () => show(true);
  colour.onchange = () => show(true);
  pick.onchange = choose;
  play.onclick = () => {
    if (timer) { clearInterval(timer); timer = null; play.textContent = "Play"; show(true); return; }
    if (+slider.value >= 1000) slider.value = 0;
    play.textContent = "Stop";
    timer = setInterval(() => {
      slider.value = +slider.value + 10; show(false);
      if (+slider.value >= 1000) play.click();
    }, 60);
  };
  choose();
}

function charts(data) {
  data.charts.forEach((chart, i) => {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption"),
      plot = document.createElement("div");
    caption.textContent = chart.title; figure.append(caption, plot); element("charts").append(figure);
    const axis = (title, zero) => ({title: {text: title, standoff: 8}, automargin: true, ...plain, ...(zero ? {rangemode: "tozero"} : {})});
    Plotly.newPlot(plot, chart.traces, {font, height: 330, margin: {l: 60, r: 10, t: 28, b: 45}, plot_bgcolor: "white",
      xaxis: axis(chart.x, chart.zero === "x"), yaxis: {...axis(chart.y, chart.zero === "y"), ...(chart.equal ? {scaleanchor: "x"} : {})},
      showlegend: chart.traces.length > 1, legend: {orientation: "h", y: -0.3}}, config);
  });
}

(async () => {
  try {
    const script = document.createElement("script");
    script.textContent = await unpack("library");
    document.head.append(script);
    const data = JSON.parse(await unpack("data"));
    process(data); charts(data);
  } catch (error) {
    element("trouble").hidden = false;
    throw error;
  }
})();
