// The part of MessagePack that the link uses: nil, booleans, numbers, text, bytes, arrays, maps.
//
// An integer above 2^53 becomes a BigInt, because a Number would round it: a robot's clock in
// nanoseconds passes 2^53 after 104 days.

const MOST_DEPTH = 32;
const TEXT = new TextEncoder();
const WORDS = new TextDecoder("utf-8", { fatal: true });

/** Encode a value. Whole numbers become integers, and all others 64-bit floats. */
export function encode(value) {
  const out = new Writer();
  write(out, value);
  return out.bytes();
}

/** Decode a value; throws a RangeError for invalid bytes, or more than one value. */
export function decode(bytes) {
  const reader = { bytes, view: new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), at: 0 };
  const value = read(reader, 0);
  if (reader.at !== bytes.length) throw new RangeError("The message has more than one value.");
  return value;
}

class Writer {
  #buffer = new Uint8Array(256);
  #view = new DataView(this.#buffer.buffer);
  #length = 0;

  /** Make room for `count` more bytes; returns their offset. */
  #room(count) {
    const at = this.#length;
    this.#length += count;
    if (this.#length > this.#buffer.length) {
      const larger = new Uint8Array(Math.max(2 * this.#buffer.length, this.#length));
      larger.set(this.#buffer.subarray(0, at));
      this.#buffer = larger;
      this.#view = new DataView(larger.buffer);
    }
    return at;
  }

  byte(value) {
    const at = this.#room(1); // First, because it may replace the buffer.
    this.#buffer[at] = value;
  }

  /** Write a number after its type byte, with a method of the DataView. */
  number(kind, method, size, value) {
    this.byte(kind);
    const at = this.#room(size);
    this.#view[method](at, value);
  }

  raw(bytes) {
    const at = this.#room(bytes.length);
    this.#buffer.set(bytes, at);
  }

  bytes() {
    return this.#buffer.slice(0, this.#length);
  }
}

function write(out, value) {
  if (value === null || value === undefined) out.byte(0xc0);
  else if (value === false) out.byte(0xc2);
  else if (value === true) out.byte(0xc3);
  else if (typeof value === "bigint") writeBig(out, value);
  else if (typeof value === "number") writeNumber(out, value);
  else if (typeof value === "string") {
    const bytes = TEXT.encode(value);
    writeLength(out, bytes.length, 0xa0, 31, 0xd9, 0xda, 0xdb);
    out.raw(bytes);
  } else if (value instanceof Uint8Array) {
    writeLength(out, value.length, 0, -1, 0xc4, 0xc5, 0xc6);
    out.raw(value);
  } else if (Array.isArray(value)) {
    writeLength(out, value.length, 0x90, 15, 0, 0xdc, 0xdd);
    for (const item of value) write(out, item);
  } else {
    const entries = Object.entries(value).filter(([, item]) => item !== undefined);
    writeLength(out, entries.length, 0x80, 15, 0, 0xde, 0xdf);
    for (const [key, item] of entries) {
      write(out, key);
      write(out, item);
    }
  }
}

function writeLength(out, length, fix, most, kind8, kind16, kind32) {
  if (length <= most) out.byte(fix | length);
  else if (kind8 && length < 0x100) out.number(kind8, "setUint8", 1, length);
  else if (length < 0x10000) out.number(kind16, "setUint16", 2, length);
  else out.number(kind32, "setUint32", 4, length);
}

function writeNumber(out, value) {
  if (!Number.isSafeInteger(value)) out.number(0xcb, "setFloat64", 8, value);
  else if (value >= 0 && value < 0x80) out.byte(value);
  else if (value < 0 && value >= -32) out.byte(value & 0xff);
  else if (value >= 0 && value < 0x100000000) out.number(0xce, "setUint32", 4, value);
  else if (value < 0 && value >= -0x80000000) out.number(0xd2, "setInt32", 4, value);
  else writeBig(out, BigInt(value));
}

function writeBig(out, value) {
  if (BigInt.asUintN(64, value) === value) out.number(0xcf, "setBigUint64", 8, value);
  else if (BigInt.asIntN(64, value) === value) out.number(0xd3, "setBigInt64", 8, value);
  else throw new RangeError("The integer needs more than 64 bits.");
}

function read(from, depth) {
  if (depth > MOST_DEPTH) throw new RangeError("The value is nested too deeply.");
  const kind = number(from, "getUint8", 1);
  if (kind < 0x80) return kind;
  if (kind < 0x90) return map(from, kind & 15, depth);
  if (kind < 0xa0) return array(from, kind & 15, depth);
  if (kind < 0xc0) return WORDS.decode(take(from, kind & 31));
  if (kind >= 0xe0) return kind - 0x100;
  switch (kind) {
    case 0xc0: return null;
    case 0xc2: return false;
    case 0xc3: return true;
    case 0xc4: return take(from, number(from, "getUint8", 1));
    case 0xc5: return take(from, number(from, "getUint16", 2));
    case 0xc6: return take(from, number(from, "getUint32", 4));
    case 0xca: return number(from, "getFloat32", 4);
    case 0xcb: return number(from, "getFloat64", 8);
    case 0xcc: return number(from, "getUint8", 1);
    case 0xcd: return number(from, "getUint16", 2);
    case 0xce: return number(from, "getUint32", 4);
    case 0xcf: return exact(number(from, "getBigUint64", 8));
    case 0xd0: return number(from, "getInt8", 1);
    case 0xd1: return number(from, "getInt16", 2);
    case 0xd2: return number(from, "getInt32", 4);
    case 0xd3: return exact(number(from, "getBigInt64", 8));
    case 0xd9: return WORDS.decode(take(from, number(from, "getUint8", 1)));
    case 0xda: return WORDS.decode(take(from, number(from, "getUint16", 2)));
    case 0xdb: return WORDS.decode(take(from, number(from, "getUint32", 4)));
    case 0xdc: return array(from, number(from, "getUint16", 2), depth);
    case 0xdd: return array(from, number(from, "getUint32", 4), depth);
    case 0xde: return map(from, number(from, "getUint16", 2), depth);
    case 0xdf: return map(from, number(from, "getUint32", 4), depth);
    default: throw new RangeError(`The link does not use type ${kind} of MessagePack.`);
  }
}

function number(from, method, size) {
  const at = from.at;
  from.at += size; // Past the end, the DataView throws a RangeError.
  return from.view[method](at);
}

/** Convert a BigInt to a Number where that is exact. */
function exact(big) {
  const near = Number(big);
  return Number.isSafeInteger(near) ? near : big;
}

function take(from, count) {
  const end = from.at + count;
  if (end > from.bytes.length) throw new RangeError("The value ends too soon.");
  const bytes = from.bytes.subarray(from.at, end);
  from.at = end;
  return bytes;
}

function array(from, count, depth) {
  if (count > from.bytes.length - from.at) throw new RangeError("The value ends too soon.");
  return Array.from({ length: count }, () => read(from, depth + 1));
}

function map(from, count, depth) {
  const found = Object.create(null); // Without inherited properties.
  for (let i = 0; i < count; i += 1) {
    const key = read(from, depth + 1);
    if (typeof key !== "string") throw new RangeError("A key must be text.");
    found[key] = read(from, depth + 1);
  }
  return found;
}
