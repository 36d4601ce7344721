import { describe, expect, test } from "vitest";
import { decodeRgb9e5, encodeRgb9e5 } from "../src/render/color/rgb9e5";
import { FrameError, parseFrame } from "../src/session/net/binaryFrame";
import { applyFrame, brushImage, emptyPixels, normalizeWeights, wholeImage } from "../src/render/pixels";

const HEADER = {
  frame: 12,
  revision: 7,
  room_revision: 0,
  view: "front",
  width: 4,
  height: 3,
  tiles: [[1, 1, 2, 2]],
  format: "rgb9e5",
  exact: true,
  kind: "picture",
  ms: { wait: 0, update: 1, encode: 1 },
};

function pack(header: unknown, payload: Uint8Array = new Uint8Array(16), length?: number): ArrayBuffer {
  const head = new TextEncoder().encode(typeof header === "string" ? header : JSON.stringify(header));
  const bytes = new Uint8Array(4 + head.length + payload.length);
  new DataView(bytes.buffer).setUint32(0, length ?? head.length, true);
  bytes.set(head, 4);
  bytes.set(payload, 4 + head.length);
  return bytes.buffer;
}

describe("parseFrame", () => {
  test("reads header and payload, whatever the header's length is modulo four", () => {
    for (const view of ["a", "ab", "abc", "abcd"]) {
      const payload = Uint8Array.from({ length: 16 }, (_, i) => i);
      const frame = parseFrame(pack({ ...HEADER, view }, payload));
      expect(frame.header.view).toBe(view);
      expect([...frame.payload]).toEqual([...payload]);
      expect(() => applyFrame(emptyPixels(4, 3), frame)).not.toThrow();
    }
  });

  test("of one tile that covers the picture is taken over as it is, any other is not", () => {
    const payload = Uint8Array.from({ length: 48 }, (_, i) => i);
    const whole = parseFrame(pack({ ...HEADER, tiles: [[0, 0, 4, 3]] }, payload));
    const copied = emptyPixels(4, 3);
    applyFrame(copied, whole);
    expect(wholeImage(whole)).toEqual(copied);
    expect(wholeImage(parseFrame(pack(HEADER)))).toBeNull();
  });

  test("keeps the coverage of its pixels apart", () => {
    const all = Uint8Array.from({ length: 20 }, (_, i) => i);
    const frame = parseFrame(pack({ ...HEADER, alpha: true }, all));
    expect([...frame.payload]).toEqual([...all.subarray(0, 16)]);
    expect([...(frame.alpha ?? [])]).toEqual([16, 17, 18, 19]);
    expect(parseFrame(pack(HEADER)).alpha).toBeNull();
  });

  const hostile: [string, ArrayBuffer][] = [
    ["empty", new ArrayBuffer(0)],
    ["shorter than a length", new ArrayBuffer(3)],
    ["header longer than the frame", pack(HEADER, new Uint8Array(16), 100_000)],
    ["header length of four gigabytes", pack(HEADER, new Uint8Array(16), 0xffffffff)],
    ["no JSON", pack("{nope")],
    ["null", pack("null")],
    ["a list", pack("[1,2]")],
    ["no size", pack({ ...HEADER, width: undefined })],
    ["zero size", pack({ ...HEADER, width: 0 })],
    ["huge size", pack({ ...HEADER, width: 1e9, height: 1e9 })],
    ["fractional size", pack({ ...HEADER, width: 4.5 })],
    ["negative tile", pack({ ...HEADER, tiles: [[-1, 0, 2, 2]] })],
    ["tile outside", pack({ ...HEADER, tiles: [[3, 1, 2, 2]] })],
    ["tile of three numbers", pack({ ...HEADER, tiles: [[0, 0, 2]] })],
    ["tiles that are no list", pack({ ...HEADER, tiles: "all" })],
    ["NaN as a number", pack({ ...HEADER, frame: null })],
    ["unknown format", pack({ ...HEADER, format: "bmp" })],
    ["no coverage where it is announced", pack({ ...HEADER, alpha: true }, new Uint8Array(16))],
    ["payload too short", pack(HEADER, new Uint8Array(15))],
    ["payload too long", pack(HEADER, new Uint8Array(17))],
  ];
  test.each(hostile)("refuses %s", (_, buffer) => {
    expect(() => parseFrame(buffer)).toThrow(FrameError);
  });
});

