/** Asks the server for the pictures of the look: on every edit, and where what is seen of it changes. */
import { effect } from "@preact/signals";
import type { Change } from "../document/change";
import { onChange } from "../edit/edit";
import { hand } from "../edit/hand";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { seenPaths, withSeenPaths } from "../seen/paths";
import { soloLight, sourcesAlone } from "../seen/solo";
import { connection } from "../state/connection";
import { held } from "../state/display";
import { forgetDrawn } from "../state/latency";
import { look } from "../state/look";
import { focusedView } from "../state/views";
import { mended } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { whenExact } from "./exactness";

/** Ask for the picture of a look, or of what shall be seen of it; `change` is the edit that made it. Where none did, no
 * hand is on anything of it. */
export function want(of: BakeConnection | null, wanted: Look, inputTime: number, change: Change | null = null): void {
  const seen = withSeenPaths(wanted);
  const asked = { look: seen, hand: change && hand.peek(), solo: sourcesAlone(wanted), inputTime };
  of?.session.want(asked, seen === wanted ? change : null);
}

/** In a room, what is on its way to take over hears of edits from there. */
function wantEverywhere(wanted: Look, inputTime: number, change: Change | null = null): void {
  want(connections.shown, wanted, inputTime, change);
  if (connections.incoming?.hello?.room == null) want(connections.incoming, wanted, inputTime, change);
}

onChange((change, inputTime) => {
  mended("edit"); // what was refused before is answered by this one
  wantEverywhere(change.after, inputTime, change);
});

effect(() => {
  soloLight.value;
  seenPaths.value;
  const current = look.peek();
  if (current !== null) wantEverywhere(current, performance.now());
});

// revisions that the view has already drawn while another one was counted tell nothing about the time they took
effect(() => forgetDrawn(stage.of(focusedView.value).revision));

/** Fetch the exact pictures of another look and take them, while the screens keep what they show. */
export async function withPicturesOf(of: Look, take: () => void): Promise<void> {
  if (connection.peek() !== "open") throw new Error("There is no connection; try again when it is back.");
  const back = look.peek() as Look;
  held.value = true;
  try {
    want(connections.shown, of, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await whenExact();
    take();
  } finally {
    want(connections.shown, look.peek() ?? back, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await whenExact();
    held.value = false;
  }
}
