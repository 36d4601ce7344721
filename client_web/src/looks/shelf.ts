/** Saved looks on the server, each with its version; saving and deleting can be undone. */
import { signal } from "@preact/signals";
import { history } from "../edit/history";
import type { NamedLook } from "../edit/history";
import { ApiError, json, request } from "../net/api";
import type { Look, LookEntry } from "../protocol";
import { scene } from "../state/scene";
import { attempt } from "../ui/toasts";
import { freeName } from "./names";

export interface SavedLook extends NamedLook {
  etag: string;
}

export const shelf = signal<SavedLook[]>([]);
const MAX_READ = 60;
const path = (name: string) => `/api/looks/${encodeURIComponent(name)}`;
const thumbnailKey = (name: string) => `relume.look.${scene.value?.id ?? ""}.${name}`;

export function thumbnailOf(name: string): string | null {
  return localStorage.getItem(thumbnailKey(name));
}

/** What a variant's thumbnail is kept under: no saved look has such a name. */
export const variantKey = (name: string): string => `${scene.value?.id}/${name}`;

export function keepThumbnail(name: string, image: string): void {
  try {
    localStorage.setItem(thumbnailKey(name), image);
  } catch {
    // the strip then shows the name alone
  }
}

/** Whether a look speaks only of what this scene has, or can be given. */
function fits(look: Partial<Look>): boolean {
  const known = new Set(scene.value?.materials.map((material) => material.name));
  const own = new Set(scene.value?.lights);
  return (
    Object.keys(look.materials ?? {}).every((name) => known.has(name)) &&
    Object.entries(look.lights ?? {}).every(([name, light]) => light.kind !== "mesh" || own.has(name))
  );
}

async function read(entry: LookEntry): Promise<SavedLook> {
  const response = await request(path(entry.name));
  return {
    name: entry.name,
    etag: response.headers.get("etag") ?? entry.etag,
    look: (await response.json()) as Partial<Look>,
  };
}

export async function refreshShelf(): Promise<void> {
  await attempt(async () => {
    const entries = (await (await request("/api/looks")).json()) as LookEntry[];
    const looks = await Promise.allSettled(entries.slice(0, MAX_READ).map(read));
    shelf.value = looks.flatMap((result) =>
      result.status === "fulfilled" && fits(result.value.look) ? [result.value] : [],
    );
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

async function write({ name, look }: NamedLook, etag: string | null): Promise<void> {
  const headers: Record<string, string> = etag === null ? { "If-None-Match": "*" } : { "If-Match": etag };
  const response = await request(path(name), json("PUT", look, headers)).catch((error: unknown) =>
    conflict(error, name, etag === null),
  );
  const saved = { name, etag: response.headers.get("etag") ?? "", look };
  const known = shelf.value.some((entry) => entry.name === name);
  shelf.value = known ? shelf.value.map((entry) => (entry.name === name ? saved : entry)) : [...shelf.value, saved];
}

async function erase(name: string): Promise<void> {
  await request(path(name), { method: "DELETE", headers: { "If-Match": etagOf(name) ?? "*" } }).catch((error: unknown) =>
    conflict(error, name),
  );
  shelf.value = shelf.value.filter((entry) => entry.name !== name);
}

/** Put a saved look in the place of another; null where there is none. */
export async function exchange(from: NamedLook | null, to: NamedLook | null): Promise<void> {
  if (to !== null) await write(to, from?.name === to.name ? etagOf(to.name) : null);
  if (from === null || from.name === to?.name) return;
  const image = thumbnailOf(from.name);
  if (to !== null && image !== null) keepThumbnail(to.name, image);
  await erase(from.name);
}

/** The change of the shelf that is under way, and those that wait for it. */
let underWay: Promise<void> | null = null;

/** When no change is under way: each is a step of the history then. Null where none is. */
export const settled = (): Promise<void> | null => underWay;

async function change(label: string, before: NamedLook | null, after: NamedLook | null): Promise<void> {
  await attempt(async () => {
    await exchange(before, after);
    history.record({ of: "shelf", label, before, after });
    history.seal();
  });
}

/** Change the shelf when the changes before this are done: an undo in between would undo the step before. */
async function perform(label: string, before: NamedLook | null, after: NamedLook | null): Promise<void> {
  const mine = (underWay ?? Promise.resolve()).then(() => change(label, before, after));
  underWay = mine;
  await mine;
  if (underWay === mine) underWay = null;
}

const named = ({ name, look }: NamedLook): NamedLook => ({ name, look });

export function addLook(name: string, look: Look): Promise<void> {
  return perform(`Save ${name}`, null, { name, look });
}

export function deleteLook(saved: SavedLook): Promise<void> {
  return perform(`Delete ${saved.name}`, named(saved), null);
}

export function updateLook(saved: SavedLook, look: Look): Promise<void> {
  return perform(`Update ${saved.name}`, named(saved), { name: saved.name, look });
}

export function renameLook(saved: SavedLook, name: string): Promise<void> {
  return perform(`Rename ${saved.name}`, named(saved), { name, look: saved.look });
}
