// Seen at once: the swatch over its card, numbers, lamps side by side, another angle, the ladder and the spectrum.
import { context2d, css, el, hex, outside } from "./dom.js";
import { checkLamp } from "./check.js";
import { spectrumPlot } from "./plot.js";
import { LADDER, ROW } from "./seen.js";

export function colourAt(seen, lamp, row) {
  const { rgb, encoded } = row < ROW.ladder ? seen.colours[lamp][row] : seen.ladder[row - ROW.ladder];
  return { rgb, encoded, css: css(rgb, encoded), outside: outside(encoded) };
}

// A canvas as large as its place, in the screen's own pixels.
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [Math.max(1, Math.round(canvas.clientWidth * ratio)), Math.max(1, Math.round(canvas.clientHeight * ratio))];
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  return context2d(canvas);
}

// The paint on its card: bare margins above and below, white half and black half; on another ground the card is a strip.
export function drawSwatch(canvas, seen, lamp, ground) {
  const pen = fitted(canvas), { width, height } = canvas;
  const fill = (row, x, y, w, h) => {
    pen.fillStyle = colourAt(seen, lamp, row).css;
    pen.fillRect(Math.round(x), Math.round(y), Math.round(x + w) - Math.round(x), Math.round(y + h) - Math.round(y));
  };
  const edge = Math.round(height * 0.1), half = width / 2;
  if (ground === "card") {
    fill(ROW.bareWhite, 0, 0, half, height);
    fill(ROW.bareBlack, half, 0, half, height);
    fill(ROW.white, 0, edge, half, height - 2 * edge);
    fill(ROW.black, half, edge, half, height - 2 * edge);
    return;
  }
  const strip = Math.round(height * 0.28);
  fill(ROW.bare, 0, 0, width, height - strip);
  fill(ROW.ground, 0, edge, width, height - strip - edge);
  fill(ROW.white, 0, height - strip, half, strip);
  fill(ROW.black, half, height - strip, half, strip);
}

