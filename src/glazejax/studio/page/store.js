// What was made: the stack, how it is looked at, the maps of the canvas, and the way back through all of it.
import { hex, outside, thickness } from "./dom.js";
import { Eye, Sentence } from "./seen.js";
import { SCREEN_WHITE, srgb, xyzOfLab } from "./solver.js";

const KEPT = 60;
export const THINNEST = 0.1;
export const THICKEST = 200;
// A coat in µm at most, here and in `glazejax`; the sliders end before.
export const MOST_UM = 10000;
export const SIZE = 1024;

export function fresh() {
  return {
    coats: [{ paint: { CobaltBlue: 1 }, um: 0.5 }, { paint: { Eosin: 1 }, um: 2 }, { paint: { ZincWhite: 1 }, um: 8 }],
    ground: "card",
    refractive_index: 1.5,
    geometry: "45:0",
  };
}

export function freshView() {
  return { lamps: ["D65", "A", "FL11", "LED-B3"], light: 45, view: 60 };
}

let marks = 0;
const mark = (coat) => ({ ...coat, id: coat.id ?? `coat${++marks}` });

export class Store {
  constructor(link) {
    this.link = link;
    this.stack = { ...fresh(), coats: fresh().coats.map(mark) };
    this.own = {};
    this.entries = new Map();
    this.swatches = new Map();
    this.lamps = [];
    this.ownLamps = {};
    this.view = freshView();
    this.selected = this.stack.coats[0].id;
    this.pinned = null;
    this.maps = new Map();
    this.seen = null;
    this.eye = null;
    this.past = [];
    this.future = [];
    this.listeners = {};
    this.later = null;
    this.alone = false;
    this.tasks = [];
    this.mostFile = 16 << 20;
  }

  // What the page knows of paints and lamps: from here on it sees.
  learn(data) {
    this.eye = new Eye(data);
    this.entries = this.eye.entries;
    Object.assign(this.own, data.own);
    this.lamps = Object.keys(data.lamps);
    this.swatch([...this.entries.keys()]);
    this.tell("lamps");
  }
  // What paints look like: hiding, thin over white, and whether a screen lacks either.
  swatch(names) {
    for (const name of names) {
      const looks = this.eye.swatch(name, this.own);
      this.swatches.set(name, [...looks.map((one) => one.rgb), looks.map((one) => outside(one.encoded))]);
    }
    this.tell("shelf");
  }

  on(name, call) {
    (this.listeners[name] ??= []).push(call);
  }
  tell(name, ...given) {
    for (const call of this.listeners[name] ?? []) call(...given);
  }
  say(words, kind = "note") {
    this.tell("say", words, kind);
  }

  // Changes -----------------------------------------------------------------------------------------------------------
  snapshot() {
    return { stack: structuredClone(this.stack), maps: new Map(this.maps), selected: this.selected };
  }
  // Changes of one key that follow one another, such as a slider's, are one step back.
  change(key, edit) {
    if (!key || key !== this.lastKey || !this.past.length) {
      this.past.push(this.snapshot());
      if (this.past.length > KEPT) this.past.shift();
    }
    this.lastKey = key;
    this.future = [];
    edit(this.stack);
    this.changed();
  }
  settle() {
    this.lastKey = null;
  }
  changed() {
    if (!this.stack.coats.some((coat) => coat.id === this.selected)) this.selected = this.stack.coats[0]?.id;
    this.tell("stack");
    this.look();
  }
  step(from, to) {
    if (!from.length) return;
    to.push(this.snapshot());
    const back = from.pop();
    this.stack = back.stack;
    this.maps = back.maps;
    this.selected = back.selected;
    this.lastKey = null;
    this.tell("maps");
    this.changed();
  }
  undo() {
    this.step(this.past, this.future);
  }
  redo() {
    this.step(this.future, this.past);
  }

