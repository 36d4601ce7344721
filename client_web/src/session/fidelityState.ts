/** Whether what is on the screens is the look's image, and how near it is. */
import { stage } from "../render/renderStage";
import type { FrameHeader } from "../protocol";
import { isFrameExact, fidelity, isOutdated, freeCameraError, worstFidelity } from "../state/fidelity";
import { connections, type BakeConnection } from "./connections";

const exactWaiters: (() => void)[] = [];

function updateFidelity(): void {
  fidelity.value = worstFidelity(stage.displayed.filter((each) => each.hasPixels).map((each) => each.fidelity));
}

/** What is shown of these views is not what the server has. */
export function resetExactness(viewNames: string[]): void {
  for (const image of viewNames.map((view) => stage.imageOf(view))) {
    image.exactRevision = image.exactShared = -1;
    image.fidelity = "approximate";
  }
  isFrameExact.value = false;
  updateFidelity();
}

/** A frame is on the screen. */
export function recordShownFrame(bakeConnection: BakeConnection, header: FrameHeader): void {
  const image = stage.imageOf(header.view);
  image.exactRevision = header.exact ? header.revision : -1;
  image.exactShared = header.exact ? header.room_revision : -1;
  image.fidelity = header.fidelity;
  if (header.previous_error !== null) freeCameraError.value = header.previous_error;
  updateFidelity();
  updateExactness(bakeConnection);
}

/** Say whether all that is on the screens is exact for what was sent, and for what others have made of the look. */
export function updateExactness(bakeConnection: BakeConnection): void {
  const { revision, sharedRevision } = bakeConnection.session;
  isFrameExact.value = stage.displayed.every((each) => each.exactRevision >= revision && each.exactShared >= sharedRevision);
  if (hasLatestRevision(bakeConnection)) isOutdated.value = false;
  if (isFrameExact.value) for (const done of exactWaiters.splice(0)) done();
}

/** Whether every shown image is of the newest look that was sent, or converging to it. */
function hasLatestRevision({ session }: BakeConnection): boolean {
  return stage.displayed.every((each) => each.revision >= session.revision);
}

/** Resolves when the image is exact for everything that was sent. */
export function untilExact(): Promise<void> {
  if (isFrameExact.peek()) return Promise.resolve();
  return new Promise((done) => exactWaiters.push(done));
}

/** Whether the active view has an image of the newest look, be it a first one. */
export function isUpToDate(): boolean {
  const session = connections.shown?.session;
  return session !== undefined && !session.hasPendingEdits && stage.active.revision >= session.revision;
}
