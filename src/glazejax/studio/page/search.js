// Recipes by the page itself: the nearest of some ten thousand tabled glazes, polished by the solver's own slopes.
import { deltaE2000, lab, labOfSrgb, looks, over, parseGeometry, reflect, whiteOf, xyz } from "./solver.js";

// Thicknesses in µm: as glazejax recipe has them, of a coat alone and of one over another.
const THINNEST = 1;
const THICKEST = 50;
const ALONE = [1, 2, 4, 8, 16, 32, THICKEST];
const ABOVE = [1, 2, 4, 8];
// Parts of two paints in one coat.
const RATIOS = [[1, 4], [1, 1], [4, 1]];
// Glazes that are polished, and recipes that are shown.
const POLISHED = 8;
const SHOWN = 5;
const MOST_PARTS = 30;
const STEP = 0.01;
// Milliseconds that the page may stand still while the table is made.
const SLICE = 25;

const pause = () => new Promise((done) => setTimeout(done, 0));

/* Paints of a shelf that a recipe may take.
   modern: none that is poisonous or hard to buy, but for one's own; own: only one's own tubes. */
export function allowed(entries, { modern, own }) {
  return entries.filter((entry) => (entry.group === "own" ? true : !own && !(modern && entry.caution)));
}

/* Own paints that a search in Python gets: the stack's first, `most` in all, as many as a stack may bring. */
export function tubesFor(used, own, most) {
  const others = Object.entries(own).filter(([name]) => !(name in used));
  return Object.fromEntries([...Object.entries(used), ...others].slice(0, most));
}

export class Recipes {
  constructor(eye, entries) {
    this.eye = eye;
    this.groups = new Map();
    for (const entry of entries) this.groups.set(entry.group, [...(this.groups.get(entry.group) ?? []), entry]);
    this.tables = new Map();
  }

  // What a stack's coats look like on its ground, to its instrument.
  spectrum(stack) {
    const coats = this.eye.shown(stack), grid = this.eye.grid(stack, coats);
    const [found] = reflect(this.eye.layers(stack, coats, grid), [parseGeometry(stack.geometry)], { index: stack.refractive_index, bands: grid.length });
    return { grid, coats: found, seen: over(found, this.eye.level(stack, grid)) };
  }
  lab(stack) {
    const { grid, seen } = this.spectrum(stack), weights = this.eye.under("D65", grid);
    return lab(xyz(seen, weights), whiteOf(weights));
  }

  // Glazes of a shelf's group over a ground, with their colours. Two coats are tabled as one over a ground that reflects
  // what the other does: near enough to choose by.
  table(group, base) {
    const key = JSON.stringify([group, base]);
    if (!this.tables.has(key)) this.tables.set(key, this.made(group, base));
    return this.tables.get(key);
  }
  async made(group, base) {
    const names = this.groups.get(group).map((entry) => entry.name), glazes = [], below = [], above = [];
    let begun = performance.now();
    const rest = async () => {
      if (performance.now() - begun < SLICE) return;
      await pause();
      begun = performance.now();
    };
    const one = (paint, um) => this.spectrum({ ...base, coats: [{ paint, um }] });
    const bare = this.spectrum({ ...base, coats: [{ paint: { [names[0]]: 1 }, um: 0 }] }), { grid } = bare;
    const weights = this.eye.under("D65", grid), white = whiteOf(weights);
    const colour = (seen) => lab(xyz(seen, weights), white);
    // The ground that looks, bare, as a coat does.
    const asGround = (seen) => seen.map((value, i) => {
      const rest = value - bare.coats.bare[i];
      return Math.min(1, Math.max(0, rest / (bare.coats.through[i] + bare.coats.back[i] * rest)));
    });
    for (const name of names) {
      for (const um of ALONE) {
        const { seen, coats } = one({ [name]: 1 }, um);
        if (seen.length !== grid.length) continue;
        glazes.push({ lab: colour(seen), coats: [{ paint: { [name]: 1 }, um }] });
        if (um === THICKEST) below.push({ name, coat: { paint: { [name]: 1 }, um }, ground: asGround(seen) });
        if (ABOVE.includes(um)) above.push({ name, coat: { paint: { [name]: 1 }, um }, coats });
        await rest();
      }
    }
    for (const [i, first] of names.entries()) {
      for (const second of names.slice(i + 1)) {
        for (const [a, b] of RATIOS) {
          const paint = { [first]: a, [second]: b }, { seen } = one(paint, THICKEST);
          if (seen.length !== grid.length) continue;
          glazes.push({ lab: colour(seen), coats: [{ paint, um: THICKEST }] });
          if (a === b) below.push({ name: "", coat: { paint, um: THICKEST }, ground: asGround(seen) });
          await rest();
        }
      }
    }
    for (const lower of below) {
      for (const upper of above) {
        if (upper.name === lower.name) continue;
        glazes.push({ lab: colour(over(upper.coats, lower.ground)), coats: [upper.coat, lower.coat] });
      }
      await rest();
    }
    return glazes;
  }

