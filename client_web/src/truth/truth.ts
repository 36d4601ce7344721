/** "How true is this?": one comparison of the picture with brute force, followed while its panel is open. */
import { signal } from "@preact/signals";
import { deleteTruth, getTruth, startTruth } from "../net/api";
import type { TruthBody } from "../protocol";
import { truthOpen } from "../state/panels";
import { togglePanel } from "../state/room";
import { seenOf } from "../state/solo";
import { bake, look, seenPaths, soloLight, viewName } from "../state/store";
import { attempt } from "../ui/toasts";

const POLL_MS = 1000;

/** The comparison, and the look that it judges. */
export const truth = signal<{ body: TruthBody; look: string } | null>(null);

/** What the comparison depends on of the look: the display does not matter. */
export function judged(): string {
  const seen = [seenPaths.value, soloLight.value];
  return JSON.stringify({ ...look.value, display: null, bake: bake.value, view: viewName.value, seen });
}

function isGoingOn(body: TruthBody): boolean {
  return body.state === "queued" || body.state === "running";
}

async function follow(id: string): Promise<void> {
  for (;;) {
    await new Promise((done) => setTimeout(done, POLL_MS));
    const current = truth.value;
    if (current?.body.id !== id || !isGoingOn(current.body)) return;
    const body = await getTruth(id);
    if (truth.value?.body.id === id) truth.value = { ...truth.value, body };
  }
}

export async function askTruth(): Promise<void> {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return;
  await forgetTruth();
  await attempt(async () => {
    const body = await startTruth({ bake: id, view: viewName.value, look: { ...seenOf(current) } });
    truth.value = { body, look: judged() };
    await follow(body.id);
  });
}

/** Stop the server's work: nobody looks at it any more. */
async function forgetTruth(): Promise<void> {
  const known = truth.value;
  truth.value = null;
  if (known !== null) await deleteTruth(known.body.id).catch(() => undefined); // it may have ended by itself
}

export function toggleTruth(): void {
  const before = truthOpen.value;
  togglePanel("truth");
  if (truthOpen.value !== before) void (truthOpen.value ? askTruth() : forgetTruth());
}
