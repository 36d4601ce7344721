import { describe, expect, test } from "vitest";
import { isLinked, linkOf, linkText, modeOf, namesOf, toggleName, type Link } from "../src/panels/lights/links";
import type { Light } from "../src/protocol";

const names = { materials: ["Velvet"], objects: ["Chair", "Table"] };

describe("a link", () => {
  test("keeps its names in another mode", () => {
    const only = linkOf("include", names);
    expect(only).toEqual({ include: names });
    expect(linkOf("exclude", namesOf(only))).toEqual({ exclude: names });
    expect(linkOf("all", namesOf(only))).toBeNull();
    expect(["all", "include", "exclude"]).toEqual([null, only, { exclude: {} }].map((link) => modeOf(link)));
  });

  test("gets and loses a name", () => {
    const link: Link = { exclude: { objects: ["Chair"] } };
    const more = toggleName(link, "materials", "Chair");
    expect(more).toEqual({ exclude: { materials: ["Chair"], objects: ["Chair"] } });
    expect(toggleName(more, "objects", "Chair")).toEqual({ exclude: { materials: ["Chair"], objects: [] } });
  });

  test("is said in words", () => {
    const texts = [null, { include: {} }, { exclude: {} }, { include: names }, { exclude: { objects: ["Chair"] } }];
    expect(texts.map((link) => linkText(link))).toEqual([
      "All",
      "Nothing",
      "All",
      "Velvet, Chair and 1 more",
      "All but Chair",
    ]);
  });

  test("marks its light", () => {
    const light = { kind: "directional", link: null } as unknown as Light;
    expect(isLinked(light)).toBe(false);
    expect(isLinked({ ...light, link: { include: {} } })).toBe(true);
    expect(isLinked({ ...light, shadow_link: { exclude: {} } })).toBe(true);
  });
});
