// Colour over the thickness of brushed coats. Up to three: a table, computed at few points and read for every pixel. More:
// each combination of thicknesses that the canvas has, once, from the coats' own matrices.
import { Layers } from "./layers.js";
import { deltaE2000, encode, lab, linearSrgb, over, parseGeometry, reflect, whiteOf, xyz } from "./solver.js";

// Steps of thickness, even in its root, where colours change fastest.
export const LEVELS = 4096;
// By the number of brushed coats: points that are computed, while a hand moves and afterwards; points between them by
// polynomials; and entries of the table that pixels read.
const QUICK = [17, 9, 6];
const EXACT = [25, 13, 10];
const SMOOTH = [4096, 128, 33];
const ROUGH = [1024, 48, 20];
const ENTRIES = [4096, 512, 64];
export const MOST_TABLED = 3;
// Steps of thickness of each coat where more are brushed, and how many of them are one while a hand moves.
const STEPS = 128;
const COARSE = 4;
// Places where colours are compared with the full computation.
const CHECKS = 6;
// Combinations that are kept at most, a power of two: about 60 MB.
const KEPT = 1 << 22;
// Milliseconds that a page may stand still while a table is made in the background.
const SLICE = 12;

/* Steps of a box of a map of thickness in µm, none above `top`, written into `levels`; both are `width` wide. */
export function fillLevels(levels, map, top, width, { x, y, w, h }) {
  const scale = 1 / top;
  for (let row = y; row < y + h; row++) {
    for (let at = row * width + x, end = at + w; at < end; at++) levels[at] = Math.sqrt(map[at] * scale) * (LEVELS - 1) + 0.5;
  }
}
export const levelOf = (um, top) => Math.floor(Math.sqrt(um / top) * (LEVELS - 1) + 0.5);

// Chebyshev points on [0, 1], and the weights that a place takes of values there (the barycentric formula).
function chebyshev(count) {
  const nodes = Array.from({ length: count }, (_, i) => 0.5 * (1 - Math.cos((Math.PI * i) / (count - 1))));
  const signs = nodes.map((_, i) => (i % 2 ? -1 : 1) * (i === 0 || i === count - 1 ? 0.5 : 1));
  const at = (x) => {
    const hit = nodes.findIndex((node) => Math.abs(node - x) < 1e-12);
    const terms = nodes.map((node, i) => (hit >= 0 ? Number(i === hit) : signs[i] / (x - node)));
    const sum = terms.reduce((all, term) => all + term, 0);
    return terms.map((term) => term / sum);
  };
  return { nodes, at };
}

// One axis of an array (outer, n, inner) taken to other points, each a list of [index, weight].
function along(values, outer, n, inner, points) {
  const found = new Float32Array(outer * points.length * inner);
  let to = 0;
  for (let o = 0; o < outer; o++) {
    for (const taps of points) {
      for (const [index, weight] of taps) {
        const from = (o * n + index) * inner;
        for (let i = 0; i < inner; i++) found[to + i] += weight * values[from + i];
      }
      to += inner;
    }
  }
  return found;
}

// All axes of an array (n, n, ..., channels).
function everyAxis(values, axes, n, channels, points) {
  for (let axis = 0; axis < axes; axis++) {
    values = along(values, points.length ** axis, n, n ** (axes - axis - 1) * channels, points);
  }
  return values;
}

const even = (count) => Array.from({ length: count }, (_, i) => i / (count - 1));
const polynomial = (rule, places) => places.map((x) => rule.at(x).map((weight, i) => [i, weight]));
const straight = (n, places) => places.map((x) => {
  const left = Math.min(n - 2, Math.floor(x * (n - 1))), share = x * (n - 1) - left;
  return [[left, 1 - share], [left + 1, share]];
});
const onRoots = new Map();
// The polynomials of a table, the same for every stack.
function polynomialsOf(count, smooth) {
  const key = `${count} ${smooth}`;
  if (!onRoots.has(key)) {
    const rule = chebyshev(count);
    onRoots.set(key, { rule, points: polynomial(rule, even(smooth)) });
  }
  return onRoots.get(key);
}

