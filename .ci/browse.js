// What browse.py asks of a page, by name.
const plotsOf = selector => [...document.querySelectorAll(selector)].filter(plot => !plot.hidden);

// Resolves when the page is loaded, and a report has drawn its plots.
const drawn = wanted => new Promise(done => {
  const look = () => {
    const plots = plotsOf(".js-plotly-plot");
    if (document.readyState === "complete" && (!wanted || plots.length && plots.every(plot => plot._fullLayout)))
      setTimeout(() => done(plots.length), 500);
    else setTimeout(look, 100);
  };
  look();
});

const picture = plot => Plotly.toImage(plot, {format: "png", width: 400, height: 300});
const pictures = () => Promise.all(plotsOf("#section.js-plotly-plot, #solid.js-plotly-plot").map(picture));

// Number of colours, other than greys, of each plot.
const colours = async () => {
  const found = [];
  for (const plot of plotsOf(".js-plotly-plot")) {
    const image = new Image(), canvas = document.createElement("canvas"), seen = new Set();
    image.src = await picture(plot);
    await image.decode();
    [canvas.width, canvas.height] = [400, 300];
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const data = context.getImageData(0, 0, 400, 300).data;
    for (let k = 0; k < data.length; k += 4) {
      const colour = [data[k], data[k + 1], data[k + 2]];
      if (Math.max(...colour) - Math.min(...colour) > 40) seen.add(colour.map(v => v >> 5).join());
    }
    found.push(seen.size);
  }
  return found;
};

// Gaps between the coloured areas of the wall of a section: each area but the last of an image ends where another begins.
const gaps = () => {
  const plot = plotsOf("#section.js-plotly-plot")[0], areas = [];
  if (!plot) return [];
  for (const trace of plot.data.filter(trace => trace.fill === "toself" && trace.x.includes(null))) {
    let area = [];
    trace.x.forEach((x, k) => {
      if (x === null) { areas.push(area); area = []; } else area.push(`${x.toPrecision(5)} ${trace.y[k].toPrecision(5)}`);
    });
  }
  const images = plot.data.filter(trace => trace.mode === "markers").length, begins = new Set(areas.map(area => area[0]));
  const joined = areas.filter(area => area.some(point => point !== area[0] && begins.has(point))).length;
  return areas.length && joined >= areas.length - images ? [] : [`the wall has gaps: ${joined} of ${areas.length} areas join`];
};

const move = () => {
  const slider = document.getElementById("slider");
  slider.value = +slider.value < 500 ? 1000 : 100;
  slider.oninput();
  slider.onchange();
};

// Chooses the last colour of the menu; returns their number.
const choose = () => {
  const menu = document.getElementById("colour");
  menu.selectedIndex = menu.options.length - 1;
  menu.onchange();
  return menu.options.length;
};

// What reaches beyond the window, and labels that reach beyond their plot.
const cut = () => {
  const wide = document.documentElement.clientWidth, page = document.scrollingElement.scrollWidth, found = [];
  const scrolls = e => e && e !== document.body &&
    (["auto", "scroll"].includes(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
  if (page > wide + 1) found.push(`the page is ${page} wide`);
  for (const e of document.querySelectorAll("img, svg, canvas, .js-plotly-plot, table, select, button, h1, h2, p")) {
    const box = e.getBoundingClientRect();
    if (box.width && (box.right > wide + 1 || box.left < -1) && !scrolls(e) && e.id !== "js-plotly-tester")
      found.push(`${e.tagName} ${e.id || e.getAttribute("class") || ""} from ${box.left} to ${box.right}`);
  }
  for (const plot of plotsOf(".js-plotly-plot")) {
    const box = plot.getBoundingClientRect();
    for (const text of plot.querySelectorAll("svg text")) {
      const inner = text.getBoundingClientRect();
      if (inner.width && (inner.right > box.right + 2 || inner.left < box.left - 2 || inner.bottom > box.bottom + 2))
        found.push(`the label "${text.textContent}" of a plot`);
    }
  }
  return found;
};

// Equations that are no picture.
const texts = () => [...document.querySelectorAll(".math")].filter(e => e.tagName !== "IMG" &&
  !e.querySelector("svg, math, mjx-container, img")).map(e => e.textContent.trim().slice(0, 60));

// Links to files beside a page.
const links = () => [...document.querySelectorAll("a[href], img[src]")].map(e => e.href || e.src)
  .filter(link => link.startsWith("file:"));
