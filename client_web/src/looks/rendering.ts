/** The batch that the server renders for this tab, one at a time: followed to its end, over reloads of the page and while
 * the server is away, and then saved. */
import { signal } from "@preact/signals";
import { deleteRender, getRender, problemText, startRender, unlessAway } from "../net/api";
import type { RenderBody, RenderRequest } from "../protocol";
import { keepInTab, keptInTab } from "../state/tab";
import { formatSeconds } from "../ui/scale";
import { attempt, note } from "../ui/toasts";

const POLL_MS = 300;
const KEY = "relume.rendering";

/** `fetchFrom`: the file of the finished batch. */
interface Rendering {
  id: string;
  what: string;
  fetchFrom: string;
}

/** What the server renders now: how far it is, and a way to stop it, once it has begun. */
export const exporting = signal<{ what: string; progress: number; secondsLeft: number | null; stop: (() => void) | null } | null>(null);

export function exportingWords({ what, progress, secondsLeft }: NonNullable<typeof exporting.value>): string {
  const left = secondsLeft === null ? "" : `, ${formatSeconds(secondsLeft)} left`;
  return `${what} ${Math.floor(100 * progress)} %${left}`;
}

export function download(href: string, name: string): void {
  const link = document.createElement("a");
  link.href = href;
  link.download = name;
  link.click();
}

/** Its last state; null where it was stopped on the way. */
async function end({ id, what }: Rendering): Promise<RenderBody | null> {
  let isStopped = false;
  const stop = () => {
    isStopped = true;
    void attempt(() => deleteRender(id));
    done();
  };
  for (;;) {
    const state = await unlessAway(getRender(id));
    if (isStopped) return null;
    if (state?.state === "ready" || state?.state === "failed") return state;
    const { progress, seconds_left: secondsLeft } = state ?? { progress: exporting.peek()?.progress ?? 0, seconds_left: null };
    exporting.value = { what, progress, secondsLeft, stop };
    await new Promise((waited) => setTimeout(waited, POLL_MS));
    if (isStopped) return null;
  }
}

function done(): void {
  exporting.value = null;
  keepInTab(KEY, null);
}

/** Follow it to its end, and save it. */
async function follow(rendering: Rendering): Promise<void> {
  const { id, what, fetchFrom } = rendering;
  const state = await end(rendering);
  if (state === null) return; // another one may have begun since
  if (state.state === "failed") throw new Error(`The ${what} could not be rendered: ${problemText(state.problem)}`);
  done();
  download(`/api/renders/${encodeURIComponent(id)}/${fetchFrom}`, "");
}

/** Do `work` while nothing else is exported; a failure is said. */
async function exported(what: string, work: () => Promise<void>): Promise<void> {
  exporting.value = { what, progress: 0, secondsLeft: null, stop: null };
  await attempt(async () => {
    try {
      await work();
    } catch (error) {
      done();
      throw error;
    }
  });
}

/** Have a batch rendered and saved, where none is on its way; `light` says which is missing. */
export async function renderAndSave(what: string, fetchFrom: string, request: RenderRequest, light: string): Promise<void> {
  if (exporting.peek() !== null) return;
  await exported(what, async () => {
    note(`Rendering the ${what} on the server${light}…`);
    const { id } = await startRender(request);
    keepInTab(KEY, { id, what, fetchFrom });
    await follow({ id, what, fetchFrom });
  });
}

/** Go on with what the page was following when it was reloaded. */
export async function resumeRendering(): Promise<void> {
  const kept = keptInTab<Rendering>(KEY);
  if (kept !== null && exporting.peek() === null) await exported(kept.what, () => follow(kept));
}
