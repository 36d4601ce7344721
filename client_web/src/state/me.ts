/** Who is here, and what they may do. */
import { computed, signal } from "@preact/signals";
import type { MeBody } from "../protocol";
import { ownName, watching } from "./together";

export const me = signal<MeBody>({ login: false, name: "", role: "admin", by: "open", viewers_comment: false });

const hasRole = computed(() => me.value.role === "edit" || me.value.role === "admin");

export const mayEdit = computed(() => hasRole.value && !watching.value);

const WATCHING = "You watch this look: what others edit is shown here. Who sent the link can send you one to edit with them.";

/** Why nothing can be edited; null where it can. */
export const readOnlyWords = computed(() =>
  mayEdit.value
    ? null
    : hasRole.value
      ? WATCHING
      : `${me.value.name} may look, but not edit: the role is “view”. An admin can hand out a token with the role “edit”.`,
);

/** Who only looks may comment where the server lets them, and is known by a name. */
export const mayComment = computed(
  () => mayEdit.value || (me.value.viewers_comment && (me.value.name !== "" || ownName.value !== "")),
);

/** Why no comment can be written; null where one can. */
export const noCommentWords = computed(() =>
  mayComment.value
    ? null
    : me.value.viewers_comment
      ? "Say your name under “Work together” to comment."
      : "Who only looks reads comments here, and does not write them.",
);

/** Counts edits of somebody who may not. */
export const refusals = signal(0);

/** Why a token is asked for; null where it is not. */
export const loginWords = signal<string | null>(null);

/** What somebody who may not edit looks at: a saved or a shared look of a scene. */
export const watched = signal<{ scene: string; look: string } | { scene: string; share: string } | null>(null);
