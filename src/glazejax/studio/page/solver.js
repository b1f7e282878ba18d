/**
 * Light in layered paint: what coats over a ground reflect, and what colour that is. No dependencies, no state.
 *
 * ```js
 * import { colourWeights, looks, medium, parseGeometry, reflect, over, srgb } from "./solver.js";
 *
 * const blue = medium({ absorption, scattering }); // 1/m, a number for each band
 * const under = colourWeights(wavelengths, lamp, observer);
 * const [coats] = reflect([{ medium: blue, thickness: 2e-6 }], [parseGeometry("45:0")]);
 * const spectrum = over(coats, 0.93); // on a ground of this internal reflectance, a number or an array
 * const { rgb } = looks(spectrum, under);
 * ```
 *
 * Each coat is homogeneous and scatters isotropically, with its own absorption k and scattering s; all share one
 * refractive index, under a smooth surface; the ground is Lambertian. Collimated light falls in, and is seen from one
 * direction or by an integrating sphere. Light is followed in a dozen directions inside the paint (discrete ordinates in
 * even-parity form), each coat by its modes in closed form: an empty coat, an opaque one, one without absorption or
 * without scattering are nothing special. It is glazejax's default solver with fixed directions; method and sources are
 * in glazejax/radiative/ordinates/solver.py, and names of variables are the same.
 *
 * Licence: Apache-2.0, as glazejax.
 *
 * @typedef {object} Medium What a coat is made of; `medium` makes it.
 * @property {number} bands
 * @property {Float64Array} extinction k + s of each band, 1/m.
 * @property {Float64Array} albedo s/(k + s) of each band.
 *
 * @typedef {{medium: Medium, thickness: number | ArrayLike<number>}} Coat Thickness in metres, or several to try.
 *
 * @typedef {object} Geometry How paint is lit and seen.
 * @property {number} light Angle of the light from the normal, degrees.
 * @property {number | null} view Angle of the view; null where a sphere collects all that is reflected.
 * @property {boolean} specular Whether the surface's own mirror reflection is seen.
 *
 * @typedef {object} Coats What coats do, whatever lies below: R(ground) = bare + through ground/(1 - back ground).
 * @property {Float64Array} bare Reflectance of each band on a ground that reflects nothing; of each combination in turn
 *   where coats have several thicknesses.
 * @property {Float64Array} through Light that reaches the ground, times the share of what leaves it that is seen.
 * @property {Float64Array} back Share of what leaves the ground that comes back to it.
 */

/** Coats at most: as many as the studio shows; nothing in here depends on it. */
export const MOST_COATS = 8;

// Directions inside the paint --------------------------------------------------------------------------------------------

// Nodes that can leave the paint, and those that are totally reflected; below the second index the rise of the internal
// reflectance is steep and takes more.
const LEAVING = 5;
const TRAPPED = 5;
const NEAR_ONE = 1.07;
const LEAVING_NEAR_ONE = 12;
// How trapped nodes crowd towards grazing, where light fades fastest.
const CROWDING = 1.2;

/** Nodes, descending, and weights of Gauss's rule on [0, 1]. */
function gauss(count) {
  const nodes = [], weights = [];
  for (let i = 0; i < count; i++) {
    let x = Math.cos((Math.PI * (i + 0.75)) / (count + 0.5)), slope = 1;
    for (let step = 0; step < 20; step++) {
      let [before, now] = [1, x];
      for (let k = 2; k <= count; k++) [before, now] = [now, ((2 * k - 1) * x * now - (k - 1) * before) / k];
      slope = (count * (x * now - before)) / (x * x - 1);
      x -= now / slope;
    }
    nodes.push(0.5 * (1 + x));
    weights.push(1 / ((1 - x * x) * slope * slope));
  }
  return { nodes, weights };
}

/** The same, crowded at zero by x = (e^(c y^2) - 1)/(e^c - 1). */
function gradedGauss(count, c) {
  const { nodes, weights } = gauss(count), scale = Math.expm1(c);
  return {
    nodes: nodes.map((y) => Math.expm1(c * y * y) / scale),
    weights: weights.map((w, i) => (w * 2 * c * nodes[i] * Math.exp(c * nodes[i] ** 2)) / scale),
  };
}

/** Cosine inside a medium of a beam that comes from air. */
export function refracted(cosine, index) {
  return Math.sqrt((index - 1) * (index + 1) + cosine * cosine) / index;
}

/** Fresnel reflectance of a smooth surface for unpolarised light from air. */
export function fresnel(cosine, index) {
  const inside = index * refracted(cosine, index);
  const s = (cosine - inside) / (cosine + inside);
  const p = (index * index * cosine - inside) / (index * index * cosine + inside);
  return 0.5 * (s * s + p * p);
}

// Light that is stronger the steeper it falls, with light that is even: orthogonal to it, and of as much flux. By the
// cube of the cosine both what is left by clear paint and what the surface lets out are followed best.
function steepLight(mu, w) {
  const moment = (power) => w.reduce((sum, weight, i) => sum + 2 * weight * mu[i] ** (1 + power), 0), mean = moment(3);
  const size = Math.sqrt(moment(6) - mean * mean);
  return Float64Array.from(w, (weight, i) => (Math.sqrt(weight) * (mu[i] ** 3 - mean)) / size);
}

