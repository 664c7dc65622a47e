// Parsing of the robot's key, and the proof that the client holds it.

const ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ234567"; // Base 32, RFC 4648.
const CHARACTERS = 26;
const KEY_BYTES = 16;
const PURPOSE = new TextEncoder().encode("shapechanger link 1");
const MISREAD = { 0: "O", 1: "I", 8: "B" };

/** Return the 16 bytes of a key; groups, spaces and case do not matter. Throws an Error. */
export function parseKey(text) {
  const plain = text.toUpperCase().replace(/[-\s]/g, "").replace(/[018]/g, (c) => MISREAD[c]);
  if (plain.length !== CHARACTERS) {
    throw new Error(`A key has ${CHARACTERS} letters and digits, got ${plain.length}.`);
  }
  const key = new Uint8Array(KEY_BYTES);
  let bits = 0;
  let held = 0;
  let at = 0;
  for (const letter of plain) {
    const value = ALPHABET.indexOf(letter);
    if (value < 0) throw new Error("A key has only the letters A to Z and the digits 2 to 7.");
    held = (held << 5) | value;
    bits += 5;
    if (bits >= 8) {
      bits -= 8;
      key[at] = held >> bits;
      held &= (1 << bits) - 1;
      at += 1;
    }
  }
  if (held !== 0) throw new Error("The last letter of this key is wrong.");
  return key;
}

/** Return the bytes of hexadecimal digits. */
export function fromHex(digits) {
  return Uint8Array.from(digits.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));
}

/** Return the HMAC-SHA256 of nonce, certificate and role, each after its length. */
export async function makeProof(key, nonce, certificate, role) {
  const parts = [PURPOSE, nonce, certificate, new TextEncoder().encode(role)];
  const text = new Uint8Array(parts.reduce((sum, part) => sum + 4 + part.length, 0));
  const view = new DataView(text.buffer);
  let at = 0;
  for (const part of parts) {
    view.setUint32(at, part.length);
    text.set(part, at + 4);
    at += 4 + part.length;
  }
  const hmac = { name: "HMAC", hash: "SHA-256" };
  const held = await crypto.subtle.importKey("raw", key, hmac, false, ["sign"]);
  return new Uint8Array(await crypto.subtle.sign(hmac, held, text));
}
