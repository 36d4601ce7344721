/** Comments pinned to pixels of this scene, and a new one. */
import { computed, signal } from "@preact/signals";
import type { CommentBody } from "../protocol";

export type CommentPin = Pick<CommentBody, "view" | "x" | "y" | "size">;

/** Comments of the open scene, oldest first. */
export const comments = signal<readonly CommentBody[]>([]);
/** Pin of the new comment; null without one. */
export const pendingPin = signal<CommentPin | null>(null);
/** The highlighted comment. */
export const selectedComment = signal<string | null>(null);
/** True if resolved comments are listed, too. */
export const showResolved = signal(false);

export const openComments = computed(() => comments.value.filter(({ resolved }) => !resolved));
/** Comments listed and pinned in the image. */
export const shownComments = computed(() => (showResolved.value ? comments.value : openComments.value));
/** A comment's number: its position among all. */
export const commentNumber = (id: string): number => comments.value.findIndex((comment) => comment.id === id) + 1;