// What a stack on the canvas is computed from: every other band where that will do.
function sceneOf(eye, stack, lamp, thinned) {
  const coats = eye.shown(stack), bands = eye.grid(stack, coats);
  const grid = thinned && bands.length > 20 ? bands.filter((_, i) => i % 2 === 0 || i === bands.length - 1) : bands;
  const layers = eye.layers(stack, coats, grid), weights = eye.under(lamp, grid);
  const grounds = stack.ground === "card" ? [eye.data.white, eye.data.black] : [eye.level(stack, grid)];
  return { coats, grid, layers, weights, white: whiteOf(weights), grounds, geometry: [parseGeometry(stack.geometry)], index: stack.refractive_index };
}
// XYZ under the lamp for each ground, where coats have several thicknesses for each of them in turn.
function fullColours({ layers, grounds, weights, geometry, index, grid }, given) {
  const [found] = reflect(layers.map((layer, i) => ({ ...layer, thickness: given.get(i) ?? layer.thickness })), geometry, { index, bands: grid.length });
  const count = found.bare.length / grid.length;
  return Array.from({ length: count }, (_, at) => {
    const [from, to] = [at * grid.length, (at + 1) * grid.length];
    const one = { bare: found.bare.subarray(from, to), through: found.through.subarray(from, to), back: found.back.subarray(from, to) };
    return grounds.map((ground) => xyz(over(one, ground), weights));
  });
}
// Columns of the matrix from XYZ to linear sRGB.
const columnsOf = (white) => [0, 1, 2].map((c) => linearSrgb([0, 1, 2].map((one) => Number(one === c)), white));

/* A table for one to three brushed coats: `brushed` has each one's place among those shown and the top of its range in µm.
 * While a hand moves it is of the coats' own matrices. Made step by step, so that a page can go on. */
export function* tableSteps(eye, stack, brushed, lamp, quick) {
  const axes = brushed.length, scene = sceneOf(eye, stack, lamp, quick), { white, grounds } = scene;
  const channels = 3 * grounds.length, count = (quick ? QUICK : EXACT)[axes - 1], smooth = (quick ? ROUGH : SMOOTH)[axes - 1];
  const { rule, points } = polynomialsOf(count, smooth), values = new Float32Array(count ** axes * channels);
  const ranges = brushed.map(([, top]) => rule.nodes.map((node) => top * node ** 2)), below = count ** (axes - 1);
  const mixed = quick ? layersOf(scene, stack, new Map(brushed.map(([at], axis) => [at, ranges[axis]]))) : null;
  // Cube roots: even steps look equal in the dark and in the light.
  for (let first = 0, to = 0, begun = performance.now(); first < count; first++) {
    if (performance.now() - begun > SLICE) {
      yield;
      begun = performance.now();
    }
    for (const found of mixed ? mixedColours(first) : exactColours(first)) for (let c = 0; c < 3; c++) values[to++] = Math.cbrt(found[c]);
  }
  const roots = everyAxis(values, axes, count, channels, points);
  yield;
  const columns = columnsOf(white);
  for (let i = 0; i < roots.length; i += 3) {
    const x = roots[i] ** 3, y = roots[i + 1] ** 3, z = roots[i + 2] ** 3;
    for (let c = 0; c < 3; c++) roots[i + c] = encode(columns[0][c] * x + columns[1][c] * y + columns[2][c] * z);
  }
  yield;
  const size = quick ? smooth : ENTRIES[axes - 1];
  const encoded = size === smooth ? roots : everyAxis(roots, axes, smooth, channels, straight(smooth, even(size)));
  yield;
  const entries = new Uint32Array(encoded.length / 3), bytes = new Uint8ClampedArray(entries.buffer), beyond = new Uint8Array(entries.length);
  for (let i = 0, at = 0; i < entries.length; i++, at += 3) {
    for (let c = 0; c < 3; c++) {
      const value = encoded[at + c];
      bytes[4 * i + c] = 255 * value;
      if (value < -0.002 || value > 1.002) beyond[i] = 1;
    }
    bytes[4 * i + 3] = 255;
  }
  return { size, sides: grounds.length, entries, beyond, lacks: beyond.includes(1), error: quick ? null : error() };

  // XYZ for each ground where the uppermost coat is at one of its points, and the others at all of theirs.
  function exactColours(first) {
    const given = brushed.map(([at], axis) => [at, (axis ? ranges[axis] : [ranges[0][first]]).map((um) => um * 1e-6)]);
    return fullColours(scene, new Map(given)).flat();
  }
  function* mixedColours(first) {
    const places = scene.coats.map(() => 0);
    places[brushed[0][0]] = first;
    for (let at = 0; at < below; at++) {
      for (let axis = 1; axis < axes; axis++) places[brushed[axis][0]] = Math.floor(at / count ** (axes - axis - 1)) % count;
      for (let side = 0; side < grounds.length; side++) yield mixed.colour(places, side);
    }
  }
  // The largest difference at some places, by the polynomials.
  function error() {
    let worst = 0;
    for (let check = 1; check <= CHECKS; check++) {
      const places = brushed.map((_, axis) => (check * [0.618, 0.755, 0.57][axis]) % 1);
      const [wanted] = fullColours(scene, new Map(brushed.map(([at, top], axis) => [at, [top * 1e-6 * places[axis] ** 2]])));
      const found = brushed.reduce((left, _, axis) => along(left, 1, count, left.length / count, [rule.at(places[axis]).map((weight, i) => [i, weight])]), values);
      wanted.forEach((one, side) => {
        const other = [...found.subarray(3 * side, 3 * side + 3)].map((root) => root ** 3);
        worst = Math.max(worst, deltaE2000(lab(one, white), lab(other, white)));
      });
    }
    return worst;
  }
}

