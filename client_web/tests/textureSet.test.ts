/** Several images that are dropped together, as libraries of textures name them. */
import { expect, test } from "vitest";
import { editorRejection, startPageRejection } from "../src/start/files/rejections";
import { isTextureFile } from "../src/panels/inspector/images/importImages";
import {
  planSet,
  setName,
  setMessage,
  withColorAndRoughness,
  withSet,
  type Slot,
} from "../src/panels/inspector/images/textureSet";
import type { ImageBody, ModelBody, Term } from "../src/protocol";
import { models } from "../src/state/scene";

const file = (name: string) => new File([], name);

function slotsOf(...names: string[]): Record<string, string> {
  return Object.fromEntries([...planSet(names.map(file)).slots].map(([slot, { name }]) => [slot, name]));
}

test("each map of a set has its place, in whatever order the files come", () => {
  const names = ["Color", "Displacement", "Metalness", "Normal", "Roughness", "AmbientOcclusion"].map(
    (map) => `Metal007_1K_${map}.jpg`,
  );
  const slots = {
    "base color": "Metal007_1K_Color.jpg",
    metalness: "Metal007_1K_Metalness.jpg",
    normals: "Metal007_1K_Normal.jpg",
    roughness: "Metal007_1K_Roughness.jpg",
  };
  expect(slotsOf(...names)).toEqual(slots);
  expect(slotsOf(...names.toReversed())).toEqual(slots);
  expect(planSet(names.map(file)).rejected.map(({ name }) => name)).toEqual([
    "Metal007_1K_Displacement.jpg",
    "Metal007_1K_AmbientOcclusion.jpg",
  ]);
});

test("normals for OpenGL are taken beside those for DirectX, and EXR files by what they are named", () => {
  expect(slotsOf("oak_nor_dx_1k.jpg", "oak_nor_gl_1k.exr", "oak_rough_1k.exr", "oak_diff_1k.jpg")).toEqual({
    "base color": "oak_diff_1k.jpg",
    normals: "oak_nor_gl_1k.exr",
    roughness: "oak_rough_1k.exr",
  });
  expect(isTextureFile(file("studio_small.exr"))).toBe(false);
});

test("one image may be roughness and metalness, unless one of them has its own", () => {
  expect(slotsOf("rust_OcclusionRoughnessMetallic.png", "rust_BaseColor.png")).toEqual({
    "base color": "rust_BaseColor.png",
    roughness: "rust_OcclusionRoughnessMetallic.png",
    metalness: "rust_OcclusionRoughnessMetallic.png",
  });
  expect(slotsOf("rust_arm_2k.jpg", "rust_rough_2k.jpg")).toEqual({
    roughness: "rust_rough_2k.jpg",
    metalness: "rust_arm_2k.jpg",
  });
});

test("images of every suffix that the server reads are textures", () => {
  for (const suffix of ["png", "JPG", "webp", "tga", "bmp", "dds", "tif", "tiff", "gif"]) {
    expect(isTextureFile(file(`oak.${suffix}`))).toBe(true);
  }
  expect(isTextureFile(file("oak.psd"))).toBe(false);
});

test("a preview beside the color is not used", () => {
  const names = ["Marble006.png", "Marble006_1K_Color.jpg", "Marble006_Roughness.tga"];
  const { slots, rejected } = planSet(names.map(file));
  expect([...slots.values()].map(({ name }) => name)).toEqual(["Marble006_1K_Color.jpg", "Marble006_Roughness.tga"]);
  expect(rejected).toEqual([{ name: "Marble006.png", reason: "another image is used as base color" }]);
});

test("one message says what is used and what is not, and a step has the name that the files share", () => {
  const refused = [{ name: "oak_ao.png", reason: "ambient occlusion; it is ray-traced" }];
  expect(setMessage("Chair", ["base color", "roughness", "normals"], refused)).toBe(
    "Applied to “Chair”: base color, roughness and normals. Not used: oak_ao.png (ambient occlusion; it is ray-traced).",
  );
  expect(setMessage("Chair", ["normals"], [])).toBe("Applied to “Chair”: normals.");
  expect(setName(["Metal007_1K_Color.jpg", "Metal007_1K_Normal.jpg"])).toBe("Metal007_1K");
  expect(setName(["oak rough.png", "oak.png"])).toBe("oak");
  expect(setName(["a.png", "b.png"])).toBe("2 images");
});

test("a material with a set has all of it at once", () => {
  models.value = [
    { model: "lambert", texture: "diffuse", parameters: [] },
    {
      model: "ggx",
      texture: "specular",
      width_parameter: "roughness",
      width_power: 1,
      parameters: [{ name: "roughness", minimum: 0, maximum: 1 }],
    },
  ] as unknown as ModelBody[];
  const image = (name: string) => ({ texture: `image:${name}`, roughness: 0.7 }) as ImageBody;
  const set = new Map<Slot, ImageBody>([
    ["base color", image("c")],
    ["roughness", image("r")],
    ["normals", image("n")],
  ]);
  const terms = [
    { model: "lambert", color: [0.5, 0.2, 0.1], texture: null },
    { model: "ggx", color: [1, 1, 1], texture: null, params: { roughness: 0.2 } },
  ] as Term[];
  const made = withSet({ terms }, withColorAndRoughness(terms, set), set);
  expect(made.terms.map(({ texture }) => texture)).toEqual(["image:c", null]);
  expect(made.terms[1]).toMatchObject({ params: { roughness: 0.7 }, roughness_map: "image:r" });
  expect(made.normal_map).toEqual({ image: "image:n", scale: 1 });
});

test("what was dropped on the wrong place is named, with where it belongs", () => {
  const dropped = (path: string) => [{ path, file: file(path) }];
  for (const refusal of [editorRejection, startPageRejection]) {
    expect(refusal(dropped("cayman.brdf"))).toMatch(/^Can't (use|open) cayman\.brdf.* drop materials on the Library/);
    expect(refusal(dropped("car.fbx"))).toMatch(/^Can't (use|open) car\.fbx.*Export a GLB/);
  }
  expect(editorRejection(dropped("car.glb"))).toMatch(/^Can't use car\.glb here\. Import scenes on the start page/);
  expect(startPageRejection(dropped("gold.binary"))).toMatch(/^Can't open gold\.binary\. .*drop materials/);
  expect(startPageRejection(dropped("car.glb"))).toBeNull();
});
