/** Bakes that are on their way to take over from the one that is shown. */
import { connect } from "../live/connect";
import { whenBakeIsReady } from "../live/handlers";
import * as api from "../net/api";
import { bakeEnd, followBake } from "../net/events";
import type { BakeBody, SceneBody } from "../protocol";
import { bake, bakes, coming } from "../state/bakes";
import { page } from "../state/scene";
import { attempt, showError } from "../ui/toasts";
import { fineness, type BakeChoice } from "./bakeChoice";
import { previewSize } from "./recipe";

let stop: () => void = () => undefined;
/** The bake that a session was opened on last. */
let opened: string | null = null;

/** Show a bake, once its first picture is there. */
export function openBake(id: string): void {
  opened = id;
  connect(id);
}

/** Open a session on a finer bake once; it takes over when its first picture is there. */
function swapTo(id: string): void {
  if (page.peek() === "editor" && id !== bake.peek() && id !== opened) openBake(id);
}

/** Follow a bake that is meant to replace the one shown. */
export function follow(started: BakeBody): void {
  stop();
  coming.value = started;
  stop = followBake(started.id, (news) => {
    coming.value = news;
    if (news.state === "ready") swapTo(news.id);
    if (news.state === "failed")
      showError(`The bake failed: ${api.problemText(news.problem)} The picture stays as it is.`);
  });
}

export function stopFollowing(): void {
  stop();
}

// a bake of this scene that comes to be ready takes over only where it is finer, of the same light; one that was ready when
// the scene was opened does not: the address, or whoever chose, named the one that is shown
whenBakeIsReady((id) => {
  const current = bake.peek();
  if (current === null || id === current) return;
  if (bakes.peek().some((each) => each.id === id && each.state === "ready")) return;
  void attempt(async () => {
    const [other, shown] = await Promise.all([api.getBake(id), api.getBake(current)]);
    if (other.recipe.method === shown.recipe.method && fineness(other) > fineness(shown)) swapTo(id);
  });
});

/** Bake what is soon there to be shown, and wait for it; gives its id. */
export async function bakePreview(scene: SceneBody, choice: BakeChoice): Promise<string> {
  const { size, lights: _, gather_samples: __, gather_rays: ___, ...rest } = choice;
  const shape = size === undefined ? {} : { size: previewSize(size) };
  const preview = await api.startBake({ scene: scene.id, ...rest, ...shape, preset: "preview" });
  coming.value = preview;
  const end = preview.state === "ready" ? preview : await bakeEnd(preview.id, (news) => (coming.value = news));
  if (end.state === "ready") return end.id;
  throw new api.ApiError(`The preview could not be baked: ${api.problemText(end.problem, end.state)}`, 0);
}

/** Bake a scene and take the result over when it is ready. */
export async function startFullBake(scene: SceneBody, choice: BakeChoice): Promise<void> {
  const full = await api.startBake({ scene: scene.id, ...choice });
  if (full.state === "ready") swapTo(full.id);
  else follow(full);
}
