import { expect, test } from "vitest";
import { baseTexture, withBaseImage, withoutBaseImage, withTexture } from "../src/panels/inspector/images/baseColor";
import { detectMap } from "../src/panels/inspector/images/mapNames";
import type { ModelBody, Term } from "../src/protocol";
import { models } from "../src/state/scene";

const IMAGE = "image:0123456789abcdef";
models.value = [
  { model: "lambert", texture: "diffuse" },
  { model: "ggx", texture: "specular" },
] as unknown as ModelBody[];
const term = (model: string, texture: string | null, color: Term["color"] = [0.5, 0.2, 0.1]): Term => ({
  model,
  texture,
  color,
});

test("an image takes the place of the diffuse color; a color that stood alone becomes white", () => {
  const made = withBaseImage([term("lambert", null), term("ggx", "specular")], IMAGE);
  expect(made).toEqual([term("lambert", IMAGE, [1, 1, 1]), term("ggx", "specular")]);
  expect(baseTexture(made)).toBe(IMAGE);
});

test("the tint of a texture stays, and all terms of its channel show the image", () => {
  const made = withBaseImage([term("lambert", "diffuse"), term("lambert", "diffuse"), term("ggx", null)], IMAGE);
  expect(made).toEqual([term("lambert", IMAGE), term("lambert", IMAGE), term("ggx", null)]);
});

test("a metal shows it in its highlights", () => {
  expect(withBaseImage([term("ggx", "specular")], IMAGE)).toEqual([term("ggx", IMAGE)]);
});

test("without it the scene's own is back", () => {
  const own = [term("lambert", null), term("ggx", "specular")];
  expect(withoutBaseImage(withBaseImage(own, IMAGE), own)).toEqual(own);
});

test("terms that share a channel change their texture together; others stay", () => {
  const terms = [term("lambert", IMAGE), term("lambert", IMAGE), term("lambert", null)];
  expect(withTexture(terms, 0, "diffuse")).toEqual([
    term("lambert", "diffuse"),
    term("lambert", "diffuse"),
    term("lambert", null),
  ]);
  expect(withTexture([term("lambert", "diffuse"), term("lambert", "diffuse")], 1, IMAGE)).toEqual([
    term("lambert", IMAGE),
    term("lambert", IMAGE),
  ]);
});

test("maps that are no colors are known by their names", () => {
  const named = [
    "oak_rough_2k.jpg",
    "Metal049A_1K-JPG_Metalness.jpg",
    "rust_arm_4k.png",
    "bricks-normalGL.png",
    "wall_AO.png",
  ];
  const otherTerms = ["oak_nor_dx_2k.jpg", "oak_nor_gl_2k.jpg", "tiles_height.png", "light_emissive.png"];
  expect(named.map(detectMap)).toEqual(["roughness", "metal", "roughness and metal", "normals", "occlusion"]);
  expect(otherTerms.map(detectMap)).toEqual(["DirectX normals", "normals", "height", "emission"]);
  const colors = [
    "rough_plaster_diff_2k.jpg",
    "Metal049A_1K-JPG_Color.jpg",
    "armchair.webp",
    "rough.png",
    "IMG_1234.jpg",
  ];
  expect(colors.map(detectMap)).toEqual(colors.map(() => null));
});
