// The stack: coats top first, each with a slider, a number, its paints, and a handle to move it by hand or by arrow keys.
import { ROW } from "./seen.js";
import { MOST_UM, SIZE, THICKEST, THINNEST } from "./store.js";
import { el, hex, icon, inkOn, thickness } from "./dom.js";

// Pixels along the little picture of where a coat was brushed.
const LITTLE = 26;

const toSlider = (um) => Math.log10(Math.max(THINNEST, Math.min(THICKEST, um)));
const fromSlider = (value) => +(10 ** value).toPrecision(3);
// A number as the field holds it: .9, not .8999999999.
const short = (um) => +um.toPrecision(6);
const GROUNDS = [["card", "Card, white and black"], ["white", "White"], ["black", "Black"], ["grey", "Grey"],
  ["paint", "Paint that hides"], ["spectrum", "Measured spectrum"]];

export function coatsPanel(store) {
  const list = el("ol.coats", { "aria-label": "Coats, top first" });
  const ground = el("div.ground");
  const section = el("div.section", { role: "group", "aria-label": "Cross-section, top first", "data-at": "section" });
  const undo = el("button.quiet", { type: "button", "data-at": "undo", title: "Undo (Ctrl+Z)", onclick: () => store.undo() }, "Undo");
  const redo = el("button.quiet", { type: "button", "data-at": "redo", title: "Redo (Ctrl+Y)", onclick: () => store.redo() }, "Redo");
  const panel = el("section.panel.stack", { "aria-label": "Stack of coats" },
    el("header", {}, el("h2", {}, "Stack"), el("span.grow"), undo, redo), section, list, ground);
  let drawn = "";

  function part(coat, name) {
    const weight = el("input", {
      type: "number", min: 0, step: "any", value: coat.paint[name], "aria-label": `Parts by weight of ${name}`,
      oninput: () => {
        const value = Number(weight.value);
        if (!(value >= 0) || !weight.value) return store.say(`A part of ${name} is a number from 0 on.`, "error");
        store.change(`part ${coat.id} ${name}`, () => { store.coat(coat.id).paint[name] = value; });
      },
    });
    const choose = el("select", { "aria-label": "Paint", onchange: () => store.change(null, () => {
      const mine = store.coat(coat.id);
      if (mine.paint[choose.value] !== undefined) return;
      mine.paint = Object.fromEntries(Object.entries(mine.paint).map(([key, value]) => [key === name ? choose.value : key, value]));
    }) }, ...[...store.entries.values()].map((entry) => el("option", { value: entry.name }, entry.group === "acrylics" ? `${entry.label} (acrylic)` : entry.label)));
    if (!store.entries.has(name)) choose.append(el("option", { value: name }, name));
    choose.value = name;
    const alone = Object.keys(coat.paint).length === 1;
    return el("div.part", {}, choose, alone ? null : weight, alone ? null : el("button.quiet", {
      type: "button", "aria-label": `Take ${name} out of the mixture`, title: "Take out",
      onclick: () => store.change(null, () => { delete store.coat(coat.id).paint[name]; }),
    }, "×"));
  }

  function row(coat, index) {
    const say = store.words(coat);
    const slider = el("input", {
      type: "range", min: toSlider(THINNEST), max: toSlider(THICKEST), step: 0.005, value: toSlider(coat.um),
      "aria-label": `Thickness of ${store.label(coat)}`, "aria-valuetext": say, "data-at": "slider",
      oninput: () => set(fromSlider(Number(slider.value))), onchange: () => store.settle(), onfocus: () => select(coat.id),
    });
    const number = el("input.um", {
      type: "number", min: 0, max: MOST_UM, step: "any", value: short(coat.um), "aria-label": `Thickness of ${store.label(coat)} in micrometres`, "data-at": "um",
      onchange: () => {
        const value = Number(number.value);
        if (!number.value || !(value >= 0 && value <= MOST_UM)) {
          store.say(`A coat of ${number.value || "no"} µm cannot be: it is between 0 and ${MOST_UM} µm (1 cm) thick.`, "error");
          number.value = short(store.coat(coat.id).um);
          return;
        }
        set(value);
        store.settle();
      },
    });
    function set(um) {
      store.change(`um ${coat.id}`, () => { store.coat(coat.id).um = um; });
    }
    const move = (step) => store.change(null, (stack) => {
      const at = stack.coats.findIndex((one) => one.id === coat.id), to = at + step;
      if (to < 0 || to >= stack.coats.length) return;
      stack.coats.splice(to, 0, ...stack.coats.splice(at, 1));
    });
    const handle = el("button.handle", {
      type: "button", title: "Drag, or arrow keys, to move", "aria-label": `Move ${say}; arrow keys`,
      "data-at": "handle", onpointerdown: (event) => drag(event, coat.id),
      onkeydown: (event) => {
        const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
        if (!step) return;
        event.preventDefault();
        move(step);
        list.querySelector(`[data-coat="${coat.id}"] .handle`)?.focus();
      },
    }, "⠿");
    const button = (words, title, at, call, more = {}) => el("button.quiet", { type: "button", title, "aria-label": `${title}: ${say}`, "data-at": at, onclick: call, ...more }, words);
    return el("li.coat", { "data-coat": coat.id, onpointerdown: () => select(coat.id) },
      handle, chip(coat),
      el("div.inside", {},
        el("div.parts", {}, ...Object.keys(coat.paint).map((name) => part(coat, name))),
        el("div.size", {}, slider, el("label.number", {}, number, "µm"))),
      el("div.tools", {},
        button(icon("copy"), "Duplicate", "copy", () => store.change(null, (stack) => stack.coats.splice(index, 0, { ...structuredClone(coat), id: `copy${Date.now()}` }))),
        button(icon(coat.hidden ? "hidden" : "show"), coat.hidden ? "Show" : "Hide", "hide", () => store.change(null, () => { const mine = store.coat(coat.id); mine.hidden = mine.hidden ? undefined : true; }), { "aria-pressed": String(!!coat.hidden) }),
        button(icon("remove"), "Remove", "remove", () => store.change(null, (stack) => { stack.coats = stack.coats.filter((one) => one.id !== coat.id); }))));
  }

  function chip(coat) {
    return fill(el("span.chip", { "aria-hidden": "true" }, ...Object.keys(coat.paint).map(() => el("span")), el("canvas", { width: LITTLE, height: LITTLE, hidden: true })), coat);
  }
  // Where a coat was brushed, as a photo app's layers show it.
  const pictured = new WeakMap();
  function showBrushed(again) {
    for (const coat of store.stack.coats) {
      const canvas = list.querySelector(`[data-coat="${coat.id}"] .chip canvas`), map = store.maps.get(coat.id);
      if (!canvas) continue;
      canvas.hidden = !map;
      if (!map || (!again && pictured.get(canvas) === map)) continue;
      pictured.set(canvas, map);
      const pen = canvas.getContext("2d"), image = pen.createImageData(LITTLE, LITTLE), apart = SIZE / LITTLE;
      const rgb = store.swatches.get(Object.keys(coat.paint)[0])?.[0] ?? [128, 128, 128];
      for (let i = 0; i < LITTLE * LITTLE; i++) {
        const um = map[Math.floor((Math.floor(i / LITTLE) + 0.5) * apart) * SIZE + Math.floor(((i % LITTLE) + 0.5) * apart)];
        image.data.set([...rgb, 255 * Math.min(1, um / Math.max(coat.um, 1e-6))], 4 * i);
      }
      pen.putImageData(image, 0, 0);
    }
  }
  store.on("brushed", () => {
    showBrushed(true);
    showSection();
  });
  function fill(node, coat) {
    Object.keys(coat.paint).forEach((name, i) => {
      const thick = store.swatches.get(name)?.[0];
      if (thick) node.children[i].style.background = hex(thick);
      node.children[i].style.flexGrow = Math.max(coat.paint[name], 0.001);
    });
    return node;
  }

  // As under a microscope: coats one over another, thin ones drawn thicker than they are.
  function showSection() {
    if (!store.eye) return;
    const cut = (tag, rgb, words, given = {}) => {
      const strip = el(tag, given, el("span", {}, words));
      Object.assign(strip.style, { background: hex(rgb), color: inkOn(rgb) });
      return strip;
    };
    section.replaceChildren(...store.shown.map((coat) => {
      const strip = cut("button.strip", store.eye.masstone(coat.paint, store.own), store.label(coat), {
        type: "button", title: `Select ${store.words(coat)}`, "aria-pressed": String(store.selected === coat.id), onclick: () => select(coat.id) });
      strip.append(el("small", {}, `${store.maps.has(coat.id) ? "brushed, " : ""}${thickness(coat.um)}`));
      strip.style.flexGrow = Math.log2(1 + 4 * coat.um).toFixed(3);
      return strip;
    }), groundStrip(cut));
  }
  function groundStrip(cut) {
    const now = store.stack.ground;
    if (now?.paint) return cut("div.strip.below", store.eye.masstone(now.paint, store.own), store.label(now));
    if (now?.wavelengths) return cut("div.strip.below", [150, 150, 150], "measured ground");
    const seen = store.seen?.colours[0], rgb = seen?.[ROW.bare].rgb ?? [237, 237, 237];
    const strip = cut("div.strip.below", rgb, now === "card" ? "card" : typeof now === "number" ? `grey ${now}` : now);
    if (now === "card" && seen) strip.style.background = `linear-gradient(90deg, ${hex(rgb)} 50%, ${hex(seen[ROW.bareBlack].rgb)} 50%)`;
    return strip;
  }
  store.on("seen", showSection);

  function select(id) {
    if (store.selected === id) return;
    store.selected = id;
    mark();
    showSection();
    store.tell("selected");
    store.look();
  }
  function mark() {
    for (const node of list.children) node.classList.toggle("selected", node.dataset.coat === store.selected);
  }

  // Dragging: the coat follows the pointer from place to place; letting go makes one step back.
  function drag(event, id) {
    event.preventDefault();
    const before = store.stack.coats.map((coat) => coat.id).join();
    const node = list.querySelector(`[data-coat="${id}"]`);
    node.classList.add("dragged");
    const over = (move) => {
      const others = [...list.children].filter((child) => child !== node);
      const next = others.find((child) => move.clientY < child.getBoundingClientRect().top + child.offsetHeight / 2);
      if (next !== node.nextElementSibling) list.insertBefore(node, next ?? null);
    };
    const end = () => {
      removeEventListener("pointermove", over);
      removeEventListener("pointerup", end);
      removeEventListener("pointercancel", end);
      node.classList.remove("dragged");
      const order = [...list.children].map((child) => child.dataset.coat);
      if (order.join() !== before) store.change(null, (stack) => { stack.coats.sort((a, b) => order.indexOf(a.id) - order.indexOf(b.id)); });
    };
    addEventListener("pointermove", over);
    addEventListener("pointerup", end);
    addEventListener("pointercancel", end);
  }

  function showGround() {
    const now = store.stack.ground;
    const kind = typeof now === "number" ? "grey" : typeof now === "string" ? now : now.paint ? "paint" : "spectrum";
    const choose = el("select", { "aria-label": "Ground below the coats", "data-at": "ground", onchange: () => {
      const found = { grey: 0.5, paint: { paint: { [[...store.entries.keys()][0] ?? "ZincWhite"]: 1 } } };
      if (choose.value === "spectrum") {
        store.say(store.spectrum ? `The ground is ${store.spectrum.name}.` : "Drop a spectrum on the page first: it can then be the ground.", store.spectrum ? "note" : "error");
        if (!store.spectrum) { choose.value = kind; return; }
        return store.change(null, (stack) => { stack.ground = { wavelengths: store.spectrum.wavelengths, reflectance: store.spectrum.reflectance.map((r) => Math.min(1, Math.max(0, r))) }; });
      }
      store.change(null, (stack) => { stack.ground = found[choose.value] ?? choose.value; });
    } }, ...GROUNDS.map(([value, words]) => el("option", { value }, words)));
    choose.value = kind;
    const more = [];
    if (kind === "grey") {
      const level = el("input", { type: "range", min: 0, max: 1, step: 0.005, value: now, "aria-label": "Reflectance of the grey ground",
        oninput: () => { output.textContent = level.value; store.change("grey", (stack) => { stack.ground = Number(level.value); }); }, onchange: () => store.settle() });
      const output = el("output", {}, String(now));
      more.push(level, output);
    }
    if (kind === "paint") {
      const paint = el("select", { "aria-label": "Paint of the ground", onchange: () => store.change(null, (stack) => { stack.ground = { paint: { [paint.value]: 1 } }; }) },
        ...[...store.entries.values()].map((entry) => el("option", { value: entry.name }, entry.label)));
      paint.value = Object.keys(now.paint)[0];
      more.push(paint);
    }
    ground.replaceChildren(el("span.label", {}, "Ground"), choose, ...more);
  }

  // While a slider is dragged only numbers follow: the list is not built again under the hand.
  function show() {
    const { coats } = store.stack;
    const shape = JSON.stringify([coats.map((coat) => [coat.id, Object.keys(coat.paint), !!coat.hidden]), store.entries.size]);
    if (shape !== drawn) {
      drawn = shape;
      list.replaceChildren(...coats.map(row));
      list.querySelectorAll("li").forEach((node, i) => node.classList.toggle("hidden-coat", !!coats[i].hidden));
      if (!coats.length) list.append(el("li.empty", {}, "No coat yet: choose a paint from the shelf."));
    }
    coats.forEach((coat) => {
      const node = list.querySelector(`[data-coat="${coat.id}"]`);
      fill(node.querySelector(".chip"), coat);
      const [slider, number] = [node.querySelector(".size input[type=range]"), node.querySelector(".um")];
      if (document.activeElement !== slider || Math.abs(Number(slider.value) - toSlider(coat.um)) > 0.01) slider.value = toSlider(coat.um);
      if (Number(number.value) !== short(coat.um)) number.value = short(coat.um);
      slider.setAttribute("aria-valuetext", store.words(coat));
      const weights = node.querySelectorAll(".part input");
      Object.values(coat.paint).forEach((value, i) => { if (weights[i] && Number(weights[i].value) !== value) weights[i].value = value; });
    });
    mark();
    showBrushed();
    const same = JSON.stringify([typeof store.stack.ground === "number" ? "grey" : store.stack.ground, store.entries.size]);
    if (ground.dataset.same !== same) { ground.dataset.same = same; showGround(); }
    history();
  }
  function history() {
    undo.disabled = !store.past.length;
    redo.disabled = !store.future.length;
  }
  store.on("history", history);
  store.on("stack", show);
  store.on("shelf", show);
  show();
  return panel;
}
