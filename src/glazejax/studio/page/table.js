// Colour over the thickness of brushed coats: computed at few points, read for every pixel.
import { deltaE2000, encode, lab, linearSrgb, over, parseGeometry, reflect, whiteOf, xyz } from "./solver.js";

// By the number of brushed coats: points that are computed, while a hand moves and afterwards; points between them by
// polynomials; and entries of the table that pixels read.
const QUICK = [9, 6, 4];
const EXACT = [25, 13, 10];
const SMOOTH = [4096, 128, 33];
const ROUGH = [1024, 64, 20];
const ENTRIES = [4096, 512, 64];
export const MOST_BRUSHED = 3;
// Places where colours are compared with the full computation.
const CHECKS = 6;
// Milliseconds that a page may stand still while a table is made beside it.
const SLICE = 12;

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
  for (let o = 0; o < outer; o++) {
    points.forEach((taps, p) => {
      const to = (o * points.length + p) * inner;
      for (const [index, weight] of taps) {
        const from = (o * n + index) * inner;
        for (let i = 0; i < inner; i++) found[to + i] += weight * values[from + i];
      }
    });
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

/* A table for brushed coats: `brushed` has each one's place among those shown and the top of its range in µm. Entries are
 * even in the root of the thickness, where colours change fastest. Made step by step, so that a page can go on. */
export function* tableSteps(eye, stack, brushed, lamp, quick) {
  const axes = brushed.length, coats = eye.shown(stack), bands = eye.grid(stack, coats);
  // Every other band will do while a hand moves.
  const grid = quick && bands.length > 20 ? bands.filter((_, i) => i % 2 === 0 || i === bands.length - 1) : bands;
  const layers = eye.layers(stack, coats, grid);
  const weights = eye.under(lamp, grid), white = whiteOf(weights), geometry = [parseGeometry(stack.geometry)];
  const settings = { index: stack.refractive_index, bands: grid.length };
  const grounds = stack.ground === "card" ? [eye.data.white, eye.data.black] : [eye.level(stack, grid)];
  const channels = 3 * grounds.length, count = (quick ? QUICK : EXACT)[axes - 1], rule = chebyshev(count);
  const exact = (places) => {
    const given = layers.slice();
    brushed.forEach(([at, top], axis) => { given[at] = { ...given[at], thickness: top * 1e-6 * places[axis] ** 2 }; });
    const [found] = reflect(given, geometry, settings);
    // Cube roots: even steps look alike in the dark and in the light.
    return grounds.flatMap((ground) => xyz(over(found, ground), weights).map((value) => Math.cbrt(value)));
  };
  const values = new Float32Array(count ** axes * channels);
  for (let at = 0, begun = performance.now(); at < count ** axes; at++) {
    if (performance.now() - begun > SLICE) {
      yield;
      begun = performance.now();
    }
    const places = brushed.map((_, axis) => rule.nodes[Math.floor(at / count ** (axes - axis - 1)) % count]);
    values.set(exact(places), at * channels);
  }
  // Colours, first on a smooth grid, then as entries.
  const smooth = (quick ? ROUGH : SMOOTH)[axes - 1];
  const roots = everyAxis(values, axes, count, channels, polynomial(rule, even(smooth)));
  yield;
  const columns = [0, 1, 2].map((c) => linearSrgb([0, 1, 2].map((one) => Number(one === c)), white));
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
  return { size, sides: grounds.length, tops: brushed.map(([, top]) => top), entries, beyond, error: quick ? null : error() };

  // The largest difference at some places, by the polynomials.
  function error() {
    let worst = 0;
    for (let check = 1; check <= CHECKS; check++) {
      const places = brushed.map((_, axis) => (check * [0.618, 0.755, 0.57][axis]) % 1), wanted = exact(places);
      const found = brushed.reduce((left, _, axis) => along(left, 1, count, left.length / count, [rule.at(places[axis]).map((weight, i) => [i, weight])]), values);
      for (let at = 0; at < channels; at += 3) {
        const [one, other] = [wanted, [...found]].map((roots) => lab(roots.slice(at, at + 3).map((root) => root ** 3), white));
        worst = Math.max(worst, deltaE2000(one, other));
      }
    }
    return worst;
  }
}

// The same at once.
export function makeTable(...given) {
  const steps = tableSteps(...given);
  for (;;) {
    const { done, value } = steps.next();
    if (done) return value;
  }
}

/* Colours of a box of pixels: `maps` are thicknesses in µm of each brushed coat, all `width` wide, none above its top, or
 * one number where a coat is even; the right half of a card is black. Returns the pixels, and the share outside sRGB. */
export function readTable(table, maps, width, { x, y, w, h }) {
  const pixels = new Uint32Array(w * h), rows = new Uint32Array(w), { size, sides, entries, beyond } = table, half = width / 2;
  let outside = 0;
  for (let row = 0; row < h; row++) {
    const from = (y + row) * width + x, to = row * w;
    rows.fill(0);
    maps.forEach((map, axis) => {
      const scale = 1 / table.tops[axis], last = size - 1;
      if (typeof map === "number") {
        const place = (Math.sqrt(map * scale) * last + 0.5) | 0;
        for (let i = 0; i < w; i++) rows[i] = rows[i] * size + place;
      } else {
        for (let i = 0; i < w; i++) rows[i] = rows[i] * size + ((Math.sqrt(map[from + i] * scale) * last + 0.5) | 0);
      }
    });
    for (let i = 0; i < w; i++) {
      const entry = sides > 1 ? 2 * rows[i] + (x + i >= half ? 1 : 0) : rows[i];
      pixels[to + i] = entries[entry];
      outside += beyond[entry];
    }
  }
  return { pixels: new Uint8ClampedArray(pixels.buffer), outside: outside / (w * h) };
}
