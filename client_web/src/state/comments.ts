/** Words that people pinned to pixels of this scene, and one that is being written. */
import { computed, signal } from "@preact/signals";
import type { CommentBody } from "../protocol";

export type Pin = Pick<CommentBody, "view" | "x" | "y" | "size">;

/** Of the open scene, oldest first. */
export const comments = signal<readonly CommentBody[]>([]);
/** Where the comment that is being written will be; null where none is. */
export const pinning = signal<Pin | null>(null);
/** The comment that is pointed out. */
export const selectedComment = signal<string | null>(null);
/** Whether those that are resolved are listed, too. */
export const resolvedShown = signal(false);

export const openComments = computed(() => comments.value.filter(({ resolved }) => !resolved));
/** Those that are listed and seen in the picture. */
export const listedComments = computed(() => (resolvedShown.value ? comments.value : openComments.value));
/** What a comment is called in the list and in the picture: its place among all. */
export const numberOf = (id: string): number => comments.value.findIndex((comment) => comment.id === id) + 1;
