// What a stack looks like, computed here: spectra by solver.js, colours under the view's lamps, the ladder, the 90 % band.
import { MOST_COATS, colourWeights, deltaE2000, linear, looks, medium, mixture, over, parseGeometry, reflect } from "./solver.js";

// Coats of the ladder's steps.
export const LADDER = [1, 2, 3, 5, 8, 13, 21, 34];
// Spectra of what is seen, in this order; the ladder's follow.
export const ROW = { ground: 0, white: 1, black: 2, angle: 3, bare: 4, bareWhite: 5, bareBlack: 6, ladder: 7 };
// Thickness of a thin glaze on the shelf, µm.
const THIN = 5;
// Relative step of k and s for their slopes.
const STEP = 0.01;

// An error that a person can correct: one sentence.
export class Sentence extends Error {}

const curves = ["absorption", "scattering"];
const errors = ["absorption_sd", "scattering_sd"];

export class Eye {
  constructor(data) {
    this.data = data;
    // What the shelf says of each paint; one's own come in later.
    this.entries = new Map(data.paints.map((entry) => [entry.name, entry]));
    this.paints = new Map(data.paints.filter((entry) => entry.curves).map((entry) => [entry.name, { ...entry.curves, provenance: entry.provenance }]));
    this.media = new Map();
    this.weights = new Map();
    this.masstones = new Map();
  }

  // A paint's coefficients; own ones come with the stack.
  paint(name, own) {
    const found = own?.[name] ?? this.paints.get(name);
    if (!found) throw new Sentence(`there is no pigment '${name}'`);
    return found;
  }

  // Coats that count, top first, in µm; where the ground is paint that hides, it is the last.
  shown(stack) {
    const coats = stack.coats.filter((coat) => !coat.hidden);
    if (stack.ground?.paint) coats.push({ paint: stack.ground.paint, um: this.data.thickest });
    if (coats.length > MOST_COATS) throw new Sentence(`${coats.length} coats are shown (a ground that hides is one); hide some: ${MOST_COATS} at most`);
    return coats;
  }

  // Wavelengths of the uppermost coat, as far as all paints and the ground reach.
  grid(stack, coats) {
    const grids = coats.flatMap((coat) => Object.keys(coat.paint).map((name) => this.paint(name, stack.pigments).wavelengths));
    if (!grids.length) grids.push(this.paints.values().next().value.wavelengths);
    if (stack.ground?.wavelengths) grids.push(stack.ground.wavelengths);
    const low = Math.max(...grids.map((grid) => grid[0])), high = Math.min(...grids.map((grid) => grid.at(-1)));
    const shared = grids[0].filter((nm) => nm >= low - 1e-6 && nm <= high + 1e-6);
    if (!shared.length) throw new Sentence("the paints and the ground share no wavelengths");
    return shared;
  }

  // A coat's parts on a grid, each with its weight.
  parts(coat, stack, grid) {
    return Object.entries(coat.paint).map(([name, weight]) => {
      const paint = this.paint(name, stack.pigments);
      const on = (values) => (paint.wavelengths.length === grid.length && paint.wavelengths.every((nm, i) => nm === grid[i])
        ? values : grid.map((nm) => linear(paint.wavelengths, values, nm)));
      return { name, paint, weight, ...Object.fromEntries([...curves, ...errors].filter((key) => paint[key]).map((key) => [key, on(paint[key])])) };
    });
  }

  medium(coat, stack, grid) {
    const key = JSON.stringify([coat.paint, grid, Object.keys(coat.paint).map((name) => stack.pigments?.[name])]);
    if (!this.media.has(key)) {
      if (this.media.size > 200) this.media.delete(this.media.keys().next().value);
      this.media.set(key, medium(mixture(this.parts(coat, stack, grid))));
    }
    return this.media.get(key);
  }

  layers(stack, coats, grid) {
    return coats.map((coat) => ({ medium: this.medium(coat, stack, grid), thickness: coat.um * 1e-6 }));
  }

