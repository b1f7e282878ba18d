// The page's solver against the library: `python -m benchmarks.studio.page_solver --table stacks.json` writes the stacks,
// and SOLVER_TABLE says where they are. `pytest tests/studio/test_solver.py` does both. What is measured is printed as JSON.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { before, test } from "node:test";
import { Layers } from "../../src/glazejax/studio/page/layers.js";
import { colourWeights, deltaE2000, fresnel, lab, looks, medium, over, parseGeometry, reflect, whiteOf } from "../../src/glazejax/studio/page/solver.js";

const table = process.env.SOLVER_TABLE;
const skip = table ? false : "SOLVER_TABLE names no table of stacks";
let given, shelf, weights;

before(() => {
  if (!table) return;
  given = JSON.parse(readFileSync(table, "utf8"));
  const { paints, lamps, eye } = given.data;
  shelf = new Map(paints.map(({ name, curves }) => [name, { grid: curves.wavelengths, medium: medium(curves) }]));
  const under = new Map();
  for (const { grid } of shelf.values()) if (!under.has(grid.length)) under.set(grid.length, colourWeights(grid, lamps[given.lamp], eye));
  weights = (bands) => under.get(bands);
});

const seen = ({ coats, ground, geometry }, index = given.index) => {
  const layers = coats.map(({ paint, thickness }) => ({ medium: shelf.get(paint).medium, thickness }));
  return over(reflect(layers, [parseGeometry(geometry)], { index })[0], ground);
};
const quantile = (values, share) => [...values].sort((a, b) => a - b)[Math.floor(share * (values.length - 1))];
const say = (figures) => console.log(`page solver: ${JSON.stringify(figures)}`);

test("spectra and colours of random stacks are the library's", { skip }, () => {
  const errors = [], colours = [];
  for (const stack of given.stacks) {
    const found = seen(stack);
    errors.push(Math.max(...found.map((value, i) => Math.abs(value - stack.reflectance[i]))));
    colours.push(deltaE2000(looks(found, weights(found.length)).lab, stack.lab));
  }
  say({ stacks: errors.length, largest: Math.max(...errors), median: quantile(errors, 0.5), delta_e: Math.max(...colours) });
  assert.ok(Math.max(...errors) < 1e-4, `${Math.max(...errors)}`);
  assert.ok(Math.max(...colours) < 0.05, `${Math.max(...colours)}`);
});

test("coats as small matrices are near it", { skip }, () => {
  const colours = [], eight = [], times = [];
  for (const { coats, ground, geometry, lab: wanted, reflectance } of given.stacks) {
    const under = weights(reflectance.length), mixed = new Layers(coats.map(({ paint, thickness }) => ({ medium: shelf.get(paint).medium, um: [thickness * 1e6] })),
      [ground], under, { geometry, index: given.index });
    const places = coats.map(() => 0);
    mixed.colour(places, 0);
    const begun = performance.now(), found = [...mixed.colour(places, 0)];
    const far = deltaE2000(lab(found, whiteOf(under)), wanted);
    colours.push(far);
    if (coats.length < 8) continue;
    times.push(performance.now() - begun);
    eight.push(far);
  }
  say({ eight_median: quantile(eight, 0.5), eight_95: quantile(eight, 0.95) });
  say({ matrices_95: quantile(colours, 0.95), matrices_largest: Math.max(...colours), matrices_ms: quantile(times, 0.5) });
  assert.ok(quantile(colours, 0.95) < 0.35);
  assert.ok(Math.max(...colours) < 1.5, `${Math.max(...colours)}`);
});

test("what a stack takes", { skip }, () => {
  for (const [coats, name] of [[1, "one_coat"], [3, "three_coats"], [8, "eight_coats"]]) {
    const some = given.stacks.filter((stack) => stack.coats.length === coats && stack.reflectance.length === 31);
    const times = some.map((stack) => {
      const begun = performance.now();
      seen(stack);
      return performance.now() - begun;
    });
    say({ [name]: quantile(times, 0.5) });
  }
});

const white = medium({ absorption: [0, 0, 0], scattering: [1e5, 1e5, 1e5] });
const dye = medium({ absorption: [1e5, 2e5, 0], scattering: [0, 0, 0] });

test("paint that absorbs nothing loses no light", () => {
  const sphere = parseGeometry("d:0");
  for (const thickness of [0, 1e-7, 1e-5, 1e-2]) {
    const [coats] = reflect([{ medium: white, thickness }], [sphere]);
    for (const value of over(coats, 1)) assert.ok(Math.abs(value - 1) < 1e-9, `${thickness}: ${value}`);
  }
});

