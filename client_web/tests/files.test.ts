import { expect, test } from "vitest";
import type { DroppedFile } from "../src/start/files/dropTypes";
import { isImportable, sortFiles, fileBaseName, mergeFiles, SCENE_SUFFIXES } from "../src/start/files/sceneFiles";
import { startPageRejection, UNSUPPORTED_SCENE_SUFFIXES } from "../src/start/files/rejections";
import { resolvePath } from "../src/start/files/references";
import { previewSize, validateRecipe } from "../src/session/scene/recipe";

const dropped = (path: string, content: BlobPart = ""): DroppedFile => ({
  path,
  file: new File([content], path.replace(/^.*\//, "")),
});
const gltf = (...uris: string[]) =>
  JSON.stringify({ buffers: uris.map((uri) => ({ uri })), images: [{ bufferView: 0 }] });

test("dropped files find their role", async () => {
  const files = [dropped("a.GLB"), dropped("b.ply"), dropped("sky.exr"), dropped("red.PNG")];
  const { scenes, environment } = await sortFiles(files);
  expect(scenes.map(({ path }) => path)).toEqual(["a.GLB", "b.ply"]);
  expect(environment?.name).toBe("sky.exr");
  expect(files.every(isImportable)).toBe(true);
  expect(isImportable(dropped("notes.txt"))).toBe(false);
  expect(["tea.pot.obj", "plain", "a/b/c.d.glb"].map(fileBaseName)).toEqual(["tea.pot", "plain", "c.d"]);
});

test("a format is either importable, and named in messages, or unsupported", () => {
  expect(SCENE_SUFFIXES.filter((suffix) => UNSUPPORTED_SCENE_SUFFIXES.includes(suffix))).toEqual([]);
  const message = startPageRejection([dropped("a.fbx")])?.toLowerCase() ?? "";
  const named = (suffix: string) => message.includes(suffix.startsWith(".usd") ? "usd" : suffix.slice(1));
  expect(SCENE_SUFFIXES.filter((suffix) => !named(suffix))).toEqual([]);
});

test("a USD layer takes along everything that a stage may name", async () => {
  const names = ["kit/parts/wheel.usdc", "kit/red.png", "kit/paint.mtlx", "kit/seat.usdz", "kit/maps/sky.exr"];
  const files = [dropped("kit/car.usda"), ...names.map((name) => dropped(name)), dropped("kit/a.bin")];
  const { scenes, environment } = await sortFiles(files);
  const car = scenes.find(({ path }) => path === "kit/car.usda");
  expect(car?.companions.map(({ path }) => path)).toEqual(names);
  expect(environment).toBeNull();
});

test("a map beside a USD layer is the environment unless the layer names it", async () => {
  const named = await sortFiles([dropped("a.usda", "asset inputs:texture:file = @./sky.exr@"), dropped("sky.exr")]);
  expect(named.environment).toBeNull();
  const other = await sortFiles([dropped("a.usda", "no map"), dropped("studio.hdr")]);
  expect(other.environment?.name).toBe("studio.hdr");
});

test("MaterialX documents need a USD layer, dropped with them or before", () => {
  const document = dropped("paint.mtlx");
  expect(startPageRejection([document])).toContain("drop materials on the Library");
  expect(startPageRejection([document, dropped("car.usdc")])).toBeNull();
  expect(startPageRejection([document], [dropped("car.usdc")])).toBeNull();
});

test("a scene takes along what it names, wherever that lies in the folder, and no more", async () => {
  const files = [
    dropped("room/scenes/sofa.gltf", gltf("sofa%20a.bin", "../textures/Red.png", "data:x", "gone.bin")),
    dropped("room/scenes/sofa a.bin"),
    dropped("room/textures/red.png"),
    dropped("room/textures/other.png"),
  ];
  const [sofa] = (await sortFiles(files)).scenes;
  expect(sofa?.companions.map(({ path }) => path)).toEqual(["room/scenes/sofa a.bin", "room/textures/red.png"]);
  expect(sofa?.missing).toEqual(["gone.bin"]);
});

test("an .obj takes its materials and the images that they name", async () => {
  const files = [
    dropped("a/tea.obj", "# by hand\r\nmtllib my looks.mtl\r\nv 0 0 0\n"),
    dropped("a/my looks.mtl", "newmtl Pot\nmap_Kd -s 1 1 1 images\\Pot.png\n"),
    dropped("a/images/Pot.png"),
    dropped("a/images/cup.png"),
  ];
  const [pot] = (await sortFiles(files)).scenes;
  expect(pot?.companions.map(({ path }) => path)).toEqual(["a/my looks.mtl", "a/images/Pot.png"]);
  expect(pot?.missing).toEqual([]);
});

test("what a binary glTF names stands in its first chunk; damaged files name nothing", async () => {
  const json = new TextEncoder().encode(gltf("far.bin"));
  const header = new DataView(new ArrayBuffer(20));
  header.setUint32(12, json.length, true);
  const files = [dropped("a.glb", new Blob([header, json])), dropped("b.glb", "gl"), dropped("c.gltf", "{")];
  expect((await sortFiles(files)).scenes.map(({ missing }) => missing)).toEqual([["far.bin"], [], []]);
});

test("of two files of one name the new one counts", () => {
  const [old, otherFile, news] = [dropped("a.glb"), dropped("b.hdr"), dropped("a.glb")];
  expect(mergeFiles([old, otherFile], [news])).toEqual([news, otherFile]);
});

test("names lead from the scene's folder, as far as there are folders", () => {
  expect(resolvePath("a/b/c.gltf", "./d/../e.bin")).toBe("a/b/e.bin");
  expect(resolvePath("c.gltf", "../../e.bin")).toBe("e.bin");
});

test("a preview has the shape of what was asked for and is never larger", () => {
  expect(previewSize([640, 480])).toEqual([320, 240]);
  const [width, height] = previewSize([4000, 500]);
  expect(width / height).toBeCloseTo(8, 1);
  expect(width * height).toBeLessThan(320 * 240 * 1.02);
  expect(previewSize([30, 900])).toEqual([30, 900]);
});

test("recipes are whole numbers within bounds", () => {
  expect(validateRecipe({ size: [16, 16384], lights: 1 })).toBeNull();
  for (const size of [
    [0, 9],
    [640, Number.NaN],
    [20.5, 20],
    [99999, 100],
  ] as [number, number][])
    expect(validateRecipe({ size, lights: 9 })).toMatch("width and height in pixels");
  expect(validateRecipe({ size: [640, 480], lights: 0 })).toMatch("environment detail");
  const good = { size: [640, 480] as [number, number], lights: 9 };
  expect(validateRecipe({ ...good, patches: 64, gather_rays: 4096 })).toBeNull();
  expect(validateRecipe({ ...good, patches: 63 })).toMatch("64–65,535 bounce samples");
  for (const gather_rays of [15, 4097, 20.5, Number.NaN])
    expect(validateRecipe({ ...good, gather_rays })).toMatch("rays per sample");
});