// A scene's coats by their matrices; `ranges` has thicknesses in µm of those that are brushed.
function layersOf({ coats, layers, grounds, weights, index }, stack, ranges) {
  const given = coats.map(({ um }, i) => ({ medium: layers[i].medium, um: ranges.get(i) ?? [um] }));
  return new Layers(given, grounds, weights, { geometry: stack.geometry, index });
}

// The same at once.
export function makeTable(...given) {
  const steps = tableSteps(...given);
  for (;;) {
    const { done, value } = steps.next();
    if (done) return value;
  }
}

/* Colours of a box of `pixels`: `levels` are steps of thickness of each brushed coat, all as wide as the pixels, or one
 * number where a coat is even; the right half of a card is black. Returns the share outside sRGB. */
export function readTable(table, levels, pixels, width, { x, y, w, h }) {
  const { size, sides, entries, beyond, lacks } = table, half = Math.min(x + w, Math.max(x, width / 2));
  const given = levels.map((level, axis) => [level, placesOf(size, sides * size ** (levels.length - axis - 1))]);
  const even = given.reduce((sum, [level, places]) => sum + (typeof level === "number" ? places[level] : 0), 0);
  // Three maps at most; where there are fewer, one without steps stands for the others.
  const maps = [...given.filter(([level]) => typeof level !== "number"), NO_MAP, NO_MAP, NO_MAP], count = maps.length - 3;
  const [[a, inA], [b, inB], [c, inC]] = maps;
  let outside = 0;
  const run = (from, to, entry) => {
    if (count > 2) for (let i = from; i < to; i++) pixels[i] = entries[entry + inA[a[i]] + inB[b[i]] + inC[c[i]]];
    else if (count > 1) for (let i = from; i < to; i++) pixels[i] = entries[entry + inA[a[i]] + inB[b[i]]];
    else if (count) for (let i = from; i < to; i++) pixels[i] = entries[entry + inA[a[i]]];
    else pixels.fill(entries[entry], from, to);
    if (lacks) for (let i = from; i < to; i++) outside += beyond[entry + (count ? inA[a[i]] : 0) + (count > 1 ? inB[b[i]] : 0) + (count > 2 ? inC[c[i]] : 0)];
  };
  for (let row = y; row < y + h; row++) {
    run(row * width + x, row * width + half, even);
    run(row * width + half, row * width + x + w, even + sides - 1);
  }
  return outside / (w * h);
}
const NO_MAP = [new Uint16Array(0), new Uint32Array(0)];
// The nearest of so many places for each step of thickness, times a stride.
function placesOf(size, stride) {
  const key = `${size} ${stride}`;
  if (!placed.has(key)) placed.set(key, Uint32Array.from({ length: LEVELS }, (_, level) => Math.floor((level * (size - 1)) / (LEVELS - 1) + 0.5) * stride));
  return placed.get(key);
}
const placed = new Map();

/* Colours where more coats are brushed: those of the combinations of thicknesses that pixels have, each computed once. */
export class Combinations {
  constructor(eye, stack, brushed, lamp) {
    this.scene = sceneOf(eye, stack, lamp, true);
    this.exact = sceneOf(eye, stack, lamp, false);
    this.tops = brushed.map(([, top]) => top);
    this.places = brushed.map(([at]) => at);
    this.um = brushed.map(([, top]) => Array.from({ length: STEPS }, (_, step) => top * (step / (STEPS - 1)) ** 2));
    this.mixed = layersOf(this.scene, stack, new Map(this.places.map((at, axis) => [at, this.um[axis]])));
    this.columns = columnsOf(this.scene.white);
    this.now = this.scene.coats.map(() => 0);
    this.stepOf = placesOf(STEPS, 1);
    this.empty(1 << 14);
  }

