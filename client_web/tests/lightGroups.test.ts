import { beforeEach, expect, test, vi } from "vitest";
import { history } from "../src/edit/history";
import { activePath } from "../src/edit/activeControl";
import {
  createGroup,
  dissolveGroup,
  editGroup,
  groupByPrefix,
  groupedByPrefix,
  moveToGroup,
  prefixOf,
  renameGroup,
  withLightsIn,
} from "../src/panels/lights/lightGroups";
import { removeLight, renameLight } from "../src/panels/lights/lightEdits";
import { completeLook } from "../src/panels/looks/abCompare";
import { undo } from "../src/panels/looks/undoRedo";
import type { Light, Look } from "../src/protocol";
import { defaultLook, look } from "../src/state/look";
import { visibleLookOf } from "../src/state/visibility/displayState";
import { groupSource, soloLight, soloSources, sourceLabel } from "../src/state/visibility/soloSources";
import { LOOK } from "./exampleLook";

const light = {
  kind: "point",
  intensity: 1,
  color: [1, 1, 1],
  enabled: true,
  emission: [1, 1, 1],
  position: [0, 1, 0],
} as unknown as Light;
const NAMES = ["Lamp", "Lamp.001", "Lamp.002", "Key"];
const BASE: Look = { ...LOOK, lights: Object.fromEntries(NAMES.map((name) => [name, light])) };
const members = () => Object.fromEntries(Object.entries(look.value?.light_groups ?? {}).map(([k, g]) => [k, g.lights]));

beforeEach(() => {
  vi.stubGlobal("window", { setTimeout: () => 0 });
  history.clear();
  defaultLook.value = LOOK;
  look.value = BASE;
  soloLight.value = null;
});

test("names end with numbers as programs write them", () => {
  expect(["Lamp.001", "Lamp 2", "Lamp_3.001", "Lamp", "12"].map(prefixOf)).toEqual([
    "Lamp",
    "Lamp",
    "Lamp",
    "Lamp",
    "12",
  ]);
});

test("lights of one name become a group, in one step that can be undone", async () => {
  groupByPrefix();
  expect(members()).toEqual({ Lamp: ["Lamp", "Lamp.001", "Lamp.002"] });
  await undo();
  expect(members()).toEqual({});
});

test("grouping by name leaves existing groups alone", () => {
  const groups = withLightsIn({}, ["Lamp.001"], "Mine");
  expect(groupedByPrefix(groups, NAMES)["Lamp"]?.lights).toEqual(["Lamp", "Lamp.002"]);
  expect(groupedByPrefix(groups, ["Key"])).toBe(groups);
});

test("a light is in one group only", () => {
  createGroup("Key");
  createGroup("Lamp.001");
  moveToGroup("Lamp.001", "Key");
  expect(members()).toEqual({ Key: ["Key", "Lamp.001"], Lamp: [] });
  moveToGroup("Lamp.001", null);
  expect(members()).toEqual({ Key: ["Key"], Lamp: [] });
});

test("groups are renamed in place, and dissolved without their lights", () => {
  groupByPrefix();
  createGroup("Key");
  renameGroup("Lamp", "Downlights");
  expect(Object.keys(members())).toEqual(["Downlights", "Key"]);
  renameGroup("Downlights", "Key"); // taken
  expect(Object.keys(members())).toEqual(["Downlights", "Key"]);
  dissolveGroup("Downlights");
  expect(Object.keys(look.value?.light_groups ?? {})).toEqual(["Key"]);
  expect(Object.keys(look.value?.lights ?? {})).toEqual(NAMES);
});

test("a group follows lights that are renamed or removed", async () => {
  createGroup("Key");
  renameLight("Key", "Main");
  expect(members()).toEqual({ Key: ["Main"] });
  removeLight("Main");
  expect(members()).toEqual({ Key: [] });
  await undo();
  expect(members()).toEqual({ Key: ["Main"] });
});

test("the fader of a group is a control", () => {
  groupByPrefix();
  editGroup("Intensity", "Lamp", "intensity", 3);
  expect(look.value?.light_groups["Lamp"]?.intensity).toBe(3);
  expect(activePath("/light_groups/Lamp/intensity", look.value as Look)).toBe("/light_groups/Lamp");
  expect(activePath("/light_groups/None/intensity", look.value as Look)).toBeNull();
});

test("solo of a group shows its lights, even if it is muted", () => {
  groupByPrefix();
  editGroup("Mute", "Lamp", "enabled", false);
  soloLight.value = groupSource("Lamp");
  const current = look.value as Look;
  expect(soloSources(current)).toEqual(["Lamp", "Lamp.001", "Lamp.002"]);
  expect(sourceLabel(current, soloLight.value)).toBe("Lamp");
  const visible = visibleLookOf(current);
  expect(visible.light_groups["Lamp"]?.enabled).toBe(true);
  expect(visible.lights["Key"]?.enabled).toBe(false);
  dissolveGroup("Lamp");
  expect(soloLight.value).toBeNull();
});

test("saved looks bring their groups", () => {
  const group = { lights: ["Key", "Gone"], intensity: 2 };
  expect(completeLook({ light_groups: { A: group } as unknown as Look["light_groups"] }).light_groups["A"]).toEqual({
    ...group,
    color: [1, 1, 1],
    enabled: true,
  });
});
