/** Working together: making a room, the links into it, and leaving it. */
import { connect } from "../live/connect";
import { saveShare } from "../looks/share";
import { keyFragment } from "../scene/url";
import { bake } from "../state/bakes";
import { scene } from "../state/scene";
import { door, people, you } from "../state/together";
import { attempt } from "../ui/toasts";

/** A name that nobody guesses. */
function newRoom(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Open a room with the look that is here; the picture stays until the room's is there. */
export function begin(): void {
  const [of, shown] = [scene.value?.id, bake.value];
  if (of === undefined || shown === null) return;
  door.value = { scene: of, room: newRoom(), watch: null, share: null };
  connect(shown);
}

/** Go on alone with the look as it is. */
export function leaveRoom(): void {
  door.value = you.value = null;
  people.value = [];
  if (bake.value !== null) connect(bake.value);
}

/** The link into the room, to edit or only to watch. It carries the look of now as well: where nobody is in the room any
 * more, it opens that. */
export async function linkInto(kind: "edit" | "watch"): Promise<string | null> {
  const asked = door.value;
  const key = kind === "edit" ? asked?.room : asked?.watch;
  if (key == null) return null;
  return (await attempt(async () => {
    const url = new URL((await saveShare()).url, location.href);
    url.hash = keyFragment(kind === "edit" ? "room" : "watch", key);
    return url.href;
  })) ?? null;
}
