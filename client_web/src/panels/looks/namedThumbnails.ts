/** Thumbnails of named looks: of saved looks on the server, for all users; of scene variants in this browser. */
import { signal } from "@preact/signals";
import { json, request } from "../../session/net/api";
import { mayEdit } from "../../state/sessionUser";
import { scene } from "../../state/scene";

/** Per version (content hash) of a saved look: a URL of the server, or a data URL. */
const thumbnailsByVersion = signal<ReadonlyMap<string, string>>(new Map());

export function thumbnailOf(etag: string): string | null {
  return thumbnailsByVersion.value.get(etag) ?? null;
}

export function cacheThumbnail(etag: string, image: string): void {
  thumbnailsByVersion.value = new Map([...thumbnailsByVersion.peek(), [etag, image]]);
}

/** The thumbnail as a data URL, which survives the look's deletion. */
export async function fetchThumbnail(etag: string): Promise<void> {
  const image = thumbnailOf(etag);
  if (image === null || image.startsWith("data:")) return;
  const bytes = new Uint8Array(await (await request(image)).arrayBuffer());
  cacheThumbnail(etag, `data:image/webp;base64,${btoa(String.fromCharCode(...bytes))}`);
}

/** Upload the thumbnail of a saved look for all users; this tab has it in any case. */
export async function uploadThumbnail(path: string, etag: string): Promise<void> {
  try {
    await fetchThumbnail(etag);
    const base64 = thumbnailOf(etag);
    if (base64 !== null && mayEdit.peek())
      await request(`${path}/thumbnail`, json("PUT", { picture: base64 }, { "If-Match": etag }));
  } catch {
    // the look has changed or the server is unreachable: the next client to show it uploads one
  }
}

const variantKey = (name: string) => `relume.look.${scene.value?.id ?? ""}.${scene.value?.id}/${name}`;

export function variantThumbnail(name: string): string | null {
  return localStorage.getItem(variantKey(name));
}

export function storeVariantThumbnail(name: string, image: string): void {
  try {
    localStorage.setItem(variantKey(name), image);
  } catch {
    // the filmstrip then shows only the name
  }
}
