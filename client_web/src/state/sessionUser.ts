/** The current user and permissions. */
import { computed, signal } from "@preact/signals";
import type { MeBody } from "../protocol";
import { ownName, isWatching } from "./collaboration";

export const sessionUser = signal<MeBody>({
  login: false,
  name: "",
  role: "admin",
  auth_method: "open",
  allow_viewer_comments: false,
});

const hasEditRole = computed(() => sessionUser.value.role === "edit" || sessionUser.value.role === "admin");

export const mayEdit = computed(() => hasEditRole.value && !isWatching.value);

const WATCHING_MESSAGE = "View-only link: you see others' edits live. Ask the sender for an edit link to join in.";

/** Reason why editing is off; null if it is on. */
export const readOnlyMessage = computed(() =>
  mayEdit.value ? null : hasEditRole.value ? WATCHING_MESSAGE : "View-only access. Ask an admin for edit rights.",
);

/** True if a user may comment: read-only users need the server's permission and a name. */
export const mayComment = computed(
  () =>
    mayEdit.value ||
    (sessionUser.value.allow_viewer_comments && (sessionUser.value.name !== "" || ownName.value !== "")),
);

/** Reason why commenting is off; null if it is on. */
export const noCommentMessage = computed(() =>
  mayComment.value
    ? null
    : sessionUser.value.allow_viewer_comments
      ? "Enter your name under “Work together” to comment."
      : "You have view-only access.",
);

/** Number of rejected edits by a read-only user. */
export const numRejectedEdits = signal(0);

/** Message of the login dialog; null while it is closed. */
export const loginMessage = signal<string | null>(null);

/** The saved or shared look that a read-only user views. */
export const joinTarget = signal<{ scene: string; look: string } | { scene: string; share: string } | null>(null);
