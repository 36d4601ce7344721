/** A look that others edit as well: coming into its room, following it, and being seen there. */
import { effect } from "@preact/signals";
import { rebased } from "../document/change";
import { passing } from "../edit/edit";
import { history } from "../edit/history";
import type { HelloMessage, Look, PatchOp, SharedMessage } from "../protocol";
import { connection } from "../state/connection";
import { look } from "../state/look";
import { selectedMaterial } from "../state/selection";
import { door, keepSeat, ownName, people, seatIn, you } from "../state/together";
import { connections, send, type BakeConnection } from "./connections";
import { sayExact } from "./exactness";
import { want } from "./want";

/** A room's look with the own ways of looking, which the room leaves to each. */
function asSeenHere(of: Look): Look {
  const own = look.peek();
  return own === null ? of : { ...of, display: own.display, transport: own.transport };
}

/** Take note of the room that a session is in. A history that was not made in it is of no use there. */
function noteRoom({ room }: HelloMessage): void {
  const asked = door.peek();
  people.value = room?.people ?? [];
  you.value = room?.you ?? null;
  if (room === null || asked === null) return;
  if (!room.created && seatIn(asked) === null) history.clear();
  keepSeat(asked, room.seat);
  door.value = { ...asked, watch: room.watch };
}

/** Come into a room: where it goes on, its look takes the place of what was here; else it has the look that is brought, and
 * this says so. */
export function comeIn(of: BakeConnection, hello: HelloMessage): boolean {
  noteRoom(hello);
  const shared = of.session.look;
  if (hello.room === null || hello.room.created || shared === null) return false;
  if (of !== connections.shown) return true; // it takes over later
  passing.value = null;
  look.value = hello.role === "view" ? shared : asSeenHere(shared);
  want(of, look.value, performance.now());
  return true;
}

/** The room's look has become another. */
export function followShared(of: BakeConnection, message: SharedMessage, shared: Look | null): void {
  if (of !== connections.shown || shared === null) return;
  const passed = passing.peek();
  if (passed !== null) passing.value = { ...passed, before: rebased(passed.before, message.patch as PatchOp[]) };
  const own = look.peek();
  look.value = own === null || shared.transport === own.transport ? shared : { ...shared, transport: own.transport };
  sayExact(of);
}

/** A new session in the room takes over from an old one: what that one has not brought there yet is brought by this. */
export function takeOver(from: BakeConnection | null, to: BakeConnection): void {
  const [shared, current] = [to.session.look, look.peek()];
  if (to.hello?.room == null || shared === null || current === null) return;
  if (from?.hello?.room != null) look.value = asSeenHere(rebased(shared, from.session.unconfirmed));
  want(to, look.peek() as Look, performance.now());
  present();
}

/** Others see the material in hand, and the name. */
function present(): void {
  const [name, material] = [ownName.peek() || null, selectedMaterial.peek()];
  if (connections.shown?.hello?.room != null) send({ type: "presence", name, material });
}

effect(() => {
  ownName.value;
  selectedMaterial.value;
  if (connection.value === "open") present();
});
