// What comes from outside, a link, a file, a lamp, checked whole: what is wrong is one sentence that names the value.
import { parseGeometry } from "./solver.js";
import { Sentence } from "./seen.js";

const KEYS = ["glazejax", "version", "coats", "ground", "refractive_index", "geometry", "pigments"];
const MOST_BANDS = 5000;
const CURVES = ["absorption", "scattering"];
const ERRORS = ["absorption_sd", "scattering_sd"];

const real = (value) => typeof value === "number" && Number.isFinite(value);
const plain = (name) => name.replace(/[\s_-]+/g, "").toLowerCase().replaceAll("/", ":");
const show = (value) => (JSON.stringify(value) ?? String(value)).slice(0, 60);
const isObject = (value) => typeof value === "object" && value !== null && !Array.isArray(value);

function refuse(words) {
  throw new Sentence(words);
}

function number(what, value, low, high) {
  if (!real(value) || value < low || value > high) refuse(`${what} is ${show(value)}; it must be a number between ${low} and ${high}`);
  return value;
}

function curve(what, values, low = -Infinity) {
  if (!Array.isArray(values) || !values.length || values.length > MOST_BANDS || !values.every(real)) refuse(`${what} must be a list of 1 to ${MOST_BANDS} numbers`);
  if (values.some((value) => value < low)) refuse(`${what} must be ${low} or more everywhere`);
  return values;
}

function rising(what, values) {
  curve(what, values);
  if (values.some((nm, i) => i && nm <= values[i - 1])) refuse(`${what} must rise from each to the next`);
  return values;
}

// Letters to change, add or drop between two words.
function distance(one, other) {
  let row = Array.from({ length: other.length + 1 }, (_, i) => i);
  for (let i = 1; i <= one.length; i++) {
    const next = [i];
    for (let j = 1; j <= other.length; j++) next[j] = Math.min(row[j] + 1, next[j - 1] + 1, row[j - 1] + (one[i - 1] === other[j - 1] ? 0 : 1));
    row = next;
  }
  return row[other.length];
}

function findPaint(name, names) {
  if (names.includes(name)) return name;
  const key = plain(name), found = names.find((one) => plain(one) === key);
  if (found) return found;
  const near = names.map((one) => [distance(key, plain(one)), one]).filter(([far]) => far <= key.length / 2).sort((a, b) => a[0] - b[0]).slice(0, 3);
  refuse(`there is no pigment '${name.slice(0, 60)}'${near.length ? `: the nearest ${near.length > 1 ? "are" : "is"} ${near.map(([, one]) => one).join(", ")}` : ""}`);
}

function parts(where, given, names, most) {
  if (!isObject(given) || !Object.keys(given).length || Object.keys(given).length > most) refuse(`${where} must be of 1 to ${most} paints with their parts by weight`);
  const weights = new Map();
  for (const [name, weight] of Object.entries(given)) {
    if (!real(weight) || weight < 0 || weight > 1e9) refuse(`${where}: the part of ${name.slice(0, 60)} is ${show(weight)}; it must be a number from 0 on`);
    // One paint may stand there in two spellings.
    const full = findPaint(name, names);
    weights.set(full, (weights.get(full) ?? 0) + weight);
  }
  if (![...weights.values()].some((weight) => weight > 0)) refuse(`${where}: all parts are 0; give one of its paints some weight`);
  return Object.fromEntries(weights);
}

export function checkPaint(name, given) {
  if (!isObject(given) || !["wavelengths", ...CURVES].every((key) => key in given)) refuse(`paint '${name}' must have wavelengths (nm), absorption and scattering (1/m)`);
  rising(`wavelengths of '${name}'`, given.wavelengths);
  for (const key of [...CURVES, ...ERRORS].filter((one) => one in given)) {
    if (curve(`${key} of '${name}'`, given[key], 0).length !== given.wavelengths.length) refuse(`${key} of '${name}' needs one number for each wavelength`);
  }
  return given;
}

