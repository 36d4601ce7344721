/** Live sessions: starting and leaving a room, and the links into it. */
import { connectToBake } from "../../session/connect";
import { createShareLink } from "../looks/shareLink";
import { keyFragment } from "../../session/scene/url";
import { bake } from "../../state/bakes";
import { scene } from "../../state/scene";
import { joinState, members, selfNumber } from "../../state/collaboration";
import { reportErrors } from "../../ui/toasts";
import { serverUrl } from "../../session/net/serverUrl";

/** An unguessable room name. */
function generateRoomKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Start a room with the current look; the image stays until the room's first one is complete. */
export function startRoom(): void {
  const [sceneId, bakeId] = [scene.value?.id, bake.value];
  if (sceneId === undefined || bakeId === null) return;
  joinState.value = { scene: sceneId, room: generateRoomKey(), watch: null, share: null };
  connectToBake(bakeId);
}

/** Leave the room and keep its current look. */
export function leaveRoom(): void {
  joinState.value = selfNumber.value = null;
  members.value = [];
  if (bake.value !== null) connectToBake(bake.value);
}

/** The link into the room, to edit or only to watch. It also carries the current look, which it opens if the room is
 * empty by then. */
export async function createRoomLink(kind: "edit" | "watch"): Promise<string | null> {
  const room = joinState.value;
  const key = kind === "edit" ? room?.room : room?.watch;
  if (key == null) return null;
  return (
    (await reportErrors(async () => {
      const url = new URL(serverUrl((await createShareLink()).url), location.href);
      url.hash = keyFragment(kind === "edit" ? "room" : "watch", key);
      return url.href;
    })) ?? null
  );
}
