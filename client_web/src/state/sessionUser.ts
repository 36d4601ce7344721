/** Who is here, and what they may do. */
import { computed, signal } from "@preact/signals";
import type { MeBody } from "../protocol";
import { ownName, isWatching } from "./collaboration";

export const sessionUser = signal<MeBody>({ login: false, name: "", role: "admin", auth_method: "open", allow_viewer_comments: false });

const hasEditRole = computed(() => sessionUser.value.role === "edit" || sessionUser.value.role === "admin");

export const mayEdit = computed(() => hasEditRole.value && !isWatching.value);

const WATCHING_MESSAGE = "You watch this look: what others edit is shown here. Who sent the link can send you one to edit with them.";

/** Why nothing can be edited; null where it can. */
export const readOnlyMessage = computed(() =>
  mayEdit.value
    ? null
    : hasEditRole.value
      ? WATCHING_MESSAGE
      : `${sessionUser.value.name} may look, but not edit: the role is “view”. An admin can hand out a token with the role “edit”.`,
);

/** Who only looks may comment where the server lets them, and is known by a name. */
export const mayComment = computed(
  () => mayEdit.value || (sessionUser.value.allow_viewer_comments && (sessionUser.value.name !== "" || ownName.value !== "")),
);

/** Why no comment can be written; null where one can. */
export const noCommentMessage = computed(() =>
  mayComment.value
    ? null
    : sessionUser.value.allow_viewer_comments
      ? "Say your name under “Work together” to comment."
      : "Who only looks reads comments here, and does not write them.",
);

/** Counts edits of somebody who may not. */
export const numRejectedEdits = signal(0);

/** Why a token is asked for; null where it is not. */
export const loginMessage = signal<string | null>(null);

/** What somebody who may not edit looks at: a saved or a shared look of a scene. */
export const joinTarget = signal<{ scene: string; look: string } | { scene: string; share: string } | null>(null);