const surfaces = new Map();

/** Directions inside paint of an index: cosines `mu`, weights, and what the surface does to each. */
function surfaceOf(index) {
  if (surfaces.has(index)) return surfaces.get(index);
  const steep = index < NEAR_ONE;
  const leaving = steep ? gradedGauss(LEAVING_NEAR_ONE, 2.8) : gauss(LEAVING);
  const critical = Math.sqrt((index - 1) * (index + 1)) / index;
  const trapped = critical > 0 ? gradedGauss(TRAPPED, CROWDING) : { nodes: [], weights: [] };
  const inside = leaving.nodes.map((cosine) => refracted(cosine, index));
  const mu = [...inside, ...trapped.nodes.map((node) => critical * node)];
  let w = [
    ...leaving.weights.map((weight, i) => (weight * leaving.nodes[i]) / (index * index * inside[i])),
    ...trapped.weights.map((weight) => critical * weight),
  ];
  const reflected = [...leaving.nodes.map((cosine) => fresnel(cosine, index)), ...trapped.nodes.map(() => 1)];
  // Sums of w and of w mu are 1 and 1/2 exactly: without that, paint that absorbs nothing would lose light.
  const moment = (power) => w.reduce((sum, weight, i) => sum + weight * mu[i] ** power, 0);
  const [m0, m1, m2] = [moment(0), moment(1), moment(2)], whole = m0 * m2 - m1 * m1;
  const constant = ((1 - m0) * m2 - (0.5 - m1) * m1) / whole, linear = ((0.5 - m1) * m0 - (1 - m0) * m1) / whole;
  w = w.map((weight, i) => weight * (1 + constant + linear * mu[i]));
  const found = {
    index,
    n: mu.length,
    mu: Float64Array.from(mu),
    weights: Float64Array.from(w),
    root: Float64Array.from(w, Math.sqrt),
    poles: Float64Array.from(mu, (cosine) => 1 / (cosine * cosine)),
    strengths: Float64Array.from(w, (weight, i) => weight / (mu[i] * mu[i])),
    impedance: Float64Array.from(reflected, (r, i) => (1 - r) / ((1 + r) * mu[i])),
    letOut: Float64Array.from(reflected, (r, i) => (Math.sqrt(w[i]) * (1 - r)) / (1 + r)),
    steep: steepLight(mu, w),
  };
  found.room = workspace(found.n);
  surfaces.set(index, found);
  return found;
}

// One coat ---------------------------------------------------------------------------------------------------------------

/**
 * Paint, from its coefficients.
 *
 * @param {{absorption: ArrayLike<number>, scattering: ArrayLike<number>}} paint 1/m, a number for each band.
 * @returns {Medium} Keep it: its modes are computed once and kept with it.
 */
export function medium({ absorption, scattering }) {
  const extinction = Float64Array.from(absorption, (k, i) => k + scattering[i]);
  const albedo = Float64Array.from(scattering, (s, i) => (extinction[i] > 1e-12 ? s / extinction[i] : 0));
  return { bands: extinction.length, extinction, albedo, modes: new Map() };
}

/**
 * A mixture: coefficients add by weight.
 *
 * @param {{absorption: ArrayLike<number>, scattering: ArrayLike<number>, weight: number}[]} parts On the same bands.
 */
export function mixture(parts) {
  const total = parts.reduce((sum, part) => sum + part.weight, 0);
  const mixed = (what) => Float64Array.from(parts[0][what], (_, i) =>
    parts.reduce((sum, part) => sum + (part.weight / total) * part[what][i], 0));
  return { absorption: mixed("absorption"), scattering: mixed("scattering") };
}

/**
 * Modes of paint of albedo q: sigma = vectors y, y'' = decay y - source.
 *
 * The eigenvalues of diag(1/mu^2) - q z z^T lie one between each pair of poles 1/mu^2: roots of a secular equation, found
 * by the two-pole iteration of Bunch, Nielsen and Sorensen (Numer. Math. 31, 1978) for r = (pole - decay)/q.
 */
