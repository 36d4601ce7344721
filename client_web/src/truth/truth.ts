/** "How true is this?": one comparison of the picture with brute force, followed while its panel is open, over reloads of
 * the page and while the server is away. */
import { effect, signal } from "@preact/signals";
import { eyeNow, sizeNow } from "../looks/export";
import { forgetTruth, getTruth, planTruth, resumeTruth, startTruth, stopTruth, unlessAway } from "../net/api";
import type { TruthBody, TruthPlanBody, TruthRequest } from "../protocol";
import { seenPaths } from "../seen/paths";
import { seenOf } from "../seen/rendered";
import { soloLight } from "../seen/solo";
import { bake } from "../state/bakes";
import { look } from "../state/look";
import { truthOpen } from "../state/panels";
import { togglePanel } from "../state/room";
import { keepInTab, keptInTab } from "../state/tab";
import { viewName, views } from "../state/views";
import { attempt } from "../ui/toasts";

const POLL_MS = 1000;
const KEY = "relume.truth";

/** What a comparison would take; null while that is being found out. */
export const truthPlan = signal<TruthPlanBody | "unknown" | null>(null);
interface Asked {
  body: TruthBody;
  /** The look that it judges. */
  look: string;
  /** When this tab asked for it, or for going on: what has been done before counts for nobody who waits. */
  since: number;
}

/** The comparison that is looked at. */
export const truth = signal<Asked | null>(null);

/** What the comparison depends on: the display of the look does not matter. */
export function judged(): string {
  const seen = [seenPaths.value, soloLight.value];
  views.value; // the eye has moved
  const eye = [eyeNow(), sizeNow()];
  return JSON.stringify({ ...look.value, display: null, bake: bake.value, view: viewName.value, seen, eye });
}

export function isGoingOn(body: TruthBody): boolean {
  return body.state === "queued" || body.state === "running";
}

async function follow(id: string): Promise<void> {
  for (;;) {
    await new Promise((done) => setTimeout(done, POLL_MS));
    const current = truth.value;
    if (current?.body.id !== id || !isGoingOn(current.body)) return;
    const body = (await unlessAway(getTruth(id))) ?? current.body;
    if (truth.value?.body.id === id) truth.value = { ...truth.value, body };
  }
}

function asked(): TruthRequest | null {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return null;
  return { bake: id, view: viewName.value, look: { ...seenOf(current) }, camera: eyeNow(), size: sizeNow() };
}

/** Keep it for a reload, as long as there is one. */
function followTruth(): void {
  effect(() => keepInTab(KEY, truth.value && { id: truth.value.body.id, look: truth.value.look }));
}

/** Go on with the comparison of a bake that was looked at when the page was reloaded. */
export async function recallTruth(of: string | null): Promise<void> {
  const kept = keptInTab<{ id: string; look: string }>(KEY);
  const body = kept === null ? null : await getTruth(kept.id).catch(() => null);
  followTruth();
  if (kept === null || body === null || truth.peek() !== null) return;
  if (body.bake !== of) return void forgetTruth(kept.id).catch(() => undefined);
  truth.value = { body, look: kept.look, since: Date.now() };
  if (!truthOpen.peek()) togglePanel("truth");
  await attempt(() => follow(body.id));
}

/** Say how long it would take; nothing begins. What other pictures tell is said until this one has been timed. */
async function plan(): Promise<void> {
  truthPlan.value = null;
  for (let request = asked(); request !== null && isPlanning(); request = asked()) {
    // the server may be away for a while
    const found = await planTruth(request).catch(() => "unknown" as const);
    if (!isPlanning()) return;
    truthPlan.value = found;
    if (found === "unknown" || found.is_measured) return;
    await new Promise((done) => setTimeout(done, POLL_MS));
  }
}

const isPlanning = () => truthOpen.peek() && truth.peek() === null;

export async function askTruth(): Promise<void> {
  const request = asked();
  if (request === null) return;
  await forget();
  await attempt(async () => {
    const body = await startTruth(request);
    truth.value = { body, look: judged(), since: Date.now() };
    await follow(body.id);
  });
}

/** Stop; what was found so far stays. */
export async function haltTruth(): Promise<void> {
  const known = truth.value;
  if (known === null) return;
  await attempt(async () => {
    await stopTruth(known.body.id);
    truth.value = { ...known, body: await getTruth(known.body.id) };
  });
}

export async function goOnWithTruth(): Promise<void> {
  const known = truth.value;
  if (known === null) return;
  await attempt(async () => {
    truth.value = { ...known, body: await resumeTruth(known.body.id), since: Date.now() };
    await follow(known.body.id);
  });
}

/** Stop the server's work: nobody looks at it any more. */
async function forget(): Promise<void> {
  const known = truth.value;
  truth.value = null;
  if (known !== null) await forgetTruth(known.body.id).catch(() => undefined); // it may have ended by itself
}

export function toggleTruth(): void {
  const before = truthOpen.value;
  togglePanel("truth");
  if (truthOpen.value !== before) void (truthOpen.value ? plan() : forget());
}
