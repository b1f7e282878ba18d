// The page: its stack is in the address's fragment. Served by `glazejax studio` it has a socket for searches and files;
// as one file it brings all that it knows.
import { readLink } from "./link.js";
import { mount } from "./studio.js";
import { NoLink, SocketLink } from "./wire.js";

const own = document.getElementById("data");
const wire = own ? new NoLink() : new SocketLink(new URL("socket", location.href.split("#")[0].replace(/^http/, "ws")).href);
const fragment = () => (location.hash.length > 1 ? readLink(location.hash.slice(1)) : null);
let mine = "";
const remember = (text) => {
  mine = text;
  history.replaceState(null, "", text);
};
const data = own ? JSON.parse(own.textContent) : null;
const { store, check } = mount(document.getElementById("studio"), wire, { begin: () => fragment() ?? (data?.begin ? [JSON.stringify(data.begin)] : null), remember, data });
addEventListener("hashchange", () => {
  if (location.hash !== mine && location.hash.length > 1) check(...fragment());
});
// What was brushed is in the link at a small size only: leaving asks first.
addEventListener("beforeunload", (event) => {
  if (store.maps.size) event.preventDefault();
});
wire.open?.();