function modesOf(surface, q) {
  const { n, mu, weights, poles, strengths } = surface;
  const decay = new Float64Array(n), coupling = new Float64Array(n), vectors = new Float64Array(n * n);
  for (let j = 0; j < n; j++) {
    const gap = j ? poles[j] - poles[j - 1] : poles[0], limit = gap / Math.max(q, 1e-300);
    let r = j ? Math.min(strengths[j], 0.5 * limit) : limit;
    for (let step = 0; step < 9 && q > 0; step++) {
      let [s, p, pull, push] = [0, 0, 0, 0];
      for (let i = 0; i < n; i++) {
        if (i === j) continue;
        const apart = poles[i] - poles[j] + q * r, ratio = strengths[i] / apart, slope = ratio / apart;
        if (i > j) {
          s += slope;
          p += ratio - q * r * slope;
        } else {
          pull += slope;
          push += ratio;
        }
      }
      const rest = gap - q * r, near = strengths[j] + q * q * s * r * r, far = q * pull * rest * rest;
      const c = 1 - q * p - q * push - q * pull * rest, b = c * gap + near * q + far;
      const root = Math.sqrt(Math.max(b * b - 4 * c * q * near * gap, 0));
      const next = j === 0 ? near / c : b > 0 ? (2 * near * gap) / (b + root) : (0.5 * (b - root)) / (c * q);
      const moved = Math.abs(next - r);
      r = Math.min(Math.max(next, 1e-300), limit);
      if (moved < 1e-14 * r) break;
    }
    if (q === 0) r = strengths[j];
    decay[j] = poles[j] - q * r;
    let square = 0;
    for (let i = 0; i < n; i++) {
      const z = Math.sqrt(strengths[i]), value = i === j ? z / r : (q * z) / (poles[i] - poles[j] + q * r);
      vectors[i * n + j] = value;
      square += value * value;
    }
    coupling[j] = 1 / Math.sqrt(square);
    for (let i = 0; i < n; i++) vectors[i * n + j] *= coupling[j];
  }
  if (q > 0.7) {
    // The slowest mode vanishes with 1 - q: from there it keeps its digits.
    let second = 0;
    for (let i = 0; i < n; i++) second += (weights[i] * mu[i] ** 2) / (1 - decay[0] * mu[i] ** 2);
    decay[0] = (1 - q) / (q * second);
  }
  const turned = vectors.map((_, at) => vectors[(at % n) * n + Math.floor(at / n)]);
  const within = (diagonal) => {
    const scaled = turned.map((value, at) => value * diagonal[at % n]), found = new Float64Array(n * n);
    productTurned(found, scaled, turned, n);
    return found;
  };
  // The surface, and a ground, as these modes meet them.
  const under = within(surface.impedance), on = within(mu.map((cosine) => 1 / cosine));
  const [ground, steep] = [surface.root, surface.steep].map((pattern) => apply(new Float64Array(n), turned, pattern, n));
  return { decay, coupling, turned, under, on, ground, steep, after: new WeakMap() };
}

// One coat's modes in those of the coat above it; above the first are the directions themselves.
function turnBetween(modes, above, n) {
  if (!above) return modes.turned;
  let turn = modes.after.get(above);
  if (!turn) {
    turn = new Float64Array(n * n);
    productTurned(turn, modes.turned, above.turned, n);
    modes.after.set(above, turn);
  }
  return turn;
}

// (e^-aD - e^-bD)/(b - a), regular at a = b; the caller has expm1 of both.
function twoDecays(a, b, depth, fadedA, fadedB) {
  const x = (b - a) * depth;
  if (Math.abs(x) > 0.1) return (fadedA - fadedB) / (b - a);
  return depth * (1 + fadedA) * (x === 0 ? 1 : -Math.expm1(-x) / x);
}

// Modes slower than this take the form that is even in kappa; no beam resonates with them.
const SLOW = 0.25;
// Coats thinner than this, in units of mode and beam, take a series of what a beam excites.
const THIN = 1e-4;

/** Room for one coat's modes, made once. */
function workspace(n) {
  const vector = () => new Float64Array(n), matrix = () => new Float64Array(n * n);
  return {
    inner: matrix(), work: matrix(), lam: vector(), kappa: vector(), faded: vector(), tanh: vector(), sech: vector(),
    scale: vector(), through: vector(), even: vector(), ends: [],
  };
}

// Room for what one end of light does to a coat's modes.
function endRoom(n) {
  const [top, bottom, apart, driven, loads] = Array.from({ length: 5 }, () => new Float64Array(n));
  return { gone: 0, top, bottom, apart, driven, loads };
}

/**
 * A beam's work on the modes of a coat: integrals of e^(-a t) with the mode that is one at the top face and zero at the
 * bottom one, and the other way round; `apart` is int e^(-kappa (D - t)) e^(-a t).
 */
function excite(room, a, depth, end, n) {
  const { tanh, sech } = room, { top, bottom, apart, gone } = end;
  for (let j = 0; j < n; j++) {
    const lam = room.lam[j], kappa = room.kappa[j], faded = room.faded[j], fade = 1 + faded;
    apart[j] = twoDecays(kappa, a, depth, faded, gone);
    if (lam * depth * depth < THIN * THIN && a * depth < THIN) {
      const x = lam * depth * depth, y = a * depth;
      top[j] = depth * (1 / 2 - y / 6 + (y * y - x) / 24);
      bottom[j] = depth * (1 / 2 - y / 3 + (3 * y * y - x) / 24);
    } else if (lam < SLOW) {
      const bend = (lam * tanh[j]) / (1 + sech[j]), rate = -gone / tanh[j], divisor = a * a - lam;
      top[j] = (a - bend - sech[j] * rate) / divisor;
      bottom[j] = (rate - bend - a * (1 + gone)) / divisor;
    } else {
      const together = -(faded + gone + faded * gone) / (kappa + a), divisor = -faded * (1 + fade);
      top[j] = (together - fade * apart[j]) / divisor;
      bottom[j] = (apart[j] - fade * together) / divisor;
    }
  }
}

