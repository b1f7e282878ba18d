// Pixels of the canvas: by WebGL2 where a graphics card draws, else by typed arrays; both look the same entries up.
import { context2d } from "./dom.js";
import { LEVELS, MOST_TABLED, readTable } from "./table.js";

// Entries of a table lie in rows of this many.
const ROW = 2048;

const VERTEX = `#version 300 es
void main() {
  // One triangle over all of the canvas.
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
uniform sampler2D entries, picture;
uniform usampler2D map0, map1, map2;
uniform ivec3 even, strides;
uniform int side, count, size, sides;
out vec4 colour;
// The same whole numbers as readTable's: the nearest of so many places for a step of thickness.
int place(usampler2D map, int level, int stride, ivec2 at) {
  int step = level < 0 ? int(texelFetch(map, at, 0).r) : level;
  return stride * ((2 * step * (size - 1) + ${LEVELS - 1}) / ${2 * (LEVELS - 1)});
}
void main() {
  ivec2 at = ivec2(int(gl_FragCoord.x), side - 1 - int(gl_FragCoord.y));
  if (count == 0) {
    colour = texelFetch(picture, at, 0);
    return;
  }
  int entry = sides > 1 && 2 * at.x >= side ? 1 : 0;
  entry += place(map0, even.x, strides.x, at);
  if (count > 1) entry += place(map1, even.y, strides.y, at);
  if (count > 2) entry += place(map2, even.z, strides.z, at);
  colour = texelFetch(entries, ivec2(entry % ${ROW}, entry / ${ROW}), 0);
}`;

/* A square canvas of `side` pixels: `draw` and `put` show a box of a table's colours, or of those in `pixels`. `wanted` is "webgl2" or "arrays" to have just that; `again` is called where a card was
 * lost and is back. */
export function makePainter(canvas, side, wanted, again) {
  // A card that is only played by the processor is slower than typed arrays.
  const pen = wanted === "arrays" ? null : canvas.getContext("webgl2", { alpha: false, antialias: false, preserveDrawingBuffer: true, failIfMajorPerformanceCaveat: wanted !== "webgl2" });
  return pen ? byCard(canvas, pen, side, again) : byArrays(canvas, side);
}

function byArrays(canvas, side) {
  const pen = context2d(canvas), image = pen.createImageData(side, side, { colorSpace: "srgb" }), pixels = new Uint32Array(image.data.buffer);
  const put = ({ x, y, w, h }) => pen.putImageData(image, 0, 0, x, y, w, h);
  return {
    name: "arrays",
    pixels,
    touch() {},
    put,
    // The share of what was drawn that sRGB lacks.
    draw(table, levels, box) {
      const outside = readTable(table, levels, pixels, side, box);
      put(box);
      return outside;
    },
  };
}

function byCard(canvas, gl, side, again) {
  const pixels = new Uint32Array(side * side), bytes = new Uint8Array(pixels.buffer);
  let places = null, maps = [], drawn = null;
  function begin() {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(`the canvas's program: ${gl.getProgramInfoLog(program)}`);
    gl.useProgram(program);
    places = Object.fromEntries(["entries", "picture", "map0", "map1", "map2", "even", "strides", "side", "count", "size", "sides"].map((name) => [name, gl.getUniformLocation(program, name)]));
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.disable(gl.DITHER);
    texture(0);
    texture(1);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, side, side);
    maps = Array.from({ length: MOST_TABLED }, (_, i) => {
      texture(2 + i);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R16UI, side, side);
      return { unit: 2 + i, steps: null };
    });
    ["entries", "picture", "map0", "map1", "map2"].forEach((name, unit) => gl.uniform1i(places[name], unit));
    gl.uniform1i(places.side, side);
    gl.viewport(0, 0, side, side);
    gl.enable(gl.SCISSOR_TEST);
    drawn = null;
  }
  function texture(unit) {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const what of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, what, gl.NEAREST);
  }
  function upload(map, { x, y, w, h }) {
    gl.activeTexture(gl.TEXTURE0 + map.unit);
    gl.pixelStorei(gl.UNPACK_ROW_LENGTH, side);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, x, y, w, h, gl.RED_INTEGER, gl.UNSIGNED_SHORT, map.steps, y * side + x);
    gl.pixelStorei(gl.UNPACK_ROW_LENGTH, 0);
  }
  function show(count, { x, y, w, h }) {
    gl.uniform1i(places.count, count);
    gl.scissor(x, side - y - h, w, h);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => {
    begin();
    again();
  });
  begin();
  return {
    name: "webgl2",
    pixels,
    // Steps of a map have changed within a box.
    touch(steps, box) {
      for (const map of maps) if (map.steps === steps) upload(map, box);
    },
    put(box) {
      gl.activeTexture(gl.TEXTURE1);
      gl.pixelStorei(gl.UNPACK_ROW_LENGTH, side);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, box.x, box.y, box.w, box.h, gl.RGBA, gl.UNSIGNED_BYTE, bytes, 4 * (box.y * side + box.x));
      gl.pixelStorei(gl.UNPACK_ROW_LENGTH, 0);
      show(0, box);
    },
    draw(table, levels, box) {
      if (drawn !== table) {
        const rows = Math.ceil(table.entries.length / ROW), filled = new Uint8Array(4 * rows * ROW);
        filled.set(new Uint8Array(table.entries.buffer));
        gl.activeTexture(gl.TEXTURE0);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, ROW, rows, 0, gl.RGBA, gl.UNSIGNED_BYTE, filled);
        drawn = table;
      }
      levels.forEach((level, i) => {
        if (typeof level === "number" || maps[i].steps === level) return;
        maps[i].steps = level;
        upload(maps[i], { x: 0, y: 0, w: side, h: side });
      });
      const three = (make) => [0, 1, 2].map((i) => (i < levels.length ? make(levels[i], i) : 0));
      gl.uniform3iv(places.even, three((level) => (typeof level === "number" ? level : -1)));
      gl.uniform3iv(places.strides, three((_, i) => table.sides * table.size ** (levels.length - i - 1)));
      gl.uniform1i(places.size, table.size);
      gl.uniform1i(places.sides, table.sides);
      show(levels.length, box);
      // Counted when the hand rests.
      return table.error === null || !table.lacks ? 0 : readTable(table, levels, pixels, side, box);
    },
  };
}
