/** Writes, resolves, deletes and shows comments. */
import { effect } from "@preact/signals";
import { cameraOf, moveFreeCamera } from "../../viewport/cameras/freeCamera";
import { onComment } from "../../session/sessionHandlers";
import { renderThumbnail } from "../looks/displayImage";
import * as api from "../../session/net/api";
import { stage } from "../../render/renderStage";
import type { CommentBody, CommentRequest } from "../../protocol";
import { bake } from "../../state/bakes";
import { comments, commentNumber, pendingPin, selectedComment } from "../../state/comments";
import { look } from "../../state/look";
import { noCommentMessage } from "../../state/sessionUser";
import { commentsOpen } from "../../state/panels";
import { pixelProbe } from "../../state/pointerPixel";
import { togglePanel } from "../../state/panelWidths";
import { scene } from "../../state/scene";
import { ownName, members, selfNumber } from "../../state/collaboration";
import { shownViews, showSingleView, activeViewName, views, setFocus } from "../../state/views";
import { reportErrors, showNote } from "../../ui/toasts";

const SNAPSHOT_WIDTH = 320;

/** Reload the list. */
export async function refreshComments(): Promise<void> {
  const sceneId = scene.peek()?.id;
  if (sceneId === undefined) return;
  const fetched = await api.listComments(sceneId);
  if (scene.peek()?.id === sceneId) comments.value = fetched;
}

effect(() => {
  if (commentsOpen.value) void reportErrors(refreshComments);
});

onComment(() => void reportErrors(refreshComments));

effect(() => {
  const openScene = scene.value;
  comments.value = [];
  pendingPin.value = selectedComment.value = null;
  if (openScene !== null) void reportErrors(refreshComments);
});

/** Move the pin of the new comment to a pixel of a view, clamped to the image. */
export function placePin(view: string, x: number, y: number): void {
  const { width, height } = stage.imageOf(view).pixels;
  const clampTo = (coordinate: number, size: number) => Math.min(size - 1, Math.max(0, coordinate));
  pendingPin.value = { view, x: clampTo(x, width), y: clampTo(y, height), size: [width, height] };
}

/** Start a comment on the pixel under the pointer, else on the center of the active view. */
export function beginComment(): void {
  if (noCommentMessage.peek() !== null) return showNote(noCommentMessage.peek() as string);
  const pixel = pixelProbe.peek();
  const { width, height } = stage.active.pixels;
  if (pixel === null) placePin(activeViewName.peek(), Math.floor(width / 2), Math.floor(height / 2));
  else placePin(pixel.view, pixel.x, pixel.y);
  if (!commentsOpen.peek()) togglePanel("comments");
}

export function cancelComment(): void {
  pendingPin.value = null;
}

/** Save the comment with a snapshot of the image; true if that succeeded. */
export async function saveComment(text: string): Promise<boolean> {
  const [pin, sceneId, bakeId, current] = [pendingPin.peek(), scene.peek()?.id, bake.peek(), look.peek()];
  if (pin === null || sceneId === undefined || bakeId === null || current === null) return false;
  const snapshot = renderThumbnail(stage.imageOf(pin.view).pixels, current.display, SNAPSHOT_WIDTH);
  const isSaved = await reportErrors(async () => {
    const memberName = members.peek().find(({ id }) => id === selfNumber.peek())?.name; // the name that others see
    const author = ownName.peek() || memberName || null;
    const created = await api.addComment(sceneId, {
      ...pin,
      bake: bakeId,
      camera: cameraOf(pin.view),
      text,
      author,
      picture: snapshot,
    });
    pendingPin.value = null;
    selectedComment.value = created.id;
    await refreshComments();
    return true;
  });
  return isSaved ?? false;
}

export async function setCommentResolved(comment: CommentBody, resolved: boolean): Promise<void> {
  await reportErrors(async () => {
    await api.setResolved(scene.peek()?.id ?? "", comment.id, resolved);
    await refreshComments();
  });
}

async function snapshotBase64({ picture: url }: CommentBody): Promise<string | null> {
  if (url === null) return null;
  const bytes = new Uint8Array(await (await api.request(url)).arrayBuffer());
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}

/** Delete a comment; its toast offers to restore it as a new one. */
export async function deleteCommentWithUndo(comment: CommentBody): Promise<void> {
  const sceneId = scene.peek()?.id ?? "";
  await reportErrors(async () => {
    const { bake: bakeId, view, x, y, size, camera, text, author } = comment;
    const commentToRestore: CommentRequest = {
      bake: bakeId,
      view,
      x,
      y,
      size,
      camera,
      text,
      author,
      picture: await snapshotBase64(comment),
    };
    const label = `Comment ${commentNumber(comment.id)} deleted.`;
    await api.deleteComment(sceneId, comment.id);
    await refreshComments();
    showNote(label, {
      label: "Undo",
      run: () => void reportErrors(() => api.addComment(sceneId, commentToRestore).then(refreshComments)),
    });
  });
}

/** Show a comment's view from its camera. */
export function showComment(comment: CommentBody): void {
  selectedComment.value = comment.id;
  const { view, camera } = comment;
  if (!views.peek().some(({ name }) => name === view)) return showNote(`This bake has no view “${view}”.`);
  if (shownViews.peek().includes(view)) setFocus(view);
  else showSingleView(view);
  if (camera !== null) moveFreeCamera(view, camera);
}

const CAMERA_TOLERANCE = 1e-3;

/** True if a view's camera is where the comment was written. */
export function isCameraAtComment({ view, camera }: CommentBody): boolean {
  const currentCamera = cameraOf(view);
  if (camera === null || currentCamera == null) return camera === null && currentCamera == null;
  return camera.to_world.every(
    (value, k) => Math.abs(value - (currentCamera.to_world[k] as number)) < CAMERA_TOLERANCE,
  );
}
