/** Saved looks on the server, each with its version; saving and deleting can be undone. */
import { signal } from "@preact/signals";
import { history } from "../edit/history";
import type { NamedLook } from "../edit/history";
import { ApiError, json, request } from "../net/api";
import type { Look, LookEntry } from "../protocol";
import { scene } from "../state/scene";
import { lookThumbnail } from "../state/thumbnails";
import { attempt } from "../ui/toasts";
import { freeName } from "./names";
import { fetchThumbnail, sendThumbnail, showThumbnail, thumbnailOf } from "./namedThumbnails";

export interface SavedLook extends NamedLook {
  etag: string;
  created: string;
}

export const shelf = signal<SavedLook[]>([]);
const MAX_READ = 60;
const path = (name: string) => `/api/looks/${encodeURIComponent(name)}`;
/** Whether a look speaks only of what this scene has, or can be given. */
function fits(look: Partial<Look>): boolean {
  const known = new Set(scene.value?.materials.map((material) => material.name));
  const own = new Set(scene.value?.lights);
  return (
    Object.keys(look.materials ?? {}).every((name) => known.has(name)) &&
    Object.entries(look.lights ?? {}).every(([name, light]) => light.kind !== "mesh" || own.has(name))
  );
}

async function read({ name, etag, created, thumbnail }: LookEntry): Promise<SavedLook> {
  const response = await request(path(name));
  if (thumbnail !== null && thumbnailOf(etag) === null) showThumbnail(etag, thumbnail);
  return { name, etag: response.headers.get("etag") ?? etag, created, look: (await response.json()) as Partial<Look> };
}

/** In the order in which they were saved first: times of the server, all written alike. */
function inOrder(looks: SavedLook[]): SavedLook[] {
  return looks.sort((a, b) => (a.created < b.created ? -1 : Number(a.created > b.created)));
}

export async function refreshShelf(): Promise<void> {
  await attempt(async () => {
    const entries = (await (await request("/api/looks")).json()) as LookEntry[];
    const looks = await Promise.allSettled(entries.slice(0, MAX_READ).map(read));
    const found = looks.flatMap((result) => (result.status === "fulfilled" ? [result.value] : []));
    shelf.value = inOrder(found.filter(({ look }) => fits(look)));
  });
}

/** A name that no look has: looks of other scenes, which are not shown, have names too. */
export async function unusedName(): Promise<string> {
  const entries = (await (await request("/api/looks")).json()) as LookEntry[];
  return freeName(
    entries.map(({ name }) => name),
    shelf.value.length,
  );
}

function conflict(error: unknown, name: string, isNew = false): never {
  if (isNew && error instanceof ApiError && error.status === 412)
    throw new Error(`There is a look called “${name}” already, perhaps of another scene. Choose another name.`);
  if (error instanceof ApiError && (error.status === 412 || error.status === 428)) {
    void refreshShelf();
    throw new Error(
      `“${name}” was changed elsewhere meanwhile. Nothing was overwritten; look at the new version first.`,
    );
  }
  throw error;
}

function etagOf(name: string): string | null {
  return shelf.value.find((entry) => entry.name === name)?.etag ?? null;
}

async function write({ name, look, created }: NamedLook, etag: string | null, image: string | null): Promise<void> {
  const headers: Record<string, string> = etag === null ? { "If-None-Match": "*" } : { "If-Match": etag };
  const place = etag === null && created !== undefined ? `?created=${encodeURIComponent(created)}` : "";
  const response = await request(path(name) + place, json("PUT", look, headers)).catch((error: unknown) =>
    conflict(error, name, etag === null),
  );
  const known = shelf.value.find((entry) => entry.name === name);
  const since = known?.created ?? ((await response.json()) as LookEntry).created;
  const saved = { name, etag: response.headers.get("etag") ?? "", created: since, look };
  shelf.value = inOrder([...shelf.value.filter((entry) => entry !== known), saved]);
  if (image !== null) showThumbnail(saved.etag, image);
  await sendThumbnail(path(name), saved.etag);
}

async function erase(name: string): Promise<void> {
  const etag = etagOf(name) ?? "*";
  await fetchThumbnail(etag).catch(() => undefined); // it goes with the look, which may come back
  await request(path(name), { method: "DELETE", headers: { "If-Match": etag } }).catch((error: unknown) =>
    conflict(error, name),
  );
  shelf.value = shelf.value.filter((entry) => entry.name !== name);
}

/** Put a saved look in the place of another; null where there is none. `image`: its thumbnail, where it has one. */
export async function exchange(from: NamedLook | null, to: NamedLook | null, image: string | null = null): Promise<void> {
  if (to !== null) await write({ created: from?.created, ...to }, from?.name === to.name ? etagOf(to.name) : null, image);
  if (from !== null && from.name !== to?.name) await erase(from.name);
}

/** Give a saved look a thumbnail. */
export function giveThumbnailTo({ name, etag }: SavedLook, image: string): void {
  showThumbnail(etag, image);
  void sendThumbnail(path(name), etag);
}

/** The change of the shelf that is under way, and those that wait for it. */
let underWay: Promise<void> | null = null;

/** When no change is under way: each is a step of the history then. Null where none is. */
export const settled = (): Promise<void> | null => underWay;

async function change(label: string, before: NamedLook | null, to: NamedLook | null, image: string | null): Promise<void> {
  await attempt(async () => {
    await exchange(before, to, image);
    const saved = shelf.value.find(({ name }) => name === to?.name);
    history.record({ of: "shelf", label, before, after: saved === undefined ? to : named(saved) });
    history.seal();
  });
}

/** Change the shelf when the changes before this are done: an undo in between would undo the step before. */
async function perform(
  label: string,
  before: NamedLook | null,
  after: NamedLook | null,
  image: string | null = null,
): Promise<void> {
  const mine = (underWay ?? Promise.resolve()).then(() => change(label, before, after, image));
  underWay = mine;
  await mine;
  if (underWay === mine) underWay = null;
}

const named = ({ name, look, created }: SavedLook): NamedLook => ({ name, look, created });

export function addLook(name: string, look: Look, image: string | null): Promise<void> {
  return perform(`Save ${name}`, null, { name, look }, image);
}

export function deleteLook(saved: SavedLook): Promise<void> {
  return perform(`Delete ${saved.name}`, named(saved), null);
}

export function updateLook(saved: SavedLook, look: Look): Promise<void> {
  return perform(`Update ${saved.name}`, named(saved), { name: saved.name, look }, lookThumbnail(look));
}

export function renameLook(saved: SavedLook, name: string): Promise<void> {
  return perform(`Rename ${saved.name}`, named(saved), { name, look: saved.look });
}
