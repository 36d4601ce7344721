/** Look documents and light mixes as files: dropped on the editor, they change the look in one step. */
import { replaceLook } from "../../edit/edit";
import type { Look } from "../../protocol";
import { look } from "../../state/look";
import { fileBaseName } from "../../start/files/sceneFiles";
import { reportErrors, showNote } from "../../ui/toasts";
import { completeGroup } from "../lights/lightGroups";
import { completeLook } from "./abCompare";

const LIGHT_MIX = "relume light mix";
const MAX_BYTES = 1 << 20;
const SECTIONS = ["materials", "environment", "background", "lights", "light_groups", "transport", "display"];

type Fields = Record<string, unknown>;

export const isLookFile = ({ name }: File): boolean => name.toLowerCase().endsWith(".json");

const isFields = (value: unknown): value is Fields =>
  typeof value === "object" && value !== null && !Array.isArray(value);

const quoted = (names: readonly string[]) => names.map((name) => `“${name}”`).join(", ");

/** The groups of a light mix with the lights of a look; those of the look if the mix has none. */
function mixedGroups(current: Look, mix: Fields): unknown {
  const groups = mix["light_groups"];
  if (!isFields(groups)) return current.light_groups;
  const existing = (names: unknown) =>
    Array.isArray(names) ? names.filter((name: string) => Object.hasOwn(current.lights, name)) : [];
  const complete = ([name, group]: [string, unknown]) =>
    isFields(group) ? [[name, completeGroup({ ...group, lights: existing(group["lights"]) })]] : [];
  return Object.fromEntries(Object.entries(groups).flatMap(complete));
}

/** The look with the lights and the environment of a light mix, and a sentence for each thing that it does not have. */
export function withLightMix(current: Look, mix: Fields): { look: Look; notes: string[] } {
  if (mix["version"] !== 1) throw new Error("This light mix is of another version of relume. Update relume.");
  const [mixed, kinds] = ["lights", "kinds"].map((name) => (isFields(mix[name]) ? mix[name] : {}));
  const lights: Record<string, unknown> = { ...current.lights };
  const differing: string[] = [];
  for (const [name, fields] of Object.entries(mixed ?? {})) {
    const light = Object.hasOwn(current.lights, name) ? current.lights[name] : undefined;
    if (light === undefined || !isFields(fields)) continue;
    const isOther = (kinds?.[name] ?? light.kind) !== light.kind;
    if (isOther) differing.push(name);
    lights[name] = { ...light, ...fields, ...(isOther ? { emission: light.emission } : {}) }; // 1 W/sr is not 1 W/m²
  }
  const missing = Object.keys(mixed ?? {}).filter((name) => !Object.hasOwn(current.lights, name));
  const environment = { ...current.environment, ...(isFields(mix["environment"]) ? mix["environment"] : {}) };
  const notes = [
    ...(missing.length > 0 ? [`This look has no lights ${quoted(missing)}; the others are set.`] : []),
    ...(differing.length > 0 ? [`Lights of another kind keep their emission: ${quoted(differing)}.`] : []),
  ];
  return { look: { ...current, lights, light_groups: mixedGroups(current, mix), environment } as Look, notes };
}

/** The look that a document makes of the current one. */
export function readLookFile(current: Look, text: string): { look: Look; notes: string[] } {
  let document: unknown;
  try {
    document = JSON.parse(text);
  } catch {
    throw new Error("This file is not JSON.");
  }
  if (isFields(document) && document["format"] === LIGHT_MIX) return withLightMix(current, document);
  if (
    !isFields(document) ||
    !Object.entries(document).every(([name, part]) => SECTIONS.includes(name) && isFields(part))
  )
    throw new Error("This file is neither a look nor a light mix.");
  return { look: completeLook(document), notes: [] };
}

/** Apply a dropped file. */
export async function applyLookFile(file: File): Promise<void> {
  await reportErrors(async () => {
    const current = look.peek();
    if (current === null) return;
    if (file.size > MAX_BYTES) throw new Error(`${file.name} is larger than a look can be (1 MB).`);
    const { look: next, notes } = readLookFile(current, await file.text());
    replaceLook(fileBaseName(file.name), next);
    showNote([`“${fileBaseName(file.name)}” applied.`, ...notes].join(" "));
  });
}
