// The studio: one store, its panels, and what the server says.
import { awayPanel } from "./away.js";
import { backwardsPanel } from "./backwards.js";
import { coatsPanel } from "./coats.js";
import { el } from "./dom.js";
import { easelPanel } from "./easel.js";
import { takeView, writeLink } from "./link.js";
import { lookPanel } from "./look.js";
import { looksLikePigments, readPigments } from "./pigments.js";
import { shelfPanel } from "./shelf.js";
import { parseStack } from "./check.js";
import { Store } from "./store.js";

/* `wire` carries searches and files to a Python behind the page; a page that has its `data` at once needs none. */
export function mount(root, wire, { begin = null, remember = null, data = null } = {}) {
  const store = new Store(wire);
  store.alone = !!data;

  const line = el("p.line", { role: "status", "aria-live": "polite", "data-at": "line" });
  const state = el("span.state", { "data-at": "state" }, data ? "" : "connecting");
  const panels = { look: lookPanel(store), canvas: easelPanel(store), backwards: backwardsPanel(store), away: awayPanel(store) };
  const names = { look: "Look", canvas: "Canvas", backwards: "Backwards", away: "Take away" };
  const tabs = el("nav.tabs", { role: "tablist", "aria-label": "Views" });
  for (const [key, words] of Object.entries(names)) {
    panels[key].id ||= `view-${key}-${Math.random().toString(36).slice(2, 7)}`;
    panels[key].setAttribute("role", "tabpanel");
    tabs.append(el("button", { type: "button", role: "tab", "data-at": `tab-${key}`, "aria-controls": panels[key].id, onclick: () => open(key), onkeydown: (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      const all = [...tabs.children], to = all[(all.indexOf(event.currentTarget) + step + all.length) % all.length];
      to.focus();
      to.click();
    } }, words));
  }
  function open(key) {
    Object.entries(panels).forEach(([name, panel], i) => {
      panel.hidden = name !== key;
      tabs.children[i].setAttribute("aria-selected", String(name === key));
      tabs.children[i].tabIndex = name === key ? 0 : -1;
    });
    store.tab = key;
    store.tell("tab");
  }
  store.on("open", open);
  root.classList.add("glaze-studio");
  root.dataset.drop = `Drop paints, ${store.alone ? "" : "films, a spectrum, "}a stack or a photograph`;
  root.replaceChildren(
    el("header.top", {}, el("h1", {}, "Glaze studio"), tabs, el("span.grow"), state),
    line,
    el("main.room", {}, el("div.view", {}, ...Object.values(panels)), coatsPanel(store), shelfPanel(store)));

  store.on("busy", (busy) => { root.dataset.busy = busy ? "yes" : ""; });

  // Sentences -----------------------------------------------------------------------------------------------------------
  let quiet = null;
  store.on("say", (words, kind) => {
    clearTimeout(quiet);
    line.textContent = words;
    line.dataset.kind = kind;
    line.dataset.about = "";
    if (kind === "note") quiet = setTimeout(() => { line.textContent = ""; }, 6000);
  });
  const spoken = (words) => words.charAt(0).toUpperCase() + words.slice(1) + (/[.!?]$/.test(words) ? "" : ".");

  // Who answers -----------------------------------------------------------------------------------------------------------
  let begun = false, there = false;
  // By which searches find this page again after a lost connection.
  const page = Array.from({ length: 3 }, () => Math.random().toString(36).slice(2)).join("");
  function start(data) {
    store.learn(data);
    begun = true;
    const [stack, view] = begin?.() ?? [];
    if (stack) check(stack, view);
    else store.changed();
  }
  wire.onopen = () => {
    there = true;
    state.textContent = "ready";
    state.dataset.kind = "";
    wire.send({ type: "hello", page });
    if (begun) {
      store.say("The studio is back; nothing was lost.");
      store.tell("back");
    }
  };
  wire.onlost = () => {
    store.tell("lost");
    state.textContent = "not connected";
    state.dataset.kind = "error";
    if (there || !begun) store.say("The studio does not answer; what you made is kept here, and colours go on. For searches and files, start glazejax studio again.", "error");
    there = false;
  };
  const answers = {
    hello(header) {
      Object.assign(store, { tasks: header.tasks, mostFile: header.most_file });
      if (!begun) start(header.data);
      store.tell("running", header.running);
    },
    file(header, arrays) {
      if (header.notes?.length) store.say(header.notes.join("; "));
      store.tell("spectra", header, arrays);
    },
    job: (header) => store.tell("job", header),
    error(header) {
      refuse(header.words, header.about);
      store.tell("failed", header);
    },
  };
  wire.onmessage = (header, arrays) => answers[header.type]?.(header, arrays);
  function refuse(words, about) {
    store.say(spoken(words), "error");
    line.dataset.about = about;
  }
  store.on("refused", refuse);
  // What was wrong with the last stack is over with the next that is seen.
  store.on("corrected", (about) => { if (line.dataset.about === about) store.say(""); });
  let number = 0;
  store.on("seen", (ms) => {
    if (ms === undefined) return;
    root.dataset.ms = ms.toFixed(1);
    root.dataset.seen = ++number;
  });
  function take(header) {
    Object.assign(store.own, header.pigments);
    for (const entry of header.entries ?? []) store.entries.set(entry.name, { ...entry, group: "own" });
    store.swatch(Object.keys(header.pigments));
  }
  store.on("paints", take);
  function check(text, view) {
    store.attempt("check", () => {
      store.take(parseStack(text, store.eye.data));
      store.past = [];
      store.tell("history");
      if (view) takeView(view, store).catch((error) => refuse(error.message, "view"));
    });
    if (!store.seen) store.changed();
  }

  // Files ---------------------------------------------------------------------------------------------------------------
  store.on("file", async (file) => {
    if (file.size > store.mostFile) return store.say(`${file.name} has ${(file.size / 1048576).toFixed(0)} MB; the studio takes files of ${store.mostFile >> 20} MB at most.`, "error");
    if (file.type.startsWith("image/")) {
      try {
        return store.tell("photograph", await createImageBitmap(file));
      } catch {
        return store.say(`${file.name} is no picture that this browser reads.`, "error");
      }
    }
    const content = new Uint8Array(await file.arrayBuffer());
    const head = new TextDecoder().decode(content.subarray(0, 4000));
    if (head.trimStart().startsWith("{") && head.includes('"glazejax"')) return check(new TextDecoder().decode(content));
    if (looksLikePigments(head)) {
      return store.attempt("file", () => {
        const found = readPigments(new TextDecoder().decode(content), file.name, store.eye.data), count = found.entries.length;
        take(found);
        store.say(`${count} ${count > 1 ? "paints" : "paint"} of ${file.name} ${count > 1 ? "are" : "is"} on the shelf, under Your own.`);
      });
    }
    if (wire.send({ type: "file", name: file.name }, {}, content)) return;
    store.say(store.alone ? `${file.name} is neither a table of paints, a stack nor a photograph; what is in a measured spectrum is found by the studio with Python behind it (glazejax studio).`
      : "The studio is not there at the moment; drop the file again when it is back.", "error");
  });
  root.addEventListener("dragover", (event) => { if (event.dataTransfer?.types.includes("Files")) { event.preventDefault(); root.classList.add("over"); } });
  root.addEventListener("dragleave", (event) => { if (!root.contains(event.relatedTarget)) root.classList.remove("over"); });
  root.addEventListener("drop", (event) => {
    root.classList.remove("over");
    if (!event.dataTransfer?.files.length) return;
    event.preventDefault();
    for (const file of event.dataTransfer.files) store.tell("file", file);
  });

  // The link follows what is on the page, some moments later ------------------------------------------------------------------------
  let later = null;
  for (const change of ["stack", "rest", "brushed", "tab"]) {
    store.on(change, () => {
      clearTimeout(later);
      if (remember) later = setTimeout(() => { if (store.eye && !store.brushing) remember(writeLink(store).link, store.plain()); }, 250);
    });
  }
  root.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || /^(text|search|number|textarea)$/.test(event.target.type ?? "")) return;
    const key = event.key.toLowerCase();
    if (key === "z" && !event.shiftKey) store.undo();
    else if (key === "y" || (key === "z" && event.shiftKey)) store.redo();
    else return;
    event.preventDefault();
  });
  open("look");
  if (data) start(data);
  return { store, check };
}
