// Backwards: recipes for a colour, what is in a spectrum, paints from films; searches run in the background, and can be stopped.
import { el, hex } from "./dom.js";
import { Recipes, allowed, labOf, tubesFor } from "./search.js";

export function backwardsPanel(store) {
  const colour = el("input", { type: "color", value: "#8a4b2d", "aria-label": "Colour wanted", "data-at": "wanted", oninput: () => { target = null; showTarget(); } });
  const photo = el("canvas.photo", { hidden: true, tabIndex: 0, role: "img", "aria-label": "Photograph: click to pick its colour", "data-at": "photo" });
  const aim = el("p.under", { "data-at": "aim" });
  const coats = el("select", { "aria-label": "Coats", "data-at": "max-coats" }, el("option", { value: 1 }, "one coat"), el("option", { value: 2, selected: true }, "up to two coats"));
  const choice = (words, at, checked) => el("label", {}, el("input", { type: "checkbox", checked, "data-at": at }), ` ${words}`);
  const modern = choice("without poisonous or unsold paints", "modern", true), own = choice("only my tubes", "own-tubes", false);
  const chosen = () => ({ modern: modern.firstChild.checked, own: own.firstChild.checked });
  const where = el("select", { "aria-label": "Ground below the film", "data-at": "below" },
    ...[["opaque", "the film hides its ground"], ["white", "over a white card"], ["black", "over a black card"], ["ground", "over the stack's ground"]].map(([value, words]) => el("option", { value }, words)));
  const spectra = el("select", { "aria-label": "Which spectrum", "data-at": "which", hidden: true, onchange: () => pick(Number(spectra.value)) });
  const found = el("div.found", { "aria-live": "polite" });
  const jobs = el("div.jobs");
  const nearest = el("button", { type: "button", "data-at": "nearest", onclick: () => ownSearch() }, "Find recipes here");
  const find = el("button", { type: "button", "data-at": "find", hidden: store.alone, onclick: () => start("recipes") }, "Search further");
  const identify = el("button", { type: "button", "data-at": "identify", disabled: true, onclick: () => start("identify") }, "Which paints are in it?");
  let target = null, table = null;
  const panel = el("section.panel.backwards", { "aria-label": "Backwards: from colour to paint" },
    el("p.about", {}, store.alone ? "Pick a colour, or drop a photograph on the page and pick in it." : "Pick a colour, or drop a spectrum or a photograph on the page and pick in it."),
    el("div.bar", {}, colour, coats, nearest, find), el("div.bar", {}, modern, own), aim, photo,
    el("h3", { hidden: store.alone }, "A measured film"),
    el("p.under.none", { hidden: store.alone }, "Drop a spectrum (CSV, or what spectrometers write) to ask which paints are in it."),
    el("div.bar", { hidden: store.alone }, spectra, where, identify), jobs, found);

  // The page's own search: its table is made while the tab is looked at.
  let search = null, known = "";
  const base = () => ({ ...store.plain(), coats: [], pigments: store.own });
  function searcher() {
    const asked = JSON.stringify([store.entries.size, chosen()]);
    if (known !== asked) search = new Recipes(store.eye, allowed([...store.entries.values()], chosen()));
    known = asked;
    return search;
  }
  store.on("tab", () => {
    if (!panel.hidden && store.eye) searcher().find([50, 0, 0], base(), { polished: 0 });
  });
  async function ownSearch() {
    const begun = performance.now(), wanted = target ?? colour.value;
    if (!allowed([...store.entries.values()], chosen()).length) return store.say("There is no tube of your own on the shelf: add paints there, or look in all.", "error");
    nearest.disabled = true;
    try {
      const { recipes, tabled } = await searcher().find(labOf(wanted, store.eye), base(), { most: Number(coats.value) });
      showFound(target?.name ?? colour.value, recipes, `the page's own search: ${tabled} glazes in its table, the nearest polished; ${((performance.now() - begun) / 1000).toFixed(1)} s`);
    } finally {
      nearest.disabled = false;
    }
  }

  function showTarget() {
    aim.textContent = target ? `Wanted: the spectrum ${target.name}` : `Wanted: ${colour.value} under ${"D65"}`;
    identify.disabled = !target && !(table?.films);
  }
  function pick(i) {
    const bands = table.wavelengths.length;
    const reflectance = table.reflectance.slice(i * bands, (i + 1) * bands);
    target = { name: table.names[i], wavelengths: [...table.wavelengths], reflectance: [...reflectance] };
    store.spectrum = target;
    if (table.rgb) colour.value = hex(table.rgb.subarray(3 * i, 3 * i + 3));
    showTarget();
  }
  store.on("spectra", (header, arrays) => {
    table = { ...header, ...arrays };
    spectra.hidden = header.names.length < 2;
    spectra.replaceChildren(...header.names.map((name, i) => el("option", { value: i }, name)));
    panel.querySelector(".none").textContent = `${header.name}: ${header.names.length} ${header.names.length > 1 ? "spectra" : "spectrum"}, ${header.words}`;
    // Of a film over cards, what is seen on white.
    const first = Math.max(0, header.films ? header.names.findIndex((name) => name.endsWith("_ow")) : 0);
    spectra.value = first;
    where.hidden = header.films;
    pick(first);
    store.tell("open", "backwards");
    if (header.films) {
      jobs.append(el("div.job", {}, `${header.name} holds films over cards. `, el("button", { type: "button", "data-at": "recover", onclick: (event) => { event.target.closest(".job").remove(); start("recover"); } }, "Recover their paints for the shelf")));
    }
  });
  store.on("photograph", (image) => {
    const width = Math.min(640, image.width);
    Object.assign(photo, { width, height: Math.round((image.height * width) / image.width), hidden: false });
    photo.getContext("2d", { willReadFrequently: true }).drawImage(image, 0, 0, photo.width, photo.height);
    store.tell("open", "backwards");
    store.say("Click in the photograph to pick a colour.");
  });
  photo.onclick = (event) => {
    const box = photo.getBoundingClientRect();
    const x = Math.floor(((event.clientX - box.left) / box.width) * photo.width), y = Math.floor(((event.clientY - box.top) / box.height) * photo.height);
    const { data } = photo.getContext("2d").getImageData(Math.max(0, x - 1), Math.max(0, y - 1), 3, 3);
    const mean = [0, 1, 2].map((c) => Math.round(data.filter((_, i) => i % 4 === c).reduce((sum, value) => sum + value, 0) / (data.length / 4)));
    target = null;
    colour.value = hex(mean);
    showTarget();
  };

  function start(task) {
    if (!store.tasks.includes(task)) return store.say("Searches need the inverse package, glazefit; it is part of a full installation of glazejax.", "error");
    const name = `${task} ${Date.now()}`, arrays = {}, options = { max_coats: Number(coats.value), below: where.value, ...chosen() };
    if (task === "recipes" && !target) options.srgb = colour.value;
    if (task === "recipes" && target) Object.assign(arrays, { wavelengths: Float32Array.from(target.wavelengths), reflectance: Float32Array.from(target.reflectance) });
    if (task !== "recipes") {
      const all = table && (table.films || task === "recover");
      Object.assign(arrays, { wavelengths: Float32Array.from(table.wavelengths), reflectance: all ? table.reflectance : Float32Array.from(target.reflectance) });
      options.names = all ? table.names : [target.name];
      options.films = !!table.films;
    }
    const meter = el("progress", { "aria-label": "Progress" });
    const words = el("span", {}, "starting");
    const stop = el("button.quiet", { type: "button", "data-at": "stop", onclick: () => store.link.send({ type: "stop", name }) }, "Stop");
    const node = el("div.job", { "data-job": name }, meter, words, stop);
    const stack = store.plain(), count = Object.keys(store.own).length, most = store.eye.data.most_coats;
    if (task === "recipes" && count) stack.pigments = tubesFor(stack.pigments ?? {}, store.own, most);
    if (!store.link.send({ type: "start", task, name, options, stack }, arrays)) return store.say("The studio is not there at the moment; try again when it is back.", "error");
    jobs.append(node);
    if (task === "recipes" && count > most) store.say(`The search takes ${most} of your ${count} tubes: those of the stack, then the first on the shelf.`);
  }
  store.on("job", (header) => {
    const node = jobs.querySelector(`[data-job="${header.name}"]`);
    if (!node) return;
    if (header.progress) {
      const { seconds, words, usual } = header.progress;
      node.querySelector("span").textContent = `${words}, ${seconds.toFixed(0)} s${usual ? ` of about ${usual.toFixed(0)}` : ""}`;
      if (usual) Object.assign(node.querySelector("progress"), { max: 1, value: Math.min(0.98, seconds / usual) });
      return;
    }
    node.remove();
    if (header.stopped) return store.say("Stopped.");
    if (header.error) return store.say(header.error, "error");
    ({ recipes: showRecipes, identify: showIdentified, recover: showRecovered })[header.name.split(" ")[0]](header.result, header.seconds);
  });
  store.on("failed", (header) => { if (header.about === "start") jobs.lastElementChild?.remove(); });
  // After a lost connection searches go on, unless the studio itself was ended.
  store.on("running", (names) => {
    for (const node of jobs.querySelectorAll("[data-job]")) {
      if (names.includes(node.dataset.job)) continue;
      node.remove();
      store.say("The studio was restarted, which ended the search. Start it again.", "error");
    }
  });

  function card(rgb, title, lines, take, words) {
    const chip = el(rgb ? "span.chip" : "span.chip.none");
    if (rgb) chip.style.background = hex(rgb);
    return el("article.answer", {}, chip, el("div", {}, el("strong", {}, title), ...lines.map((line) => el("span", {}, line))),
      take ? el("button", { type: "button", "data-at": "take", onclick: () => { store.take(take); store.say(words); } }, "Take") : null);
  }
  function showRecipes(result, seconds) {
    const unit = result.recipes[0]?.in_gamut === false ? `; ${result.words}` : "";
    showFound(result.target, result.recipes, `best first, found in ${seconds.toFixed(0)} s${unit}`);
  }
  const cautions = (stack) => [...new Set(stack.coats.flatMap((coat) => Object.keys(coat.paint)))].map((name) => store.entries.get(name)).filter((entry) => entry?.caution)
    .map((entry) => `${entry.label}: ${entry.caution}`).join("; ");
  function showFound(name, recipes, words) {
    found.replaceChildren(el("h3", {}, `Recipes for ${name}`), el("p.under", {}, words),
      ...recipes.map((one) => card(one.rgb, `ΔE00 ${one.delta_e.toFixed(2)}`, [one.stack.coats.map((coat) => store.words(coat)).join(" over "), one.parts && `parts ${one.parts}`, one.between !== undefined && `two mixings differ by ${one.between.toFixed(1)}`, one.cautions ?? cautions(one.stack)].filter(Boolean), one.stack, "The recipe is the stack now; undo brings back what was there.")));
  }
  // Paints as the shelf calls them.
  const named = (one) => Object.keys(Object.assign({}, ...(one.stack?.coats ?? []).map((coat) => coat.paint))).sort((a, b) => b.length - a.length)
    .reduce((words, name) => words.replaceAll(new RegExp(`(?<![A-Za-z])${name.replace(/[^\w]/g, "\\$&")}(?![A-Za-z])`, "g"), store.entries.get(name)?.label ?? name), one.words);
  function showIdentified(result, seconds) {
    found.replaceChildren(...result.spectra.flatMap((one) => [
      el("h3", {}, `In ${one.name}`), el("p.under", {}, `${one.words}; ${seconds.toFixed(0)} s`),
      ...one.candidates.map((each) => card(each.rgb, `${(100 * each.probability).toFixed(each.probability < 0.1 ? 1 : 0)} %`, [named(each), each.fit].filter(Boolean), each.stack, "The film is the stack now; undo brings back what was there.")),
    ]));
  }
  function showRecovered(result) {
    store.tell("paints", result);
    found.replaceChildren(el("h3", {}, "Recovered"), el("p.under", {}, `${Object.keys(result.pigments).length} paints are on the shelf; ${result.words}`));
  }
  showTarget();
  return panel;
}
