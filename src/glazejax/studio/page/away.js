// Take away: pictures, tables, the stack as a file, as Python and as a link.
import { el, hex, save } from "./dom.js";
import { pythonLines } from "./lines.js";
import { writeLink } from "./link.js";
import { colourAt } from "./look.js";
import { LADDER, ROW } from "./seen.js";

export function spectraTable(store) {
  const { seen } = store;
  const named = [["ground", ROW.ground], ["over_white", ROW.white], ["over_black", ROW.black], ["bare_ground", ROW.bare], ["bare_white", ROW.bareWhite], ["bare_black", ROW.bareBlack]];
  const rows = named.map(([name, row]) => [name, ...seen.spectra[row]]);
  return [["Name", ...seen.wavelengths], ...rows].map((row) => row.map((cell) => (typeof cell === "number" ? +cell.toPrecision(7) : cell)).join(",")).join("\n") + "\n";
}

export function awayPanel(store) {
  const code = el("textarea.code", { readOnly: true, rows: 12, spellcheck: false, "aria-label": "The stack as Python", "data-at": "python" });
  const address = el("input", { readOnly: true, "aria-label": "Link that holds the stack", "data-at": "link" });
  const held = el("p.under", { "data-at": "held" });
  const button = (words, at, call) => el("button", { type: "button", "data-at": at, onclick: call }, words);
  const need = (call) => () => (store.seen?.ladder.length ? call() : store.say("Nothing is seen yet: wait for the first colours.", "error"));
  const file = el("input", { type: "file", accept: ".json", hidden: true, onchange: () => { for (const one of file.files) store.tell("file", one); file.value = ""; } });
  const panel = el("section.panel.away", { "aria-label": "Take away" },
    el("div.bar", {}, button("Picture as PNG", "png", need(picture)), button("Spectra as CSV", "csv", need(() => save("spectra.csv", spectraTable(store), "text/csv"))),
      button("Stack as JSON", "json", () => save("stack.json", JSON.stringify(store.plain(), null, 1) + "\n", "application/json")), button("Open a stack", "open-stack", () => file.click()), file),
    el("p.about", {}, "The file is read by this page, by ", el("code", {}, "glazejax render --stack stack.json"), " and by ", el("code", {}, "glazejax.load_glaze"), "."),
    el("h3", {}, "Link"), el("div.bar", {}, address, button("Copy", "copy-link", () => copy(address))), held,
    el("h3", {}, "Python"), code, el("div.bar", {}, button("Copy", "copy-python", () => copy(code))));

  function copy(field) {
    field.select();
    navigator.clipboard?.writeText(field.value).then(() => store.say("Copied."), () => document.execCommand("copy"));
  }
  // What is seen, with its words: swatch, lamps and ladder on the surround's grey.
  function picture() {
    const { seen } = store, pen = el("canvas", { width: 1200, height: 820 }).getContext("2d");
    const fill = (css, x, y, w, h) => { pen.fillStyle = css; pen.fillRect(x, y, w, h); };
    fill("#8f8f8f", 0, 0, 1200, 820);
    const card = store.stack.ground === "card", left = card ? ROW.white : ROW.ground, right = card ? ROW.black : ROW.ground;
    fill(colourAt(seen, 0, card ? ROW.bareWhite : ROW.bare).css, 40, 40, 560, 480);
    fill(colourAt(seen, 0, card ? ROW.bareBlack : ROW.bare).css, 600, 40, 560, 480);
    fill(colourAt(seen, 0, left).css, 40, 90, 560, 380);
    fill(colourAt(seen, 0, right).css, 600, 90, 560, 380);
    const lamps = seen.colours.length;
    pen.font = "20px system-ui, sans-serif";
    for (let i = 0; i < lamps; i++) {
      const x = 40 + (i * 1120) / lamps, w = 1120 / lamps - 10;
      fill(colourAt(seen, i, left).css, x, 540, w / 2, 80);
      fill(colourAt(seen, i, right).css, x + w / 2, 540, w / 2, 80);
      fill("#101010", x, 0, 0, 0);
      pen.fillText(store.view.lamps[i], x, 645);
    }
    LADDER.forEach((_, i) => fill(colourAt(seen, 0, ROW.ladder + i).css, 40 + (i * 1120) / LADDER.length, 665, 1120 / LADDER.length, 60));
    pen.fillStyle = "#101010";
    pen.fillText(`${store.shown.map((coat) => store.words(coat)).join(" over ")}`.slice(0, 110), 40, 765);
    pen.fillText(`${hex(colourAt(seen, 0, left).rgb)}; ${seen.geometry}; ladder of ${LADDER.join(", ")} coats`, 40, 795);
    pen.canvas.toBlob((blob) => save("glaze.png", blob, "image/png"));
  }
  function show() {
    if (panel.hidden || !store.eye) return;
    const { link, pixels } = writeLink(store);
    address.value = location.href.split("#")[0] + link;
    held.textContent = pixels === null ? "It holds all that is on the page." : pixels ? `It holds all that is on the page, and what was brushed at ${pixels} pixels; Map as NPY on the canvas has all 1024.`
      : "It holds all that is on the page but what was brushed: that is too much for a link. Save each coat's map on the canvas.";
    code.value = pythonLines(store.plain(), store.eye.data);
    code.rows = code.value.split("\n").length;
  }
  store.on("stack", show);
  store.on("tab", show);
  return panel;
}
