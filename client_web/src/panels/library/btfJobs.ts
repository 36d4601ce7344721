/** BTF jobs on the server, polled while the library is open. */
import { signal } from "@preact/signals";
import { ApiError, deleteBtfJob, listBtfJobs, resumeBtfJob, startBtfJob, stopBtfJob } from "../../session/net/api";
import { uploadBtf, uploadGeometry } from "../../session/net/upload";
import type { BtfJobBody, SyntheticBtfRequest } from "../../protocol";
import { libraryOpen } from "../../state/panels";
import { formatSeconds } from "../../ui/scale";
import { reportErrors, showNote } from "../../ui/toasts";

const POLL_MS = 1000;

export type Geometry = SyntheticBtfRequest["geometry"];
export const GEOMETRIES: readonly Geometry[] = ["weave", "pebbles", "corduroy"];

/** Running, queued, stopped and failed jobs; finished BTFs are in the library instead. */
export const btfJobs = signal<readonly BtfJobBody[]>([]);
/** Uploaded fraction of the images or the mesh; null without an upload. */
export const btfUploadProgress = signal<number | null>(null);

let isFollowing = false;

export function isRunning({ state }: Pick<BtfJobBody, "state">): boolean {
  return state === "queued" || state === "running";
}

/** True if such a job exists: a second one would give the same BTF. */
export function isBeingMade(geometry: Geometry): boolean {
  return btfJobs.value.some((work) => work.geometry === geometry && isRunning(work));
}

/** Poll the jobs until none runs or the library is closed; `onReady` is called when one finishes. */
export async function trackJobs(onReady: () => Promise<void>): Promise<void> {
  if (isFollowing) return;
  isFollowing = true;
  try {
    for (;;) {
      const all = await listBtfJobs();
      const ready = all.filter(({ state }) => state === "ready");
      btfJobs.value = all.filter(({ state }) => state !== "ready");
      if (ready.length > 0) {
        await onReady();
        for (const { id, name } of ready) {
          showNote(`“${name}” added to the library.`);
          await deleteBtfJob(id);
        }
      }
      if (!libraryOpen.value || !btfJobs.value.some(isRunning)) return;
      await new Promise((done) => setTimeout(done, POLL_MS));
    }
  } finally {
    isFollowing = false;
  }
}

export async function generate(geometry: Geometry): Promise<void> {
  await startBtfJob({ geometry });
}

export const importImages = (file: File) => uploadJob((onProgress) => uploadBtf(file, onProgress));
/** `period`: width of one repeat in meters; null: the width of the bounding box. */
export const makeFromMesh = (file: File, period: number | null) =>
  uploadJob((onProgress) => uploadGeometry(file, period, onProgress));

async function uploadJob(upload: (onProgress: (fraction: number) => void) => Promise<BtfJobBody>): Promise<void> {
  btfUploadProgress.value = 0;
  try {
    const { name, geometry } = await upload((progress) => (btfUploadProgress.value = progress));
    const isBefore = (work: BtfJobBody) => work.state === "failed" && work.name === name && work.geometry === geometry;
    for (const { id } of btfJobs.value.filter(isBefore)) await removeJob(id); // a new attempt replaces failed jobs
  } finally {
    btfUploadProgress.value = null;
  }
}

/** Stop a job; its results so far remain. */
export async function stopJob(id: string): Promise<void> {
  await reportErrors(async () => {
    await stopBtfJob(id);
    btfJobs.value = btfJobs.value.map((work) => (work.id === id ? { ...work, state: "canceled" as const } : work));
  });
}

export async function continueJob(id: string): Promise<void> {
  await resumeBtfJob(id);
}

export async function deleteJob(id: string): Promise<void> {
  await reportErrors(() => removeJob(id));
}

async function removeJob(id: string): Promise<void> {
  try {
    await deleteBtfJob(id);
  } catch (error) {
    if (!(error instanceof ApiError && error.status === 404)) throw error; // 404: already deleted elsewhere
  }
  btfJobs.value = btfJobs.value.filter((work) => work.id !== id);
}

export function jobText({ state, progress, seconds_left, problem }: BtfJobBody): string {
  switch (state) {
    case "queued":
      return "queued";
    case "running": {
      const left = seconds_left === null ? "" : `, ${formatSeconds(seconds_left)} left`;
      return `${Math.floor(100 * progress)} %${left}`;
    }
    case "canceled":
      return "stopped; progress is saved";
    case "failed":
      return problem ?? "failed";
    case "ready":
      return "ready";
  }
}
