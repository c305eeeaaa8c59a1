// Sets as runs in a variable-length code (docs/reference/walk-folder.md).

/** Ids of the set whose code is bytes[begin] to bytes[end - 1], ascending; none is `count` or more. */
export function decode(bytes, begin, end, count) {
  const ids = [];
  let at = begin;
  const number = () => {
    let value = 0;
    for (let place = 0; ; place += 7) {
      if (at >= end || place > 28) throw new Error("sets: expected a whole code, found one cut short");
      const byte = bytes[at++];
      value += (byte & 127) * 2 ** place;
      if (byte < 128) return value;
    }
  };
  let next = 0;
  let first = true;
  while (at < end) {
    next += number() + (first ? 0 : 1);
    first = false;
    const stop = next + number() + 1;
    if (stop > count) throw new Error(`sets: expected ids below ${count}, found ${stop - 1}`);
    while (next < stop) ids.push(next++);
  }
  return ids;
}
