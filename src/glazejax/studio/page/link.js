// All that is on the page as a link: the stack, how it is looked at, and what was brushed, as small pictures.
import { checkLamp } from "./check.js";
import { Sentence } from "./seen.js";
import { MOST_UM, SIZE, freshView } from "./store.js";

// Pixels along a map in a link, the most that fit; and the letters of a link that every program still carries.
const SMALL = [128, 64, 32];
const MOST_LETTERS = 60000;
const TABS = ["canvas", "backwards", "away"];

const isAngle = (value) => typeof value === "number" && value >= 0 && value <= 85;

// What a map of thickness looks like: white is `top` µm. Kept with the map, which no stroke changes once it has ended.
const pictures = new WeakMap();
function mapToPicture(map, small) {
  if (!pictures.has(map)) pictures.set(map, new Map());
  const known = pictures.get(map);
  if (!known.has(small)) known.set(small, drawMap(map, small));
  return known.get(small);
}
function drawMap(map, small) {
  const canvas = Object.assign(document.createElement("canvas"), { width: small, height: small });
  const pen = canvas.getContext("2d"), image = pen.createImageData(small, small), step = SIZE / small;
  const top = map.reduce((most, value) => Math.max(most, value), 1e-6);
  for (let i = 0; i < small * small; i++) {
    const from = (Math.floor(i / small) * SIZE + (i % small)) * step;
    let sum = 0;
    for (let row = 0; row < step; row++) for (let column = 0; column < step; column++) sum += map[from + row * SIZE + column];
    image.data.fill(Math.round((255 * sum) / (step * step * top)), 4 * i, 4 * i + 3);
    image.data[4 * i + 3] = 255;
  }
  pen.putImageData(image, 0, 0);
  // With letters that an address need not write as three.
  return { top: +top.toPrecision(4), png: canvas.toDataURL("image/png").split(",")[1].replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "") };
}

async function pictureToMap({ top, png }) {
  if (!(top > 0 && top <= MOST_UM) || typeof png !== "string") throw new Sentence("what was brushed cannot be read from the link");
  const bytes = Uint8Array.from(atob(png.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0)), image = await createImageBitmap(new Blob([bytes]));
  const pen = Object.assign(document.createElement("canvas"), { width: SIZE, height: SIZE }).getContext("2d", { willReadFrequently: true });
  pen.drawImage(image, 0, 0, SIZE, SIZE);
  const { data } = pen.getImageData(0, 0, SIZE, SIZE);
  return Float32Array.from({ length: SIZE * SIZE }, (_, i) => (data[4 * i] / 255) * top);
}

// What differs from the view that the page begins with.
function viewOf(store) {
  const { view, ownLamps, pinned } = store, usual = freshView(), found = {};
  for (const key of Object.keys(usual)) if (JSON.stringify(view[key]) !== JSON.stringify(usual[key])) found[key] = view[key];
  const own = view.lamps.filter((name) => ownLamps[name]).map((name) => ownLamps[name]);
  if (own.length) found.own = own;
  if (TABS.includes(store.tab)) found.tab = store.tab;
  if (pinned) found.pinned = pinned.lab.map((value) => +value.toFixed(3));
  return found;
}

/* The link, and pixels along what was brushed in it: 0 where that did not fit, null where nothing was. */
export function writeLink(store) {
  const view = viewOf(store), plain = `#${encodeURIComponent(JSON.stringify(store.plain()))}`;
  const whole = (given) => (Object.keys(given).length ? `${plain}&view=${encodeURIComponent(JSON.stringify(given))}` : plain);
  const maps = store.stack.coats.map((coat, i) => [i, store.maps.get(coat.id)]).filter(([, map]) => map);
  if (!maps.length) return { link: whole(view), pixels: null };
  for (const pixels of SMALL) {
    const link = whole({ ...view, maps: maps.map(([i, map]) => ({ coat: i, ...mapToPicture(map, pixels) })) });
    if (link.length <= MOST_LETTERS) return { link, pixels };
  }
  return { link: whole(view), pixels: 0 };
}

// The texts of a link's stack and view.
export function readLink(fragment) {
  return fragment.split("&view=").slice(0, 2).map((part) => {
    try {
      return decodeURIComponent(part);
    } catch {
      return part;
    }
  });
}

// Look as a link says.
export async function takeView(text, store) {
  let given = null;
  try {
    given = JSON.parse(text);
  } catch {
    throw new Sentence("how the link looks at its stack cannot be read: it was cut short");
  }
  for (const lamp of Array.isArray(given.own) ? given.own : []) store.ownLamps[String(lamp.name)] = checkLamp(lamp);
  const known = (name) => store.lamps.includes(name) || store.ownLamps[name];
  if (Array.isArray(given.lamps) && given.lamps.length && given.lamps.length <= 8 && given.lamps.every(known)) store.view.lamps = given.lamps;
  for (const key of ["light", "view"]) if (isAngle(given[key])) store.view[key] = given[key];
  if (Array.isArray(given.pinned) && given.pinned.length === 3 && given.pinned.every(Number.isFinite)) store.pin(given.pinned);
  for (const one of Array.isArray(given.maps) ? given.maps : []) {
    const coat = store.stack.coats[one?.coat];
    if (coat) store.maps = new Map(store.maps).set(coat.id, await pictureToMap(one));
  }
  if (TABS.includes(given.tab)) store.tell("open", given.tab);
  store.tell("lamps");
  store.tell("view");
  store.changed();
}
