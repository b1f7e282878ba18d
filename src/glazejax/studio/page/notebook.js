// The studio in a notebook: an anywidget whose searches and files go to the kernel, and what is seen too.
import { mount } from "./studio.js";
import { packMessage, unpackMessage } from "./wire.js";

class KernelLink {
  constructor(model) {
    this.model = model;
    this.onmessage = this.onopen = this.onlost = () => {};
    this.hear = (content, buffers) => {
      if (content?.glaze !== "answer") return;
      const view = buffers[0], bytes = new Uint8Array(view.buffer ?? view, view.byteOffset ?? 0, view.byteLength);
      // Numbers must start at a multiple of 4.
      const { header, arrays } = unpackMessage(bytes.slice().buffer);
      this.onmessage(header, arrays);
    };
    model.on("msg:custom", this.hear);
  }
  get there() {
    return true;
  }
  send(header, arrays, rest) {
    this.model.send({ glaze: "question" }, undefined, [packMessage(header, arrays, rest).buffer]);
    return true;
  }
}

function render({ model, el: place }) {
  const root = document.createElement("div");
  place.append(root);
  const wire = new KernelLink(model);
  let mine = "";
  const remember = (_, plain) => {
    mine = JSON.stringify(plain);
    if (mine === JSON.stringify(model.get("stack"))) return;
    model.set("stack", plain);
    model.save_changes();
  };
  const { store, check } = mount(root, wire, { begin: () => [JSON.stringify(model.get("stack"))], remember });
  store.on("rest", () => {
    const { wavelengths, spectra, colours } = store.seen, { lab, rgb } = colours[0][0];
    model.set("seen", { wavelengths: [...wavelengths], reflectance: [...spectra[0]], lab, rgb });
    model.save_changes();
  });
  const follow = () => {
    const text = JSON.stringify(model.get("stack"));
    if (text !== mine) check(text);
  };
  model.on("change:stack", follow);
  wire.onopen();
  return () => {
    model.off("msg:custom", wire.hear);
    model.off("change:stack", follow);
  };
}

export default { render };
