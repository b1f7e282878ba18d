// A stack as ten lines of Python that compute it.

const paint = (name) => (name.includes("/") ? `${name.split("/")[0]}["${name.split("/")[1]}"]` : `oils["${name}"]`);

function mediumOf(coat) {
  const names = Object.keys(coat.paint), total = Object.values(coat.paint).reduce((sum, part) => sum + part, 0);
  if (names.length === 1) return paint(names[0]);
  return `gj.Mixture([${names.map(paint).join(", ")}], [${names.map((name) => +(coat.paint[name] / total).toPrecision(9)).join(", ")}])`;
}

// Own paints and measured grounds are numbers that no ten lines hold, and paints of two catalogues differ in their
// wavelengths: there the program reads the stack's file.
export function pythonLines(stack, { white, black, thickest }) {
  const { ground, geometry, refractive_index: index } = stack, coats = stack.coats.filter((coat) => !coat.hidden);
  if (ground?.paint) coats.push({ paint: ground.paint, um: thickest });
  const tail = [`spectrum = gj.reflectance(glaze, "${geometry}")`, "print(gj.colour.lab(glaze.wavelengths, spectrum))"];
  const names = coats.flatMap((coat) => Object.keys(coat.paint)), oils = names.some((name) => !name.includes("/"));
  const groups = new Set(names.filter((name) => name.includes("/")).map((name) => name.split("/")[0]));
  if (groups.size + oils > 1 || Object.keys(stack.pigments ?? {}).length || ground?.wavelengths || !coats.length) {
    return ["import glazejax as gj", 'glaze = gj.load_glaze("stack.json")  # saved in the studio', ...tail].join("\n");
  }
  const level = typeof ground === "number" ? ground : ground?.paint ? 0.5 : ground === "black" ? black : white;
  return [
    "import glazejax as gj",
    ...(oils ? ["oils = gj.catalogue.load()"] : []),
    ...[...groups].map((group) => `${group} = gj.catalogue.load("${group}")`),
    "glaze = gj.Glaze([",
    ...coats.map((coat) => `    gj.Layer(${mediumOf(coat)}, ${+coat.um.toPrecision(6)}e-6),`),
    `], ${level}, ${index})${ground === "card" ? "  # the white half of the card" : ""}`,
    ...tail,
  ].join("\n");
}
