// The page of `glazejax studio`: the studio over a socket, its stack in the address's fragment.
import { mount } from "./studio.js";
import { SocketLink } from "./wire.js";

const wire = new SocketLink(new URL("socket", location.href.split("#")[0].replace(/^http/, "ws")).href);
const fragment = () => {
  try {
    return decodeURIComponent(location.hash.slice(1));
  } catch {
    return location.hash.slice(1);
  }
};
let mine = "";
const remember = (text) => {
  mine = text;
  history.replaceState(null, "", text);
};
const { store, check } = mount(document.getElementById("studio"), wire, { begin: fragment, remember });
addEventListener("hashchange", () => {
  if (location.hash !== mine && location.hash.length > 1) check(fragment());
});
// What was brushed is in no link: leaving asks first.
addEventListener("beforeunload", (event) => {
  if (store.maps.size) event.preventDefault();
});
wire.open();