/** Light that a coat gives from beam a to beam b while its faces let no more of it in or out. */
function scatterWithin(room, coupling, a, b, one, other, q, n) {
  const { gone: goneA, apart } = one, { gone: goneB, top, bottom } = other;
  const single = -(goneA + goneB + goneA * goneB) / (a + b);
  let again = 0;
  for (let j = 0; j < n; j++) {
    const kappa = room.kappa[j], faded = room.faded[j], square = coupling[j] * coupling[j];
    if (room.lam[j] < SLOW) {
      again += (square * (top[j] + (1 + goneA) * bottom[j] - single)) / (a * a - room.lam[j]);
      continue;
    }
    const lesser = kappa < a ? -(faded + goneB + faded * goneB) / (kappa + b) : single;
    const area = (lesser - (1 + goneB) * apart[j]) / ((kappa < a ? a : kappa) + b);
    again += (square * (area - apart[j] * bottom[j])) / (a + kappa);
  }
  return q * (single + q * again);
}

// Matrices, n x n, row by row -----------------------------------------------------------------------------------------------

// out = a b^T, four sums at a time; of a symmetric one the lower half is enough.
function productTurned(out, a, b, n, lower = false) {
  for (let i = 0; i < n; i += 2) {
    const nextRow = i + 1 < n ? n : 0, end = lower ? i + 1 : n;
    for (let j = 0; j < end; j += 2) {
      const nextColumn = j + 1 < n ? n : 0;
      let p = i * n, q = j * n, s = 0, t = 0, u = 0, v = 0;
      for (let k = 0; k < n; k++, p++, q++) {
        const x = a[p], y = a[p + nextRow], z = b[q], w = b[q + nextColumn];
        s += x * z;
        t += x * w;
        u += y * z;
        v += y * w;
      }
      const at = i * n + j;
      out[at] = s;
      if (nextColumn) out[at + 1] = t;
      if (nextRow) out[at + n] = u;
      if (nextRow && nextColumn) out[at + n + 1] = v;
    }
  }
}

// a, of which the lower half is given, becomes minus its inverse, whole: sweeps of Gauss and Jordan. It is symmetric and
// positive definite, so no pivoting is needed.
function invertNegative(a, column, n) {
  for (let k = 0; k < n; k++) {
    const pivot = 1 / a[k * n + k];
    for (let i = 0; i < k; i++) column[i] = a[k * n + i];
    for (let i = k + 1; i < n; i++) column[i] = a[i * n + k];
    for (let i = 0; i < n; i++) {
      if (i === k) continue;
      const factor = column[i] * pivot, row = i * n;
      for (let j = 0; j <= i; j++) a[row + j] -= factor * column[j];
    }
    for (let i = 0; i < k; i++) a[k * n + i] = column[i] * pivot;
    for (let i = k + 1; i < n; i++) a[i * n + k] = column[i] * pivot;
    a[k * n + k] = -pivot;
  }
  for (let i = 1; i < n; i++) for (let j = 0; j < i; j++) a[j * n + i] = a[i * n + j];
}

// The lower half of a becomes L of a = L L^T.
function factorise(a, n) {
  for (let j = 0; j < n; j++) {
    for (let i = j; i < n; i++) {
      let sum = a[i * n + j];
      for (let k = 0; k < j; k++) sum -= a[i * n + k] * a[j * n + k];
      a[i * n + j] = i === j ? Math.sqrt(sum) : sum / a[j * n + j];
    }
  }
}

// out = L^-1 x.
function solveLower(out, a, x, n) {
  for (let i = 0; i < n; i++) {
    let sum = x[i];
    for (let k = 0; k < i; k++) sum -= a[i * n + k] * out[k];
    out[i] = sum / a[i * n + i];
  }
  return out;
}

// out = a x, row by row.
function apply(out, a, x, n) {
  for (let i = 0; i < n; i++) {
    let sum = 0;
    for (let k = 0; k < n; k++) sum += a[i * n + k] * x[k];
    out[i] = sum;
  }
  return out;
}

function dot(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
  return sum;
}

// Coats over one another -----------------------------------------------------------------------------------------------------

/**
 * What coats do to light, whatever they lie on.
 *
 * The half of the stack above a depth is delta = Z sigma - source there: it begins as the surface and takes in one coat
 * after the other, so that all geometries and all grounds share that work. Where coats have several thicknesses, every
 * combination is computed, and those that agree in their upper coats share these; the lowest coat's thickness changes first.
 *
 * @param {Coat[]} coats Top first; those of no thickness are absent.
 * @param {Geometry[]} geometries
 * @param {{index?: number, bands?: number}} [settings] Refractive index of the paint, from 1 to 2.5; number of bands,
 *   where there may be no coat.
 * @returns {Coats[]} One for each geometry.
 */
