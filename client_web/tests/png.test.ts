/** A PNG that is exported says what its colors are. */
import { decode, encode } from "fast-png";
import { expect, test } from "vitest";
import { addSrgbChunk } from "../src/panels/looks/displayImage";

test("the tag is a chunk of its own, and the picture is as it was", async () => {
  const data = new Uint8Array([255, 0, 0, 0, 255, 0]);
  const png = new Blob([encode({ width: 2, height: 1, data, channels: 3 }) as Uint8Array<ArrayBuffer>], {
    type: "image/png",
  });
  const tagged = addSrgbChunk(png);
  const bytes = await tagged.arrayBuffer();
  expect(tagged.type).toBe("image/png");
  expect(new TextDecoder("latin1").decode(bytes.slice(33, 46)).slice(4, 8)).toBe("sRGB");
  const decoded = decode(bytes, { checkCrc: true });
  expect([decoded.width, decoded.height, ...decoded.data]).toEqual([2, 1, ...data]);
});
