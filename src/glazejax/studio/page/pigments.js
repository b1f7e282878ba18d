// A table of one's own paints, a line for each paint and wavelength, as `glazejax recover` and `write_pigments` write it.
import { checkPaint } from "./check.js";
import { Sentence } from "./seen.js";

const NEEDED = ["pigment", "wavelength_nm", "absorption", "scattering"];
const MAYBE = ["absorption_sd", "scattering_sd"];
const TRUTH = { true: true, 1: true, yes: true, false: false, 0: false, no: false };
const MOST = 100;
// No paint has such coefficients.
const HUGE = 1e30;

// Cells of a line; those with commas stand in quotation marks, where two marks are one.
function split(line) {
  const cells = [""];
  let quoted = false;
  for (let i = 0; i < line.length; i++) {
    if (line[i] === '"' && quoted && line[i + 1] === '"') cells[cells.length - 1] += line[i++];
    else if (line[i] === '"') quoted = !quoted;
    else if (line[i] === "," && !quoted) cells.push("");
    else cells[cells.length - 1] += line[i];
  }
  return cells.map((cell) => cell.trim());
}
const isNumber = (cell) => /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(cell);

// Whether a file's beginning is that of such a table, well written or not.
export function looksLikePigments(head) {
  const first = head.replace(/^\ufeff/, "").split(/\r?\n|\r/).find((line) => line.trim() && !line.startsWith("#")) ?? "";
  return /\b(pigment|absorption|scattering)\b/.test(first) && !first.trimStart().startsWith("{");
}

/* Paints of a table: `pigments`, as stacks bring them, and `entries` for the shelf, by names that no catalogue has. What is
 * wrong is one sentence that names the line, the value and what it should be. */
export function readPigments(text, file, data) {
  const comments = [], found = new Map();
  let header = null;
  text.replace(/^\ufeff/, "").split(/\r\n|\n|\r/).forEach((line, i) => {
    const refuse = (words) => { throw new Sentence(`${file}, line ${i + 1}: ${words}`); };
    if (line.startsWith("#")) comments.push(line.replace(/^[# ]+/, "").trim());
    if (!line.trim() || line.startsWith("#")) return;
    const cells = split(line);
    if (!header) {
      header = cells;
      const missing = NEEDED.filter((title) => !cells.includes(title));
      if (missing.length && /[;\t]/.test(line)) refuse(`its columns are divided by ${line.includes(";") ? "semicolons" : "tabs"}; save the table with commas between columns and points in numbers`);
      if (missing.length) refuse(`there is no column ${missing.join(", ")}; a table of paints has ${NEEDED.join(",")}`);
      return;
    }
    if (cells.length !== header.length) refuse(`${cells.length} cells where the header has ${header.length}; a number's decimals stand behind a point, not a comma`);
    const row = Object.fromEntries(header.map((title, at) => [title, cells[at]]));
    // A name that a spreadsheet would take for a formula has an apostrophe before it.
    const name = row.pigment.replace(/^'(?='*[=+\-@])/, "");
    if (!name) refuse("the pigment has no name; write one into the column pigment");
    if (!found.has(name)) {
      if (found.size === MOST) refuse(`more than ${MOST} paints; split the table`);
      found.set(name, { from: i + 1, columns: Object.fromEntries([...NEEDED.slice(1), ...MAYBE, "identifiable"].map((title) => [title, []])) });
    }
    const { columns } = found.get(name);
    for (const title of NEEDED.slice(1)) {
      if (!isNumber(row[title]) || Math.abs(row[title]) >= HUGE) refuse(`${title} is '${row[title].slice(0, 30)}'; write a number such as 12500 or 1.25e4`);
      if (Number(row[title]) < 0) refuse(`${title} is ${row[title]}; it must be 0 or more`);
      columns[title].push(Number(row[title]));
    }
    const grid = columns.wavelength_nm;
    if (grid.length > 1 && grid.at(-1) <= grid.at(-2)) refuse(`the wavelengths of '${name}' go from ${grid.at(-2)} to ${grid.at(-1)} nm; they must rise from line to line`);
    for (const title of MAYBE) if (title in row) columns[title].push(isNumber(row[title]) ? Number(row[title]) : NaN);
    if ("identifiable" in row) {
      const truth = TRUTH[row.identifiable.toLowerCase()];
      if (truth === undefined) refuse(`identifiable is '${row.identifiable.slice(0, 30)}'; it must be true or false`);
      columns.identifiable.push(truth);
    }
  });
  if (!found.size) throw new Sentence(header ? `${file} has a header but no paint below it; add a line for each wavelength` : `${file} is empty; a table of paints has the columns ${NEEDED.join(",")}`);
  const pigments = {}, entries = [], taken = new Set(data.paints.map(({ name }) => name)), provenance = comments.join(" ") || `from ${file}`;
  for (const [given, { from, columns }] of found) {
    const name = taken.has(given) || given.includes("/") ? `${given} (own)` : given, grid = columns.wavelength_nm;
    if (grid[0] > 420 || grid.at(-1) < 680) throw new Sentence(`${file}, line ${from}: '${given}' is known from ${grid[0]} to ${grid.at(-1)} nm; a colour needs 420 to 680 nm of it at least`);
    const paint = { wavelengths: grid, absorption: columns.absorption, scattering: columns.scattering };
    // An error may be missing where a coefficient is not identifiable; such a paint has none.
    for (const title of MAYBE) if (columns[title].length && columns[title].every((sd) => sd >= 0 && sd < HUGE)) paint[title] = columns[title];
    if (columns.identifiable.length) paint.identifiable = columns.identifiable;
    pigments[name] = checkPaint(name, { ...paint, provenance });
    entries.push({ name, label: name, group: "own", provenance, bands: `${grid[0]}-${grid.at(-1)} nm (${grid.length} bands)`, unknown: unknownOf(paint) });
  }
  return { pigments, entries };
}

// Bands where only k/s is known, as ranges: `400-450, 620 nm`.
function unknownOf({ wavelengths, identifiable }) {
  const ranges = [];
  (identifiable ?? []).forEach((known, i) => {
    if (known) return;
    if (i && !identifiable[i - 1]) ranges.at(-1)[1] = wavelengths[i];
    else ranges.push([wavelengths[i], wavelengths[i]]);
  });
  return ranges.length ? `${ranges.map(([low, high]) => (low === high ? low : `${low}-${high}`)).join(", ")} nm` : "";
}