test("a clear dye is Beer's law there and back", () => {
  const [bare, dyed] = [[], [{ medium: dye, thickness: 3e-6 }]].map((coats) => reflect(coats, [parseGeometry("0:0")], { bands: 3 })[0]);
  // To first order in a dark ground: light straight down, and seen straight up.
  [0, 1, 2].forEach((band) => {
    const k = [1e5, 2e5, 0][band], share = dyed.through[band] / bare.through[band];
    assert.ok(Math.abs(share - Math.exp(-2 * k * 3e-6)) < 1e-9, `${share}`);
  });
});

test("coats of one paint are one coat, and light goes both ways", () => {
  const grey = medium({ absorption: [3e4], scattering: [2e5] }), pair = ["60:20", "20:60"].map(parseGeometry);
  const [there, back] = reflect([{ medium: grey, thickness: 4e-6 }], pair).map((one) => over(one, 0.4)[0]);
  const [thrice] = reflect([1, 2, 1].map((um) => ({ medium: grey, thickness: um * 1e-6 })), pair).map((one) => over(one, 0.4)[0]);
  assert.ok(Math.abs(there - back) < 1e-9);
  assert.ok(Math.abs(there - thrice) < 1e-9);
});

test("coats of several thicknesses are each combination of them", () => {
  const paints = [medium({ absorption: [3e4, 1e5], scattering: [2e5, 1e4] }), medium({ absorption: [2e3, 0], scattering: [4e5, 3e5] }), dye];
  const tried = [[0, 2e-6, 9e-6], [1e-6, 4e-6], 3e-6], both = ["45:0", "d:8"].map(parseGeometry), settings = { bands: 2 };
  const all = reflect(paints.map((paint, i) => ({ medium: paint, thickness: tried[i] })), both, settings);
  let at = 0;
  for (const first of tried[0]) {
    for (const second of tried[1]) {
      const alone = reflect([first, second, 3e-6].map((thickness, i) => ({ medium: paints[i], thickness })), both, settings);
      for (let band = 0; band < 2; band++, at++) {
        both.forEach((_, g) => { for (const key of ["bare", "through", "back"]) assert.ok(Math.abs(all[g][key][at] - alone[g][key][band]) < 1e-14, `${key} ${at}`); });
      }
    }
  }
  assert.equal(at, all[0].bare.length);
});

test("a coat by itself is that coat over a ground, exactly", () => {
  const grey = medium({ absorption: [3e4, 1e3], scattering: [2e5, 3e5] }), under = [0, 1, 2].map((i) => Float64Array.of(i === 0, i === 1));
  for (const geometry of ["45:0", "d:8", "30:30:specular"]) {
    const [coat] = reflect([{ medium: grey, thickness: 4e-6 }], [parseGeometry(geometry)]);
    const found = new Layers([{ medium: grey, um: [1, 4] }], [0.6], under, { geometry, index: 1.5 }).colour([1], 0);
    over(coat, 0.6).forEach((value, band) => assert.ok(Math.abs(value - found[band]) < 1e-12, `${geometry}: ${value} ${found[band]}`));
  }
});

test("the surface is added where it is seen", () => {
  const coats = [{ medium: white, thickness: 1e-5 }], [seen, hidden] = reflect(coats, ["d:8", "de:8"].map(parseGeometry));
  assert.ok(Math.abs(seen.bare[0] - hidden.bare[0] - fresnel(Math.cos((8 * Math.PI) / 180), 1.5)) < 1e-12);
});

test("words that name no geometry", () => {
  for (const words of ["", "45", "d:d", "45:95", "8:d:specular", "45:0:specular", "x:8", "NaN:0", ":8"]) assert.equal(parseGeometry(words), null, words);
  assert.deepEqual(parseGeometry("8:de"), { light: 8, view: null, specular: false });
});

test("CIEDE2000 of the paper's pairs", () => {
  assert.ok(Math.abs(deltaE2000([50, 2.6772, -79.7751], [50, 0, -82.7485]) - 2.0425) < 1e-4);
  assert.ok(Math.abs(deltaE2000([50, -1.3802, -84.2814], [50, 0, -82.7485]) - 1.0) < 1e-4);
  assert.ok(Math.abs(deltaE2000([22.7233, 20.0904, -46.694], [23.0331, 14.973, -42.5619]) - 2.0373) < 1e-4);
  assert.ok(Math.abs(deltaE2000([90.8027, -2.0831, 1.441], [91.1528, -1.6435, 0.0447]) - 1.4441) < 1e-4);
});
