/** Synchronizes a shared look: joining its room, applying others' edits, and presence. */
import { effect } from "@preact/signals";
import { rebasePatch } from "../state/document/jsonPatch";
import { previewedStep } from "../edit/edit";
import { history } from "../edit/history";
import type { HelloMessage, Look, RoomUpdate } from "../protocol";
import { connection } from "../state/connection";
import { look } from "../state/look";
import { selectedMaterial } from "../state/selection";
import { joinState, saveMemberToken, ownName, members, loadMemberToken, selfNumber } from "../state/collaboration";
import { connections, sendToShown, type BakeConnection } from "./connections";
import { updateExactness } from "./fidelityState";
import { requestFrames } from "./requestFrames";

/** A room's look with the user's own view settings, which are not shared. */
function withOwnView(sharedLook: Look): Look {
  const ownLook = look.peek();
  return ownLook === null ? sharedLook : { ...sharedLook, display: ownLook.display, transport: ownLook.transport };
}

/** Record the session's room. A history from outside the room is dropped. */
function updateRoom({ room }: HelloMessage): void {
  const currentJoin = joinState.peek();
  members.value = room?.people ?? [];
  selfNumber.value = room?.self_id ?? null;
  if (room === null || currentJoin === null) return;
  if (!room.is_new && loadMemberToken(currentJoin) === null) history.clear();
  saveMemberToken(currentJoin, room.participant_token);
  joinState.value = { ...currentJoin, watch: room.view_token };
}

/** Join a room: if it exists, its look replaces the own one; else it starts with the own look. Returns true in the
 * latter case. */
export function joinRoom(bakeConnection: BakeConnection, hello: HelloMessage): boolean {
  updateRoom(hello);
  const shared = bakeConnection.session.look;
  if (hello.room === null || hello.room.is_new || shared === null) return false;
  if (bakeConnection !== connections.shown) return true; // joined when it replaces the shown bake
  previewedStep.value = null;
  look.value = hello.role === "view" ? shared : withOwnView(shared);
  requestFrames(bakeConnection, look.value, performance.now());
  return true;
}

/** The room's look has changed. */
export function onRoomUpdate(bakeConnection: BakeConnection, message: RoomUpdate, shared: Look | null): void {
  if (bakeConnection !== connections.shown || shared === null) return;
  const preview = previewedStep.peek();
  if (preview !== null) previewedStep.value = { ...preview, before: rebasePatch(preview.before, message.patch) };
  const ownLook = look.peek();
  look.value = ownLook === null || shared.transport === ownLook.transport ? shared : { ...shared, transport: ownLook.transport };
  updateExactness(bakeConnection);
}

/** A new session in the room replaces an old one and sends its unsent edits. */
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
  void ownName.value;
  void selectedMaterial.value;
  if (connection.value === "open") sendPresence();
});
