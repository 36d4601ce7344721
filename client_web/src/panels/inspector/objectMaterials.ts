/** Materials that the look gives to some objects of a material of the scene. */
import { replaceLook } from "../../edit/edit";
import type { Look, MaterialLook } from "../../protocol";
import { look } from "../../state/look";
import { materialOf } from "../../state/scene";
import { selectMaterial } from "../../state/selection";

export interface ObjectMaterial {
  name: string;
  objects: readonly string[];
}

/** The object materials of a material of the scene. */
export function objectMaterialsOf(materials: Look["materials"], base: string): ObjectMaterial[] {
  return Object.entries(materials)
    .filter(([, material]) => material.base === base)
    .map(([name, { objects }]) => ({ name, objects: objects ?? [] }));
}

/** The objects that show a material of the scene itself. */
export function sharedObjects(materials: Look["materials"], base: string): string[] {
  const assigned = new Set(objectMaterialsOf(materials, base).flatMap(({ objects }) => objects));
  return (materialOf(base)?.objects ?? []).filter((name) => !assigned.has(name));
}

function freeName(materials: Look["materials"], preferred: string): string {
  let [name, number] = [preferred, 2];
  while (name in materials) name = `${preferred} ${number++}`;
  return name;
}

function assign(label: string, materials: Look["materials"], selected: string): void {
  if (look.value === null) return;
  replaceLook(label, { ...look.value, materials });
  selectMaterial(selected);
}

/** Give an object a copy of its material. */
export function makeUnique(base: string, object: string): void {
  const materials = look.value?.materials;
  const material = materials?.[base];
  if (materials === undefined || material === undefined) return;
  const name = freeName(materials, `${base} (${object})`);
  assign(`${base} · Make “${object}” unique`, { ...materials, [name]: { ...material, base, objects: [object] } }, name);
}

/** Give another object of the base material an object material. */
export function addObject(name: string, object: string): void {
  const materials = look.value?.materials;
  const material = materials?.[name];
  if (materials === undefined || material === undefined) return;
  const objects = [...(material.objects ?? []), object].sort();
  assign(`${name} · Add “${object}”`, { ...materials, [name]: { ...material, objects } }, name);
}

/** Give the objects of an object material the material of the scene again. */
export function rejoin(name: string, { base }: MaterialLook): void {
  const materials = look.value?.materials;
  if (materials === undefined || base == null) return;
  const remaining = Object.fromEntries(Object.entries(materials).filter(([other]) => other !== name));
  assign(`${name} · Use “${base}” again`, remaining, base);
}
