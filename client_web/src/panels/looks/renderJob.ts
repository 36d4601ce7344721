/** The render job of this tab, one at a time: polled to its end, over page reloads and server restarts, then downloaded. */
import { signal } from "@preact/signals";
import { deleteRender, getRender, problemText, startRender, nullIfUnavailable } from "../../session/net/api";
import type { RenderBody, RenderRequest } from "../../protocol";
import { renderedBake } from "../../state/bakes";
import { saveInTab, loadFromTab } from "../../state/tabSession";
import { formatSeconds } from "../../ui/scale";
import { reportErrors, showNote } from "../../ui/toasts";
import { serverUrl } from "../../session/net/serverUrl";

const POLL_MS = 300;
const KEY = "relume.rendering";

/** `fetchFrom`: the file of the finished job. */
interface ExportJob {
  id: string;
  exportName: string;
  fetchFrom: string;
}

/** The running export: its progress, and a way to stop it once it has started. */
export const exporting = signal<{
  exportName: string;
  progress: number;
  /** Progress of a bake that the images wait for; null: none. */
  baking: number | null;
  secondsLeft: number | null;
  stop: (() => void) | null;
} | null>(null);

export function exportText({ exportName, progress, baking, secondsLeft }: NonNullable<typeof exporting.value>): string {
  if (baking !== null) return `${exportName}: baking ${Math.floor(100 * baking)} %`;
  const left = secondsLeft === null ? "" : `, ${formatSeconds(secondsLeft)} left`;
  return `${exportName} ${Math.floor(100 * progress)} %${left}`;
}

export function download(href: string, name: string): void {
  const link = document.createElement("a");
  link.href = href;
  link.download = name;
  link.click();
}

/** The job's final state; null if it was stopped. */
async function finishRendering({ id, exportName }: ExportJob): Promise<RenderBody | null> {
  const stopping = new AbortController();
  const isStopped = () => stopping.signal.aborted;
  const stop = () => {
    stopping.abort();
    void reportErrors(() => deleteRender(id));
    clearExport();
  };
  for (;;) {
    const state = await nullIfUnavailable(getRender(id));
    if (isStopped()) return null;
    if (state?.state === "ready" || state?.state === "failed") return state;
    const last = exporting.peek();
    const { progress, seconds_left: secondsLeft } = state ?? { progress: last?.progress ?? 0, seconds_left: null };
    const baking = state === null ? (last?.baking ?? null) : state.baking;
    renderedBake.value = state?.bake ?? renderedBake.peek();
    exporting.value = { exportName, progress, baking, secondsLeft, stop };
    await new Promise((waited) => setTimeout(waited, POLL_MS));
    if (isStopped()) return null;
  }
}

function clearExport(): void {
  exporting.value = null;
  saveInTab(KEY, null);
}

/** Poll the job to its end and download the result. */
async function pollRendering(rendering: ExportJob): Promise<void> {
  const { id, exportName, fetchFrom } = rendering;
  const state = await finishRendering(rendering);
  if (state === null) return; // another job may have started since
  if (state.state === "failed") throw new Error(`${exportName} export failed: ${problemText(state.problem)}`);
  clearExport();
  download(serverUrl(`/api/renders/${encodeURIComponent(id)}/${fetchFrom}`), "");
}

/** Run `work` unless another export is running; report errors. */
async function runExport(exportName: string, work: () => Promise<void>): Promise<void> {
  exporting.value = { exportName, progress: 0, baking: null, secondsLeft: null, stop: null };
  await reportErrors(async () => {
    try {
      await work();
    } catch (error) {
      clearExport();
      throw error;
    }
  });
}

/** Render and download a job, unless one is running; `light`: text of the active filters. */
export async function renderAndSave(
  exportName: string,
  fetchFrom: string,
  request: RenderRequest,
  light: string,
): Promise<void> {
  if (exporting.peek() !== null) return;
  await runExport(exportName, async () => {
    showNote(`Rendering ${exportName}${light}…`);
    const { id } = await startRender(request);
    saveInTab(KEY, { id, exportName, fetchFrom });
    await pollRendering({ id, exportName, fetchFrom });
  });
}

/** Resume the job that was running before a reload. */
export async function resumeRendering(): Promise<void> {
  const stored = loadFromTab(KEY) as ExportJob | null;
  if (stored !== null && exporting.peek() === null) await runExport(stored.exportName, () => pollRendering(stored));
}