  coat(id = this.selected) {
    return this.stack.coats.find((coat) => coat.id === id);
  }
  add(paint, um) {
    this.change(null, (stack) => {
      const coat = mark({ paint, um: um ?? 10 });
      stack.coats.unshift(coat);
      this.selected = coat.id;
    });
  }
  // A stack from elsewhere takes the place of this one; the way back stays.
  take(given) {
    Object.assign(this.own, given.pigments ?? {});
    for (const name of Object.keys(given.pigments ?? {})) {
      if (!this.entries.has(name))
        this.entries.set(name, { name, label: name, group: "own", provenance: "came with a stack", unknown: "" });
      this.swatch([name]);
    }
    this.change(null, (stack) => {
      stack.coats = given.coats.map((coat) => mark({ paint: coat.paint, um: coat.um, hidden: coat.hidden || undefined }));
      for (const key of ["ground", "refractive_index", "geometry"]) if (key in given) stack[key] = given[key];
      this.selected = stack.coats[0]?.id;
    });
    this.tell("shelf");
  }

  // As the server and files have it: own paints that are used go along.
  plain() {
    const coats = this.stack.coats.map(({ paint, um, hidden }) => ({ paint, um, ...(hidden ? { hidden: true } : {}) }));
    const { ground, refractive_index, geometry } = this.stack;
    const used = new Set([...coats, ground].flatMap((one) => Object.keys(one?.paint ?? {})));
    const pigments = Object.fromEntries([...used].filter((name) => this.own[name]).map((name) => [name, this.own[name]]));
    const plain = { glazejax: "stack", version: 1, coats, ground, refractive_index, geometry };
    return Object.keys(pigments).length ? { ...plain, pigments } : plain;
  }
  get shown() {
    return this.stack.coats.filter((coat) => !coat.hidden);
  }
  label(coat) {
    const names = Object.keys(coat.paint);
    const total = Object.values(coat.paint).reduce((sum, part) => sum + part, 0) || 1;
    const short = (name) => this.entries.get(name)?.label ?? name;
    if (names.length === 1) return short(names[0]);
    return names.map((name) => `${Math.round((100 * coat.paint[name]) / total)} % ${short(name)}`).join(" + ");
  }
  words(coat) {
    return `${this.label(coat)}, ${thickness(coat.um)}`;
  }

  // Looking: one question at a time, and the newest next --------------------------------------------------------------
  lampOf(name) {
    return this.ownLamps[name] ?? name;
  }
  viewNow() {
    const shown = this.shown;
    return {
      ...this.view,
      lamps: this.view.lamps.map((name) => this.lampOf(name)),
      repeated: Math.max(0, shown.findIndex((coat) => coat.id === this.selected)),
      ...(this.pinned ? { pinned: this.pinned.lab } : {}),
    };
  }
  // The swatch at once; ladder and band when the hand rests.
  look() {
    if (!this.eye) return;
    clearTimeout(this.later);
    this.tell("busy", true);
    this.attempt("see", () => {
      const begun = performance.now();
      const found = this.eye.see(this.plain(), this.viewNow());
      // The ladder stays until the next one is there.
      this.seen = { ladder: this.seen?.ladder ?? [], sd: null, rest: "", ...found };
      this.tell("seen", performance.now() - begun);
    });
    this.later = setTimeout(() => {
      this.attempt("see", () => {
        Object.assign(this.seen, this.eye.rest(this.plain(), this.viewNow()));
        this.tell("rest");
      });
      this.tell("busy", false);
    }, 40);
  }
  pin(lab) {
    const shown = srgb(xyzOfLab(lab, SCREEN_WHITE), SCREEN_WHITE).map((value) => 255 * Math.min(1, Math.max(0, value)));
    this.pinned = { lab, css: hex(shown) };
    this.tell("pinned");
  }
  // What a person can correct is said in a sentence; all else is a fault of the page.
  attempt(about, call) {
    try {
      call();
      this.tell("corrected", about);
    } catch (error) {
      if (!(error instanceof Sentence)) throw error;
      this.tell("refused", error.message, about);
    }
  }
}
