/** Tracks whether the shown images are exact for the look, and their fidelity. */
import { stage } from "../render/renderStage";
import type { FrameHeader } from "../protocol";
import { isFrameExact, fidelity, isOutdated, freeCameraError, worstFidelity } from "../state/fidelity";
import { connections, type BakeConnection } from "./connections";

const exactWaiters: (() => void)[] = [];

function updateFidelity(): void {
  fidelity.value = worstFidelity(stage.displayed.filter((each) => each.hasPixels).map((each) => each.fidelity));
}

/** Views whose shown image differs from the server's. */
export function resetExactness(viewNames: string[]): void {
  for (const image of viewNames.map((view) => stage.imageOf(view))) {
    image.exactRevision = image.exactShared = -1;
    image.fidelity = "approximate";
  }
  isFrameExact.value = false;
  updateFidelity();
}

/** Record a frame that is on the screen. */
export function recordShownFrame(bakeConnection: BakeConnection, header: FrameHeader): void {
  const image = stage.imageOf(header.view);
  image.exactRevision = header.exact ? header.revision : -1;
  image.exactShared = header.exact ? header.room_revision : -1;
  image.fidelity = header.fidelity;
  if (header.free_camera_error !== null) freeCameraError.value = header.free_camera_error;
  updateFidelity();
  updateExactness(bakeConnection);
}

/** Update whether all shown images are exact for the sent edits and the room's version of the look. */
export function updateExactness(bakeConnection: BakeConnection): void {
  const { revision, sharedRevision } = bakeConnection.session;
  isFrameExact.value = stage.displayed.every(
    (each) => each.exactRevision >= revision && each.exactShared >= sharedRevision,
  );
  if (hasLatestRevision(bakeConnection)) isOutdated.value = false;
  if (isFrameExact.value) for (const done of exactWaiters.splice(0)) done();
}

/** True if every shown image is of the newest sent look, or converging to it. */
function hasLatestRevision({ session }: BakeConnection): boolean {
  return stage.displayed.every((each) => each.revision >= session.revision);
}

/** Resolves when the image is exact for everything that was sent. */
export function untilExact(): Promise<void> {
  if (isFrameExact.peek()) return Promise.resolve();
  return new Promise((done) => exactWaiters.push(done));
}

/** True if the active view has an image of the newest look, even an approximate one. */
export function isUpToDate(): boolean {
  const session = connections.shown?.session;
  return session !== undefined && !session.hasPendingEdits && stage.active.revision >= session.revision;
}