export function lookPanel(store) {
  const swatch = el("canvas.swatch", { role: "img", "aria-label": "The paint over its card", "data-at": "swatch" });
  const under = el("p.under", { "aria-live": "off" });
  const numbers = el("dl.numbers", { "data-at": "numbers" });
  const pin = el("button.quiet", { type: "button", "data-at": "pin", onclick: () => {
    if (store.pinned) store.pinned = null;
    else if (store.seen) store.pin(store.seen.colours[0][ROW.ground].lab);
    store.look();
  } }, "Pin this colour");
  const lamps = el("div.lamps", { role: "group", "aria-label": "The same under several lamps" });
  const ladder = el("div.ladder", { role: "img" });
  const angleTitle = el("h3", {}, "Another angle: right half");
  const ladderTitle = el("h3", {}, "Ladder of coats");
  const plot = spectrumPlot();
  const marks = el("ul.doubts");
  const angle = { swatch: el("canvas.small", { role: "img", "aria-label": "The paint at another angle", "data-at": "angle" }) };
  for (const [key, words] of [["light", "Light"], ["view", "View"]]) {
    const output = el("output", {}, `${store.view[key]}°`);
    store.on("view", () => {
      angle[key].querySelector("input").value = store.view[key];
      output.textContent = `${store.view[key]}°`;
    });
    angle[key] = el("label.angle", {}, words, el("input", {
      type: "range", min: 0, max: 80, step: 1, value: store.view[key], "data-at": `angle-${key}`, "aria-label": `Angle of ${key}, degrees from upright`,
      oninput: (event) => { store.view[key] = Number(event.target.value); output.textContent = `${event.target.value}°`; store.look(); },
    }), output);
  }
  const geometry = el("select", { "aria-label": "Geometry of the large swatch", "data-at": "geometry", onchange: () => store.change(null, (stack) => { stack.geometry = geometry.value; }) },
    ...[["45:0", "light 45°, view 0°"], ["0:0", "light 0°, view 0°"], ["d:8", "sphere, gloss included"], ["de:8", "sphere, gloss excluded"]].map(([value, words]) => el("option", { value }, words)));

  const panel = el("section.panel.look", { "aria-label": "What it looks like" },
    el("div.stage", {}, swatch), under,
    el("div.facts", {}, numbers, el("div.choices", {}, pin, geometry)),
    el("div.lamps-head", {}, el("h3", {}, "Lamps"), el("button.quiet", { type: "button", "data-at": "own-lamp", title: "Two columns: nm and relative power", onclick: () => lampFile.click() }, "Own lamp")), lamps,
    el("div.pair", {},
      el("div", {}, angleTitle, el("div.tilt", {}, angle.swatch, el("div", {}, angle.light, angle.view))),
      el("div", {}, ladderTitle, ladder)),
    el("h3", {}, "Spectrum"), plot.node, marks);

  const lampFile = el("input", { type: "file", accept: ".csv,.txt,.tsv", hidden: true, "data-at": "lamp-file", onchange: () => { if (lampFile.files[0]) ownLamp(lampFile.files[0]); lampFile.value = ""; } });
  panel.querySelector(".lamps-head").append(lampFile);
  // A lamp of one's own: two columns, nm and relative power.
  async function ownLamp(file) {
    if (file.size > 1 << 20) return store.say(`${file.name} is larger than 1 MB; a lamp is two columns, nm and power.`, "error");
    const rows = (await file.text()).split(/\r?\n/).map((line) => line.split(/[,;\t ]+/).map(Number)).filter((row) => row.length >= 2 && row.slice(0, 2).every(Number.isFinite));
    if (rows.length < 2) return store.say(`${file.name} is no lamp: it needs two columns of numbers, nm and relative power.`, "error");
    rows.sort((a, b) => a[0] - b[0]);
    const name = file.name.replace(/\.[^.]*$/, "").slice(0, 40);
    store.attempt("lamp", () => {
      store.ownLamps[name] = checkLamp({ name, wavelengths: rows.map((row) => row[0]), power: rows.map((row) => row[1]) });
      store.view.lamps[store.view.lamps.length - 1] = name;
      drawnLamps = "";
      store.tell("lamps");
      store.look();
    });
  }

  let drawnLamps = "";
  function buildLamps() {
    const key = JSON.stringify([store.view.lamps, store.lamps.length, Object.keys(store.ownLamps)]);
    if (key === drawnLamps) return;
    drawnLamps = key;
    const names = [...Object.keys(store.ownLamps), ...store.lamps];
    lamps.replaceChildren(...store.view.lamps.map((name, i) => {
      const choose = el("select", { "aria-label": i ? `Lamp ${i + 1}` : "Main lamp", "data-at": `lamp-${i}`, onchange: () => { store.view.lamps[i] = choose.value; drawnLamps = ""; store.tell("lamps"); store.look(); } },
        ...(names.length ? names : [name]).map((one) => el("option", { value: one }, one)));
      choose.value = name;
      return el("figure.lamp", {}, el("canvas", { role: "img", "aria-label": `Under ${name}`, "data-at": `under-${i}` }), el("figcaption", {}, choose, el("span.lab")));
    }));
  }

  function show() {
    const seen = store.seen;
    buildLamps();
    // What nobody looks at is drawn when its tab is opened.
    if (!seen || panel.hidden) return;
    drawSwatch(swatch, seen, 0, store.stack.ground);
    [...lamps.children].forEach((figure, i) => {
      if (i >= seen.colours.length) return;
      drawSwatch(figure.querySelector("canvas"), seen, i, store.stack.ground);
      const { lab } = seen.colours[i][ROW.ground];
      const beyond = (store.stack.ground === "card" ? [ROW.white, ROW.black] : [ROW.ground]).some((row) => colourAt(seen, i, row).outside);
      figure.querySelector(".lab").textContent = lab.map((value) => value.toFixed(0)).join(" ") + (beyond ? " ◢" : "");
    });
    const pen = fitted(angle.swatch), { width, height } = angle.swatch;
    pen.fillStyle = colourAt(seen, 0, ROW.ground).css;
    pen.fillRect(0, 0, width / 2, height);
    pen.fillStyle = colourAt(seen, 0, ROW.angle).css;
    pen.fillRect(width / 2, 0, width, height);
    angleTitle.textContent = `Another angle: right half${colourAt(seen, 0, ROW.angle).outside ? " ◢" : ""}`;

    const onCard = store.stack.ground === "card";
    const rows = onCard ? [["white", ROW.white], ["black", ROW.black]] : [["its ground", ROW.ground]];
    const beyond = rows.filter(([, row]) => colourAt(seen, 0, row).outside).map(([name]) => name);
    const said = onCard ? "left over white, right over black" : "above on its ground, below over a white and a black card";
    under.textContent = `${said}; ${seen.geometry}`;
    if (beyond.length) under.append(el("span.beyond", { title: "The screen's sRGB cannot show this colour" }, `◢ outside sRGB over ${beyond.join(" and ")}: the nearest is shown`));

    const { lab } = seen.colours[0][ROW.ground], main = colourAt(seen, 0, ROW.ground);
    const facts = [["L*", lab[0].toFixed(1)], ["a*", lab[1].toFixed(1)], ["b*", lab[2].toFixed(1)], ["sRGB", hex(main.rgb) + (main.outside ? " ◢" : "")]];
    if (onCard) facts.push(["over black", hex(colourAt(seen, 0, ROW.black).rgb)]);
    if (store.pinned && seen.delta !== null) facts.push(["ΔE00 to pinned", seen.delta.toFixed(2)]);
    numbers.replaceChildren(...facts.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
    if (store.pinned) {
      const spot = el("span.spot", { title: "The pinned colour" });
      spot.style.background = store.pinned.css;
      numbers.lastElementChild.append(spot);
    }
    pin.textContent = store.pinned ? "Unpin" : "Pin this colour";

    plot.show(seen, store);
    marks.replaceChildren(...seen.doubts.map((words) => el("li", {}, words)));
  }
  function showRest() {
    const seen = store.seen;
    if (!seen?.ladder.length || panel.hidden) return;
    // The selected coat is repeated, or the uppermost where that one is hidden.
    const coat = store.shown[store.viewNow().repeated];
    ladder.setAttribute("aria-label", coat ? `1 to ${LADDER.at(-1)} coats of ${store.label(coat)}` : "No coat");
    ladderTitle.textContent = coat ? `Ladder of coats: ${store.label(coat)}` : "Ladder of coats";
    ladder.replaceChildren(...LADDER.map((count, i) => {
      const step = el(colourAt(seen, 0, ROW.ladder + i).outside ? "span.clipped" : "span", { title: `${count} ${count === 1 ? "coat" : "coats"}` }, el("small", {}, `${count}×`));
      step.style.setProperty("--paint", colourAt(seen, 0, ROW.ladder + i).css);
      return step;
    }));
    plot.show(seen, store);
  }
  store.on("seen", show);
  store.on("rest", showRest);
  store.on("tab", () => { show(); showRest(); });
  store.on("lamps", buildLamps);
  store.on("stack", () => { geometry.value = store.stack.geometry; if (geometry.value !== store.stack.geometry) { geometry.append(el("option", { value: store.stack.geometry }, store.stack.geometry)); geometry.value = store.stack.geometry; } });
  new ResizeObserver(show).observe(swatch);
  buildLamps();
  return panel;
}
