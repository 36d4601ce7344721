/** How the live session is doing. */
import { signal } from "@preact/signals";
import type { Connection } from "../net/socket";

export const connection = signal<Connection>("connecting");
export const retryInMs = signal(0);
/** The browser says that it has no network. A server on the same machine may still answer. */
export const offline = signal(false);
/** What the server said where it has no room for this session now; null where it said nothing. */
export const refusedBecause = signal<string | null>(null);
/** What takes time on the server: a curve that is frozen, or a term that is shaded for the first time. */
export const freezing = signal<{
  state: "freezing" | "shading";
  view: string;
  what: string;
  progress: number;
} | null>(null);
