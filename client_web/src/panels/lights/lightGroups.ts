/** The light groups of the look: creating, renaming and dissolving them, and moving lights between them. */
import { batch, computed } from "@preact/signals";
import { editValue, replaceLook } from "../../edit/edit";
import { MAX_LIGHT_GROUPS, type LightGroupLook } from "../../look.gen";
import { jsonPointer } from "../../state/document/pointer";
import { look } from "../../state/look";
import { groupSource, soloLight } from "../../state/visibility/soloSources";
import { showNote } from "../../ui/toasts";
import { nameProblem, nextLightName } from "./lightKinds";

export type Groups = Readonly<Record<string, LightGroupLook>>;

const NEUTRAL: LightGroupLook = { lights: [], intensity: 1, color: [1, 1, 1], enabled: true };

export const lightGroups = computed<Groups>(() => look.value?.light_groups ?? {});

/** The group of each grouped light. */
export const groupOfLight = computed(
  () =>
    new Map(Object.entries(lightGroups.value).flatMap(([name, { lights }]) => lights.map((light) => [light, name]))),
);

export const groupPath = (name: string, field?: string) =>
  field === undefined ? jsonPointer("light_groups", name) : jsonPointer("light_groups", name, field);

/** Change a field of a group; edits of one gesture on one field are one step. */
export function editGroup(label: string, name: string, field: keyof LightGroupLook, value: unknown): void {
  editValue(label, groupPath(name, field), value);
}

/** A complete group from a partial one. */
export function completeGroup(partial: Partial<LightGroupLook>, base: LightGroupLook = NEUTRAL): LightGroupLook {
  return { ...base, ...partial };
}

/** Groups without some lights; other groups stay the same objects. */
export function withoutLights(groups: Groups, names: readonly string[]): Groups {
  const without = (group: LightGroupLook) =>
    group.lights.some((name) => names.includes(name))
      ? { ...group, lights: group.lights.filter((name) => !names.includes(name)) }
      : group;
  return Object.fromEntries(Object.entries(groups).map(([name, group]) => [name, without(group)]));
}

/** Groups with lights in the group `to`, which is made if there is none; null: in no group. */
export function withLightsIn(groups: Groups, names: readonly string[], to: string | null): Groups {
  const others = withoutLights(groups, names);
  if (to === null) return others;
  const group = others[to] ?? NEUTRAL;
  return { ...others, [to]: { ...group, lights: [...group.lights, ...names] } };
}

/** The name of a light without the numbers at its end, as the importer has it. */
export function prefixOf(name: string): string {
  const prefix = name.replace(/[\s._-]*\d+$/, "");
  if (prefix === "" || prefix === name) return prefix || name;
  return prefixOf(prefix);
}

/** Groups with those of all lights in no group that share a prefix. */
export function groupedByPrefix(groups: Groups, lightNames: readonly string[]): Groups {
  const grouped = new Set(Object.values(groups).flatMap((group) => group.lights));
  const members = new Map<string, string[]>();
  for (const name of lightNames) {
    if (grouped.has(name)) continue;
    members.set(prefixOf(name), [...(members.get(prefixOf(name)) ?? []), name]);
  }
  return [...members].reduce(
    (result, [prefix, names]) =>
      names.length > 1 || Object.hasOwn(result, prefix) ? withLightsIn(result, names, prefix) : result,
    groups,
  );
}

function replaceGroups(label: string, groups: Groups): void {
  const current = look.peek();
  if (current === null) return;
  if (Object.keys(groups).length > MAX_LIGHT_GROUPS)
    return showNote(`Limit of ${MAX_LIGHT_GROUPS} light groups reached. Dissolve one first.`);
  replaceLook(label, { ...current, light_groups: groups });
}

export function groupByPrefix(): void {
  const current = look.peek();
  if (current === null) return;
  const groups = groupedByPrefix(lightGroups.peek(), Object.keys(current.lights));
  if (groups === lightGroups.peek()) showNote("No ungrouped lights share a name.");
  else replaceGroups("Group lights by name", groups);
}

/** Move a light to a group; null: to none. */
export function moveToGroup(light: string, to: string | null): void {
  if ((groupOfLight.peek().get(light) ?? null) === to) return;
  replaceGroups(
    `${light} · ${to === null ? "Remove from group" : `Move to ${to}`}`,
    withLightsIn(lightGroups.peek(), [light], to),
  );
}

/** Make a group of a light, named after it. */
export function createGroup(light: string): void {
  const name = nextLightName(prefixOf(light), Object.keys(lightGroups.peek()));
  replaceGroups(`${name} · Create group`, withLightsIn(lightGroups.peek(), [light], name));
}

/** Rename a group; it keeps its position in the list. */
export function renameGroup(name: string, to: string): void {
  const groups = lightGroups.peek();
  const problem = nameProblem("light group", to, groups);
  if (problem !== null) return showNote(problem);
  const renamed = Object.entries(groups).map(([key, group]) => [key === name ? to : key, group]);
  batch(() => {
    replaceGroups(`${name} · Rename to ${to}`, Object.fromEntries(renamed) as Groups);
    if (soloLight.peek() === groupSource(name)) soloLight.value = groupSource(to);
  });
}

/** Dissolve a group; its lights stay, without its gain. */
export function dissolveGroup(name: string): void {
  batch(() => {
    editValue("Dissolve", groupPath(name), undefined);
    if (soloLight.peek() === groupSource(name)) soloLight.value = null;
  });
}
