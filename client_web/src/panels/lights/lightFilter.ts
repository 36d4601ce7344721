/** The rows of the mixer whose names contain a text. */
import type { LightGroupLook } from "../../look.gen";
import type { Groups } from "./lightGroups";

interface Rows {
  /** Groups, each with the lights that are shown. */
  groups: { name: string; group: LightGroupLook; shown: readonly string[] }[];
  /** Lights in no group. */
  lights: string[];
}

/** Groups of that name with all their lights, other groups with the lights that match, and matching other lights. */
export function filterRows(groups: Groups, lights: readonly string[], text: string): Rows {
  const matches = (name: string) => name.toLowerCase().includes(text.trim().toLowerCase());
  const grouped = new Set(Object.values(groups).flatMap((group) => group.lights));
  return {
    groups: Object.entries(groups)
      .map(([name, group]) => ({
        name,
        group,
        shown: matches(name) ? group.lights : group.lights.filter(matches),
      }))
      .filter(({ name, shown }) => matches(name) || shown.length > 0),
    lights: lights.filter((name) => !grouped.has(name) && matches(name)),
  };
}