  // Weights of a lamp: a name, or one's own.
  under(lamp, grid) {
    const key = JSON.stringify([lamp, grid]);
    if (!this.weights.has(key)) {
      const found = typeof lamp === "string" ? this.data.lamps[lamp] : lamp;
      if (!found) throw new Sentence(`unknown illuminant '${lamp}'`);
      if (this.weights.size > 60) this.weights.delete(this.weights.keys().next().value);
      this.weights.set(key, colourWeights(grid, found, this.data.eye));
    }
    return this.weights.get(key);
  }

  // The ground's internal reflectance; of a card, that of its white half.
  level(stack, grid) {
    const { ground } = stack, { white, black } = this.data;
    if (typeof ground === "number") return ground;
    if (ground?.wavelengths) return grid.map((nm) => linear(ground.wavelengths, ground.reflectance, nm));
    return ground === "black" ? black : white;
  }

  // The stack on its ground, white and black, at the view's angles, and the three bare: what a hand on a slider waits for.
  see(stack, view) {
    const coats = this.shown(stack), grid = this.grid(stack, coats), layers = this.layers(stack, coats, grid);
    const geometry = parseGeometry(stack.geometry), index = stack.refractive_index, bands = grid.length;
    const angle = geometry.view === null ? { ...geometry, light: view.light } : { light: view.light, view: view.view, specular: geometry.specular };
    const [main, tilted] = reflect(layers, [geometry, angle], { index, bands }), [bare] = reflect([], [geometry], { index, bands });
    const { white, black } = this.data, level = this.level(stack, grid), grounds = [level, white, black];
    const spectra = [...grounds.map((ground) => over(main, ground)), over(tilted, level), ...grounds.map((ground) => over(bare, ground))];
    const lamps = view.lamps.map((lamp) => this.under(lamp, grid));
    const colours = lamps.map((weights) => spectra.map((spectrum) => looks(spectrum, weights)));
    const unsure = coats.flatMap((coat) => Object.keys(coat.paint).filter((name) => coat.paint[name] > 0));
    const doubts = [...new Set(unsure)].map((name) => [name, this.unknown(name)]).filter(([, bands]) => bands);
    return {
      wavelengths: grid,
      spectra,
      colours,
      delta: view.pinned ? deltaE2000(view.pinned, colours[0][0].lab) : null,
      doubts: doubts.map(([name, bands]) => `${name} at ${bands}: only k/s is known; thin coats may look different`),
      geometry: words(geometry),
    };
  }

  unknown(name) {
    return this.entries.get(name)?.unknown ?? "";
  }

  // What may come a moment later: the ladder of the repeated coat, and the 90 % band.
  rest(stack, view) {
    const coats = this.shown(stack), grid = this.grid(stack, coats), layers = this.layers(stack, coats, grid);
    const geometry = parseGeometry(stack.geometry), settings = { index: stack.refractive_index, bands: grid.length };
    const level = this.level(stack, grid), weights = this.under(view.lamps[0], grid);
    const seen = (given) => over(reflect(given, [geometry], settings)[0], level);
    const repeated = Math.min(view.repeated, coats.length - 1), most = this.data.thickest * 1e-6;
    const ladder = LADDER.map((count) => looks(seen(layers.map((layer, i) =>
      (i === repeated ? { ...layer, thickness: Math.min(count * layer.thickness, most) } : layer))), weights));
    return { ladder, ...this.deviation(stack, coats, { grid, layers, seen }) };
  }

