// Coats over one another as small matrices: quick enough to be asked for each pixel, near enough to be looked at.
//
// Each coat is what it does by itself to the light's beam, to the view's, and to diffuse light in two patterns (`layer` in
// solver.js). Light between two coats is followed as these four alone; the coats themselves are exact.
import { LAYER, layer, outsideOf, parseGeometry } from "./solver.js";

const N = LAYER.length;

// Ranges of thickness that are kept with each paint.
const KEPT = 12;
const kept = new WeakMap();

/* Coats top first, each with the thicknesses `um` that it may have; `colour` then asks by their places in that list.
 * `grounds` are internal reflectances, `weights` of `colourWeights`. */
export class Layers {
  constructor(coats, grounds, weights, { geometry, index }) {
    const seen = parseGeometry(geometry);
    Object.assign(this, outsideOf(seen, index), { coats: coats.length, weights, bands: weights[0].length });
    this.layers = coats.map(({ medium, um }, i) => this.numbers(medium, um, { seen, geometry, index, top: i === 0 }));
    this.grounds = grounds.map((ground) => Float64Array.from({ length: this.bands }, (_, band) => (typeof ground === "number" ? ground : ground[band])));
    this.xyz = new Float64Array(3);
  }

  // A coat's numbers, each thickness's computed when it is asked for first.
  numbers(medium, um, { seen, geometry, index, top }) {
    if (!kept.has(medium)) kept.set(medium, new Map());
    const known = kept.get(medium), key = [geometry, index, top, um.length, um[0], um.at(-1)].join();
    let found = known.get(key);
    if (!found) {
      if (known.size >= KEPT) known.delete(known.keys().next().value);
      const size = this.bands * N, numbers = new Float64Array(um.length * size), there = new Uint8Array(um.length);
      const fill = (place) => {
        numbers.set(layer({ medium, thickness: um[place] * 1e-6 }, seen, { index, top }), place * size);
        there[place] = 1;
      };
      found = { numbers, there, fill };
      known.set(key, found);
    }
    return found;
  }

  // XYZ of the coats at `places` of their thicknesses, on one of the grounds; in an array that the next call overwrites.
  colour(places, side) {
    const { layers, bands, coats, rates, grounds, weights, xyz, factor, mirror } = this, [x, y, z] = weights;
    for (let i = 0; i < coats; i++) if (!layers[i].there[places[i]]) layers[i].fill(places[i]);
    let sumX = 0, sumY = 0, sumZ = 0;
    for (let band = 0; band < bands; band++) {
      // What lies below: beam to view, each to diffuse light, and diffuse light sent back.
      const ground = grounds[side][band];
      let s = (4 * ground) / (rates[0] * rates[1]), l0 = ground / rates[0], l1 = 0, v0 = ground / rates[1], v1 = 0, r00 = ground, r01 = 0, r11 = 0;
      for (let i = coats - 1; i >= 0; i--) {
        const g = layers[i].numbers, at = (places[i] * bands + band) * N;
        const a = g[at + 1], b = g[at + 2], p0 = g[at + 7], p1 = g[at + 8], q0 = g[at + 9], q1 = g[at + 10];
        const b00 = g[at + 11], b01 = g[at + 12], b11 = g[at + 13];
        // Diffuse light downwards that what lies below sends back, and both that way.
        const rp0 = r00 * p0 + r01 * p1, rp1 = r01 * p0 + r11 * p1, rq0 = r00 * q0 + r01 * q1, rq1 = r01 * q0 + r11 * q1;
        const up0 = a * l0 + rp0, up1 = a * l1 + rp1, vp0 = b * v0 + rq0, vp1 = b * v1 + rq1;
        // (1 - r back)^-1: between the coat and what lies below, to and fro.
        const m00 = 1 - (r00 * b00 + r01 * b01), m01 = -(r00 * b01 + r01 * b11), m10 = -(r01 * b00 + r11 * b01), m11 = 1 - (r01 * b01 + r11 * b11);
        const whole = 1 / (m00 * m11 - m01 * m10);
        const w0 = (m11 * vp0 - m01 * vp1) * whole, w1 = (m00 * vp1 - m10 * vp0) * whole;
        s = g[at] + a * b * s + 4 * (a * (l0 * q0 + l1 * q1) + b * (v0 * p0 + v1 * p1) + p0 * rq0 + p1 * rq1
          + up0 * (b00 * w0 + b01 * w1) + up1 * (b01 * w0 + b11 * w1));
        if (i === 0) break;
        const u0 = (m11 * up0 - m01 * up1) * whole, u1 = (m00 * up1 - m10 * up0) * whole;
        const t00 = g[at + 14], t01 = g[at + 15], t11 = g[at + 16];
        l0 = g[at + 3] + t00 * u0 + t01 * u1;
        l1 = g[at + 4] + t01 * u0 + t11 * u1;
        v0 = g[at + 5] + t00 * w0 + t01 * w1;
        v1 = g[at + 6] + t01 * w0 + t11 * w1;
        // r = back + T (1 - r back)^-1 r T.
        const c00 = (m11 * r00 - m01 * r01) * whole, c01 = (m11 * r01 - m01 * r11) * whole, c11 = (m00 * r11 - m10 * r01) * whole;
        const d00 = t00 * c00 + t01 * c01, d01 = t00 * c01 + t01 * c11, e00 = t01 * c00 + t11 * c01, e01 = t01 * c01 + t11 * c11;
        r00 = b00 + d00 * t00 + d01 * t01;
        r01 = b01 + d00 * t01 + d01 * t11;
        r11 = b11 + e00 * t01 + e01 * t11;
      }
      const value = factor * s + mirror;
      sumX += x[band] * value;
      sumY += y[band] * value;
      sumZ += z[band] * value;
    }
    xyz[0] = sumX;
    xyz[1] = sumY;
    xyz[2] = sumZ;
    return xyz;
  }
}