export function reflect(coats, geometries, { index = 1.5, bands = coats[0]?.medium.bands ?? 1 } = {}) {
  const surface = surfaceOf(index), { n, room } = surface;
  const tried = coats.map(({ thickness }) => (typeof thickness === "number" ? [thickness] : thickness));
  const count = tried.reduce((product, { length }) => product * length, 1);
  const paths = geometries.map((geometry) => lightPath(geometry, surface, bands * count));
  const optics = { rates: paths.flatMap(({ rates }) => rates), pairs: paths.map((_, g) => [2 * g, 2 * g + 1]) };
  const halves = [null, ...coats].map(() => emptyHalf(optics, surface)), [first] = halves;
  for (let i = 0; i < n; i++) first.matrix[i * n + i] = surface.impedance[i];
  paths.forEach(({ outside }, g) => first.source[2 * g + 1].set(outside));
  let at = 0;
  for (let band = 0; band < bands; band++) {
    at = band;
    descend(0, first, band);
  }
  return paths.map((path) => path.coats);

  function descend(depth, half, band) {
    if (depth === coats.length) {
      meetGround(half);
      at += bands;
      return;
    }
    const paint = coats[depth].medium;
    for (const thickness of tried[depth]) {
      const thick = paint.extinction[band] * thickness, below = halves[depth + 1];
      if (thick > ABSENT) takeIn(room, half, below, optics, modesAt(paint, surface, band), paint.albedo[band], thick, n);
      descend(depth + 1, thick > ABSENT ? below : half, band);
    }
  }

  // Below lies a ground that reflects nothing, or one that sends light into all directions evenly.
  function meetGround(half) {
    const { even, ends } = room, work = belowFactor(surface, half), { modes, source, left, total } = half;
    solveLower(even, work, modes ? modes.ground : surface.root, n);
    const within = dot(even, even);
    for (let g = 0; g < paths.length; g++) {
      const { rates, factor, mirror, coats: found } = paths[g], [one, other] = [ends[2 * g], ends[2 * g + 1]];
      solveLower(one.loads, work, source[2 * g], n);
      solveLower(other.loads, work, source[2 * g + 1], n);
      const light = left[2 * g] / rates[0], view = rates[1] ? left[2 * g + 1] / rates[1] : 0;
      // A ground adds 4 rho/(1 + rho) times one pattern of directions: Sherman and Morrison's formula, in rho.
      found.bare[at] = factor * (total[g] + dot(one.loads, other.loads)) + mirror;
      found.through[at] = 4 * factor * (light + dot(even, one.loads)) * (view + dot(even, other.loads));
      found.back[at] = 4 * within - 1;
    }
  }
}

/** A half of the stack: its matrix in the modes of its lowest coat; for each end of light what drives the half, and what
 * is left of a beam; and for each pair of ends what has gone from one to the other already. */
function emptyHalf({ rates, pairs }, { n, room: { ends } }) {
  while (ends.length < rates.length) ends.push(endRoom(n));
  const source = rates.map(() => new Float64Array(n)), left = new Float64Array(rates.length).fill(1);
  return { matrix: new Float64Array(n * n), modes: null, inside: false, source, left, total: new Float64Array(pairs.length) };
}

// Factor L of the half over paint that reflects nothing.
function belowFactor({ n, mu, room: { work } }, { matrix, modes }) {
  for (let i = 0; i < n * n; i++) work[i] = matrix[i] + (modes ? modes.on[i] : i % (n + 1) ? 0 : 1 / mu[i / (n + 1)]);
  factorise(work, n);
  return work;
}

// Coats of less optical thickness are as good as absent.
const ABSENT = 1e-10;

/** Numbers of a coat by itself that `layer` gives, in this order: light from the beam to the view; what is left of both;
 * what of each becomes diffuse upwards, and downwards; diffuse light sent back, and let through. Diffuse light is two
 * patterns, even and steep. */
export const LAYER = ["beam", "leftLight", "leftView", "upLight", "upLightSteep", "upView", "upViewSteep", "downLight", "downLightSteep",
  "downView", "downViewSteep", "back", "backMixed", "backSteep", "pass", "passMixed", "passSteep"];

/**
 * A coat by itself, as what it does to two beams and to diffuse light in two patterns: coats over one another are then
 * products of small matrices (`layers.js`), a hundred times as quick and good to CIEDE2000 of some .3.
 *
 * @param {Coat} coat Of one thickness.
 * @param {Geometry} geometry
 * @param {{index: number, top: boolean}} settings Whether the coat lies under the surface; else within paint.
 * @returns {Float64Array} `LAYER`'s numbers of each band in turn.
 */
