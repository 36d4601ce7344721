import { expect, test } from "vitest";
import {
  batchFile,
  batchRequest,
  choiceProblem,
  namesText,
  size4K,
  type BatchChoice,
} from "../src/panels/looks/batchRequest";
import { LOOK } from "./exampleLook";

const CHOICE: BatchChoice = {
  hasCurrent: false,
  saved: ["Day", "Night"],
  views: ["front", "side"],
  usesSavedViews: false,
  size: null,
  format: "png",
  hasSheet: false,
  fileName: "{look}",
  start: 1,
  priority: 0,
};
const POSE = { to_world: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], yfov: 40 };
const CONTEXT = { bake: "b", look: LOOK, activeView: "side", pose: POSE, colorSpace: "ACEScg" };

test("all chosen looks are rendered in all chosen views", () => {
  const request = batchRequest(CHOICE, CONTEXT);
  expect(request).toMatchObject({ looks: [], saved_looks: ["Day", "Night"], format: "png", rebake: false });
  expect(request.views).toEqual([{ view: "front" }, { view: "side" }]);
  expect([request.view, request.path, request.layers]).toEqual([undefined, undefined, undefined]);
});

test("the current look has a name, and a free camera its pose in its own view only", () => {
  const choice = { ...CHOICE, hasCurrent: true, views: ["side"] };
  expect(batchRequest(choice, CONTEXT)).toMatchObject({ look_names: ["Current"], path: { cameras: [POSE] } });
  expect(batchRequest({ ...choice, views: ["front"] }, CONTEXT).path).toBeUndefined();
});

test("sets are rendered in their own views, others in the active one", () => {
  const request = batchRequest({ ...CHOICE, usesSavedViews: true }, CONTEXT);
  expect(request).toMatchObject({ saved_views: true, view: "side" });
  expect([request.views, request.path]).toEqual([undefined, undefined]);
});

test("4K keeps the aspect ratio, and bakes its size", () => {
  expect(size4K(640, 480)).toEqual([3840, 2880]);
  expect(size4K(1080, 1920)).toEqual([2160, 3840]);
  expect(batchRequest({ ...CHOICE, size: [3840, 2880] }, CONTEXT)).toMatchObject({ size: [3840, 2880], rebake: true });
});

test("EXR has layers and a color space, PNG perhaps a contact sheet", () => {
  expect(batchRequest({ ...CHOICE, format: "exr_layers", hasSheet: true }, CONTEXT)).toMatchObject({
    format: "exr",
    layers: true,
    color_space: "ACEScg",
  });
  const sheet = batchRequest({ ...CHOICE, hasSheet: true }, CONTEXT);
  expect(sheet.format).toBe("contact_sheet");
  expect(batchFile(sheet, 1)).toBe("archive.zip");
  expect(batchFile(batchRequest(CHOICE, CONTEXT), 4)).toBe("archive.zip");
  expect(batchFile(batchRequest(CHOICE, CONTEXT), 1)).toBe("frames/0");
});

test("what cannot be rendered is said", () => {
  expect(choiceProblem(CHOICE)).toBeNull();
  expect(choiceProblem({ ...CHOICE, saved: [] })).toBe("Choose a look.");
  expect(choiceProblem({ ...CHOICE, views: [] })).toBe("Choose a view.");
  expect(choiceProblem({ ...CHOICE, views: [], usesSavedViews: true })).toBeNull();
  expect(choiceProblem({ ...CHOICE, size: [NaN, 100] })).toContain("width and height");
});

test("the first names stand for all", () => {
  expect(namesText(["a.png"], 1)).toBe("1 image: a.png");
  expect(namesText(["a.png", "b.png", "c.png", "d.png"], 12)).toBe("12 images: a.png, b.png, c.png and 9 more");
});
