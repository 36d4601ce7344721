/** Images that were dropped: onto what, and into which of its places. */
import { select, selectedMaterial } from "../state/selection";
import { attempt, note, showError } from "../ui/toasts";
import { uploadImage } from "../net/upload";
import type { ImageBody } from "../protocol";
import { loadImages, putBoth, putMetalness, putNormals, putRoughness, putSet, sending, sendOnto, type Put } from "./images";
import { isColorNamed, mapNamed } from "./mapNames";
import { planned, setName, setWords, type Slot } from "./textureSet";

export const IMAGE_TYPES = ["image/png", "image/jpeg", "image/webp"];

/** What files were let go over: a material, and the place in it where that is known. */
export interface Target {
  material: Promise<string | null>;
  put: Put | undefined;
}

let target: Target | null = null;

/** Files were let go over a material, which is known now or soon; over what `put` is for, or anywhere on it. */
export function letGoOver(material: Promise<string | null>, put?: Put): void {
  target = { material, put };
}

/** What the files that come now were let go over; null where that was no material. */
export function takeTarget(): Target | null {
  const over = target;
  target = null;
  return over;
}

/** Whether a file is an image that a material can show. An EXR is one where its name says what it is a map of. */
export function isTexture(file: File): boolean {
  const isExr = file.name.toLowerCase().endsWith(".exr");
  return IMAGE_TYPES.includes(file.type) || (isExr && (mapNamed(file.name) !== null || isColorNamed(file.name)));
}

/** What is put where, by what an image is a map of, and in words. */
const PLACES: Record<string, { put: Put; as: string }> = {
  roughness: { put: putRoughness, as: "as roughness" },
  metal: { put: putMetalness, as: "as metalness" },
  normals: { put: putNormals, as: "as normals" },
  "roughness and metal": { put: putBoth, as: "as roughness by its green and as metalness by its blue" },
};

/** Why what an image is a map of has no place. */
const NO_PLACE: Record<string, string> = {
  gloss: "Turn it round into one of roughness, and drop that.",
  heights: "Drop the normal map that was made of it.",
  "normals for DirectX": "Its green points down: drop the one for OpenGL, as glTF has it.",
  occlusion: "What hides light is traced here.",
  "what shines": "Light is part of a bake: import the scene with it, and bake again.",
  opacity: "What is cut out comes with the scene.",
  reflectance: "Set it with f0.",
};

/** Send the images of a set one after another; gives those that came, and says of the others why. */
async function sendSet(slots: ReadonlyMap<Slot, File>, refuse: (name: string, reason: string) => void) {
  const files = [...new Set(slots.values())];
  const sent = new Map<File, ImageBody>();
  for (const [k, file] of files.entries()) {
    const which = `${k + 1} of ${files.length}: ${file.name}`;
    const tell = (share: number) =>
      (sending.value = share < 1 ? `Sending ${which}, ${Math.round(100 * share)} %` : `Reading ${which}…`);
    tell(0);
    try {
      sent.set(file, await uploadImage(file, tell));
    } catch (error) {
      refuse(file.name, (error as Error).message);
    }
  }
  return sent;
}

/** Put a set of images onto a material, each in its place, in one step; one message says what became of them. */
async function takeSet(material: string, files: readonly File[]): Promise<void> {
  if (sending.value !== null) return note("Images are on their way already; drop these when they are there.");
  const { slots, refused } = planned(files, isTexture);
  select(material); // its inspector says how far the images are
  try {
    const sent = await sendSet(slots, (name, reason) => refused.push({ name, reason }));
    await loadImages();
    const set = new Map([...slots].flatMap(([slot, file]) => (sent.has(file) ? [[slot, sent.get(file) as ImageBody]] : [])));
    const label = `Textures · ${setName([...slots.values()].map(({ name }) => name))}`;
    const images = new Map(set);
    for (const [slot, reason] of await putSet(label, material, set)) {
      refused.push({ name: images.get(slot)?.name ?? slot, reason: `${slot}: ${reason}` });
    }
    const warnings = new Set([...set.values()].flatMap(({ warnings: each }) => each));
    note([setWords(material, [...set.keys()], refused), ...warnings].join(" "));
  } catch (error) {
    showError(error, "files");
  } finally {
    sending.value = null;
  }
}

/** Take one image: into the place that its name says, else as the base color. */
async function takeOne(material: string, file: File): Promise<void> {
  const map = mapNamed(file.name);
  if (map === null) return sendOnto(material, file);
  const asColour = { label: "Use as colour", run: () => void sendOnto(material, file) };
  const place = PLACES[map];
  if (place !== undefined) {
    note(`“${file.name}” is shown ${place.as}.`, asColour);
    return sendOnto(material, file, place.put);
  }
  note(`“${file.name}” looks like a map of ${map}. ${NO_PLACE[map] ?? ""}`, asColour);
}

/** Take images that were dropped on the page: by what they were let go over, else by what is selected. */
export async function takeImages(files: readonly File[], over: Target | null): Promise<void> {
  const material = (await attempt(async () => over?.material)) ?? selectedMaterial.value;
  const [first] = files;
  if (first === undefined) return;
  if (material === null) return note("Drop the image on an object, or choose a material first; it takes what comes next.");
  if (files.length > 1) return takeSet(material, files);
  await (over?.put === undefined ? takeOne(material, first) : sendOnto(material, first, over.put));
}
