/** 16-bit grey PNG, decoded by hand: browsers round such images to 8 bits, and material ids need all of them. */

const SIGNATURE = [137, 80, 78, 71, 13, 10, 26, 10];
const MAX_PIXELS = 1 << 26;

export interface Ids {
  width: number;
  height: number;
  /** Row-major, top row first; 65535 = background. */
  values: Uint16Array;
}

interface Chunks {
  width: number;
  height: number;
  data: Uint8Array[];
}

function readChunks(bytes: Uint8Array): Chunks {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (SIGNATURE.some((byte, i) => bytes[i] !== byte)) throw new Error("the material image is not a PNG");
  let offset = 8;
  const result: Chunks = { width: 0, height: 0, data: [] };
  while (offset + 12 <= bytes.length) {
    const length = view.getUint32(offset);
    const type = String.fromCharCode(...bytes.subarray(offset + 4, offset + 8));
    if (offset + 12 + length > bytes.length) throw new Error("the material image is cut short");
    const body = bytes.subarray(offset + 8, offset + 8 + length);
    if (type === "IHDR") {
      result.width = view.getUint32(offset + 8);
      result.height = view.getUint32(offset + 12);
      const [depth, colour, , , interlace] = body.subarray(8);
      if (depth !== 16 || colour !== 0 || interlace !== 0) throw new Error("the material image is not 16-bit grey");
    } else if (type === "IDAT") result.data.push(body);
    else if (type === "IEND") break;
    offset += 12 + length;
  }
  if (result.width * result.height === 0 || result.width * result.height > MAX_PIXELS) {
    throw new Error("the material image has no usable size");
  }
  return result;
}

async function inflate(parts: Uint8Array[]): Promise<Uint8Array> {
  const stream = new Blob(parts as BlobPart[]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function paeth(a: number, b: number, c: number): number {
  const p = a + b - c;
  const [pa, pb, pc] = [Math.abs(p - a), Math.abs(p - b), Math.abs(p - c)];
  if (pa <= pb && pa <= pc) return a;
  return pb <= pc ? b : c;
}

/** Undo one row's filter in place (PNG 1.2, section 6); two bytes a pixel. */
function unfilter(filter: number, row: Uint8Array, above: Uint8Array): void {
  for (let i = 0; i < row.length; i++) {
    const a = i >= 2 ? (row[i - 2] as number) : 0;
    const b = above[i] as number;
    const c = i >= 2 ? (above[i - 2] as number) : 0;
    const add = [0, a, b, (a + b) >> 1, paeth(a, b, c)][filter] ?? 0;
    row[i] = (row[i] as number) + add;
  }
}

export async function decodeIds(buffer: ArrayBuffer): Promise<Ids> {
  const { width, height, data } = readChunks(new Uint8Array(buffer));
  const raw = await inflate(data);
  const stride = 2 * width;
  if (raw.length !== (stride + 1) * height) throw new Error("the material image has the wrong length");
  const values = new Uint16Array(width * height);
  let above: Uint8Array = new Uint8Array(stride);
  for (let y = 0; y < height; y++) {
    const start = y * (stride + 1);
    const row = raw.subarray(start + 1, start + 1 + stride);
    if (raw[start] !== 0) unfilter(raw[start] as number, row, above);
    for (let x = 0; x < width; x++) values[y * width + x] = ((row[2 * x] as number) << 8) | (row[2 * x + 1] as number);
    above = row;
  }
  return { width, height, values };
}