  // Standard deviation of the spectrum by what is not known of its paints, to first order in log k and log s. Paints of
  // one provenance share their errors; where a paint has standard deviations alone, its bands count as independent.
  deviation(stack, coats, { grid, layers, seen }) {
    const mixed = coats.map((coat) => this.parts(coat, stack, grid).filter((part) => part.weight > 0));
    const silent = mixed.flat().find(({ paint }) => !paint.modes && !paint.absorption_sd);
    if (silent) return { sd: null, rest: `no 90 % band: how sure ${silent.name} is has not been stated` };
    const main = seen(layers), shared = new Map(), alone = new Map();
    mixed.forEach((parts, i) => {
      const whole = mixture(parts), total = parts.reduce((sum, part) => sum + part.weight, 0);
      const slopes = curves.map((what) => {
        const more = medium({ ...whole, [what]: whole[what].map((value) => value * (1 + STEP)) });
        const moved = seen(layers.map((layer, j) => (i === j ? { ...layer, medium: more } : layer)));
        return moved.map((value, band) => (value - main[band]) / STEP);
      });
      for (const part of parts) {
        // Slope by log k of this paint alone: its share of the coat's k.
        const own = curves.map((what, c) => slopes[c].map((slope, band) =>
          (slope * part.weight * part[what][band]) / (total * Math.max(whole[what][band], 1e-30))));
        if (part.paint.modes) {
          const change = this.modes(part.paint, grid, own), before = shared.get(part.paint.provenance);
          shared.set(part.paint.provenance, before ? before.map((mode, m) => mode.map((value, band) => value + change[m][band])) : change);
        } else {
          errors.forEach((key, c) => {
            const change = own[c].map((slope, band) => (slope * (part[key]?.[band] ?? 0)) / Math.max(part[curves[c]][band], 1e-30));
            const before = alone.get(part.name + key);
            alone.set(part.name + key, before ? before.map((value, band) => value + change[band]) : change);
          });
        }
      }
    });
    const changes = [...[...shared.values()].flat(), ...alone.values()];
    return { sd: grid.map((_, band) => Math.sqrt(changes.reduce((sum, change) => sum + change[band] ** 2, 0))), rest: "" };
  }

  // Change of the spectrum by each of a paint's error modes, which the page's data hold in 16 bits.
  modes(paint, grid, [byK, byS]) {
    paint.unpacked ??= new Int16Array(Uint8Array.from(atob(paint.modes), (letter) => letter.charCodeAt(0)).buffer);
    const bands = paint.wavelengths.length, found = [];
    const at = grid.map((nm) => paint.wavelengths.findIndex((one) => Math.abs(one - nm) < 1e-6 || one > nm));
    for (let m = 0; m * 2 * bands < paint.unpacked.length; m++) {
      const [k, s] = [m * 2 * bands, (m * 2 + 1) * bands];
      found.push(at.map((band, i) => paint.step * (paint.unpacked[k + band] * byK[i] + paint.unpacked[s + band] * byS[i])));
    }
    return found;
  }

  // 8-bit colour of a mixture that hides.
  masstone(paint, own) {
    const key = JSON.stringify([paint, Object.keys(paint).map((name) => own?.[name])]);
    if (!this.masstones.has(key)) {
      const stack = { pigments: own, ground: "white" }, coats = [{ paint, um: this.data.thickest }], grid = this.grid(stack, coats);
      const [found] = reflect(this.layers(stack, coats, grid), [parseGeometry("45:0")]);
      this.masstones.set(key, looks(over(found, this.data.white), this.under("D65", grid)).rgb);
    }
    return this.masstones.get(key);
  }

  // A paint as the shelf shows it: hiding, and as a thin glaze over white; whether sRGB lacks a colour.
  swatch(name, own) {
    const { wavelengths } = this.paint(name, own), stack = { pigments: own }, coat = { paint: { [name]: 1 } };
    const weights = this.under("D65", wavelengths), geometry = parseGeometry("45:0");
    return [this.data.thickest, THIN].map((um) =>
      looks(over(reflect(this.layers(stack, [{ ...coat, um }], wavelengths), [geometry])[0], this.data.white), weights));
  }
}

function words({ light, view, specular }) {
  if (view === null) return `an integrating sphere at ${light}°, specular ${specular ? "in" : "ex"}cluded`;
  return `light at ${light}°, view at ${view}°, ${specular ? "mirror reflection included" : "no mirror reflection"}`;
}
