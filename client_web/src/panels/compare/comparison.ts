/** One comparison of the image with a reference, polled while its panel is open, over page reloads
 * and server restarts. */
import { effect, signal } from "@preact/signals";
import { currentPose, currentSize } from "../looks/exportImage";
import { deleteComparison, getComparison, planComparison, resumeComparison, startComparison, stopComparison, nullIfUnavailable } from "../../session/net/api";
import type { ComparisonBody, ComparisonPlanBody, ComparisonRequest } from "../../protocol";
import { pathOverride } from "../../state/visibility/lightPaths";
import { visibleLookOf } from "../../state/visibility/displayState";
import { soloLight } from "../../state/visibility/soloSources";
import { bake } from "../../state/bakes";
import { look } from "../../state/look";
import { comparisonOpen } from "../../state/panels";
import { togglePanel } from "../../state/panelWidths";
import { saveInTab, loadFromTab } from "../../state/tabSession";
import { activeViewName, views } from "../../state/views";
import { reportErrors } from "../../ui/toasts";

const POLL_MS = 1000;
const COMPARISON_KEY = "relume.comparison";

/** Estimated cost of a comparison; null while unknown. */
export const comparisonPlan = signal<ComparisonPlanBody | "unknown" | null>(null);
interface ActiveComparison {
  body: ComparisonBody;
  /** The compared look. */
  look: string;
  /** When this tab started or resumed it; earlier work does not count as waiting time. */
  since: number;
}

/** The displayed comparison. */
export const activeComparison = signal<ActiveComparison | null>(null);

/** The state that the comparison depends on, without the look's display settings. */
export function comparedState(): string {
  const visibleLight = [pathOverride.value, soloLight.value];
  void views.value; // the camera has moved
  const camera = [currentPose(), currentSize()];
  return JSON.stringify({ ...look.value, display: null, bake: bake.value, view: activeViewName.value, light: visibleLight, camera });
}

export function isInProgress(body: ComparisonBody): boolean {
  return body.state === "queued" || body.state === "running";
}

async function pollComparison(id: string): Promise<void> {
  for (;;) {
    await new Promise((done) => setTimeout(done, POLL_MS));
    const current = activeComparison.value;
    if (current?.body.id !== id || !isInProgress(current.body)) return;
    const body = (await nullIfUnavailable(getComparison(id))) ?? current.body;
    if (activeComparison.value?.body.id === id) activeComparison.value = { ...activeComparison.value, body };
  }
}

function comparisonRequest(): ComparisonRequest | null {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) return null;
  return { bake: id, view: activeViewName.value, look: { ...visibleLookOf(current) }, camera: currentPose(), size: currentSize() };
}

/** Store the comparison for a reload. */
function trackComparison(): void {
  effect(() => saveInTab(COMPARISON_KEY, activeComparison.value && { id: activeComparison.value.body.id, look: activeComparison.value.look }));
}

/** Continue with the comparison of a bake that was displayed before a reload. */
export async function loadComparison(bakeId: string | null): Promise<void> {
  const stored = loadFromTab(COMPARISON_KEY) as { id: string; look: string } | null;
  const body = stored === null ? null : await getComparison(stored.id).catch(() => null);
  trackComparison();
  if (stored === null || body === null || activeComparison.peek() !== null) return;
  if (body.bake !== bakeId) return void deleteComparison(stored.id).catch(() => undefined);
  activeComparison.value = { body, look: stored.look, since: Date.now() };
  if (!comparisonOpen.peek()) togglePanel("comparison");
  await reportErrors(() => pollComparison(body.id));
}

/** Estimate the duration without starting; timings of other images are used until this one is timed. */
async function planWhileOpen(): Promise<void> {
  comparisonPlan.value = null;
  for (let request = comparisonRequest(); request !== null && isPlanning(); request = comparisonRequest()) {
    // the server may be unreachable for a while
    const newPlan = await planComparison(request).catch(() => "unknown" as const);
    if (!isPlanning()) return;
    comparisonPlan.value = newPlan;
    if (newPlan === "unknown" || newPlan.is_measured) return;
    await new Promise((done) => setTimeout(done, POLL_MS));
  }
}

const isPlanning = () => comparisonOpen.peek() && activeComparison.peek() === null;

export async function beginComparison(): Promise<void> {
  const request = comparisonRequest();
  if (request === null) return;
  await discardComparison();
  await reportErrors(async () => {
    const body = await startComparison(request);
    activeComparison.value = { body, look: comparedState(), since: Date.now() };
    await pollComparison(body.id);
  });
}

/** Stop; results so far remain. */
export async function haltComparison(): Promise<void> {
  const current = activeComparison.value;
  if (current === null) return;
  await reportErrors(async () => {
    await stopComparison(current.body.id);
    activeComparison.value = { ...current, body: await getComparison(current.body.id) };
  });
}

export async function continueComparison(): Promise<void> {
  const current = activeComparison.value;
  if (current === null) return;
  await reportErrors(async () => {
    activeComparison.value = { ...current, body: await resumeComparison(current.body.id), since: Date.now() };
    await pollComparison(current.body.id);
  });
}

/** Delete the comparison that is no longer displayed. */
async function discardComparison(): Promise<void> {
  const current = activeComparison.value;
  activeComparison.value = null;
  if (current !== null) await deleteComparison(current.body.id).catch(() => undefined); // it may be deleted already
}

export function toggleComparison(): void {
  const wasOpen = comparisonOpen.value;
  togglePanel("comparison");
  if (comparisonOpen.value !== wasOpen) void (comparisonOpen.value ? planWhileOpen() : discardComparison());
}
