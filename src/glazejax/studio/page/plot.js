// The spectrum: one line with its 90 % band, and thin ones over white and black. No colour but the paint's own.
import { el, svg } from "./dom.js";

const [W, H, LEFT, BOTTOM, TOP, RIGHT] = [700, 220, 34, 26, 8, 6];
const NINETY = 1.6448536269514722;

export function spectrumPlot() {
  const picture = svg("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", class: "plot" });
  const words = el("p.under");
  const node = el("div.spectrum", {}, picture, words);

  function show(seen, store) {
    const grid = seen.wavelengths, [low, high] = [grid[0], grid[grid.length - 1]];
    const row = (i) => seen.spectra[i];
    const most = Math.max(1, ...seen.spectra.map((each) => Math.max(...each))) > 1.02 ? 1.2 : 1;
    const x = (nm) => LEFT + ((nm - low) / (high - low || 1)) * (W - LEFT - RIGHT);
    const y = (r) => TOP + (1 - r / most) * (H - TOP - BOTTOM);
    const path = (values) => [...values].map((r, i) => `${i ? "L" : "M"}${x(grid[i]).toFixed(1)} ${y(r).toFixed(1)}`).join("");
    const parts = [];
    for (let r = 0; r <= most + 1e-9; r += 0.2) {
      parts.push(svg("line", { x1: LEFT, x2: W - RIGHT, y1: y(r), y2: y(r), class: "grid" }));
      const text = svg("text", { x: LEFT - 6, y: y(r) + 4, "text-anchor": "end" });
      text.textContent = r.toFixed(1);
      parts.push(text);
    }
    for (let nm = Math.ceil(low / 50) * 50; nm <= high; nm += 50) {
      const text = svg("text", { x: x(nm), y: H - 8, "text-anchor": nm > high - 20 ? "end" : "middle" });
      text.textContent = nm + 50 > high ? `${nm} nm` : nm;
      parts.push(svg("line", { x1: x(nm), x2: x(nm), y1: H - BOTTOM, y2: H - BOTTOM + 4, class: "tick" }), text);
    }
    const main = row(0);
    if (seen.sd) {
      const upper = main.map((r, i) => Math.min(most, r + NINETY * seen.sd[i]));
      const lower = main.map((r, i) => Math.max(0, r - NINETY * seen.sd[i]));
      const back = [...lower].map((r, i) => `L${x(grid[i]).toFixed(1)} ${y(r).toFixed(1)}`).reverse().join("");
      parts.push(svg("path", { d: `${path(upper)}${back}Z`, class: "band", "data-at": "band" }));
    }
    const card = store.stack.ground === "card";
    if (!card) parts.push(svg("path", { d: path(row(1)), class: "thin" }));
    parts.push(svg("path", { d: path(row(2)), class: "thin dashed" }));
    parts.push(svg("path", { d: path(main), class: "main", "data-at": "curve" }));
    picture.replaceChildren(...parts);
    picture.setAttribute("aria-label", `Reflectance from ${low} to ${high} nm, between ${Math.min(...main).toFixed(2)} and ${Math.max(...main).toFixed(2)}`);
    const band = seen.sd ? "grey: 90 % band of the catalogue's errors" : seen.rest;
    words.textContent = `line: reflectance ${card ? "over white" : "on the ground"}; dashed: over black${card ? "" : "; thin: over white"}${band ? `; ${band}` : ""}`;
  }
  return { node, show };
}
