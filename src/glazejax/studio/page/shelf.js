// The shelf: every paint as a tube next to its drawdown, thick to thin, with search, provenance and a mark where k or s is not known.
import { el, hex } from "./dom.js";

const TITLES = { own: "Your own", oils: "Oils", acrylics: "Acrylics" };

export function shelfPanel(store) {
  const list = el("div.shelf-list");
  const search = el("input", {
    type: "search",
    placeholder: "Search paints",
    "aria-label": "Search paints",
    "data-at": "search",
    oninput: () => show(),
  });
  const about = el("p.about", { "aria-live": "polite" });
  const file = el("input", { type: "file", hidden: true, "data-at": "file", onchange: () => {
    for (const one of file.files) store.tell("file", one);
    file.value = "";
  } });
  const panel = el("section.panel.shelf", { "aria-label": "Shelf of paints" },
    el("header", {}, el("h2", {}, "Shelf"), el("button.quiet", {
      type: "button", title: `A table of own paints (CSV), a stack, a photograph${store.alone ? "" : ", films over a black and a white card, a spectrum"}`,
      onclick: () => file.click(),
    }, "Add a file")),
    search, list, about, file);

  function tile(entry) {
    const [thick, thin, beyond = []] = store.swatches.get(entry.name) ?? [];
    const chip = el("span.chip", { "aria-hidden": "true" });
    const tube = el("span.tube", { "aria-hidden": "true" }, el("span.label")), upper = el("span.thick"), lower = el("span.thin");
    if (thick) {
      tube.firstChild.style.background = hex(thick);
      upper.style.background = hex(thick);
      lower.style.background = hex(thin);
      upper.classList.toggle("clipped", !!beyond[0]);
      lower.classList.toggle("clipped", !!beyond[1]);
    }
    chip.append(upper, lower);
    const unknown = entry.unknown ? `; k and s not separable at ${entry.unknown}` : "";
    const words = `${entry.label}${unknown}${beyond[0] || beyond[1] ? "; the corner marks a colour outside sRGB" : ""}`;
    const tell = () => {
      about.textContent = `${entry.label}. ${entry.unknown ? `At ${entry.unknown} only k/s is known. ` : ""}${entry.provenance}`;
    };
    return el("div.tile", { "data-paint": entry.name },
      el("button.paint", {
        type: "button", title: `Lay ${words} on top`, "aria-label": `Lay ${words} on top`,
        onclick: () => store.add({ [entry.name]: 1 }, 10), onfocus: tell, onmouseenter: tell,
      }, tube, chip, el("span.name", {}, entry.label, entry.unknown ? el("sup", { title: `k and s not separable at ${entry.unknown}` }, "?") : null)),
      el("button.mix", {
        type: "button", title: `Mix ${entry.label} into the selected coat`, "aria-label": `Mix ${entry.label} into the selected coat`,
        onclick: () => mix(entry),
      }, "+"));
  }

  function mix(entry) {
    const coat = store.coat();
    if (!coat) return store.add({ [entry.name]: 1 }, 10);
    if (coat.paint[entry.name]) return store.say(`${entry.label} is in this coat already; change its part there.`);
    if (Object.keys(coat.paint).length >= 4) return store.say("A coat holds four paints at most.", "error");
    store.change(null, () => {
      const total = Object.values(coat.paint).reduce((sum, part) => sum + part, 0);
      store.coat().paint[entry.name] = +(total / Object.keys(coat.paint).length).toPrecision(3);
    });
  }

  function show() {
    const wanted = search.value.trim().toLowerCase();
    const groups = new Map([["own", []], ["oils", []], ["acrylics", []]]);
    for (const entry of store.entries.values()) {
      if (!wanted || entry.name.toLowerCase().includes(wanted)) (groups.get(entry.group) ?? groups.get("own")).push(entry);
    }
    list.replaceChildren();
    for (const [group, entries] of groups) {
      if (!entries.length) continue;
      list.append(el("h3", {}, TITLES[group]), el("div.tiles", {}, ...entries.map(tile)));
    }
    if (!list.childElementCount) list.append(el("p.about", {}, store.entries.size ? "No paint has this name." : "Waiting for the studio's paints."));
  }
  store.on("shelf", show);
  show();
  return panel;
}
