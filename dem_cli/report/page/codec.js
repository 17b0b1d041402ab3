"use strict";

// Undoes codes.py: base64, deflate, bytes shuffled by place, differences between frames, quanta.

const TYPES = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array };
const SPAN = Math.log(1e9);
const POWERS = Float64Array.from({ length: 32768 }, (_, q) => (q ? Math.exp((SPAN * (q - 32767)) / 32766) : 0));

async function inflate(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let k = 0; k < binary.length; k++) bytes[k] = binary.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The quanta of one section as a typed array.
function unshuffle(blob, section) {
  const Type = TYPES[section.type];
  const width = Type.BYTES_PER_ELEMENT;
  const n = section.count;
  const bytes = new Uint8Array(n * width);
  for (let b = 0; b < width; b++) {
    const from = section.offset + b * n;
    for (let k = 0; k < n; k++) bytes[k * width + b] = blob[from + k];
  }
  const quanta = new Type(bytes.buffer);
  if (section.delta) for (let k = section.row; k < n; k++) quanta[k] += quanta[k - section.row];
  return quanta;
}

const decoders = {
  linear: (section) => {
    const width = section.high > section.low ? section.high - section.low : 1;
    return (q) => (q === 65535 ? NaN : section.low + (q * width) / 65534);
  },
  log: (section) => (q) => {
    if (q === 32768) return NaN;
    const size = section.largest * POWERS[q & 32767];
    return q > 32768 ? -size : size;
  },
  angle: () => (q) => (q * Math.PI) / 32768,
};

// The numbers of a player: data.row("x", frame) is an array with one value a grain, data.whole("radius") all of a section.
class Data {
  constructor(blob, sections) {
    this.sections = sections;
    this.quanta = {};
    for (const [name, section] of Object.entries(sections)) this.quanta[name] = unshuffle(blob, section);
    this.kept = new Map();
  }

  has(name) {
    return name in this.sections;
  }

  whole(name) {
    return this.quanta[name];
  }

  row(name, frame) {
    const key = `${name} ${frame}`;
    const kept = this.kept.get(key);
    if (kept) return kept;
    const section = this.sections[name];
    const width = section.row;
    const quanta = this.quanta[name].subarray(frame * width, (frame + 1) * width);
    const found = section.code ? Float64Array.from(quanta, decoders[section.code](section)) : quanta;
    if (this.kept.size > 60) this.kept.delete(this.kept.keys().next().value);
    this.kept.set(key, found);
    return found;
  }
}
