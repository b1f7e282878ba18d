// Messages: a header of JSON, then float32 arrays, as the server's messages.py has them; and the socket that carries them.

export function packMessage(header, arrays = {}, rest = null) {
  const listed = Object.entries(arrays).map(([name, array]) => [name, [array.length]]);
  let head = new TextEncoder().encode(JSON.stringify({ ...header, arrays: listed }));
  const padded = new Uint8Array(Math.ceil(head.length / 4) * 4).fill(32);
  padded.set(head);
  const parts = [new Uint32Array([padded.length]), padded, ...Object.values(arrays)];
  if (rest) parts.push(rest);
  const size = parts.reduce((sum, part) => sum + part.byteLength, 0);
  const out = new Uint8Array(size);
  let at = 0;
  for (const part of parts) {
    out.set(new Uint8Array(part.buffer ?? part, part.byteOffset ?? 0, part.byteLength), at);
    at += part.byteLength;
  }
  return out;
}

export function unpackMessage(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  let at = 4 + length;
  for (const [name, shape] of header.arrays) {
    const count = shape.reduce((product, n) => product * n, 1);
    const values = new Float32Array(buffer, at, count);
    values.shape = shape;
    arrays[name] = values;
    at += 4 * count;
  }
  return { header, arrays };
}

// A socket that comes back: whatever was asked and not answered is asked again by its owner, on `open`.
export class SocketLink {
  constructor(address) {
    this.address = address;
    this.wait = 300;
    this.onmessage = this.onopen = this.onlost = () => {};
  }
  open() {
    const socket = (this.socket = new WebSocket(this.address));
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.wait = 300;
      this.onopen();
    };
    socket.onmessage = (event) => {
      const { header, arrays } = unpackMessage(event.data);
      this.onmessage(header, arrays);
    };
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.onlost();
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(4000, this.wait * 1.6);
    };
  }
  get there() {
    return this.socket?.readyState === 1;
  }
  send(header, arrays, rest) {
    if (!this.there) return false;
    this.socket.send(packMessage(header, arrays, rest));
    return true;
  }
}

// A page by itself: nobody to ask.
export class NoLink {
  get there() {
    return false;
  }
  send() {
    return false;
  }
}