describe("scene updates", () => {
  const array = { name: "even", dtype: "float32", shape: [2, 4] };
  const tables = (arrays: unknown) => ({ ...HEADER, tiles: [], format: "arrays", kind: "scene_update", scene_update: { arrays } });

  test("keep their payload whole", () => {
    const frame = parseFrame(pack(tables([array, { name: "vectors", dtype: "float16", shape: [1, 4] }]), new Uint8Array(40)));
    expect(frame.payload.byteLength).toBe(40);
  });

  test("are refused where arrays and bytes do not agree, or a form is unknown", () => {
    const bad = [[], [{ ...array, dtype: "float64" }], [{ ...array, shape: [2, 3] }], [{ ...array, shape: [-2, 4] }], undefined];
    for (const arrays of bad) expect(() => parseFrame(pack(tables(arrays), new Uint8Array(32)))).toThrow(FrameError);
    expect(() => parseFrame(pack({ ...tables([array]), scene_update: null }, new Uint8Array(32)))).toThrow(FrameError);
  });
});

describe("rgb9e5", () => {
  test("known words decode to known values", () => {
    // exponent 16: mantissas count 2^(16-15-9) = 1/256
    const word = ((16 << 27) | (64 << 18) | (128 << 9) | 256) >>> 0;
    expect(decodeRgb9e5(word)).toEqual([1, 0.5, 0.25]);
    expect(decodeRgb9e5(0)).toEqual([0, 0, 0]);
    expect(decodeRgb9e5(0xffffffff)).toEqual([65408, 65408, 65408]);
  });

  test("a round trip is within half a step of the largest channel", () => {
    for (let i = 0; i < 400; i++) {
      const rgb = [0, 1, 2].map((c) => 2 ** (((i * 7 + c * 13) % 36) - 20)) as [number, number, number];
      const back = decodeRgb9e5(encodeRgb9e5(...rgb));
      const step = Math.max(...rgb, 2 ** -15) / 256;
      back.forEach((v, c) => expect(Math.abs(v - (rgb[c] as number))).toBeLessThanOrEqual(step / 2 + 2 ** -25));
    }
  });

  test("negative, NaN and too bright values are clamped", () => {
    expect(decodeRgb9e5(encodeRgb9e5(-1, Number.NaN, 0))).toEqual([0, 0, 0]);
    expect(decodeRgb9e5(encodeRgb9e5(1e9, Number.POSITIVE_INFINITY, 0))).toEqual([65408, 65408, 0]);
    expect(decodeRgb9e5(encodeRgb9e5(0.99999, 0, 0))[0]).toBe(1);
  });
});

describe("applyFrame", () => {
  test("a tile lands where it belongs and nowhere else", () => {
    const encoded = Uint32Array.from([1, 2, 3, 4]);
    const pixels = emptyPixels(4, 3);
    applyFrame(pixels, parseFrame(pack(HEADER, new Uint8Array(encoded.buffer))));
    expect([...pixels.encoded]).toEqual([0, 0, 0, 0, 0, 1, 2, 0, 0, 3, 4, 0]);
  });

  test("floats become the nearest shared-exponent words", () => {
    const floats = Float32Array.from({ length: 12 }, (_, i) => i / 4);
    const pixels = emptyPixels(4, 3);
    applyFrame(pixels, parseFrame(pack({ ...HEADER, format: "f32" }, new Uint8Array(floats.buffer))));
    expect(decodeRgb9e5(pixels.encoded[5] as number)).toEqual([0, 0.25, 0.5]);
  });

  test("a brush has one byte a pixel", () => {
    const frame = parseFrame(pack({ ...HEADER, kind: "highlight", format: "r8" }, Uint8Array.from([10, 20, 30, 40])));
    expect([...brushImage(frame)]).toEqual([0, 0, 0, 0, 0, 10, 20, 0, 0, 30, 40, 0]);
    expect(Math.max(...normalizeWeights(brushImage(frame)))).toBe(255);
    expect(Math.max(...normalizeWeights(Uint8Array.from([0, 1])))).toBe(51);
  });
});