export function layer({ medium: paint, thickness }, geometry, { index, top }) {
  const surface = surfaceOf(index), { n, mu, room, root, steep } = surface, { rates: seen } = lightPath(geometry, surface, 1);
  const sphere = !seen[1], rates = top ? seen : [seen[0], seen[1] || seen[0], 0, 0];
  // Under the surface light comes from above as beams only, and a sphere collects what is let out.
  const patterns = top ? [null, sphere ? surface.letOut : null] : [null, null, root, steep];
  const optics = { rates, pairs: top ? [[0, 1]] : [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3]] };
  const found = new Float64Array(paint.bands * LAYER.length), [above, below] = [0, 1].map(() => emptyHalf(optics, surface));
  above.inside = !top;
  for (let i = 0; i < n; i++) above.matrix[i * n + i] = top ? surface.impedance[i] : 1 / mu[i];
  patterns.forEach((pattern, i) => { if (pattern) above.source[i].set(pattern); });
  const [inEven, inSteep, ...loads] = Array.from({ length: 2 + rates.length }, () => new Float64Array(n));
  for (let band = 0, at = 0; band < paint.bands; band++, at += LAYER.length) {
    const thick = paint.extinction[band] * thickness, there = thick > ABSENT, half = there ? below : above;
    const modes = there ? modesAt(paint, surface, band) : null;
    if (there) takeIn(room, above, below, optics, modes, paint.albedo[band], thick, n);
    const work = belowFactor(surface, half);
    solveLower(inEven, work, there ? modes.ground : root, n);
    solveLower(inSteep, work, there ? modes.steep : steep, n);
    loads.forEach((load, i) => solveLower(load, work, half.source[i], n));
    optics.pairs.forEach(([i, j], pair) => { found[at + (pair && pair + 2)] = half.total[pair] + dot(loads[i], loads[j]); });
    found[at + 1] = half.left[0];
    found[at + 2] = rates[1] ? half.left[1] : 0;
    for (let i = 0; i < 2; i++) {
      found[at + 7 + 2 * i] = dot(inEven, loads[i]);
      found[at + 8 + 2 * i] = dot(inSteep, loads[i]);
    }
    found[at + 11] = 4 * dot(inEven, inEven) - 1;
    found[at + 12] = 4 * dot(inEven, inSteep);
    found[at + 13] = 4 * dot(inSteep, inSteep) - 1;
    if (top) continue;
    found[at + 14] = 4 * dot(inEven, loads[2]);
    found[at + 15] = 4 * dot(inEven, loads[3]);
    found[at + 16] = 4 * dot(inSteep, loads[3]);
  }
  return found;
}

/** Factor of a spectrum that `layers.js` gives, what the surface adds, and 1/cosines inside of its two beams. */
export function outsideOf(geometry, index) {
  const { factor, mirror, rates } = lightPath(geometry, surfaceOf(index), 1);
  return { factor, mirror, rates: [rates[0], rates[1] || rates[0]] };
}

/** Light's way in and out for a geometry: two ends, beams by their 1/cosine inside the paint; a sphere's has none. */
function lightPath({ light, view, specular }, { n, index, letOut }, bands) {
  const cosines = (view === null ? [light] : [light, view]).map((angle) => Math.cos((angle * Math.PI) / 180));
  const beams = cosines.map((cosine) => 1 / refracted(cosine, index));
  const letIn = cosines.map((cosine, i) => (1 - fresnel(cosine, index)) * beams[i]);
  const mirrored = specular && (view === null || view === light);
  return {
    rates: [beams[0], beams[1] ?? 0],
    factor: view === null ? letIn[0] : (letIn[0] * letIn[1]) / (4 * index * index),
    mirror: mirrored ? fresnel(cosines[0], index) : 0,
    // A sphere sees whatever is let out.
    outside: view === null ? letOut : new Float64Array(n),
    coats: { bare: new Float64Array(bands), through: new Float64Array(bands), back: new Float64Array(bands) },
  };
}

function modesAt(paint, surface, band) {
  if (!paint.modes.has(surface.index)) paint.modes.set(surface.index, []);
  return (paint.modes.get(surface.index)[band] ??= modesOf(surface, paint.albedo[band]));
}

/** The half above takes in a coat and becomes `below`. */
function takeIn(room, above, below, { rates, pairs }, modes, q, depth, n) {
  const { inner, work, scale, through, tanh, sech, even, ends } = room, { decay, coupling } = modes;
  for (let j = 0; j < n; j++) {
    const lam = decay[j], kappa = Math.sqrt(Math.max(lam, 1e-300));
    const faded = Math.expm1(-kappa * depth), fade = 1 + faded, norm = 1 / (1 + fade * fade);
    tanh[j] = kappa * depth < 1e-20 ? depth : (-faded * (1 + fade) * norm) / kappa;
    sech[j] = 2 * fade * norm;
    room.lam[j] = lam;
    room.kappa[j] = kappa;
    room.faded[j] = faded;
    scale[j] = Math.sqrt(tanh[j] / depth);
    through[j] = sech[j] / scale[j];
  }
  // The half in the coat's modes, and (1 + D Z)^-1, here with a minus.
  const turn = turnBetween(modes, above.modes, n);
  if (above.modes) {
    productTurned(work, turn, above.matrix, n);
    productTurned(inner, work, turn, n, true);
  } else inner.set(above.inside ? modes.on : modes.under);
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) inner[i * n + j] *= depth * scale[i] * scale[j];
    inner[i * n + i] += 1;
  }
  invertNegative(inner, even, n);
  for (let e = 0; e < rates.length; e++) {
    const end = ends[e], rate = rates[e], strength = rate ? q * above.left[e] : 0;
    apply(end.driven, turn, above.source[e], n);
    if (rate) {
      end.gone = Math.expm1(-rate * depth);
      excite(room, rate, depth, end, n);
      for (let j = 0; j < n; j++) end.driven[j] += strength * coupling[j] * end.top[j];
      below.left[e] = above.left[e] * (1 + end.gone);
    }
    for (let j = 0; j < n; j++) end.driven[j] *= scale[j];
    apply(end.loads, inner, end.driven, n);
    for (let j = 0; j < n; j++) below.source[e][j] = (rate ? strength * coupling[j] * end.bottom[j] : 0) - through[j] * end.loads[j];
  }
  for (let p = 0; p < pairs.length; p++) {
    const a = pairs[p][0], b = pairs[p][1], one = ends[a], other = ends[b];
    const within = rates[a] && rates[b] ? above.left[a] * above.left[b] * scatterWithin(room, coupling, rates[a], rates[b], one, other, q, n) : 0;
    below.total[p] = above.total[p] + within - depth * dot(other.driven, one.loads);
  }
  // Z = lambda T + S Z (1 + D Z)^-1 S, in the coat's modes.
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < n; j++) below.matrix[i * n + j] = (inner[i * n + j] * through[i] * through[j]) / depth;
    below.matrix[i * n + i] += (through[i] * through[i]) / depth + room.lam[i] * tanh[i];
  }
  below.modes = modes;
}

