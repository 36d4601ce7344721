/** Comments pinned to pixels of this scene, and the one being written. */
import { computed, signal } from "@preact/signals";
import type { CommentBody } from "../protocol";

export type CommentPin = Pick<CommentBody, "view" | "x" | "y" | "size">;

/** Of the open scene, oldest first. */
export const comments = signal<readonly CommentBody[]>([]);
/** Where the comment that is being written will be; null where none is. */
export const pendingPin = signal<CommentPin | null>(null);
/** The comment that is pointed out. */
export const selectedComment = signal<string | null>(null);
/** Whether those that are resolved are listed, too. */
export const showResolved = signal(false);

export const openComments = computed(() => comments.value.filter(({ resolved }) => !resolved));
/** Comments that are listed and pinned in the image. */
export const shownComments = computed(() => (showResolved.value ? comments.value : openComments.value));
/** A comment's number in the list and in the image: its position among all. */
export const commentNumber = (id: string): number => comments.value.findIndex((comment) => comment.id === id) + 1;
