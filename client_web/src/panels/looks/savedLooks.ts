/** Saved looks on the server, with versions; saving and deleting can be undone. */
import { signal } from "@preact/signals";
import { history } from "../../edit/history";
import type { NamedLook } from "../../edit/history";
import { ApiError, json, request } from "../../session/net/api";
import type { Light, Look, LookEntry, LookView } from "../../protocol";
import { isDeepEqual } from "../../state/document/difference";
import { scene } from "../../state/scene";
import { lookThumbnail } from "../../state/thumbnails";
import { reportErrors } from "../../ui/toasts";
import { nextName } from "./lookNames";
import { fetchThumbnail, uploadThumbnail, cacheThumbnail, thumbnailOf } from "./namedThumbnails";

export interface SavedLook extends NamedLook {
  etag: string;
  created: string;
  view: LookView | null;
}

export const savedLooks = signal<SavedLook[]>([]);
const MAX_READ = 60;
const path = (name: string) => `/api/looks/${encodeURIComponent(name)}`;
/** True if the look only refers to materials and lights of this scene, or to ones it can have. */
function fitsScene(look: Partial<Look>): boolean {
  const materialNames = new Set(scene.value?.materials.map((material) => material.name));
  const lightNames = new Set(scene.value?.lights);
  const hasMesh = (name: string, light: Light) =>
    lightNames.has(name) || (light.kind === "mesh" && light.image != null && materialNames.has(light.material));
  return (
    Object.entries(look.materials ?? {}).every(([name, { base }]) => materialNames.has(base ?? name)) &&
    Object.entries(look.lights ?? {}).every(([name, light]) => light.kind !== "mesh" || hasMesh(name, light))
  );
}

async function readSavedLook({ name, etag, created, thumbnail, view }: LookEntry): Promise<SavedLook> {
  const response = await request(path(name));
  if (thumbnail !== null && thumbnailOf(etag) === null) cacheThumbnail(etag, thumbnail);
  const document = (await response.json()) as Partial<Look>;
  return { name, etag: response.headers.get("etag") ?? etag, created, view, look: document };
}

/** Sorted by the time of their first save, as formatted by the server. */
function sortByCreation(looks: SavedLook[]): SavedLook[] {
  return looks.sort((a, b) => (a.created < b.created ? -1 : Number(a.created > b.created)));
}

export async function refreshSavedLooks(): Promise<void> {
  await reportErrors(async () => {
    const entries = (await (await request("/api/looks")).json()) as LookEntry[];
    const looks = await Promise.allSettled(entries.slice(0, MAX_READ).map(readSavedLook));
    const loaded = looks.flatMap((result) => (result.status === "fulfilled" ? [result.value] : []));
    savedLooks.value = sortByCreation(loaded.filter(({ look }) => fitsScene(look)));
  });
}

/** An unused name, also among looks of other scenes, which are not listed. */
export async function unusedName(): Promise<string> {
  const entries = (await (await request("/api/looks")).json()) as LookEntry[];
  return nextName(
    entries.map(({ name }) => name),
    savedLooks.value.length,
  );
}

function reportConflict(error: unknown, name: string, isNew = false): never {
  if (isNew && error instanceof ApiError && error.status === 412)
    throw new Error(`A look named “${name}” already exists, perhaps in another scene. Choose another name.`);
  if (error instanceof ApiError && (error.status === 412 || error.status === 428)) {
    void refreshSavedLooks();
    throw new Error(`“${name}” was changed elsewhere. Nothing was overwritten; check the new version first.`);
  }
  throw error;
}

function etagOf(name: string): string | null {
  return savedLooks.value.find((entry) => entry.name === name)?.etag ?? null;
}

/** Store the view of a look version; null: none. */
async function writeView(name: string, etag: string, view: LookView | null): Promise<void> {
  const headers = { "If-Match": etag };
  const init = view === null ? { method: "DELETE", headers } : json("PUT", view, headers);
  await request(`${path(name)}/view`, init).catch((error: unknown) => reportConflict(error, name));
}