/**
 * Coats on a ground.
 *
 * @param {Coats} coats
 * @param {number | ArrayLike<number>} ground Internal reflectance: a usual white card has .93, a black one .025.
 * @returns {Float64Array} Reflectance factor, or reflectance for a sphere, of each band.
 */
export function over({ bare, through, back }, ground) {
  return bare.map((value, i) => {
    const rho = typeof ground === "number" ? ground : ground[i];
    return value + (through[i] * rho) / (1 - back[i] * rho);
  });
}

/**
 * Words for a geometry: `45:0`, `d:8` or `di:8` (a sphere, gloss included), `de:8` (excluded), `30:30:specular`.
 *
 * @returns {Geometry | null} null where they name none.
 */
export function parseGeometry(text) {
  const parts = String(text).replaceAll("/", ":").split(":").map((part) => part.trim().toLowerCase().replace(/°$/, ""));
  const mirror = parts.length === 3 && parts[2] === "specular";
  const pair = mirror ? parts.slice(0, 2) : parts, spheres = { d: true, di: true, de: false };
  const sphere = pair.filter((part) => part in spheres), angles = pair.filter((part) => !(part in spheres)).map(Number);
  if (pair.length !== 2 || pair.includes("") || !angles.length || (sphere.length && mirror)) return null;
  if (!angles.every((angle) => angle >= 0 && angle < 90) || (mirror && angles[0] !== angles[1])) return null;
  return sphere.length ? { light: angles[0], view: null, specular: spheres[sphere[0]] } : { light: angles[0], view: angles[1], specular: mirror };
}

// Colour -------------------------------------------------------------------------------------------------------------------

/**
 * Weights that turn reflectance into XYZ under a lamp, Y = 1 for white: ASTM E2022's on even grids, the same way on others.
 *
 * @param {ArrayLike<number>} wavelengths nm, ascending, of the spectra.
 * @param {{wavelengths: ArrayLike<number>, power: ArrayLike<number>}} lamp Relative power, linear between its bands.
 * @param {{start: number, x: ArrayLike<number>, y: ArrayLike<number>, z: ArrayLike<number>}} observer Colour matching
 *   functions at every nanometre from `start`.
 * @returns {Float64Array[]} For X, Y and Z, a number for each band; their sums are the white point.
 */
export function colourWeights(wavelengths, lamp, observer) {
  const bands = wavelengths.length, last = bands - 1, weights = [0, 1, 2].map(() => new Float64Array(bands));
  const curves = [observer.x, observer.y, observer.z];
  const power = Float64Array.from(observer.y, (_, i) => linear(lamp.wavelengths, lamp.power, observer.start + i));
  const scale = 1 / dot(power, observer.y);
  for (let i = 0; i < power.length; i++) {
    // Lagrange's cubic through the four nearest bands, a parabola at the ends, constant beyond.
    const x = Math.min(Math.max(observer.start + i, wavelengths[0]), wavelengths[last]);
    let left = 0;
    while (left < last - 1 && wavelengths[left + 1] <= x) left++;
    const nodes = [left - 1, left, left + 1, left + 2].filter((node) => node >= 0 && node <= last);
    for (const node of nodes) {
      let term = scale * power[i];
      for (const other of nodes) if (other !== node) term *= (x - wavelengths[other]) / (wavelengths[node] - wavelengths[other]);
      for (let c = 0; c < 3; c++) weights[c][node] += term * curves[c][i];
    }
  }
  return weights;
}

/** Values at x of a curve, linear between its points and constant beyond them. */
export function linear(points, values, x) {
  let right = 0;
  while (right < points.length && points[right] <= x) right++;
  if (right === 0) return values[0];
  if (right === points.length) return values[right - 1];
  const share = (x - points[right - 1]) / (points[right] - points[right - 1]);
  return values[right - 1] + share * (values[right] - values[right - 1]);
}

/** XYZ of a spectrum. */
export function xyz(spectrum, weights) {
  return weights.map((each) => dot(each, spectrum));
}

/** XYZ of white under the lamp of these weights. */
export function whiteOf(weights) {
  return weights.map((each) => each.reduce((sum, value) => sum + value, 0));
}

