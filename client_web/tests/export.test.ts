import { expect, test, vi } from "vitest";
import { fileStem } from "../src/panels/looks/exportImage";
import type { SceneBody } from "../src/protocol";
import { scene } from "../src/state/scene";
import { activeViewName } from "../src/state/views";

vi.mock("../src/session/fidelityState", () => ({ untilExact: () => Promise.resolve() }));

function called(name: string, view: string): string {
  scene.value = { name } as SceneBody;
  activeViewName.value = view;
  return fileStem();
}

test("a picture's file is called like the scene and the view", () => {
  expect(called("still life", "front")).toBe("still-life-front");
  expect(called("a/b", "灯 1")).toBe("a-b-灯-1");
});

test("long names are cut between characters, far below what the server takes", () => {
  expect(called("x".repeat(256), "front")).toBe("x".repeat(120));
  expect(called(`x${"𠀀".repeat(200)}`, "front")).toBe(`x${"𠀀".repeat(119)}`);
});

test("sequences have different file names from single images", () => {
  called("still life", "front");
  expect(fileStem("light groups", "ACEScg")).toBe("still-life-front-light-groups-ACEScg");
});
