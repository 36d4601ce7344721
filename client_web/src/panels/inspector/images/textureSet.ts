/** Images dropped together: assigns each to a material map, or rejects it. */
import type { ImageBody, MaterialLook, Term } from "../../../protocol";
import { withBaseImage } from "./baseColor";
import { isColorName, detectMap } from "./mapNames";
import { withNormals } from "./normals";
import { roughTermIndices, withRoughnessImage } from "./roughness";

export type Slot = "base color" | "roughness" | "metalness" | "normals" | "emission";

/** A rejected file and the reason. */
export interface RejectedFile {
  name: string;
  reason: string;
}

const SLOT_ORDER: readonly Slot[] = ["base color", "roughness", "metalness", "normals", "emission"];

export interface SetPlan {
  slots: Map<Slot, File>;
  rejected: RejectedFile[];
}

/** The slots of each kind of map. */
const SLOTS: Record<string, readonly Slot[]> = {
  roughness: ["roughness"],
  metal: ["metalness"],
  normals: ["normals"],
  emission: ["emission"],
  "roughness and metal": ["roughness", "metalness"],
};

/** Why a kind of map is not supported. */
const REASONS: Record<string, string> = {
  gloss: "gloss; invert it to a roughness map",
  height: "height; use a normal map",
  "DirectX normals": "DirectX normals; use the OpenGL version",
  occlusion: "ambient occlusion; it is ray-traced",
  opacity: "opacity; it comes with the scene file",
  specular: "specular; set Specular F0",
};

/** Priority: maps with one channel before packed ones; images named as colors before unnamed ones. */
function mapRank({ name }: File): number {
  const map = detectMap(name);
  if (map === "roughness and metal") return 1;
  return map === null && !isColorName(name) ? 2 : 0;
}

/** Assign files to slots; the first file named for a slot gets it. */
export function planSet(files: readonly File[]): SetPlan {
  const slots = new Map<Slot, File>();
  const rejected: RejectedFile[] = [];
  const reject = ({ name }: File, reason: string) => rejected.push({ name, reason });
  for (const file of [...files].sort((a, b) => mapRank(a) - mapRank(b))) {
    const map = detectMap(file.name);
    const slotNames = map === null ? (["base color"] as const) : (SLOTS[map] ?? []);
    const free = slotNames.filter((slot) => !slots.has(slot));
    if (slotNames.length === 0) reject(file, REASONS[map ?? ""] ?? "unknown kind of map");
    else if (free.length === 0) reject(file, `another image is used as ${slotNames.join(" and ")}`);
    else for (const slot of free) slots.set(slot, file);
  }
  return {
    slots: new Map(SLOT_ORDER.flatMap((slot) => (slots.has(slot) ? [[slot, slots.get(slot) as File]] : []))),
    rejected,
  };
}

/** Terms with the base color and roughness of a set; the server applies metalness. */
export function withColorAndRoughness(terms: readonly Term[], images: ReadonlyMap<Slot, ImageBody>): Term[] {
  const [color, roughness] = [images.get("base color"), images.get("roughness")];
  const colored = color === undefined ? [...terms] : withBaseImage(terms, color.texture);
  return roughness === undefined ? colored : withRoughnessImage(colored, roughTermIndices(colored), roughness);
}

/** The material with a set's terms and normal map. */
export function withSet(material: MaterialLook, terms: Term[], images: ReadonlyMap<Slot, ImageBody>): MaterialLook {
  const normals = images.get("normals");
  return normals === undefined ? { ...material, terms } : withNormals({ ...material, terms }, normals.texture);
}

/** The name of a set: the common prefix of its file names. */
export function setName(names: readonly string[]): string {
  const [first = [], ...remainingNames] = names.map((name) => name.replace(/\.\w+$/, "").split(/(?=[_\-. ])/));
  const count = first.findIndex((word, k) => remainingNames.some((name) => name[k] !== word));
  const common = first.slice(0, count < 0 ? first.length : count).join("");
  return common === "" ? `${names.length} images` : common;
}

const MAX_NAMED = 6;

function joinPhrases(phrases: readonly string[]): string {
  return phrases.length < 2 ? phrases.join("") : `${phrases.slice(0, -1).join(", ")} and ${phrases.at(-1)}`;
}

/** Message about the used and the rejected files. */
export function setMessage(material: string, used: readonly Slot[], rejected: readonly RejectedFile[]): string {
  const onto =
    used.length === 0 ? `Nothing applied to “${material}”.` : `Applied to “${material}”: ${joinPhrases(used)}.`;
  if (rejected.length === 0) return onto;
  const more = rejected.length > MAX_NAMED ? `; and ${rejected.length - MAX_NAMED} more` : "";
  const rejections = rejected.slice(0, MAX_NAMED).map(({ name, reason }) => `${name} (${reason})`);
  return `${onto} Not used: ${rejections.join("; ")}${more}.`;
}
