/** Images that were sent: the list, sending one, and putting one onto a material. */
import { computed, signal } from "@preact/signals";
import { isImage } from "../document/texture";
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import { history } from "../edit/history";
import { deleteImage, listImages, withMetalness } from "../net/api";
import { uploadImage } from "../net/upload";
import type { ImageBody, MaterialLook, Term } from "../protocol";
import { defaultLook, look } from "../state/look";
import { scene } from "../state/scene";
import { select, selectedMaterial } from "../state/selection";
import { attempt, note } from "../ui/toasts";
import { baseTexture, mapNamed, withBaseImage, withoutBaseImage } from "./colour";
import { mayBeMetal, metalnessOf, withoutMetalness } from "./metalness";
import { withNormals, withoutNormals } from "./normals";
import { roughPlaces, withoutRoughnessImage, withRoughnessImage } from "./roughness";

export const IMAGE_TYPES = ["image/png", "image/jpeg", "image/webp"];
export const images = signal<readonly ImageBody[]>([]);
/** What is on its way, in words. */
export const sending = signal<string | null>(null);

/** Those that people sent: others were made of them. */
export const sentImages = computed(() => images.value.filter(({ metalness }) => metalness === null));

const NO_METAL = "This material cannot become metal: it needs a term that scatters light, and a highlight with f0, such as GGX.";

/** Puts an image onto a material, in some place. */
export type Put = (material: string, image: ImageBody) => void | Promise<void>;

/** What becomes of a material's terms; `own`: those of the scene. */
type Make = (terms: readonly Term[], own: readonly Term[]) => Term[];

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

const termsOf = (material: string) => look.value?.materials[material]?.terms;
const ownTerms = (material: string): readonly Term[] => defaultLook.value?.materials[material]?.terms ?? [];

function replaceTerms(label: string, material: string, make: Make): void {
  const terms = termsOf(material);
  if (terms === undefined) return;
  history.seal();
  edit(label, pointer("materials", material, "terms"), make(terms, ownTerms(material)));
}

/** Change a material's terms, and let an image say where they are metal: the server makes of it what the terms name. */
async function makeMetal(label: string, material: string, image: ImageBody, make: Make): Promise<void> {
  const terms = termsOf(material);
  const of = scene.value?.id;
  if (terms === undefined || of === undefined) return;
  const made = await attempt(() => withMetalness(image.id, of, material, make(terms, ownTerms(material))));
  if (made === undefined) return;
  await loadImages(); // those that were made are known before the look names them
  if (termsOf(material) !== terms) return note("The material was changed meanwhile; put the image on it again.");
  replaceTerms(label, material, () => made);
}

/** The image of metalness that stays on a material whose base colour changes. */
function metalOn(material: string): ImageBody | undefined {
  const name = metalnessOf(termsOf(material) ?? [], imageOf);
  return name === null ? undefined : imageOf(name);
}

/** Change the base colour, which lies under metalness where an image says that. */
function replaceBase(label: string, material: string, make: Make): void | Promise<void> {
  const metal = metalOn(material);
  if (metal === undefined) return replaceTerms(label, material, make);
  return makeMetal(label, material, metal, (terms, own) => make(withoutMetalness(terms, own, imageOf), own));
}

/** The texture of the base colour as it is, under metalness too. */
export function baseOf(terms: readonly Term[]): string | null {
  const shown = baseTexture(terms);
  const image = isImage(shown) ? imageOf(shown) : undefined;
  return image !== undefined && image.metalness !== null ? image.base : shown;
}

/** Show an image as the base colour of a material. */
export async function putImage(material: string, { texture, name }: ImageBody): Promise<void> {
  select(material);
  await replaceBase(`Image · ${name}`, material, (terms) => withBaseImage(terms, texture));
}

/** Let an image say where a material is metal; `make` changes the material in the same step. */
export async function putMetalness(material: string, image: ImageBody, make: Make = (terms) => [...terms]): Promise<void> {
  if (!mayBeMetal(termsOf(material) ?? [])) return note(NO_METAL);
  select(material);
  await makeMetal(`Metalness · ${image.name}`, material, image, make);
}

/** The material is metal where the scene's own is again. */
export function takeMetalnessOff(material: string): void {
  replaceTerms("Metalness image off", material, (terms, own) => withoutMetalness(terms, own, imageOf));
}

/** Show an image as the roughness of a material: of a term and those that follow a map with it, or of the whole. */
export function putRoughness(material: string, image: ImageBody, index: number | null = null): void {
  const places = (terms: readonly Term[]) => (index === null ? roughPlaces(terms) : [index]);
  if (places(termsOf(material) ?? []).length === 0) return note("Nothing of this material has a roughness.");
  replaceTerms(`Roughness · ${image.name}`, material, (terms) => withRoughnessImage(terms, places(terms), image));
  select(material);
}

function replaceMaterial(label: string, material: string, make: (of: MaterialLook) => MaterialLook): void {
  const of = look.value?.materials[material];
  if (of === undefined) return;
  history.seal();
  edit(label, pointer("materials", material), make(of));
}

/** Let an image say how a material's surfaces lean. */
export function putNormals(material: string, { texture, name }: ImageBody): void {
  replaceMaterial(`Normals · ${name}`, material, (of) => withNormals(of, texture));
  select(material);
}

/** The material has the bumps of the scene again. */
export function takeNormalsOff(material: string): void {
  replaceMaterial("Normal image off", material, (of) => withoutNormals(of, defaultLook.value?.materials[material]));
}

/** Show an image as both, as files of glTF pack them: green is roughness, blue is metalness. */
function putBoth(material: string, image: ImageBody): void | Promise<void> {
  if (!mayBeMetal(termsOf(material) ?? [])) {
    note(NO_METAL);
    return putRoughness(material, image);
  }
  return putMetalness(material, image, (terms) => withRoughnessImage(terms, roughPlaces(terms), image));
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
};

/** The material is as rough as the scene's own again. */
export function takeRoughnessOff(material: string): void {
  replaceMaterial("Roughness image off", material, (of) => {
    const bare = { ...of, terms: withoutRoughnessImage(of.terms, ownTerms(material)) };
    return of.normal_map == null ? bare : withNormals(bare, of.normal_map.image); // which bumps widen
  });
}

/** The material shows its own colours again. */
export async function takeOff(material: string): Promise<void> {
  await replaceBase("Image off", material, withoutBaseImage);
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
  await put(material, image);
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
  const place = PLACES[map];
  if (place !== undefined) {
    note(`“${file.name}” is shown ${place.as}.`, asColour);
    return sendOnto(material, file, place.put);
  }
  note(`“${file.name}” looks like a map of ${map}. ${NO_PLACE[map] ?? ""}`, asColour);
}

/** Delete an image once that was confirmed; the material shows its own again. What saved looks show stays. */
export function offerToDelete(material: string, { id, name }: ImageBody, off: (material: string) => void | Promise<void>): void {
  note(`Delete the image “${name}”? It can be sent again.`, {
    label: "Delete",
    run: () =>
      void attempt(async () => {
        await off(material);
        await deleteImage(id);
        await loadImages();
      }),
  });
}
