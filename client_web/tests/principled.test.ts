/** Principled parameters: edits become terms that the server makes, one step a gesture, for all selected materials. */
import { beforeEach, expect, test, vi } from "vitest";
import type { Look, PrincipledBody, PrincipledParameters } from "../src/protocol";
import { LOOK } from "./exampleLook";

const server = vi.hoisted(() => ({ read: vi.fn(), make: vi.fn() }));
vi.mock("../src/session/net/api", async (original) => ({
  ...(await original<object>()),
  readPrincipled: server.read,
  makePrincipledTerms: server.make,
}));

import { history } from "../src/edit/history";
import { onLookChange } from "../src/edit/edit";
import { closestText, GROUPS, isShown } from "../src/panels/inspector/principled/controls";
import {
  editedParameters,
  editPrincipled,
  readMaterial,
  replaceByClosest,
} from "../src/panels/inspector/principled/principled";
import { look } from "../src/state/look";
import { selectMaterials } from "../src/state/selection";

const parameters = { roughness: 0.3, metallic: 0 } as PrincipledParameters;
const terms = (roughness: number) => [
  { model: "lambert", color: [0.1, 0.1, 0.1], params: {}, curves: {} },
  { model: "ggx", color: [1, 1, 1], params: { roughness, f0: 0.04 }, curves: {} },
];
const reading = (reason: string | null = null) => ({ parameters, terms: terms(0.3), glass: null, error: 0.2, reason });
const materialsOf = (...roughness: number[]) =>
  Object.fromEntries(roughness.map((value, k) => [`M${k}`, { terms: terms(value) }])) as Look["materials"];
const roughnessOf = (name: string) => look.value?.materials[name]?.terms[1]?.params?.["roughness"];

vi.stubGlobal("window", { event: undefined });

let patches: string[] = [];
beforeEach(() => {
  history.clear();
  patches = [];
  look.value = { ...LOOK, materials: materialsOf(0.3, 0.5, 0.7) };
  selectMaterials(["M0"]);
  server.read.mockReset().mockImplementation(() => Promise.resolve(reading()));
  server.make
    .mockReset()
    .mockImplementation((body: { parameters: PrincipledParameters }) =>
      Promise.resolve({ terms: terms(body.parameters.roughness), glass: null }),
    );
  onLookChange(({ patch }) => patches.push(...patch.map(({ path }) => path)));
});

test("a drag is one step, also if the server's last answer comes after its end, and sends the changed numbers", async () => {
  const first = editPrincipled("Roughness", parameters, { roughness: 0.4 });
  const second = editPrincipled("Roughness", { ...parameters, roughness: 0.4 }, { roughness: 0.6 });
  expect(editedParameters.value?.parameters.roughness).toBe(0.6);
  history.endGesture();
  await Promise.all([first, second]);
  expect(roughnessOf("M0")).toBe(0.6);
  expect(history.steps.value.map(({ label }) => label)).toEqual(["M0 · Roughness"]);
  expect(new Set(patches)).toEqual(new Set(["/materials/M0/terms/1/params/roughness"]));
  expect(editedParameters.value).toBeNull();
  await editPrincipled("Roughness", parameters, { roughness: 0.2 });
  expect(history.steps.value).toHaveLength(2);
  expect(server.read).toHaveBeenCalledTimes(1); // terms that were made are known
});

test("an edit changes all selected materials that are principled, as one step", async () => {
  server.read.mockImplementation(({ material }: { material: string }) =>
    Promise.resolve(reading(material === "M1" ? "It has measured layers." : null)),
  );
  selectMaterials(["M0", "M1", "M2"]);
  await editPrincipled("Roughness", parameters, { roughness: 0.9 });
  expect(["M0", "M1", "M2"].map(roughnessOf)).toEqual([0.9, 0.5, 0.9]);
  expect(history.steps.value.map(({ label }) => label)).toEqual(["M0 · Roughness (2 materials)"]);
});

test("the closest principled material replaces others, as one step", async () => {
  const other = { ...reading("It has layers of other models."), terms: terms(0.8) } as unknown as PrincipledBody;
  replaceByClosest("M0", other);
  expect(roughnessOf("M0")).toBe(0.8);
  const current = look.value?.materials["M0"];
  expect(current && (await readMaterial("M0", current)).reason).toBeNull();
  expect(closestText("It has curves drawn by hand.", 0.234)).toBe(
    "It has curves drawn by hand. The closest principled material differs by 23 % (relative RMS).",
  );
});

test("layers show their controls once they have a weight, and only glass transmits", () => {
  const shown = (change: object, material: object) =>
    GROUPS.flatMap(({ controls }) => controls)
      .filter((control) =>
        isShown(control, { ...parameters, coat_weight: 0, sheen_weight: 0, ...change }, material as never),
      )
      .map(({ name }) => name);
  expect(shown({}, {})).not.toContain("coat_roughness");
  expect(shown({ coat_weight: 0.1 }, {})).toContain("coat_roughness");
  expect(shown({}, {})).not.toContain("transmission");
  expect(shown({}, { glass: {} })).toContain("transmission");
});

test("a material of some objects is read as that of the scene, which has its textures", async () => {
  await readMaterial("M0 (vase)", { terms: [], base: "M0", objects: ["vase"] });
  expect(server.read).toHaveBeenCalledWith(expect.objectContaining({ material: "M0" }));
});
