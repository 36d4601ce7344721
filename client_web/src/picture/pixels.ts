/** The picture as the client holds it: RGB9_E5 words, kept so that probes, export, thumbnails and a lost GPU context
 * need no round trip. */
import { encodeRgb9e5 } from "../color/rgb9e5";
import type { Frame } from "../net/binaryFrame";
import type { Tile } from "../protocol";

export interface Pixels {
  readonly width: number;
  readonly height: number;
  /** Row-major, top row first. */
  readonly words: Uint32Array;
}

export function emptyPixels(width: number, height: number): Pixels {
  return { width, height, words: new Uint32Array(width * height) };
}

export function copyPixels(pixels: Pixels): Pixels {
  return { ...pixels, words: pixels.words.slice() };
}

function copyTile(target: Pixels, tile: Tile, words: Uint32Array): void {
  const [x, y, w, h] = tile;
  for (let row = 0; row < h; row++) {
    target.words.set(words.subarray(row * w, (row + 1) * w), (y + row) * target.width + x);
  }
}

/** The payload as words, copied only where the header's length left it unaligned. */
function wordsOf(bytes: Uint8Array): Uint32Array {
  const aligned = bytes.byteOffset % 4 === 0 ? bytes : bytes.slice();
  return new Uint32Array(aligned.buffer, aligned.byteOffset, aligned.byteLength / 4);
}

function wordsFromFloats(bytes: Uint8Array): Uint32Array {
  const floats = new Float32Array(bytes.slice().buffer);
  const words = new Uint32Array(floats.length / 3);
  for (let i = 0; i < words.length; i++) {
    words[i] = encodeRgb9e5(floats[3 * i] ?? 0, floats[3 * i + 1] ?? 0, floats[3 * i + 2] ?? 0);
  }
  return words;
}

/** Write a frame's tiles into the picture and return each tile's words, ready for upload. */
export function applyFrame(target: Pixels, frame: Frame): { tile: Tile; words: Uint32Array }[] {
  const words = frame.header.format === "f32" ? wordsFromFloats(frame.payload) : wordsOf(frame.payload);
  let offset = 0;
  return frame.header.tiles.map((tile) => {
    const count = tile[2] * tile[3];
    const part = words.subarray(offset, offset + count);
    offset += count;
    copyTile(target, tile, part);
    return { tile, words: part };
  });
}

/** Below this share even the brightest pixel is not tinted fully: there is next to nothing to show. */
const FAINTEST = 5;

/** Stretch an image so that its largest value is 255. */
export function normalised(values: Uint8Array): Uint8Array {
  const largest = values.reduce((a, b) => Math.max(a, b), FAINTEST);
  return values.map((value) => (value * 255) / largest);
}

/** Write the bytes of tiles, one tile after another, into an image. */
export function copyTiles(target: Uint8Array, width: number, tiles: readonly Tile[], bytes: Uint8Array): void {
  let offset = 0;
  for (const [x, y, w, h] of tiles) {
    for (let row = 0; row < h; row++) {
      target.set(bytes.subarray(offset, offset + w), (y + row) * width + x);
      offset += w;
    }
  }
}

/** Coverage of a whole picture once a frame has come: null where it is opaque everywhere. `before` may be written. */
export function takeAlpha(before: Uint8Array | null, { header, alpha }: Frame): Uint8Array | null {
  if (alpha === null) return header.tiles.length > 0 ? null : before;
  const size = header.width * header.height;
  const all = before?.length === size ? before : new Uint8Array(size).fill(255);
  copyTiles(all, header.width, header.tiles, alpha);
  return all;
}

/** A brush frame (how much of each pixel comes from a stretch of the curve) as one image, 255 = all of it. */
export function brushImage(frame: Frame): Uint8Array {
  const { width, height, tiles } = frame.header;
  const values = new Uint8Array(width * height);
  copyTiles(values, width, tiles, frame.payload);
  return values;
}