  /* Recipes for L*a*b* under D65: coats over the base's ground, best first. Made by slices, so that the page goes on. */
  async find(wanted, base, { most = 2, polished = POLISHED, groups = [...this.groups.keys()] } = {}) {
    const near = [];
    let tabled = 0;
    for (const group of groups) {
      const glazes = (await this.table(group, base)).filter(({ coats }) => coats.length <= most);
      tabled += glazes.length;
      const far = (glaze) => Math.hypot(...glaze.lab.map((value, i) => value - wanted[i]));
      const closest = glazes.map((glaze) => [far(glaze), glaze]).sort((a, b) => a[0] - b[0]).slice(0, 200);
      near.push(...closest.map(([, glaze]) => [deltaE2000(glaze.lab, wanted), glaze]));
    }
    // One of each set of paints: five thicknesses of one glaze are no choice.
    const kinds = new Map();
    for (const [far, glaze] of near.sort((a, b) => a[0] - b[0])) {
      const kind = JSON.stringify(glaze.coats.map((coat) => Object.keys(coat.paint)));
      if (kinds.size === polished) break;
      if (!kinds.has(kind)) kinds.set(kind, glaze);
    }
    const found = [...kinds.values()].map((glaze) => this.polish(glaze.coats, wanted, base));
    found.sort((a, b) => a.delta_e - b.delta_e);
    return { recipes: found.slice(0, SHOWN), tabled };
  }

  // Thicknesses, and parts of mixtures, by Gauss and Newton, slopes by finite differences; steps that do not help shrink.
  polish(coats, wanted, base) {
    const free = coats.flatMap((coat, i) => [[i, "um"], ...Object.keys(coat.paint).slice(1).map((name) => [i, name])]);
    const made = (by) => coats.map((coat, i) => {
      const found = { paint: { ...coat.paint }, um: coat.um };
      free.forEach(([at, what], f) => {
        if (at !== i) return;
        if (what === "um") found.um = Math.min(THICKEST, Math.max(THINNEST, coat.um * Math.exp(by[f])));
        else found.paint[what] = coat.paint[what] * Math.min(MOST_PARTS, Math.max(1 / MOST_PARTS, Math.exp(by[f])));
      });
      return found;
    });
    const colour = (by) => this.lab({ ...base, coats: made(by) }), miss = (found) => found.map((value, i) => value - wanted[i]);
    let by = free.map(() => 0), now = miss(colour(by)), damping = 1;
    const square = (values) => values.reduce((sum, value) => sum + value * value, 0);
    for (let round = 0; round < 6 && square(now) > 0.01; round++) {
      const slopes = free.map((_, f) => miss(colour(by.map((value, i) => value + (i === f ? STEP : 0)))).map((value, c) => (value - now[c]) / STEP));
      const normal = slopes.map((one, i) => slopes.map((other, j) => one.reduce((sum, value, c) => sum + value * other[c], 0) + (i === j ? damping : 0)));
      const step = solve(normal, slopes.map((one) => -one.reduce((sum, value, c) => sum + value * now[c], 0)));
      const next = by.map((value, i) => value + Math.max(-1, Math.min(1, step[i]))), there = miss(colour(next));
      if (square(there) < square(now)) [by, now, damping] = [next, there, damping / 4];
      else damping *= 8;
    }
    const rounded = made(by).map(({ paint, um }) => ({ paint: parts(paint), um: +um.toPrecision(3) })), stack = { ...base, coats: rounded };
    const { grid, seen } = this.spectrum(stack), found = looks(seen, this.eye.under("D65", grid));
    return { delta_e: deltaE2000(found.lab, wanted), rgb: found.rgb, stack };
  }
}

// Parts by weight, so that the least is about one.
function parts(paint) {
  const least = Math.min(...Object.values(paint));
  return Object.fromEntries(Object.entries(paint).map(([name, value]) => [name, +(value / least).toPrecision(3)]));
}

// A small system of equations, by elimination; damped, so that pivots stay away from zero.
function solve(matrix, right) {
  const n = right.length, rows = matrix.map((row, i) => [...row, right[i]]);
  for (let k = 0; k < n; k++) {
    for (let i = k + 1; i < n; i++) {
      const factor = rows[i][k] / rows[k][k];
      for (let j = k; j <= n; j++) rows[i][j] -= factor * rows[k][j];
    }
  }
  const found = new Array(n);
  for (let k = n - 1; k >= 0; k--) found[k] = (rows[k][n] - rows[k].slice(k + 1, n).reduce((sum, value, j) => sum + value * found[k + 1 + j], 0)) / rows[k][k];
  return found;
}

// L*a*b* under D65 that is wanted: of a colour such as #8a4b2d, or of a spectrum.
export function labOf(wanted, eye) {
  if (typeof wanted === "string") return labOfSrgb([1, 3, 5].map((at) => parseInt(wanted.slice(at, at + 2), 16) / 255));
  const weights = eye.under("D65", wanted.wavelengths);
  return lab(xyz(wanted.reflectance, weights), whiteOf(weights));
}
