import { expect, test } from "vitest";
import { filterRows } from "../src/panels/lights/lightFilter";
import { completeGroup } from "../src/panels/lights/lightGroups";

const GROUPS = {
  Ceiling: completeGroup({ lights: ["Bulb 1", "Bulb 2"] }),
  Desk: completeGroup({ lights: ["Lamp"] }),
  Empty: completeGroup({}),
};
const shown = (text: string) => {
  const { groups, lights } = filterRows(GROUPS, LIGHTS, text);
  return { groups: groups.map((row) => [row.name, row.shown]), lights };
};
const LIGHTS = ["Bulb 1", "Bulb 2", "Lamp", "Sun", "Lamp post"];

test("no text shows all rows, each light once", () => {
  const all = [
    ["Ceiling", ["Bulb 1", "Bulb 2"]],
    ["Desk", ["Lamp"]],
    ["Empty", []],
  ];
  expect(shown(" ")).toEqual({ groups: all, lights: ["Sun", "Lamp post"] });
});

test("a light is found in its group, without the others", () => {
  expect(shown("b 2")).toEqual({ groups: [["Ceiling", ["Bulb 2"]]], lights: [] });
  expect(shown("LAMP")).toEqual({ groups: [["Desk", ["Lamp"]]], lights: ["Lamp post"] });
});

test("a group is found with all its lights", () => {
  expect(shown("ceil")).toEqual({ groups: [["Ceiling", ["Bulb 1", "Bulb 2"]]], lights: [] });
  expect(shown("empty").groups).toEqual([["Empty", []]]);
  expect(shown("moon")).toEqual({ groups: [], lights: [] });
});
