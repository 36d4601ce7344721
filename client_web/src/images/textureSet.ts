/** Several images that were dropped together: which of them goes where on one material, and which has no place. */
import type { ImageBody, MaterialLook, Term } from "../protocol";
import { withBaseImage } from "./colour";
import { isColorNamed, mapNamed } from "./mapNames";
import { withNormals } from "./normals";
import { roughPlaces, withRoughnessImage } from "./roughness";

export type Slot = "base color" | "roughness" | "metalness" | "normals";

/** A file that is not used, and the reason in words. */
export interface Refused {
  name: string;
  reason: string;
}

const SLOT_ORDER: readonly Slot[] = ["base color", "roughness", "metalness", "normals"];

export interface SetPlan {
  slots: Map<Slot, File>;
  refused: Refused[];
}

/** The places of each kind of map. */
const SLOTS: Record<string, readonly Slot[]> = {
  roughness: ["roughness"],
  metal: ["metalness"],
  normals: ["normals"],
  "roughness and metal": ["roughness", "metalness"],
};

/** Why a kind of map has no place. */
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
function rank({ name }: File): number {
  const map = mapNamed(name);
  if (map === "roughness and metal") return 1;
  return map === null && !isColorNamed(name) ? 2 : 0;
}

/** Which file goes where; of several for one place the first that is named for it. */
export function planned(files: readonly File[], isReadable: (file: File) => boolean): SetPlan {
  const slots = new Map<Slot, File>();
  const refused: Refused[] = [];
  const refuse = ({ name }: File, reason: string) => refused.push({ name, reason });
  for (const file of [...files].sort((a, b) => rank(a) - rank(b))) {
    const map = mapNamed(file.name);
    const places = map === null ? (["base color"] as const) : (SLOTS[map] ?? []);
    const free = places.filter((slot) => !slots.has(slot));
    if (!isReadable(file)) refuse(file, "save it as .png, .jpg, .webp or .exr");
    else if (places.length === 0) refuse(file, REASONS[map ?? ""] ?? "it has no place");
    else if (free.length === 0) refuse(file, `another image is the ${places.join(" and the ")}`);
    else for (const slot of free) slots.set(slot, file);
  }
  return { slots: new Map(SLOT_ORDER.flatMap((slot) => (slots.has(slot) ? [[slot, slots.get(slot) as File]] : []))), refused };
}

/** A material with the images of a set, but for metalness, which the server works into its terms. */
export function withColorAndRoughness(terms: readonly Term[], of: ReadonlyMap<Slot, ImageBody>): Term[] {
  const [color, roughness] = [of.get("base color"), of.get("roughness")];
  const colored = color === undefined ? [...terms] : withBaseImage(terms, color.texture);
  return roughness === undefined ? colored : withRoughnessImage(colored, roughPlaces(colored), roughness);
}

/** The material with terms of a set, and its normals. */
export function withSet(material: MaterialLook, terms: Term[], of: ReadonlyMap<Slot, ImageBody>): MaterialLook {
  const normals = of.get("normals");
  return normals === undefined ? { ...material, terms } : withNormals({ ...material, terms }, normals.texture);
}

/** What the files of a set are called together: the words that their names begin with. */
export function setName(names: readonly string[]): string {
  const [first = [], ...others] = names.map((name) => name.replace(/\.\w+$/, "").split(/(?=[_\-. ])/));
  const count = first.findIndex((word, k) => others.some((other) => other[k] !== word));
  const common = first.slice(0, count < 0 ? first.length : count).join("");
  return common === "" ? `${names.length} images` : common;
}

const MAX_NAMED = 6;

function listed(words: readonly string[]): string {
  return words.length < 2 ? words.join("") : `${words.slice(0, -1).join(", ")} and ${words.at(-1)}`;
}

/** What was used, and what was not. */
export function setWords(material: string, used: readonly Slot[], refused: readonly Refused[]): string {
  const onto = used.length === 0 ? `No image is used on “${material}”.` : `On “${material}”: ${listed(used)}.`;
  if (refused.length === 0) return onto;
  const more = refused.length > MAX_NAMED ? `; and ${refused.length - MAX_NAMED} more` : "";
  const named = refused.slice(0, MAX_NAMED).map(({ name, reason }) => `${name} (${reason})`);
  return `${onto} Not used: ${named.join("; ")}${more}.`;
}