function ground(given, names, most) {
  if (["white", "black", "card"].includes(given)) return given;
  if (isObject(given) && "paint" in given) return { paint: parts("the ground", given.paint, names, most) };
  if (isObject(given)) {
    rising("wavelengths of the ground", given.wavelengths);
    const values = curve("reflectance of the ground", given.reflectance, 0);
    if (values.length !== given.wavelengths.length || values.some((value) => value > 1)) refuse("the ground needs one reflectance from 0 to 1 for each wavelength");
    return given;
  }
  if (typeof given === "string") refuse(`the ground is '${given.slice(0, 60)}'; write a number from 0 to 1, white, black or card`);
  return number("the ground", given, 0, 1);
}

// The stack of what JSON gives, as the page keeps it.
export function checkStack(given, data) {
  if (!isObject(given) || given.glazejax !== "stack") refuse('this is no stack: it must be an object such as {"glazejax": "stack", "coats": [{"paint": {"CobaltBlue": 1}, "um": 12}]}');
  if ((given.version ?? 1) !== 1) refuse(`the stack is of version ${show(given.version)}, and this studio reads version 1`);
  const unknown = Object.keys(given).find((key) => !KEYS.includes(key));
  if (unknown) refuse(`a stack has no '${unknown.slice(0, 60)}'; it has ${KEYS.join(", ")}`);
  const listed = given.coats ?? [], pigments = given.pigments ?? {};
  if (!Array.isArray(listed) || listed.length > data.most_coats) refuse(`"coats" must be a list of ${data.most_coats} coats at most`);
  if (!isObject(pigments) || Object.keys(pigments).length > data.most_coats) refuse(`"pigments" must be ${data.most_coats} own paints at most, by name`);
  for (const [name, one] of Object.entries(pigments)) checkPaint(name, one);
  const names = [...data.paints.map((entry) => entry.name), ...Object.keys(pigments)];
  const coats = listed.map((coat, i) => {
    const where = `coat ${i + 1}`;
    if (!isObject(coat) || !("paint" in coat) || !("um" in coat)) refuse(`${where} must have "paint" and "um", such as {"paint": {"CobaltBlue": 1}, "um": 12}`);
    if (!real(coat.um)) refuse(`${where}: "um" is ${show(coat.um)}; it must be a number of micrometres, without a unit`);
    if (coat.um < 0 || coat.um > data.thickest) refuse(`${where} is ${coat.um} micrometres thick; it must be between 0 and ${data.thickest}`);
    return { paint: parts(where, coat.paint, names, data.most_parts), um: coat.um, ...(coat.hidden === true ? { hidden: true } : {}) };
  });
  const geometry = given.geometry ?? "45:0";
  if (typeof geometry !== "string" || !parseGeometry(geometry)) refuse(`geometry is ${show(geometry)}; it must be d:8 or di:8 (integrating sphere, mirror reflection included), de:8 (excluded), 45:0, or another ANGLE:ANGLE of light and view in degrees`);
  return {
    coats,
    ground: ground(given.ground ?? "card", names, data.most_parts),
    refractive_index: number("refractive_index", given.refractive_index ?? 1.5, 1, 2.5),
    geometry,
    pigments,
  };
}

// The stack of a text.
export function parseStack(text, data) {
  let given;
  try {
    given = JSON.parse(text);
  } catch {
    refuse("the link's stack cannot be read: it was cut short, or is of something else");
  }
  return checkStack(given, data);
}

// A lamp of one's own, fit for colour from 420 to 680 nm.
export function checkLamp(lamp) {
  const { name, wavelengths, power } = lamp;
  rising("wavelengths of the lamp", wavelengths);
  if (!Array.isArray(power) || power.length !== wavelengths.length || !power.every((one) => real(one) && one >= 0 && one <= 1e100)) refuse("a lamp needs one power for each wavelength, each a number from 0 to 1e100");
  if (wavelengths[0] > 420 || wavelengths.at(-1) < 680) refuse(`the lamp is known from ${wavelengths[0]} to ${wavelengths.at(-1)} nm; a colour needs 420 to 680 nm of it at least`);
  if (!wavelengths.some((nm, i) => nm >= 420 && nm <= 680 && power[i] > 0)) refuse("the lamp gives no light between 420 and 680 nm");
  return { name, wavelengths, power };
}
