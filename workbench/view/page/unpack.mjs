// What Python has written: a head in JSON, and arrays one after the other in one block of bytes.

const KINDS = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i4: Int32Array, f4: Float32Array };

/** The bytes of a text in base64, unpacked. */
export async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Arrays by name; `head` says of each its kind, where it begins and how many numbers it has. */
export function arraysOf(head, bytes) {
  const found = {};
  for (const [name, [kind, begin, count]] of Object.entries(head)) {
    const made = KINDS[kind];
    const size = made.BYTES_PER_ELEMENT * count;
    if (begin + size > bytes.length) {
      throw new Error(`${name}: expected ${size} bytes from ${begin} on, found ${Math.max(0, bytes.length - begin)}`);
    }
    // A copy is aligned, wherever the part lies.
    found[name] = new made(bytes.slice(begin, begin + size).buffer);
  }
  return found;
}
