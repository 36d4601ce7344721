/** Textures from all sides in the making: rendered or imported by the server, followed while the library is open. */
import { signal } from "@preact/signals";
import { ApiError, forgetBtfWork, listBtfWorks, resumeBtfWork, startBtf, stopBtfWork } from "../net/api";
import { uploadBtf, uploadGeometry } from "../net/upload";
import type { BtfWorkBody, SyntheticBtfRequest } from "../protocol";
import { libraryOpen } from "../state/panels";
import { formatSeconds } from "../ui/scale";
import { attempt, note } from "../ui/toasts";

const POLL_MS = 1000;

export type Geometry = SyntheticBtfRequest["geometry"];
export const GEOMETRIES: readonly Geometry[] = ["weave", "pebbles", "corduroy"];

/** What is made, waits, was stopped or failed; what is ready is in the library instead. */
export const makings = signal<readonly BtfWorkBody[]>([]);
/** Share of the images, or of the mesh, that has been sent; null while none are on their way. */
export const sendingImages = signal<number | null>(null);

let isFollowing = false;

export function isGoingOn({ state }: Pick<BtfWorkBody, "state">): boolean {
  return state === "queued" || state === "running";
}

/** A second one would be the same. */
export function isInTheMaking(geometry: Geometry): boolean {
  return makings.value.some((work) => work.geometry === geometry && isGoingOn(work));
}

/** Follow what is made until nothing is, or the library is closed; `arrived` is called when something is ready. */
export async function followMakings(arrived: () => Promise<void>): Promise<void> {
  if (isFollowing) return;
  isFollowing = true;
  try {
    for (;;) {
      const all = await listBtfWorks();
      const ready = all.filter(({ state }) => state === "ready");
      makings.value = all.filter(({ state }) => state !== "ready");
      if (ready.length > 0) {
        await arrived();
        for (const { id, name } of ready) {
          note(`${name} is in the library.`);
          await forgetBtfWork(id);
        }
      }
      if (!libraryOpen.value || !makings.value.some(isGoingOn)) return;
      await new Promise((done) => setTimeout(done, POLL_MS));
    }
  } finally {
    isFollowing = false;
  }
}

export async function makeSynthetic(geometry: Geometry): Promise<void> {
  await startBtf({ geometry });
}

export const importImages = (file: File) => sent((told) => uploadBtf(file, told));
/** `period`: side of what repeats, metres; null: that of the box about it. */
export const makeOfMesh = (file: File, period: number | null) => sent((told) => uploadGeometry(file, period, told));

async function sent(upload: (told: (share: number) => void) => Promise<BtfWorkBody>): Promise<void> {
  sendingImages.value = 0;
  try {
    const { name, geometry } = await upload((share) => (sendingImages.value = share));
    const isBefore = (work: BtfWorkBody) => work.state === "failed" && work.name === name && work.geometry === geometry;
    for (const { id } of makings.value.filter(isBefore)) await forget(id); // what was wrong with the file has been read
  } finally {
    sendingImages.value = null;
  }
}

/** What was found so far is kept. */
export async function stopMaking(id: string): Promise<void> {
  await attempt(async () => {
    await stopBtfWork(id);
    makings.value = makings.value.map((work) => (work.id === id ? { ...work, state: "stopped" as const } : work));
  });
}

export async function goOnMaking(id: string): Promise<void> {
  await resumeBtfWork(id);
}

export async function forgetMaking(id: string): Promise<void> {
  await attempt(() => forget(id));
}

async function forget(id: string): Promise<void> {
  try {
    await forgetBtfWork(id);
  } catch (error) {
    if (!(error instanceof ApiError && error.status === 404)) throw error; // else somebody else has forgotten it
  }
  makings.value = makings.value.filter((work) => work.id !== id);
}

export function makingWords({ state, progress, seconds_left, problem }: BtfWorkBody): string {
  switch (state) {
    case "queued":
      return "waits for its turn";
    case "running": {
      const left = seconds_left === null ? "" : `, ${formatSeconds(seconds_left)} left`;
      return `${Math.floor(100 * progress)} %${left}`;
    }
    case "stopped":
      return "stopped; what was found is kept";
    case "failed":
      return problem ?? "failed";
    case "ready":
      return "ready";
  }
}