async function writeLook(
  { name, look, created, view = null }: NamedLook,
  etag: string | null,
  image: string | null,
): Promise<void> {
  const headers: Record<string, string> = etag === null ? { "If-None-Match": "*" } : { "If-Match": etag };
  const query = etag === null && created !== undefined ? `?created=${encodeURIComponent(created)}` : "";
  const response = await request(path(name) + query, json("PUT", look, headers)).catch((error: unknown) =>
    reportConflict(error, name, etag === null),
  );
  const existing = savedLooks.value.find((entry) => entry.name === name);
  const since = existing?.created ?? ((await response.json()) as LookEntry).created;
  const saved = { name, etag: response.headers.get("etag") ?? "", created: since, look, view };
  if (!isDeepEqual(view, existing?.view ?? null)) await writeView(name, saved.etag, view);
  savedLooks.value = sortByCreation([...savedLooks.value.filter((entry) => entry !== existing), saved]);
  if (image !== null) cacheThumbnail(saved.etag, image);
  await uploadThumbnail(path(name), saved.etag);
}

async function eraseLook(name: string): Promise<void> {
  const etag = etagOf(name) ?? "*";
  await fetchThumbnail(etag).catch(() => undefined); // kept for undoing the deletion
  await request(path(name), { method: "DELETE", headers: { "If-Match": etag } }).catch((error: unknown) =>
    reportConflict(error, name),
  );
  savedLooks.value = savedLooks.value.filter((entry) => entry.name !== name);
}

/** Replace a saved look by another; null: none. `image`: its thumbnail, if any. */
export async function exchangeSavedLook(
  from: NamedLook | null,
  to: NamedLook | null,
  image: string | null = null,
): Promise<void> {
  if (to !== null)
    await writeLook(
      { created: from?.created, view: from?.view ?? null, ...to },
      from?.name === to.name ? etagOf(to.name) : null,
      image,
    );
  if (from !== null && from.name !== to?.name) await eraseLook(from.name);
}

/** Set a saved look's thumbnail. */
export function attachSavedThumbnail({ name, etag }: SavedLook, image: string): void {
  cacheThumbnail(etag, image);
  void uploadThumbnail(path(name), etag);
}

/** The pending change of the saved looks, followed by queued ones. */
let pendingChange: Promise<void> | null = null;

/** Resolves when all changes are done and in the history; null without pending changes. */
export const whenSaved = (): Promise<void> | null => pendingChange;

async function runChange(
  label: string,
  before: NamedLook | null,
  to: NamedLook | null,
  image: string | null,
): Promise<void> {
  await reportErrors(async () => {
    await exchangeSavedLook(before, to, image);
    const saved = savedLooks.value.find(({ name }) => name === to?.name);
    history.record({ kind: "savedLook", label, before, after: saved === undefined ? to : toNamedLook(saved) });
    history.endGesture();
  });
}

/** Change the saved looks after the pending changes: an undo in between would undo an earlier step. */
async function queueChange(
  label: string,
  previous: NamedLook | null,
  after: NamedLook | null,
  image: string | null = null,
): Promise<void> {
  const operation = (pendingChange ?? Promise.resolve()).then(() => runChange(label, previous, after, image));
  pendingChange = operation;
  await operation;
  if (pendingChange === operation) pendingChange = null;
}

const toNamedLook = ({ name, look, created, view }: SavedLook): NamedLook => ({ name, look, created, view });

export function addLook(name: string, look: Look, image: string | null, view: LookView | null): Promise<void> {
  return queueChange(`Save ${name}`, null, { name, look, view }, image);
}

/** Set the view of a saved look; null: none. */
export function setLookView(saved: SavedLook, view: LookView | null): Promise<void> {
  const label = view === null ? `Remove view of ${saved.name}` : `Set view of ${saved.name}`;
  return queueChange(label, toNamedLook(saved), { ...toNamedLook(saved), view }, thumbnailOf(saved.etag));
}

export function deleteLook(saved: SavedLook): Promise<void> {
  return queueChange(`Delete ${saved.name}`, toNamedLook(saved), null);
}

export function updateLook(saved: SavedLook, look: Look): Promise<void> {
  return queueChange(`Update ${saved.name}`, toNamedLook(saved), { name: saved.name, look }, lookThumbnail(look));
}

export function renameLook(saved: SavedLook, name: string): Promise<void> {
  return queueChange(`Rename ${saved.name}`, toNamedLook(saved), { name, look: saved.look });
}