  // Open addressing: two words of a key, its colour, none where the place is free, and whether sRGB lacks it.
  empty(size) {
    Object.assign(this, { mask: size - 1, known: 0, low: new Uint32Array(size), high: new Uint32Array(size), colours: new Uint32Array(size), beyond: new Uint8Array(size) });
  }
  find(low, high) {
    let hash = Math.imul(low, 0x9e3779b1) ^ Math.imul(high, 0x85ebca77);
    hash ^= hash >>> 15;
    for (let at = hash & this.mask; ; at = (at + 1) & this.mask) {
      if (this.colours[at] === 0 || (this.low[at] === low && this.high[at] === high)) return at;
    }
  }
  grow() {
    const { low, high, colours, beyond } = this;
    if (colours.length === KEPT) return this.empty(1 << 14);
    this.empty(2 * colours.length);
    for (let i = 0; i < colours.length; i++) {
      if (colours[i] === 0) continue;
      const at = this.find(low[i], high[i]);
      [this.low[at], this.high[at], this.colours[at], this.beyond[at]] = [low[i], high[i], colours[i], beyond[i]];
      this.known++;
    }
  }
  // A step of each coat in 7 bits, four coats a word, and the ground's side in the highest bit.
  stepsOf(low, high) {
    return this.places.map((_, axis) => ((axis < 4 ? low : high) >>> (7 * (axis % 4))) & 127);
  }
  learn(at, low, high) {
    const steps = this.stepsOf(low, high), { columns, now } = this;
    this.places.forEach((place, axis) => { now[place] = steps[axis]; });
    const [x, y, z] = this.mixed.colour(now, low >>> 31);
    let colour = 255 << 24, beyond = 0;
    for (let c = 0; c < 3; c++) {
      const value = encode(columns[0][c] * x + columns[1][c] * y + columns[2][c] * z);
      if (value < -0.002 || value > 1.002) beyond = 1;
      colour |= Math.round(255 * Math.min(1, Math.max(0, value))) << (8 * c);
    }
    this.low[at] = low;
    this.high[at] = high;
    this.colours[at] = colour >>> 0;
    this.beyond[at] = beyond;
    this.known++;
  }

  /* Colours of a box as `readTable` gives them; `quick` takes several steps as one. */
  read(levels, pixels, width, { x, y, w, h }, quick = false) {
    const lows = new Uint32Array(w), highs = new Uint32Array(w), half = width / 2, { sides } = this;
    const round = (step) => Math.min(STEPS - 1, (step + COARSE / 2) & -COARSE);
    const steps = quick ? this.stepOf.map(round) : this.stepOf;
    let outside = 0;
    for (let row = 0; row < h; row++) {
      const from = (y + row) * width + x;
      for (let i = 0; i < w; i++) lows[i] = sides > 1 && x + i >= half ? 0x80000000 : 0;
      highs.fill(0);
      levels.forEach((level, axis) => {
        const words = axis < 4 ? lows : highs, shift = 7 * (axis % 4);
        for (let i = 0; i < w; i++) words[i] |= steps[level[from + i]] << shift;
      });
      for (let i = 0, before = -1; i < w; i++) {
        // Neighbours are often equal.
        if (before >= 0 && this.low[before] === lows[i] && this.high[before] === highs[i]) {
          pixels[from + i] = this.colours[before];
          outside += this.beyond[before];
          continue;
        }
        before = this.find(lows[i], highs[i]);
        if (this.colours[before] === 0) {
          if (2 * this.known > this.mask) {
            this.grow();
            before = this.find(lows[i], highs[i]);
          }
          this.learn(before, lows[i], highs[i]);
        }
        pixels[from + i] = this.colours[before];
        outside += this.beyond[before];
      }
    }
    return outside / (w * h);
  }
  get sides() {
    return this.scene.grounds.length;
  }

  // The largest difference from the full computation of some combinations that the canvas has.
  error() {
    const at = [...this.colours.keys()].filter((i) => this.colours[i] !== 0), { exact, scene } = this;
    let worst = 0;
    for (let check = 0; check < CHECKS && at.length; check++) {
      const i = at[Math.floor(((check + 0.5) / CHECKS) * at.length)], steps = this.stepsOf(this.low[i], this.high[i]), side = this.low[i] >>> 31;
      const [wanted] = fullColours(exact, new Map(this.places.map((place, axis) => [place, this.um[axis][steps[axis]] * 1e-6])));
      this.places.forEach((place, axis) => { this.now[place] = steps[axis]; });
      worst = Math.max(worst, deltaE2000(lab(wanted[side], exact.white), lab([...this.mixed.colour(this.now, side)], scene.white)));
    }
    return worst;
  }
}
