/** Images that were sent: the list, sending one, and putting one onto a material. */
import { signal } from "@preact/signals";
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import { history } from "../edit/history";
import { deleteImage, listImages } from "../net/api";
import { uploadImage } from "../net/upload";
import type { ImageBody, Term } from "../protocol";
import { defaultLook, look } from "../state/look";
import { select, selectedMaterial } from "../state/selection";
import { attempt, note } from "../ui/toasts";
import { mapNamed, withBaseImage, withoutBaseImage } from "./colour";
import { roughPlaces, withoutRoughnessImage, withRoughnessImage } from "./roughness";

export const IMAGE_TYPES = ["image/png", "image/jpeg", "image/webp"];
export const images = signal<readonly ImageBody[]>([]);
/** What is on its way, in words. */
export const sending = signal<string | null>(null);

/** Puts an image onto a material, in some place. */
type Put = (material: string, image: ImageBody) => void;

/** The material that files were let go over, and the place in it where that is known, until they are taken. */
let target: { material: Promise<string | null>; put: Put | undefined } | null = null;

export const imageOf = (texture: string): ImageBody | undefined => images.value.find((image) => image.texture === texture);
export const isImageFile = (file: File): boolean => IMAGE_TYPES.includes(file.type);

export async function loadImages(): Promise<void> {
  await attempt(async () => {
    images.value = await listImages();
  });
}

/** Files were let go over a material, which is known now or soon; over what `put` is for, or anywhere on it. */
export function letGoOver(material: Promise<string | null>, put?: Put): void {
  target = { material, put };
}

function replaceTerms(label: string, material: string, make: typeof withoutBaseImage): void {
  const terms = look.value?.materials[material]?.terms;
  if (terms === undefined) return;
  history.seal();
  edit(label, pointer("materials", material, "terms"), make(terms, defaultLook.value?.materials[material]?.terms ?? []));
}

/** Show an image as the base colour of a material. */
export function putImage(material: string, { texture, name }: ImageBody): void {
  replaceTerms(`Image · ${name}`, material, (terms) => withBaseImage(terms, texture));
  select(material);
}

/** Show an image as the roughness of a material: of a term and those that follow a map with it, or of the whole. */
export function putRoughness(material: string, image: ImageBody, index: number | null = null): void {
  const places = (terms: readonly Term[]) => (index === null ? roughPlaces(terms) : [index]);
  if (places(look.value?.materials[material]?.terms ?? []).length === 0) return note("Nothing of this material has a roughness.");
  replaceTerms(`Roughness · ${image.name}`, material, (terms) => withRoughnessImage(terms, places(terms), image));
  select(material);
}

/** The material is as rough as the scene's own again. */
export function takeRoughnessOff(material: string): void {
  replaceTerms("Roughness image off", material, withoutRoughnessImage);
}

/** The material shows its own colours again. */
export function takeOff(material: string): void {
  replaceTerms("Image off", material, withoutBaseImage);
}

/** Send an image, and show it as the base colour of a material, or where `put` puts it. */
export async function sendOnto(material: string, file: File, put: Put = putImage): Promise<void> {
  if (sending.value !== null) return note("One image is on its way already; give the next one when it is there.");
  const tell = (share: number) =>
    (sending.value = share < 1 ? `Sending ${file.name}, ${Math.round(100 * share)} %` : `Reading ${file.name}…`);
  tell(0);
  const image = await attempt(() => uploadImage(file, tell));
  sending.value = null;
  if (image === undefined) return;
  await loadImages();
  put(material, image);
  for (const warning of image.warnings) note(warning);
}

/** Take images that were dropped on the page: by what they were let go over, else by what is selected. */
export async function takeImages(files: readonly File[]): Promise<void> {
  const over = target;
  target = null;
  const material = (await attempt(async () => over?.material)) ?? selectedMaterial.value;
  const file = files.find(isImageFile);
  if (file === undefined) return;
  if (material === null) return note("Drop the image on an object, or choose a material first; it takes what comes next.");
  if (over?.put !== undefined) return sendOnto(material, file, over.put);
  const map = mapNamed(file.name);
  if (map === null) return sendOnto(material, file);
  const asColour = { label: "Use as colour", run: () => void sendOnto(material, file) };
  if (map.includes("roughness")) {
    const rest = map === "roughness" ? "is shown as roughness" : "is shown as roughness by its green; the rest of it is part of a bake";
    note(`“${file.name}” ${rest}.`, asColour);
    return sendOnto(material, file, putRoughness);
  }
  const told = `“${file.name}” looks like a map of ${map}. Those are part of a bake: import the scene with it, and bake again.`;
  note(told, asColour);
}

/** Delete an image once that was confirmed; the material shows its own again. What saved looks show stays. */
export function offerToDelete(material: string, { id, name }: ImageBody, off = takeOff): void {
  note(`Delete the image “${name}”? It can be sent again.`, {
    label: "Delete",
    run: () =>
      void attempt(async () => {
        off(material);
        await deleteImage(id);
        await loadImages();
      }),
  });
}
