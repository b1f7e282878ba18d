// Small helpers: elements, numbers in words, colours for CSS.

export function el(tag, given = {}, ...children) {
  const [name, ...classes] = tag.split(".");
  const node = document.createElement(name || "div");
  if (classes.length) node.className = classes.join(" ");
  for (const [key, value] of Object.entries(given)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key in node && key !== "list" && key !== "form" && !key.includes("-")) node[key] = value;
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

export function svg(tag, given = {}, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(given)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

const ICONS = {
  copy: "M5.5 5.5h7v7h-7zM3 10V3h7",
  show: "M1.5 8s2.5-4 6.5-4 6.5 4 6.5 4-2.5 4-6.5 4-6.5-4-6.5-4zM8 6.2a1.8 1.8 0 1 0 0 3.6 1.8 1.8 0 1 0 0-3.6",
  hidden: "M1.5 8s2.5-4 6.5-4 6.5 4 6.5 4-2.5 4-6.5 4-6.5-4-6.5-4zM2.5 13.5l11-11",
  remove: "M4 4l8 8M12 4l-8 8",
};
export function icon(name) {
  return svg("svg", { viewBox: "0 0 16 16", class: "icon", "aria-hidden": "true" }, svg("path", { d: ICONS[name] }));
}

// A number and its unit stay on one line.
export function thickness(um) {
  if (um >= 1000) return `${+(um / 1000).toPrecision(3)}\u00a0mm`;
  return um >= 0.1 || um === 0 ? `${+um.toPrecision(3)}\u00a0µm` : `${+(um * 1000).toPrecision(3)}\u00a0nm`;
}

export function hex(rgb) {
  return "#" + [...rgb].map((value) => Math.round(value).toString(16).padStart(2, "0")).join("");
}

// Black or white, whichever is read on a colour: by the luminance at which both have the same contrast.
export function inkOn(rgb) {
  const [r, g, b] = [...rgb].map((value) => (value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.179 ? "#000" : "#fff";
}

// Unclipped sRGB that a screen cannot show: by more than half a step of 255.
export function outside(encoded) {
  return [...encoded].some((value) => value < -0.002 || value > 1.002);
}

// A wide screen gets the colour itself, any other the nearest that sRGB has.
const wide = matchMedia("(color-gamut: p3)").matches;
export function css(rgb, encoded) {
  if (!wide || !encoded || !outside(encoded)) return hex(rgb);
  // Below zero the server follows the straight part of the encoding, and CSS mirrors the curve.
  const mirrored = [...encoded].map((value) => {
    const light = -value / 12.92;
    return value >= 0 || light <= 0.0031308 ? value : -(1.055 * light ** (1 / 2.4) - 0.055);
  });
  return `color(srgb ${mirrored.join(" ")})`;
}

export function context2d(canvas) {
  return canvas.getContext("2d", { colorSpace: wide ? "display-p3" : "srgb", willReadFrequently: true });
}

export function save(name, content, type) {
  const link = el("a", { download: name, href: URL.createObjectURL(new Blob([content], { type })) });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
