/** Images dropped together: which material map each is used for, and which are rejected. */
import type { ImageBody, MaterialLook, Term } from "../../../protocol";
import { withBaseImage } from "./baseColor";
import { isColorName, detectMap } from "./mapNames";
import { withNormals } from "./normals";
import { roughTermIndices, withRoughnessImage } from "./roughness";

export type Slot = "base color" | "roughness" | "metalness" | "normals";

/** A rejected file, and the reason. */
export interface RejectedFile {
  name: string;
  reason: string;
}

const SLOT_ORDER: readonly Slot[] = ["base color", "roughness", "metalness", "normals"];

export interface SetPlan {
  slots: Map<Slot, File>;
  rejected: RejectedFile[];
}

/** The slots of each kind of map. */
const SLOTS: Record<string, readonly Slot[]> = {
  roughness: ["roughness"],
  metal: ["metalness"],
  normals: ["normals"],
  "roughness and metal": ["roughness", "metalness"],
};

/** Why a kind of map is not supported. */
const REASONS: Record<string, string> = {
  gloss: "invert it to a roughness map",
  heights: "displacement; surfaces keep their shape",
  "normals for DirectX": "normals for DirectX; the ones for OpenGL are used",
  occlusion: "ambient occlusion; relume traces it",
  "what shines": "emission; it is part of a bake",
  opacity: "opacity; it comes with the scene",
  reflectance: "reflectance; set it with f0",
};

/** Images that say one thing go before those that say two, and colors that are named so before others. */
function mapRank({ name }: File): number {
  const map = detectMap(name);
  if (map === "roughness and metal") return 1;
  return map === null && !isColorName(name) ? 2 : 0;
}

/** Which file is used for which slot; of several for one slot the first that is named for it. */
export function planSet(files: readonly File[], isReadable: (file: File) => boolean): SetPlan {
  const slots = new Map<Slot, File>();
  const rejected: RejectedFile[] = [];
  const reject = ({ name }: File, reason: string) => rejected.push({ name, reason });
  for (const file of [...files].sort((a, b) => mapRank(a) - mapRank(b))) {
    const map = detectMap(file.name);
    const slotNames = map === null ? (["base color"] as const) : (SLOTS[map] ?? []);
    const free = slotNames.filter((slot) => !slots.has(slot));
    if (!isReadable(file)) reject(file, "save it as .png, .jpg, .webp or .exr");
    else if (slotNames.length === 0) reject(file, REASONS[map ?? ""] ?? "it has no place");
    else if (free.length === 0) reject(file, `another image is the ${slotNames.join(" and the ")}`);
    else for (const slot of free) slots.set(slot, file);
  }
  return { slots: new Map(SLOT_ORDER.flatMap((slot) => (slots.has(slot) ? [[slot, slots.get(slot) as File]] : []))), rejected };
}

/** A material with the images of a set, but for metalness, which the server works into its terms. */
export function withColorAndRoughness(terms: readonly Term[], images: ReadonlyMap<Slot, ImageBody>): Term[] {
  const [color, roughness] = [images.get("base color"), images.get("roughness")];
  const colored = color === undefined ? [...terms] : withBaseImage(terms, color.texture);
  return roughness === undefined ? colored : withRoughnessImage(colored, roughTermIndices(colored), roughness);
}

/** The material with terms of a set, and its normals. */
export function withSet(material: MaterialLook, terms: Term[], images: ReadonlyMap<Slot, ImageBody>): MaterialLook {
  const normals = images.get("normals");
  return normals === undefined ? { ...material, terms } : withNormals({ ...material, terms }, normals.texture);
}

/** The name of a set: the common beginning of its file names. */
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

/** What was used, and what was not. */
export function setMessage(material: string, used: readonly Slot[], rejected: readonly RejectedFile[]): string {
  const onto = used.length === 0 ? `No image is used on “${material}”.` : `On “${material}”: ${joinPhrases(used)}.`;
  if (rejected.length === 0) return onto;
  const more = rejected.length > MAX_NAMED ? `; and ${rejected.length - MAX_NAMED} more` : "";
  const rejections = rejected.slice(0, MAX_NAMED).map(({ name, reason }) => `${name} (${reason})`);
  return `${onto} Not used: ${rejections.join("; ")}${more}.`;
}
