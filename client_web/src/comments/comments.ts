/** Writing, resolving and deleting comments; finding what one is about. */
import { effect } from "@preact/signals";
import { cameraOf, lookFrom } from "../cameras/eye";
import { whenCommented } from "../live/handlers";
import { thumbnail } from "../looks/image";
import * as api from "../net/api";
import { stage } from "../picture/stage";
import type { CommentBody, CommentRequest } from "../protocol";
import { bake } from "../state/bakes";
import { comments, numberOf, pinning, selectedComment } from "../state/comments";
import { look } from "../state/look";
import { noCommentWords } from "../state/me";
import { commentsOpen } from "../state/panels";
import { probe } from "../state/probe";
import { togglePanel } from "../state/room";
import { scene } from "../state/scene";
import { ownName, people, you } from "../state/together";
import { shownViews, showAlone, viewName, views, workIn } from "../state/views";
import { attempt, note } from "../ui/toasts";

const PICTURE_WIDTH = 320;

/** Read the list again. */
export async function refresh(): Promise<void> {
  const of = scene.peek()?.id;
  if (of === undefined) return;
  const found = await api.listComments(of);
  if (scene.peek()?.id === of) comments.value = found;
}

effect(() => {
  if (commentsOpen.value) void attempt(refresh);
});

whenCommented(() => void attempt(refresh));

effect(() => {
  const of = scene.value;
  comments.value = [];
  pinning.value = selectedComment.value = null;
  if (of !== null) void attempt(refresh);
});

/** Put the pin of the comment that is being written to a pixel of a view, as near as the picture has it. */
export function pinAt(view: string, x: number, y: number): void {
  const { width, height } = stage.of(view).pixels;
  const inside = (at: number, size: number) => Math.min(size - 1, Math.max(0, at));
  pinning.value = { view, x: inside(x, width), y: inside(y, height), size: [width, height] };
}

/** Begin a comment on the pixel that the pointer is over, else on the middle of the active view. */
export function beginComment(): void {
  if (noCommentWords.peek() !== null) return note(noCommentWords.peek() as string);
  const at = probe.peek();
  const { width, height } = stage.active.pixels;
  if (at === null) pinAt(viewName.peek(), Math.floor(width / 2), Math.floor(height / 2));
  else pinAt(at.view, at.x, at.y);
  if (!commentsOpen.peek()) togglePanel("comments");
}

export function cancelComment(): void {
  pinning.value = null;
}

/** Keep the words, with the picture as it is now; whether that succeeded. */
export async function keepComment(text: string): Promise<boolean> {
  const [pin, of, shown, current] = [pinning.peek(), scene.peek()?.id, bake.peek(), look.peek()];
  if (pin === null || of === undefined || shown === null || current === null) return false;
  const picture = thumbnail(stage.of(pin.view).pixels, current.display, PICTURE_WIDTH);
  const kept = await attempt(async () => {
    const inRoom = people.peek().find(({ number }) => number === you.peek())?.name; // as others see this one
    const author = ownName.peek() || inRoom || null;
    const made = await api.addComment(of, { ...pin, bake: shown, camera: cameraOf(pin.view), text, author, picture });
    pinning.value = null;
    selectedComment.value = made.id;
    await refresh();
    return true;
  });
  return kept ?? false;
}

export async function settle(comment: CommentBody, resolved: boolean): Promise<void> {
  await attempt(async () => {
    await api.settleComment(scene.peek()?.id ?? "", comment.id, resolved);
    await refresh();
  });
}

async function pictureOf({ picture }: CommentBody): Promise<string | null> {
  if (picture === null) return null;
  const bytes = new Uint8Array(await (await api.request(picture)).arrayBuffer());
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}

/** Forget a comment; for a while it can be had back, as a new one. */
export async function remove(comment: CommentBody): Promise<void> {
  const of = scene.peek()?.id ?? "";
  await attempt(async () => {
    const { bake: pictured, view, x, y, size, camera, text, author } = comment;
    const again: CommentRequest = { bake: pictured, view, x, y, size, camera, text, author, picture: await pictureOf(comment) };
    const label = `Comment ${numberOf(comment.id)} is deleted.`;
    await api.deleteComment(of, comment.id);
    await refresh();
    note(label, { label: "Undo", run: () => void attempt(() => api.addComment(of, again).then(refresh)) });
  });
}

/** Show what a comment is about: its view, and where the eye was. */
export function pointOut(comment: CommentBody): void {
  selectedComment.value = comment.id;
  const { view, camera } = comment;
  if (!views.peek().some(({ name }) => name === view)) return note(`The view “${view}” is not in this bake.`);
  if (shownViews.peek().includes(view)) workIn(view);
  else showAlone(view);
  if (camera !== null) lookFrom(view, camera);
}

const SAME = 1e-3;

/** Whether a view is seen from where a comment was written. */
export function isSeenFrom({ view, camera }: CommentBody): boolean {
  const now = cameraOf(view);
  if (camera === null || now == null) return camera === null && now == null;
  return camera.to_world.every((value, k) => Math.abs(value - (now.to_world[k] as number)) < SAME);
}
