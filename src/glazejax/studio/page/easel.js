// The canvas: a map of thickness for each brushed coat, turned into colour by a table.
import { el, save } from "./dom.js";
import { makePainter } from "./painter.js";
import { MOST_UM, SIZE } from "./store.js";
import { Combinations, MOST_TABLED, fillLevels, levelOf, makeTable, tableSteps } from "./table.js";

// Strokes that can be taken back.
const MOST_STEPS = 24;
// Where more coats are brushed than a table has: pixels along the quick picture, rows and milliseconds of a slice of the fine one.
const QUICK = 128;
const ROWS = 16;
const SLICE = 12;

export function easelPanel(store) {
  const canvas = el("canvas.easel", { width: SIZE, height: SIZE, tabIndex: 0, role: "img", "aria-label": `Canvas, ${SIZE} by ${SIZE}; the selected coat is brushed`, "data-at": "easel" });
  // `?canvas=webgl2` or `?canvas=arrays` in the address has just that.
  const painter = makePainter(canvas, SIZE, new URLSearchParams(location.search).get("canvas"), () => ask(whole()));
  canvas.dataset.by = painter.name;
  const size = el("input", { type: "range", min: 4, max: 180, value: 48, "aria-label": "Size of the brush", "data-at": "brush" });
  const tool = el("select", { "aria-label": "Tool", "data-at": "tool" }, ...[["brush", "Brush: lay the coat"], ["wash", "Wash: lay it thin, soft"], ["wipe", "Wipe: take it off"]].map(([value, words]) => el("option", { value }, words)));
  const ring = el("span.ring", { hidden: true, "aria-hidden": "true" });
  const which = el("p.under"), state = el("p.under", { "aria-live": "polite", "data-at": "easel-state" });
  const file = el("input", { type: "file", accept: ".png,.npy", hidden: true, "data-at": "map-file", onchange: () => { if (file.files[0]) load(file.files[0]); file.value = ""; } });
  const button = (words, at, title, call) => el("button.quiet", { type: "button", "data-at": at, title, onclick: call }, words);
  const panel = el("section.panel.canvas", { "aria-label": "Canvas" },
    el("div.bar", {}, tool, el("label", {}, "Size ", size),
      button("Clear", "clear", "Take all of this coat off", () => { edit(() => new Float32Array(SIZE * SIZE)); store.tell("brushed"); ask(whole()); }),
      button("Even", "even", "Lay this coat evenly again", () => even())),
    which, el("div.stage", {}, canvas, ring), state,
    el("div.bar", {}, button("Picture as PNG", "canvas-png", "What the canvas looks like", () => canvas.toBlob((blob) => save("canvas.png", blob, "image/png"))),
      button("Load map", "load-map", "Thickness of this coat, from PNG or NPY", () => file.click()),
      button("Map as PNG", "map-png", "Thickness of this coat, white is the thickest", () => asPng()), button("Map as NPY", "map-npy", "Thickness of this coat in metres", () => asNpy()), file));

  // Colours: a quick table while a hand moves a slider, a fine one as it rests.
  const whole = () => ({ x: 0, y: 0, w: SIZE, h: SIZE });
  const join = (a, b) => {
    if (!a) return b;
    const x = Math.min(a.x, b.x), y = Math.min(a.y, b.y);
    return { x, y, w: Math.max(a.x + a.w, b.x + b.w) - x, h: Math.max(a.y + a.h, b.y + b.h) - y };
  };
  const tables = new Map();
  let later = null;
  // A table of colours that is there, or a quick one, and how a fine one is made.
  function tableOf(brushed) {
    const stack = store.plain(), shown = stack.coats.filter((coat) => !coat.hidden), lamp = store.lampOf(store.view.lamps[0]);
    const given = brushed.map(([coat, i]) => [i, top(coat)]);
    // Its own thickness does not matter to a brushed coat's table.
    for (const [i] of given) shown[i].um = 0;
    const key = JSON.stringify([stack, given, lamp]), many = given.length > MOST_TABLED;
    if (!tables.has(key)) {
      if (tables.size > 3) tables.delete(tables.keys().next().value);
      tables.set(key, many ? new Combinations(store.eye, stack, given, lamp) : makeTable(store.eye, stack, given, lamp, true));
    }
    return { table: tables.get(key), refine: () => refine(key, tableSteps(store.eye, stack, given, lamp, false)) };
  }
  // Step by step: a stroke that begins meanwhile does not wait.
  function refine(key, steps) {
    const { done, value } = steps.next();
    if (!done) later = setTimeout(() => refine(key, steps), 0);
    else {
      tables.set(key, value);
      ask(whole());
    }
  }
  // A coat's map as steps of its range; they go from a stroke's map to the next one's.
  const stepped = new WeakMap();
  function stepsOf(coat) {
    const map = store.maps.get(coat.id), most = top(coat);
    if (!map) return levelOf(Math.min(coat.um, most), most);
    const known = stepped.get(map);
    if (known?.top === most) return known.steps;
    const steps = known?.steps ?? new Uint16Array(SIZE * SIZE);
    fillLevels(steps, map, most, SIZE, whole());
    painter.touch(steps, whole());
    stepped.set(map, { top: most, steps });
    return steps;
  }
  function changeSteps(map, box) {
    const { top, steps } = stepped.get(map);
    fillLevels(steps, map, top, SIZE, box);
    painter.touch(steps, box);
  }
  function ask(box) {
    if (panel.hidden || !store.eye) return;
    const shown = store.shown;
    let brushed = shown.map((coat, i) => [coat, i]).filter(([coat]) => store.maps.has(coat.id));
    if (!shown.length) { state.textContent = "No coat is shown: add one first."; return; }
    if (!brushed.length) brushed = [[shown[0], 0]];
    store.attempt("canvas", () => {
      canvas.dataset.state = "quick";
      // What was still to be drawn of another picture is not.
      clearTimeout(later);
      const begun = performance.now(), { table, refine } = tableOf(brushed), made = performance.now();
      const steps = brushed.map(([coat]) => stepsOf(coat)), many = brushed.length > MOST_TABLED;
      const outside = many ? drawMany(table, steps, box) : painter.draw(table, steps, box);
      canvas.dataset.table = (made - begun).toFixed(1);
      canvas.dataset.took = (performance.now() - begun).toFixed(1);
      canvas.dataset.done = Number(canvas.dataset.done ?? 0) + 1;
      if (many) return;
      if (table.error === null) later = setTimeout(refine, 200);
      else said(table.error, outside);
    });
  }
  function said(error, outside) {
    canvas.dataset.state = "exact";
    state.textContent = `colours within ΔE00 ${Math.max(0.01, error).toFixed(2)} of the full computation${outside > 0.001 ? `; ◢ ${(100 * outside).toFixed(0)} % of what changed is outside sRGB, the nearest is shown` : ""}`;
  }
  // A box at once; the whole canvas in few pixels at once, and in all of them slice by slice.
  function drawMany(table, steps, box) {
    if (box.w * box.h < (SIZE * SIZE) / 4) {
      table.read(steps, painter.pixels, SIZE, box);
      painter.put(box);
      later = setTimeout(() => sharpen(table, steps, 0, 0), 200);
      return;
    }
    const few = new Uint32Array(QUICK * QUICK), { pixels } = painter, apart = SIZE / QUICK;
    table.read(steps.map(thinned), few, QUICK, { x: 0, y: 0, w: QUICK, h: QUICK }, true);
    for (let y = 0, from = 0; y < SIZE; y += apart) {
      const row = y * SIZE;
      for (let x = 0; x < SIZE; x += apart) pixels.fill(few[from++], row + x, row + x + apart);
      for (let more = 1; more < apart; more++) pixels.copyWithin(row + more * SIZE, row, row + SIZE);
    }
    painter.put(whole());
    later = setTimeout(() => sharpen(table, steps, 0, 0), 30);
  }
  // Steps of a map at the middles of the quick picture's pixels.
  function thinned(all) {
    const found = new Uint16Array(QUICK * QUICK), apart = SIZE / QUICK, middle = (SIZE + 1) * (apart >> 1);
    for (let y = 0, at = 0; y < QUICK; y++) for (let x = 0; x < QUICK; x++) found[at++] = all[(y * SIZE + x) * apart + middle];
    return found;
  }
  function sharpen(table, steps, from, outside) {
    const begun = performance.now();
    let y = from, lacking = outside;
    for (; y < SIZE && performance.now() - begun < SLICE; y += ROWS) {
      const box = { x: 0, y, w: SIZE, h: ROWS };
      lacking += (table.read(steps, painter.pixels, SIZE, box) * ROWS) / SIZE;
      painter.put(box);
    }
    if (y < SIZE) later = setTimeout(() => sharpen(table, steps, y, lacking), 0);
    else {
      canvas.dataset.sharp = Number(canvas.dataset.sharp ?? 0) + 1;
      said(table.error(), lacking);
    }
  }
  // The table's range, as far as a stroke will reach: powers of two, so that it is seldom made again.
  const top = (coat) => Math.min(MOST_UM, 2 ** Math.ceil(Math.log2(Math.max(0.5, tallest(coat) || coat.um))));
  const heights = new WeakMap();
  function tallest(coat) {
    const map = store.maps.get(coat.id);
    if (!map) return coat.um;
    if (!heights.has(map)) heights.set(map, map.reduce((most, value) => Math.max(most, value), 0));
    return heights.get(map);
  }

  // Brushing ----------------------------------------------------------------------------------------------------------
  const coatNow = () => {
    const coat = store.coat();
    return coat && !coat.hidden ? coat : store.shown[0];
  };
  function mapOf(coat) {
    return store.maps.get(coat.id) ?? new Float32Array(SIZE * SIZE).fill(0);
  }
  // A new map for the coat, as one step back.
  function edit(make) {
    const coat = coatNow();
    if (!coat) return store.say("No coat is shown: add one to brush with.", "error");
    store.past.push(store.snapshot());
    // Each step holds a map of its own.
    while (store.past.length > MOST_STEPS) store.past.shift();
    store.future = [];
    store.lastKey = null;
    const first = !store.maps.has(coat.id);
    store.maps = new Map(store.maps).set(coat.id, make(mapOf(coat)));
    store.tell("history");
    // A coat that lay evenly begins on a bare canvas.
    if (first) ask(whole());
  }
  function even() {
    const coat = coatNow();
    if (!coat || !store.maps.has(coat.id)) return;
    store.past.push(store.snapshot());
    store.future = [];
    store.maps = new Map(store.maps);
    store.maps.delete(coat.id);
    store.tell("history");
    store.tell("brushed");
    ask(whole());
  }

  let stroke = null;
  function begin(coat, at) {
    store.brushing = true;
    const before = store.maps.get(coat.id);
    edit((map) => map.slice());
    stroke = { coat, map: store.maps.get(coat.id), at };
    heights.set(stroke.map, before && heights.has(before) ? heights.get(before) : 0);
    // The map before has its steps counted again where it comes back.
    const known = before && stepped.get(before);
    if (known) {
      stepped.delete(before);
      stepped.set(stroke.map, known);
    }
  }
  function place(event) {
    const box = canvas.getBoundingClientRect();
    return { x: ((event.clientX - box.left) / box.width) * SIZE, y: ((event.clientY - box.top) / box.height) * SIZE,
      force: event.pointerType === "pen" && event.pressure ? event.pressure : 0.6 };
  }
  canvas.onpointerdown = (event) => {
    const coat = coatNow();
    if (!coat) return store.say("No coat is shown: add one to brush with.", "error");
    canvas.setPointerCapture?.(event.pointerId);
    event.preventDefault();
    begin(coat, place(event));
    dab(stroke.at, stroke.at);
  };
  canvas.onpointermove = (event) => {
    if (!stroke) return;
    for (const one of event.getCoalescedEvents?.().length ? event.getCoalescedEvents() : [event]) {
      const to = place(one);
      dab(stroke.at, to);
      stroke.at = to;
    }
  };
  const end = () => {
    store.brushing = false;
    if (stroke) store.tell("brushed");
    stroke = null;
  };
  canvas.onpointerup = canvas.onpointercancel = end;

  function dab(from, to) {
    const { map, coat } = stroke, radius = Number(size.value), kind = tool.value;
    const steps = Math.max(1, Math.ceil(Math.hypot(to.x - from.x, to.y - from.y) / Math.max(1, radius / 4)));
    let box = null;
    for (let n = 1; n <= steps; n++) {
      const x = from.x + ((to.x - from.x) * n) / steps, y = from.y + ((to.y - from.y) * n) / steps;
      box = join(box, spot(map, x, y, radius, kind, to.force, coat.um));
    }
    // What a stroke can reach at most; to look through a million pixels takes longer than to paint them.
    heights.set(map, Math.max(heights.get(map), kind === "wipe" ? 0 : reach(kind, Math.max(from.force, to.force), coat.um)));
    if (!box || !(box.w > 0 && box.h > 0)) return;
    if (stepped.get(map)?.top === top(coat)) {
      changeSteps(map, box);
      ask(box);
    } else ask(whole());
  }
  const reach = (kind, force, um) => Math.min(MOST_UM, kind === "wash" ? 4 * um : (um * force) / 0.6);
  // One touch: soft at its edge. A brush lays up to the coat's thickness, a wash a little more each time.
  function spot(map, cx, cy, radius, kind, force, um) {
    const x0 = Math.max(0, Math.floor(cx - radius)), x1 = Math.min(SIZE, Math.ceil(cx + radius + 1));
    const y0 = Math.max(0, Math.floor(cy - radius)), y1 = Math.min(SIZE, Math.ceil(cy + radius + 1)), most = reach(kind, force, um);
    for (let y = y0; y < y1; y++) {
      for (let x = x0; x < x1; x++) {
        const far = Math.hypot(x - cx, y - cy) / radius;
        if (far >= 1) continue;
        const soft = kind === "wash" ? (1 - far * far) ** 2 : Math.min(1, (1 - far) * 3), at = y * SIZE + x;
        if (kind === "wipe") map[at] *= 1 - soft * force;
        else if (kind === "wash") map[at] = Math.max(map[at], Math.min(most, map[at] + 0.06 * um * soft * force));
        else map[at] = Math.max(map[at], map[at] + (most - map[at]) * soft * 0.8);
      }
    }
    return { x: x0, y: y0, w: Math.max(0, x1 - x0), h: Math.max(0, y1 - y0) };
  }
  // By keyboard: arrows move a cross, the space bar sets the brush down.
  canvas.onblur = () => { ring.hidden = true; };
  const cross = { x: SIZE / 2, y: SIZE / 2, force: 0.6 };
  canvas.onkeydown = (event) => {
    const step = { ArrowLeft: [-16, 0], ArrowRight: [16, 0], ArrowUp: [0, -16], ArrowDown: [0, 16] }[event.key];
    if (step) {
      cross.x = Math.max(0, Math.min(SIZE - 1, cross.x + step[0]));
      cross.y = Math.max(0, Math.min(SIZE - 1, cross.y + step[1]));
      const scale = canvas.clientWidth / SIZE, across = 2 * Number(size.value) * scale;
      ring.hidden = false;
      Object.assign(ring.style, { width: `${across}px`, height: `${across}px`, left: `${canvas.offsetLeft + cross.x * scale - across / 2}px`, top: `${canvas.offsetTop + cross.y * scale - across / 2}px` });
      state.textContent = `brush at ${cross.x}, ${cross.y}; space lays paint`;
    } else if (event.key === " ") {
      if (!coatNow()) return;
      begin(coatNow(), { ...cross });
      dab(cross, cross);
      end();
    } else return;
    event.preventDefault();
  };

  // Files of thickness ------------------------------------------------------------------------------------------------
  function asPng() {
    const coat = coatNow();
    if (!coat) return;
    const map = mapOf(coat), most = Math.max(...[tallest(coat), 1e-6]);
    const grey = el("canvas", { width: SIZE, height: SIZE }), image = new ImageData(SIZE, SIZE);
    map.forEach((value, i) => { const level = Math.round((255 * value) / most); image.data.set([level, level, level, 255], 4 * i); });
    grey.getContext("2d").putImageData(image, 0, 0);
    grey.toBlob((blob) => save(`thickness ${store.label(coat)} white=${+most.toPrecision(4)}um.png`, blob, "image/png"));
  }
  function asNpy() {
    const coat = coatNow();
    if (!coat) return;
    let head = `{'descr': '<f4', 'fortran_order': False, 'shape': (${SIZE}, ${SIZE}), }`;
    head = head.padEnd(Math.ceil((10 + head.length + 1) / 64) * 64 - 11) + "\n";
    const front = new Uint8Array([0x93, 78, 85, 77, 80, 89, 1, 0, head.length & 255, head.length >> 8, ...new TextEncoder().encode(head)]);
    // Metres, as `glazejax.picture` takes them.
    save(`thickness ${store.label(coat)}.npy`, new Blob([front, mapOf(coat).map((um) => um * 1e-6)]), "application/octet-stream");
  }
  async function load(given) {
    const coat = coatNow();
    if (!coat) return;
    try {
      if (given.size > 64 << 20) throw new Error("it is larger than 64 MB");
      const found = given.name.toLowerCase().endsWith(".npy") ? fromNpy(await given.arrayBuffer()) : await fromPng(given, coat);
      edit(() => found);
      store.tell("brushed");
      ask(whole());
      store.say(`${given.name} is the thickness of ${store.label(coat)} now.`);
    } catch (error) {
      store.say(`${given.name} is no map of thickness: ${error.message}.`, "error");
    }
  }
  async function fromPng(given, coat) {
    const image = await createImageBitmap(given).catch(() => { throw new Error("it is no picture that this browser reads"); });
    const grey = el("canvas", { width: SIZE, height: SIZE }), pen2 = grey.getContext("2d");
    pen2.drawImage(image, 0, 0, SIZE, SIZE);
    const named = /white=([\d.]+)um/.exec(given.name), most = named ? Number(named[1]) : coat.um;
    if (!(most <= MOST_UM)) throw new Error(`white is ${named[1]} µm by its name; it must be at most ${MOST_UM}`);
    const { data } = pen2.getImageData(0, 0, SIZE, SIZE);
    return Float32Array.from({ length: SIZE * SIZE }, (_, i) => (((data[4 * i] + data[4 * i + 1] + data[4 * i + 2]) / 765) * most));
  }
  function fromNpy(buffer) {
    const bytes = new Uint8Array(buffer);
    if (bytes[0] !== 0x93 || String.fromCharCode(...bytes.slice(1, 6)) !== "NUMPY") throw new Error("it is no NPY file");
    const long = bytes[6] > 1, view = new DataView(buffer), length = long ? view.getUint32(8, true) : view.getUint16(8, true), at = (long ? 12 : 10) + length;
    const head = new TextDecoder().decode(bytes.slice(long ? 12 : 10, at));
    const kind = /'descr': '([<|]f[48])'/.exec(head)?.[1], shape = /'shape': \((\d+), (\d+)\)/.exec(head);
    if (!kind || !shape || head.includes("'fortran_order': True")) throw new Error("it must hold one map of float32 or float64, rows first");
    const [rows, columns] = [Number(shape[1]), Number(shape[2])], Kind = kind.endsWith("8") ? Float64Array : Float32Array;
    if (rows * columns * Kind.BYTES_PER_ELEMENT > buffer.byteLength - at) throw new Error("it ends too early");
    const values = new Kind(buffer.slice(at, at + rows * columns * Kind.BYTES_PER_ELEMENT));
    if (values.some((value) => !(value >= 0 && value <= MOST_UM * 1e-6))) throw new Error("thickness is in metres there, between 0 and 0.01");
    return Float32Array.from({ length: SIZE * SIZE }, (_, i) => {
      const [row, column] = [Math.floor(((i / SIZE) | 0) * (rows / SIZE)), Math.floor((i % SIZE) * (columns / SIZE))];
      return values[row * columns + column] * 1e6;
    });
  }

  function show() {
    const coat = coatNow();
    which.textContent = coat ? `Brushing ${store.words(coat)}; choose another coat in the stack. Coats that were never brushed lie evenly.` : "No coat to brush with: add one.";
    // A coat that was brushed keeps its map; where a slider moved, the table is another.
    if (!panel.hidden && !stroke) ask(whole());
  }
  store.on("stack", show);
  store.on("selected", () => { const coat = coatNow(); which.textContent = coat ? `Brushing ${store.words(coat)}.` : ""; });
  store.on("tab", () => show());
  return panel;
}
