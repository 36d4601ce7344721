/** Binary frames: uint32 little-endian header length, JSON header, payload. All of it is validated. */
import type { FrameHeader, Tile } from "../../protocol";

const MAX_HEADER_BYTES = 1 << 20;
const MAX_SIDE = 16_384;
const MAX_TEXELS = 2 ** 28;
const DTYPE_BYTES: Record<string, number> = { float32: 4, float16: 2, uint32: 4, int32: 4 };
const PIXEL_BYTES: Record<string, number> = { rgb9e5: 4, f32: 12, r8: 1 };

export interface Frame {
  header: FrameHeader;
  payload: Uint8Array;
  /** Coverage of each pixel of the tiles; null if opaque. */
  alpha: Uint8Array | null;
}

export class FrameError extends Error {}

function isIntegerUpTo(value: unknown, maximum: number): value is number {
  return typeof value === "number" && Number.isInteger(value) && value >= 0 && value <= maximum;
}

function validateTiles(tiles: unknown, width: number, height: number): asserts tiles is Tile[] {
  if (!Array.isArray(tiles)) throw new FrameError("a frame has no list of tiles");
  for (const tile of tiles) {
    const [x, y, w, h] = Array.isArray(tile) && tile.length === 4 ? (tile as unknown[]) : [];
    const inside =
      isIntegerUpTo(x, width) &&
      isIntegerUpTo(y, height) &&
      isIntegerUpTo(w, width) &&
      isIntegerUpTo(h, height) &&
      x + w <= width &&
      y + h <= height;
    if (!inside) throw new FrameError("a frame has a tile outside the picture");
  }
}

function validateArrays(tables: FrameHeader["scene_update"] | undefined, size: number): void {
  if (typeof tables !== "object" || tables === null || !Array.isArray(tables.arrays)) {
    throw new FrameError("a frame has no list of arrays");
  }
  let bytes = 0;
  for (const { dtype, shape } of tables.arrays) {
    const itemBytes = DTYPE_BYTES[dtype];
    const [texels, components] = Array.isArray(shape) ? shape : [];
    if (itemBytes === undefined || !isIntegerUpTo(texels, MAX_TEXELS) || ![1, 2, 4].includes(Number(components))) {
      throw new FrameError("a frame has an array of an unknown format");
    }
    bytes += itemBytes * texels * Number(components);
  }
  if (bytes !== size) throw new FrameError("a frame's arrays do not match its bytes");
}

function parseHeader(text: string): FrameHeader {
  let header: unknown;
  try {
    header = JSON.parse(text);
  } catch {
    throw new FrameError("a frame's header is not JSON");
  }
  if (typeof header !== "object" || header === null) throw new FrameError("a frame's header is not an object");
  const { frame, revision, width, height, tiles, format } = header as Record<string, unknown>;
  if (!isIntegerUpTo(width, MAX_SIDE) || !isIntegerUpTo(height, MAX_SIDE) || width === 0 || height === 0) {
    throw new FrameError("a frame's size is out of range");
  }
  if (!isIntegerUpTo(frame, 2 ** 53) || !isIntegerUpTo(revision, 2 ** 53)) throw new FrameError("a frame has no number");
  if (typeof format !== "string") throw new FrameError("a frame has no format");
  validateTiles(tiles, width, height);
  return header as FrameHeader;
}

/** Parse a frame. Throws FrameError for invalid bytes; reads nothing outside `buffer`. */
export function parseFrame(buffer: ArrayBuffer): Frame {
  if (buffer.byteLength < 4) throw new FrameError("a frame is too short");
  const headerBytes = new DataView(buffer).getUint32(0, true);
  if (headerBytes > MAX_HEADER_BYTES || 4 + headerBytes > buffer.byteLength) {
    throw new FrameError("a frame's header is longer than the frame");
  }
  const header = parseHeader(new TextDecoder().decode(new Uint8Array(buffer, 4, headerBytes)));
  const body = new Uint8Array(buffer, 4 + headerBytes);
  if (header.kind === "scene_update") {
    validateArrays(header.scene_update, body.byteLength);
    return { header, payload: body, alpha: null };
  }
  if (header.format === "jpeg") return { header, payload: body, alpha: null };
  const perPixel = PIXEL_BYTES[header.format];
  if (perPixel === undefined) throw new FrameError(`a frame has the unknown format ${header.format}`);
  const pixels = header.tiles.reduce((sum, [, , w, h]) => sum + w * h, 0);
  const size = pixels * perPixel;
  if (size + (header.alpha ? pixels : 0) !== body.byteLength) {
    throw new FrameError("a frame's tiles do not match its bytes");
  }
  return { header, payload: body.subarray(0, size), alpha: header.alpha ? body.subarray(size) : null };
}
