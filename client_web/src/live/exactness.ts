/** Whether what is on the screens is the look's picture, and how near it is. */
import { stage } from "../picture/stage";
import type { FrameHeader } from "../protocol";
import { exact, fidelity, isOutdated, movingError, worst } from "../state/fidelity";
import { connections, type BakeConnection } from "./connections";

const waiters: (() => void)[] = [];

function sayFidelity(): void {
  fidelity.value = worst(stage.shown.filter((each) => each.isThere).map((each) => each.fidelity));
}

/** What is shown of these views is not what the server has. */
export function nothingIsExact(shown: string[]): void {
  for (const picture of shown.map((view) => stage.of(view))) {
    picture.exactRevision = picture.exactShared = -1;
    picture.fidelity = "approximate";
  }
  exact.value = false;
  sayFidelity();
}

/** A frame is on the screen. */
export function noteShown(of: BakeConnection, header: FrameHeader): void {
  const picture = stage.of(header.view);
  picture.exactRevision = header.exact ? header.revision : -1;
  picture.exactShared = header.exact ? header.shared : -1;
  picture.fidelity = header.fidelity;
  if (header.was_off !== null) movingError.value = header.was_off;
  sayFidelity();
  sayExact(of);
}

/** Say whether all that is on the screens is exact for what was sent, and for what others have made of the look. */
export function sayExact(of: BakeConnection): void {
  const { revision, shared } = of.session;
  exact.value = stage.shown.every((each) => each.exactRevision >= revision && each.exactShared >= shared);
  if (isAnswered(of)) isOutdated.value = false;
  if (exact.value) for (const done of waiters.splice(0)) done();
}

/** Whether every shown picture is of the newest look that was sent, or on its way there. */
function isAnswered({ session }: BakeConnection): boolean {
  return stage.shown.every((each) => each.revision >= session.revision);
}

/** Resolves when the picture is exact for everything that was sent. */
export function whenExact(): Promise<void> {
  if (exact.peek()) return Promise.resolve();
  return new Promise((done) => waiters.push(done));
}

/** Whether the active view has a picture of the newest look, be it a first one. */
export function isDrawn(): boolean {
  const session = connections.shown?.session;
  return session !== undefined && !session.pending && stage.active.revision >= session.revision;
}