/** CIE 1976 L*a*b* of XYZ relative to a white. */
export function lab(values, white) {
  const [x, y, z] = values.map((value, i) => {
    const ratio = value / white[i];
    return ratio <= (6 / 29) ** 3 ? ratio / (3 * (6 / 29) ** 2) + 4 / 29 : Math.cbrt(ratio);
  });
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

/** XYZ of L*a*b* relative to a white: `lab` backwards. */
export function xyzOfLab([lightness, a, b], white) {
  const y = (lightness + 16) / 116;
  return [y + a / 500, y, y - b / 200].map((value, i) => white[i] * (value <= 6 / 29 ? 3 * (6 / 29) ** 2 * (value - 4 / 29) : value ** 3));
}

// XYZ to linear sRGB (IEC 61966-2-1, from its primaries), its white, and Bradford's cones.
const SCREEN = [[3.2409699419045226, -1.537383177570094, -0.4986107602930034], [-0.9692436362808796, 1.8759675015077202, 0.04155505740717559],
  [0.05563007969699366, -0.20397695888897652, 1.0569715142428786]];
export const SCREEN_WHITE = [0.9504559270516716, 1, 1.0890577507598784];
const CONES = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
const CONES_BACK = [[0.9869929054667121, -0.14705425642099013, 0.15996265166373122],
  [0.43230526972339456, 0.5183602715367776, 0.049291228212855594], [-0.008528664575177328, 0.04004282165408487, 0.96848669578755]];
const times = (matrix, vector) => matrix.map((row) => row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2]);

/** Linear sRGB of XYZ under a white, adapted by Bradford's method. */
export function linearSrgb(values, white) {
  const [seen, given, wanted] = [values, white, SCREEN_WHITE].map((one) => times(CONES, one));
  return times(SCREEN, times(CONES_BACK, seen.map((cone, i) => (cone * wanted[i]) / given[i])));
}

/** A linear value as a screen's, from 0 to 1. */
export function encode(light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055;
}

/** Encoded sRGB of XYZ under a white; outside [0, 1] where a screen cannot show it. */
export function srgb(values, white) {
  return linearSrgb(values, white).map(encode);
}

/** CIE 1976 L*a*b* of encoded sRGB, from 0 to 1. */
export function labOfSrgb(encoded) {
  const light = encoded.map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
  return lab(times(SCREEN_BACK, light), SCREEN_WHITE);
}
const SCREEN_BACK = [[0.41239079926595934, 0.357584339383878, 0.1804807884018343], [0.21263900587151027, 0.715168678767756, 0.07219231536073371],
  [0.01933081871559182, 0.11919477979462598, 0.9505321522496607]];

/**
 * A spectrum's colour: XYZ, L*a*b*, encoded sRGB as it is, and in 8 bits.
 *
 * @param {ArrayLike<number>} spectrum
 * @param {Float64Array[]} weights Of `colourWeights`.
 */
export function looks(spectrum, weights) {
  const white = whiteOf(weights), values = xyz(spectrum, weights), encoded = srgb(values, white);
  return { xyz: values, lab: lab(values, white), encoded, rgb: encoded.map((value) => Math.round(255 * Math.min(1, Math.max(0, value)))) };
}

/** CIEDE2000 between two L*a*b* (G. Sharma, W. Wu, E. N. Dalal, Color Research and Application 30 (2005) 21). */
export function deltaE2000([l1, a1, b1], [l2, a2, b2]) {
  const rad = Math.PI / 180, bend = (chroma) => Math.sqrt(chroma ** 7 / (chroma ** 7 + 25 ** 7));
  const stretch = 1 + (1 - bend((Math.hypot(a1, b1) + Math.hypot(a2, b2)) / 2)) / 2;
  const [c1, c2] = [Math.hypot(stretch * a1, b1), Math.hypot(stretch * a2, b2)];
  const [h1, h2] = [[a1, b1], [a2, b2]].map(([a, b]) => (Math.atan2(b, stretch * a) / rad + 360) % 360);
  const grey = c1 * c2 === 0;
  let turn = grey ? 0 : h2 - h1;
  turn += turn > 180 ? -360 : turn < -180 ? 360 : 0;
  const total = h1 + h2, far = total < 360 ? total + 360 : total - 360;
  const hue = grey ? total : (Math.abs(h1 - h2) > 180 ? far : total) / 2, chroma = (c1 + c2) / 2;
  const cos = (factor, shift) => Math.cos((factor * hue + shift) * rad);
  const weight = 1 - 0.17 * cos(1, -30) + 0.24 * cos(2, 0) + 0.32 * cos(3, 6) - 0.2 * cos(4, -63);
  const middle = ((l1 + l2) / 2 - 50) ** 2;
  const byLightness = (l2 - l1) / (1 + (0.015 * middle) / Math.sqrt(20 + middle));
  const byChroma = (c2 - c1) / (1 + 0.045 * chroma);
  const byHue = (2 * Math.sqrt(c1 * c2) * Math.sin((turn / 2) * rad)) / (1 + 0.015 * chroma * weight);
  const rotation = -2 * bend(chroma) * Math.sin(60 * Math.exp(-(((hue - 275) / 25) ** 2)) * rad);
  return Math.sqrt(byLightness ** 2 + byChroma ** 2 + byHue ** 2 + rotation * byChroma * byHue);
}
