/** A look that others edit as well: joining its room, applying their edits, and presence. */
import { effect } from "@preact/signals";
import { rebasePatch } from "../state/document/jsonPatch";
import { previewedStep } from "../edit/edit";
import { history } from "../edit/history";
import type { HelloMessage, Look, PatchOp, RoomUpdate } from "../protocol";
import { connection } from "../state/connection";
import { look } from "../state/look";
import { selectedMaterial } from "../state/selection";
import { joinState, saveMemberToken, ownName, members, loadMemberToken, selfNumber } from "../state/collaboration";
import { connections, sendToShown, type BakeConnection } from "./connections";
import { updateExactness } from "./fidelityState";
import { requestFrames } from "./requestFrames";

/** A room's look with the own ways of looking, which the room leaves to each. */
function withOwnView(sharedLook: Look): Look {
  const ownLook = look.peek();
  return ownLook === null ? sharedLook : { ...sharedLook, display: ownLook.display, transport: ownLook.transport };
}

/** Take note of the room that a session is in. A history that was not made in it is of no use there. */
function updateRoom({ room }: HelloMessage): void {
  const currentJoin = joinState.peek();
  members.value = room?.people ?? [];
  selfNumber.value = room?.self_id ?? null;
  if (room === null || currentJoin === null) return;
  if (!room.is_new && loadMemberToken(currentJoin) === null) history.clear();
  saveMemberToken(currentJoin, room.participant_token);
  joinState.value = { ...currentJoin, watch: room.view_token };
}

/** Join a room: if it exists, its look replaces the own one; else it begins with the own look, and
 * this says so. */
export function joinRoom(bakeConnection: BakeConnection, hello: HelloMessage): boolean {
  updateRoom(hello);
  const shared = bakeConnection.session.look;
  if (hello.room === null || hello.room.is_new || shared === null) return false;
  if (bakeConnection !== connections.shown) return true; // it takes over later
  previewedStep.value = null;
  look.value = hello.role === "view" ? shared : withOwnView(shared);
  requestFrames(bakeConnection, look.value, performance.now());
  return true;
}

/** The room's look has become another. */
export function onRoomUpdate(bakeConnection: BakeConnection, message: RoomUpdate, shared: Look | null): void {
  if (bakeConnection !== connections.shown || shared === null) return;
  const preview = previewedStep.peek();
  if (preview !== null) previewedStep.value = { ...preview, before: rebasePatch(preview.before, message.patch as PatchOp[]) };
  const ownLook = look.peek();
  look.value = ownLook === null || shared.transport === ownLook.transport ? shared : { ...shared, transport: ownLook.transport };
  updateExactness(bakeConnection);
}

/** A new session in the room takes over from an old one: what that one has not brought there yet is brought by this. */
export function assumeRoom(previous: BakeConnection | null, next: BakeConnection): void {
  const [shared, current] = [next.session.look, look.peek()];
  if (next.hello?.room == null || shared === null || current === null) return;
  if (previous?.hello?.room != null) look.value = withOwnView(rebasePatch(shared, previous.session.unconfirmedPatch));
  requestFrames(next, look.peek() as Look, performance.now());
  sendPresence();
}

/** Send presence: the selected material, and the name. */
function sendPresence(): void {
  const [name, material] = [ownName.peek() || null, selectedMaterial.peek()];
  if (connections.shown?.hello?.room != null) sendToShown({ type: "presence", name, material });
}

effect(() => {
  ownName.value;
  selectedMaterial.value;
  if (connection.value === "open") sendPresence();
});
